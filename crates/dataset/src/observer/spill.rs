//! Grains that have come to lie outside a circle.

use granulcal_dem::Pour;
use granulcal_scene::{ObserveSpill, Scene};
use nalgebra::{Vector2, Vector3};

use super::observation::{Observation, ObservedStatistic};

/// `spilled`.
#[derive(Clone, Debug)]
pub(super) struct Spill {
    spec: ObserveSpill,
    /// Spheres of a grain: pours are told sphere by sphere.
    spheres: usize,
}

impl Spill {
    pub(super) fn new(spec: &ObserveSpill, scene: &Scene) -> Self {
        Self { spec: spec.clone(), spheres: scene.effects.clump.members() }
    }
}

impl Observation for Spill {
    fn statistics(&self) -> Vec<ObservedStatistic> {
        let radius = self.spec.radius;
        let doc = format!("grains whose centre is more than {radius} m from the axis at the end");
        vec![ObservedStatistic { name: "spilled".to_owned(), unit: "grains", doc }]
    }

    fn values(&self, pour: &Pour) -> Vec<f64> {
        let axis = Vector2::from(self.spec.axis);
        let centre =
            |grain: &[Vector3<f64>]| grain.iter().sum::<Vector3<f64>>() / grain.len() as f64;
        let is_out = |x: &Vector3<f64>| (x.xy() - axis).norm() > self.spec.radius;
        vec![pour.positions.chunks(self.spheres).map(centre).filter(is_out).count() as f64]
    }
}
