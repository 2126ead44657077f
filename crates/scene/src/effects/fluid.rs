//! A fluid around the grains: buoyancy, drag and added mass; air is one. The equations are in `effect/drag.rs`.

use serde::{Deserialize, Serialize};

use super::effect::Effect;
use crate::check::non_negative;
use crate::error::SceneError;

/// A fluid; known, or of a viscosity to infer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Fluid {
    /// Density rho_f `[kg/m^3]`.
    pub density: f64,
    /// Dynamic viscosity mu `[Pa s]`.
    pub viscosity: f64,
    /// Added mass C_a over the displaced mass `[-]`: 1/2 for a sphere.
    pub added_mass: f64,
    /// Share of Di Felice's exponent for the drag among neighbours `[-]`: 0 for that of a lone grain.
    pub crowding: f64,
    /// Share of its neighbours' velocity that the fluid around a grain has `[-]`: 0 for a fluid at rest.
    pub entrained: f64,
    /// Share of the pressure of a fluid that fills the grains up to their own surface `[-]`: 0 for one that is
    /// everywhere.
    pub saturated: f64,
}

impl Default for Fluid {
    fn default() -> Self {
        Self {
            density: 0.0,
            viscosity: 0.0,
            added_mass: 0.5,
            crowding: 0.0,
            entrained: 0.0,
            saturated: 0.0,
        }
    }
}

impl Effect for Fluid {
    fn path(&self) -> &'static str {
        "effects.fluid"
    }

    fn check(&self) -> Result<(), SceneError> {
        non_negative("effects.fluid.density", self.density)?;
        non_negative("effects.fluid.viscosity", self.viscosity)?;
        non_negative("effects.fluid.added_mass", self.added_mass)?;
        for (name, got) in [
            ("effects.fluid.crowding", self.crowding),
            ("effects.fluid.entrained", self.entrained),
            ("effects.fluid.saturated", self.saturated),
        ] {
            if !(0.0..=1.0).contains(&got) {
                return Err(SceneError::range(name, got, "in [0, 1]"));
            }
        }
        Ok(())
    }

    fn is_on(&self) -> bool {
        self.density > 0.0 || self.viscosity > 0.0
    }
}
