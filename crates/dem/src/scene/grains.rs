//! What is poured.

use serde::{Deserialize, Serialize};

/// What is poured: equal spheres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Grains {
    /// How many.
    pub count: usize,
    /// Diameter `[m]`.
    pub diameter: f64,
    /// Density `[kg/m^3]`; it drops out of dry pours of equal grains and only sets the unit of energy.
    pub density: f64,
}

impl Grains {
    /// Radius of a grain `[m]`.
    pub fn radius(&self) -> f64 {
        0.5 * self.diameter
    }
}
