//! How many frames of a pour there can be.

use granulcal_dem::Simulation;

use crate::DatasetError;

/// Share by which a rate of one frame a substep may be rounded.
const ROUNDING: f64 = 1e-9;

/// Refuses a number of frames a simulated second that is none, or of which several would fall in one substep: they
/// would show the same, and enough of them never end.
pub(crate) fn check_frame_rate(rate: f64, simulation: &Simulation) -> Result<(), DatasetError> {
    let most = 1.0 / simulation.settings().dt;
    if rate > 0.0 && rate <= most * (1.0 + ROUNDING) {
        return Ok(());
    }
    let (what, allowed) = ("the frames per second", "positive and at most one a substep");
    Err(DatasetError::Argument { what, got: format!("{rate} for {most} substeps"), allowed })
}

#[cfg(test)]
mod tests {
    use granulcal_scene::Scene;

    use super::*;

    #[test]
    fn there_is_at_most_a_frame_a_substep() {
        let simulation = Simulation::new(&Scene::drop(0.02), 1).unwrap();
        let most = 1.0 / simulation.settings().dt;
        for rate in [1e-3, 60.0, most] {
            check_frame_rate(rate, &simulation).unwrap();
        }
        for rate in [0.0, -1.0, f64::NAN, f64::INFINITY, 1.001 * most, 1e300] {
            let error = check_frame_rate(rate, &simulation).unwrap_err().to_string();
            assert!(
                error.contains("frames per second") && error.contains("at most one"),
                "{error}"
            );
        }
    }
}
