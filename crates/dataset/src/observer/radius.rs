//! Percentiles of the grains' distance from an axis at the end.

use granulcal_dem::Pour;
use granulcal_features::series::mass_percentiles;
use granulcal_scene::ObserveRadius;
use nalgebra::Vector2;

use super::observation::{Observation, ObservedStatistic};

/// `radius[p]` of the stated percentiles.
#[derive(Clone, Debug)]
pub(super) struct Radius {
    spec: ObserveRadius,
}

impl Radius {
    pub(super) fn new(spec: &ObserveRadius) -> Self {
        Self { spec: spec.clone() }
    }
}

impl Observation for Radius {
    fn statistics(&self) -> Vec<ObservedStatistic> {
        let of = |percent: &f64| ObservedStatistic {
            name: format!("radius[{percent}]"),
            unit: "m",
            doc: format!(
                "radius about the axis within which {percent} % of the mass is at the end"
            ),
        };
        self.spec.percentiles.iter().map(of).collect()
    }

    fn values(&self, pour: &Pour) -> Vec<f64> {
        let axis = Vector2::from(self.spec.axis);
        mass_percentiles(&pour.positions, &pour.radii, axis, &self.spec.percentiles)
            .unwrap_or_else(|_| vec![f64::NAN; self.spec.percentiles.len()])
    }
}
