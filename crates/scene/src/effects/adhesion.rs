//! Dry adhesion: surfaces that touch pull each other with a constant force, the pull-off force.
//!
//! For rigid grains only the pull-off force of JKR, `F = 3 pi gamma R_eff`, is left, with
//! `R_eff = r_i r_j / (r_i + r_j)` (r at a flat wall) and gamma half the work of adhesion; DMT's is 4/3 of it, and a
//! simplified JKR (SJKR) differs in how the force sets in over an overlap that rigid grains do not have. Source:
//! Johnson, Kendall and Roberts, Proc. R. Soc. A 324 (1971) 301, doi:10.1098/rspa.1971.0141; Derjaguin, Muller and
//! Toporov, J. Colloid Interface Sci. 53 (1975) 314. Dimensional screen: roughness cuts an ideal surface's pull 10 to
//! 100 times; no effect below a Bond number of 0.03.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use super::effect::Effect;
use super::tension::either;
use crate::check::{non_negative, positive};
use crate::error::SceneError;

/// Dry adhesion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Adhesion {
    /// Pull of two touching typical grains over the weight of one `[-]`.
    pub bond: f64,
    /// Surface energy gamma `[N/m]`, half the work of adhesion, in place of `bond`: the same at any gravity.
    pub tension: f64,
    /// Gap up to which surfaces count as touching, in radii of a typical grain `[-]`.
    pub range: f64,
    /// Pull at walls over that at a wall like the grains `[-]`.
    pub walls: f64,
}

impl Default for Adhesion {
    fn default() -> Self {
        Self { bond: 0.0, tension: 0.0, range: 5e-3, walls: 1.0 }
    }
}

impl Effect for Adhesion {
    fn path(&self) -> &'static str {
        "effects.adhesion"
    }

    fn check(&self) -> Result<(), SceneError> {
        non_negative("effects.adhesion.bond", self.bond)?;
        either("effects.adhesion.tension", self.tension, self.bond)?;
        positive("effects.adhesion.range", self.range)?;
        non_negative("effects.adhesion.walls", self.walls)
    }

    fn is_on(&self) -> bool {
        self.bond > 0.0 || self.tension > 0.0
    }
}

impl Adhesion {
    /// Pull of two touching grains of a `radius` and a `mass` over that mass, at a gravity of `g` `[m/s^2]`.
    pub fn touch(&self, radius: f64, mass: f64, g: f64) -> f64 {
        // JKR's pull-off, 3 pi gamma R_eff with R_eff = r / 2 of equal grains.
        self.bond * g + 1.5 * PI * self.tension * radius / mass
    }

    /// Pull over that of touching typical grains `[-]`; lengths in radii of a typical grain.
    pub fn pull(&self, gap: f64, derjaguin: f64) -> f64 {
        if gap <= self.range { derjaguin } else { 0.0 }
    }

    /// Work to part surfaces from `gap` on, over the pull of touching typical grains times a radius `[-]`: the integral
    /// of [`Adhesion::pull`].
    pub fn work(&self, gap: f64, derjaguin: f64) -> f64 {
        derjaguin * (self.range - gap.max(0.0)).max(0.0)
    }
}
