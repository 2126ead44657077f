//! Grains that have come to lie outside a circle.

use granulcal_dem::Pour;
use granulcal_scene::ObserveSpill;
use nalgebra::Vector2;

use super::observation::{Observation, ObservedStatistic};

/// `spilled`.
#[derive(Clone, Debug)]
pub(super) struct Spill {
    spec: ObserveSpill,
}

impl Spill {
    pub(super) fn new(spec: &ObserveSpill) -> Self {
        Self { spec: spec.clone() }
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
        let is_out = |x: &&nalgebra::Vector3<f64>| (x.xy() - axis).norm() > self.spec.radius;
        vec![pour.positions.iter().filter(is_out).count() as f64]
    }
}
