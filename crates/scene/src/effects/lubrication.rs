//! Lubrication: a fluid between two surfaces resists their coming together and their parting.
//!
//! With R_eff = r_i r_j / (r_i + r_j) (r at a flat wall) and v_n the speed at which the gap h closes,
//!
//! ```text
//! F = 6 pi mu R_eff^2 v_n / max(h, h_0)
//! ```
//!
//! which is (3/2) pi mu a^2 v_n / h for equal spheres of radius a, and 6 pi mu a^2 v_n / h at a wall. h_0 is what
//! roughness leaves between surfaces that touch. It acts on the motion of surfaces towards each other, where a drag
//! acts on that against the fluid; tangential motion, whose force grows with the logarithm of h alone, is left out.
//!
//! Source: Reynolds' equation in the limit of a thin film, Kim and Karrila, Microhydrodynamics (1991), chapter 9; with
//! a cut at the roughness: Smart and Leighton, Phys. Fluids A 1 (1989) 52, doi:10.1063/1.857523. Dimensional screen: no
//! effect above a Stokes number rho_s d v / 9 mu of some hundred.

use serde::{Deserialize, Serialize};

use super::effect::Effect;
use crate::check::{non_negative, positive};
use crate::error::SceneError;

/// A fluid film between surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Lubrication {
    /// Viscosity mu `[Pa s]`; 0: no film.
    pub viscosity: f64,
    /// Gap below which the force grows no more, in radii of a typical grain `[-]`.
    pub roughness: f64,
    /// Gap up to which it acts, in radii of a typical grain `[-]`.
    pub range: f64,
}

impl Default for Lubrication {
    fn default() -> Self {
        Self { viscosity: 0.0, roughness: 1e-2, range: 0.5 }
    }
}

impl Effect for Lubrication {
    fn path(&self) -> &'static str {
        "effects.lubrication"
    }

    fn check(&self) -> Result<(), SceneError> {
        non_negative("effects.lubrication.viscosity", self.viscosity)?;
        positive("effects.lubrication.roughness", self.roughness)?;
        positive("effects.lubrication.range", self.range)
    }

    fn is_on(&self) -> bool {
        self.viscosity > 0.0
    }
}
