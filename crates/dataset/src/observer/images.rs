//! The camera's image at several times while the grains fall.

use granulcal_dem::Pour;
use granulcal_features::PAPER16;
use granulcal_scene::{CameraSpec, ObserveImages};
use nalgebra::Vector3;

use super::observation::{Frame, Observation, ObservedStatistic, holds};
use crate::drawn::Drawn;
use crate::observe::observe_grains;

const COUNT: usize = PAPER16.len();

/// The 16 statistics at the stated times: `max_z[0.4]` and so on, time by time.
#[derive(Clone, Debug)]
pub(super) struct Images {
    spec: ObserveImages,
    /// The scene's camera, without its noise.
    camera: CameraSpec,
    /// Of each time whose image has been taken.
    seen: Vec<[f64; COUNT]>,
}

impl Images {
    pub(super) fn new(spec: &ObserveImages, camera: &CameraSpec) -> Self {
        let camera = CameraSpec { blur: 0.0, depth_noise: 0.0, sensor: None, ..*camera };
        Self { spec: spec.clone(), camera, seen: Vec::new() }
    }

    /// NaN where too few grains are in view.
    fn measure(&self, positions: &[Vector3<f64>], radii: &[f64]) -> [f64; COUNT] {
        let is_shown = |x: &Vector3<f64>| self.spec.below.is_none_or(|below| x.z <= below);
        let shown = || positions.iter().zip(radii).filter(|(x, _)| is_shown(x));
        let places: Vec<_> = shown().map(|(x, _)| *x).collect();
        let sizes: Vec<_> = shown().map(|(_, r)| *r).collect();
        let seen = observe_grains(&self.camera, &Drawn::spheres(&places, &sizes), 0).ok();
        seen.and_then(|seen| seen.statistics.ok()).unwrap_or([f64::NAN; COUNT])
    }
}

impl Observation for Images {
    fn statistics(&self) -> Vec<ObservedStatistic> {
        let of = |time: &f64| {
            PAPER16.map(|statistic| ObservedStatistic {
                name: format!("{}[{time}]", statistic.name),
                unit: statistic.unit,
                doc: format!("{}, {time} s after the begin", statistic.doc),
            })
        };
        self.spec.times.iter().flat_map(of).collect()
    }

    fn see(&mut self, frame: &Frame) {
        // A time that no sample has met when the next one is due has the next one's image.
        while self.spec.times.get(self.seen.len()).is_some_and(|t| *t <= frame.stands_for + 1e-9) {
            self.seen.push(self.measure(&frame.positions, &frame.radii));
        }
    }

    fn values(&self, pour: &Pour) -> Vec<f64> {
        let rest = self.spec.times.len() - self.seen.len();
        let last = if rest > 0 && holds(pour) {
            self.measure(&pour.positions, &pour.radii)
        } else {
            [f64::NAN; COUNT]
        };
        let ended = std::iter::repeat_n(last, rest);
        self.seen.iter().copied().chain(ended).flatten().collect()
    }
}
