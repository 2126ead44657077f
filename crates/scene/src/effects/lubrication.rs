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
//! acts on that against the fluid. Surfaces that slide past each other at u_t are resisted by
//!
//! ```text
//! F_t = shear 6 pi mu r_i Y ln(s / max(h, h_0)) u_t,   Y = 4 b (2 + b + 2 b^2) / (15 (1 + b)^3),   b = r_j / r_i
//! ```
//!
//! with s the mean radius: pi mu a ln(a / h) u_t for equal spheres, (16/5) pi mu a ln(a / h) u_t at a wall (Y = 8/15, s
//! = a). It acts at the surfaces, so that what rolls as gears do is not resisted.
//!
//! Source: Reynolds' equation in the limit of a thin film, Kim and Karrila, Microhydrodynamics (1991), chapter 9 (Y is
//! their Y^A_11, section 9.3); Ball and Melrose, Physica A 247 (1997) 444, doi:10.1016/S0378-4371(97)00412-3; with
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
    /// Share of the force on surfaces that slide past each other `[-]`: 0 for none, 1 for that of smooth spheres.
    pub shear: f64,
}

impl Default for Lubrication {
    fn default() -> Self {
        Self { viscosity: 0.0, roughness: 1e-2, range: 0.5, shear: 0.0 }
    }
}

impl Effect for Lubrication {
    fn path(&self) -> &'static str {
        "effects.lubrication"
    }

    fn check(&self) -> Result<(), SceneError> {
        non_negative("effects.lubrication.viscosity", self.viscosity)?;
        positive("effects.lubrication.roughness", self.roughness)?;
        positive("effects.lubrication.range", self.range)?;
        if !(0.0..=1.0).contains(&self.shear) {
            return Err(SceneError::range("effects.lubrication.shear", self.shear, "in [0, 1]"));
        }
        Ok(())
    }

    fn is_on(&self) -> bool {
        self.viscosity > 0.0
    }
}
