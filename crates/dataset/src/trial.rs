//! What a pour costs, found within a bounded time.

use std::time::{Duration, Instant};

use cpu_time::ThreadTime;
use granulcal_dem::Simulation;
use granulcal_scene::Scene;

use crate::{DatasetError, Observer, Room};

/// What a pour costs that was made, or begun.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trial {
    /// Processor time of the whole pour `[s]`; of one that was cut short what it would be if it lasted until its
    /// horizon at the pace of the last half of the trial.
    pub cpu_s: f64,
    /// Simulated time `[s]`.
    pub reached_s: f64,
    /// Whether it was made to its end.
    pub has_ended: bool,
}

/// Pours `scene` for at most about `patience` on the clock; `None` when `keep_going` said no.
///
/// # Errors
/// What is wrong with the scene, or [`DatasetError::NoRoom`].
pub fn try_pour(
    scene: &Scene,
    seed: u64,
    patience: Duration,
    keep_going: &dyn Fn() -> bool,
) -> Result<Option<Trial>, DatasetError> {
    Room::of_pour(scene, None).require(None)?;
    let (clock, begun) = (ThreadTime::now(), Instant::now());
    let mut simulation = Simulation::new(scene, seed).map_err(DatasetError::Simulation)?;
    simulation.check_start().map_err(DatasetError::Simulation)?;
    let mut observer = Observer::new(scene);
    let stride = simulation.settings().dt * simulation.settings().list_period as f64;
    // Where the last half began: processor time and simulated time.
    let mut middle = (0.0, 0.0);
    let mut is_late = false;
    loop {
        let (cpu_s, reached_s) = (clock.elapsed().as_secs_f64(), simulation.time());
        if simulation.ended().is_some() {
            return Ok(Some(Trial { cpu_s, reached_s, has_ended: true }));
        }
        if reached_s > middle.1 && begun.elapsed() >= patience {
            let cpu_s = to_horizon((cpu_s, reached_s), middle, scene.end.horizon);
            return Ok(Some(Trial { cpu_s, reached_s, has_ended: false }));
        }
        if !keep_going() {
            return Ok(None);
        }
        if !is_late && begun.elapsed() >= patience / 2 {
            (is_late, middle) = (true, (cpu_s, reached_s));
        }
        observer.advance(&mut simulation, stride)?;
    }
}

/// Processor time until the horizon `[s]`, at the pace since `middle`; both are processor time and simulated time
/// `[s]`.
fn to_horizon((cpu_s, reached_s): (f64, f64), middle: (f64, f64), horizon: f64) -> f64 {
    let pace = (cpu_s - middle.0) / (reached_s - middle.1);
    cpu_s + pace * (horizon - reached_s).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene() -> Scene {
        let mut scene = Scene::drop(0.01);
        scene.set(&[("grains.count", 40.0)]).unwrap();
        scene
    }

    #[test]
    fn a_short_pour_is_made_and_a_long_one_is_cut() {
        let whole = try_pour(&scene(), 1, Duration::from_secs(600), &|| true).unwrap().unwrap();
        assert!(whole.has_ended && whole.cpu_s > 0.0 && whole.reached_s > 0.0);
        let mut long = scene();
        long.end.horizon = 1e6;
        // Vibration without end: it never comes to rest.
        long.end.kinetic_energy = 1e-300;
        let cut = try_pour(&long, 1, Duration::from_millis(300), &|| true).unwrap().unwrap();
        assert!(!cut.has_ended && cut.reached_s > 0.0 && cut.cpu_s > 0.0, "{cut:?}");
        assert_eq!(try_pour(&long, 1, Duration::from_secs(600), &|| false).unwrap(), None);
    }

    #[test]
    fn what_is_left_takes_as_long_as_the_last_half_says() {
        // Half a second of it took 2 s, after a start that took 1.
        assert_eq!(to_horizon((3.0, 0.75), (1.0, 0.25), 4.0), 3.0 + 4.0 * 3.25);
        assert_eq!(to_horizon((3.0, 4.5), (1.0, 0.25), 4.0), 3.0);
    }

    #[test]
    fn a_pour_without_patience_still_gives_a_pace() {
        let cut = try_pour(&scene(), 1, Duration::ZERO, &|| true).unwrap().unwrap();
        assert!(!cut.has_ended && cut.reached_s > 0.0 && cut.cpu_s.is_finite(), "{cut:?}");
    }
}
