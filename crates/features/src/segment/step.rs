//! The step in which a camera counts, if its depths are whole numbers of one.

use super::levelled::{Cloud, Footprint};

/// Depths looked at, evenly chosen: enough to find every level that the ground is on.
const LOOKED_AT: usize = 4096;
/// Depths that differ by less are the same, but for rounding `[m]`.
const ROUNDING: f64 = 1e-7;
/// Least step that rounding of an f32 depth leaves to be told `[m]`.
const LEAST_STEP: f64 = 2e-5;
/// Neighbouring levels this many steps apart are looked at, whose number is then whole but for the tolerance.
const NEAR: f64 = 8.5;
const TOLERANCE: f64 = 0.12;
/// Neighbouring levels that must be looked at.
const LEAST_GAPS: usize = 8;

impl Cloud {
    /// The step of the depths or heights `[m]`: all neighbouring ones are a whole number of it apart; 0 if there is
    /// none.
    pub(super) fn step(&self) -> f64 {
        let stride = self.points.len().div_ceil(LOOKED_AT).max(1);
        let along = self.points.iter().step_by(stride).map(|point| match self.footprint {
            Footprint::Column { .. } => point.z,
            Footprint::Pyramid { centre, axis, .. } => (point - centre).dot(&axis),
        });
        step_of(along.collect())
    }
}

fn step_of(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let gaps = values.windows(2).map(|pair| pair[1] - pair[0]).filter(|&gap| gap > ROUNDING);
    let gaps: Vec<f64> = gaps.collect();
    let step = gaps.iter().copied().fold(f64::INFINITY, f64::min);
    if !step.is_finite() || step < LEAST_STEP {
        return 0.0;
    }
    let near: Vec<f64> = gaps.iter().map(|gap| gap / step).filter(|&steps| steps < NEAR).collect();
    let is_whole = |steps: &f64| (steps - steps.round()).abs() < TOLERANCE;
    let is_counted = near.len() >= LEAST_GAPS.max(gaps.len() / 2) && near.iter().all(is_whole);
    if is_counted { step } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::raster::render;
    use crate::rng::Stream;
    use crate::{Camera, Levelled, Segmentation, level_depth};

    #[test]
    fn whole_numbers_of_a_step_are_found_and_nothing_else_is() {
        let mut stream = Stream::new(3);
        let depths: Vec<f64> = (0..3000).map(|_| 0.44 + 0.03 * stream.uniform()).collect();
        for step in [1e-4, 2.5e-4, 1e-3] {
            let counted = |depth: &f64| f64::from((step * (depth / step).round()) as f32);
            let found = step_of(depths.iter().map(counted).collect());
            assert!((found / step - 1.0).abs() < 0.01, "{found} {step}");
        }
        assert_eq!(step_of(depths.clone()), 0.0);
        // A few levels may be a whole number of anything.
        assert_eq!(step_of([0.0, 0.01, 0.02, 0.0].repeat(100)), 0.0);
        // The mean of ten frames has steps of a tenth: where pixels lack in some, there is none.
        let means = depths
            .iter()
            .enumerate()
            .map(|(i, z)| 1e-4 * (1e4 * z).round() / (1.0 + 1e-3 * (i % 7) as f64));
        assert_eq!(step_of(means.collect()), 0.0);
        assert_eq!(step_of(Vec::new()), 0.0);
    }
    /// A ball on level ground, straight from above, its depths noisy and counted in a unit.
    fn counted(unit: f64, noise: f64) -> Levelled {
        let camera = Camera::overhead(0.45, 0.45, 120).unwrap();
        let ball = [Vector3::new(0.0, 0.0, 0.02)];
        let mut image = render(&camera, &ball, &[0.02]).unwrap();
        let mut stream = Stream::new(8);
        for depth in &mut image.depth {
            let noisy = f64::from(*depth) + noise * stream.normal();
            *depth = (unit * (noisy / unit).round()) as f32;
        }
        level_depth(&camera, &image, None, &Segmentation::default()).unwrap()
    }

    #[test]
    fn noise_of_a_level_ground_is_seen_through_the_counts() {
        let grains = counted(1e-4, 0.0).mask.iter().filter(|&&grain| grain).count();
        for (unit, noise) in
            [(1e-3, 0.0), (1e-3, 2e-4), (1e-3, 3e-4), (1e-3, 5e-4), (1e-3, 7e-4), (2e-3, 6e-4)]
        {
            let got = counted(unit, noise);
            let true_sd = noise.hypot(unit / 12_f64.sqrt());
            let ratio = got.ground_sd / true_sd;
            assert!((0.75..1.6).contains(&ratio), "{unit} {noise}: {ratio}");
            // One count of noise is no grain.
            let count = got.mask.iter().filter(|&&grain| grain).count();
            assert!(count <= grains + 2 && count > grains / 2, "{unit} {noise}: {count} {grains}");
        }
        // A tilted or a finely counted ground needs none of it.
        let fine = counted(1e-4, 5e-4).ground_sd;
        assert!((fine / 5e-4 - 1.0).abs() < 0.05, "{fine}");
        assert!(counted(1e-4, 0.0).ground_sd.is_sign_positive());
    }
}
