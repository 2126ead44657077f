//! What is poured.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::grain_shape::{GrainShape, Solid};

/// What is poured: equal spheres, or equal convex bodies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Grains {
    /// How many.
    pub count: usize,
    /// Diameter `[m]`.
    pub diameter: f64,
    /// Density `[kg/m^3]`; it drops out of dry pours of equal grains and only sets the unit of energy.
    pub density: f64,
    /// What shape they have; spheres if it is not stated. docs/theory/bodies.md.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape: Option<GrainShape>,
}

impl Grains {
    /// Radius of a grain `[m]`.
    pub fn radius(&self) -> f64 {
        0.5 * self.diameter
    }

    /// The body that every grain is, if it has a shape; of a checked scene.
    ///
    /// # Panics
    /// For a shape that a checked scene cannot have.
    pub fn solid(&self) -> Option<Arc<Solid>> {
        let solid = |shape| Solid::new(shape, self.diameter).expect("a checked shape");
        self.shape.as_ref().map(solid)
    }
}
