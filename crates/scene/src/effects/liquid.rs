//! A liquid with a flow of its own: it stands among the grains as a column about the z axis, and runs out over the
//! ground. The equations are in `dem/src/liquid.rs` and docs/theory/effects.md.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use super::effect::Effect;
use crate::check::{non_negative, positive};
use crate::error::SceneError;

/// A liquid that flows by itself; known, or of a permeability to infer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Liquid {
    /// Height of its surface where it stands at the begin `[m]`; 0: no liquid.
    pub height: f64,
    /// Radius about the z axis of the column that it stands in then `[m]`.
    pub radius: f64,
    /// When it is there `[s]`: grains that start in a lattice settle before, without it.
    pub begin: f64,
    /// Density rho_f `[kg/m^3]`.
    pub density: f64,
    /// Dynamic viscosity mu `[Pa s]`.
    pub viscosity: f64,
    /// Permeability of the grains over that of Di Felice's drag `[-]`: it slips past them the less, the smaller.
    pub permeability: f64,
    /// Surface tension gamma `[N/m]`: what holds its edge on the dry ground.
    pub tension: f64,
    /// Contact angle theta on the ground `[rad]`: 0 is held by nothing.
    pub contact_angle: f64,
}

impl Default for Liquid {
    fn default() -> Self {
        Self {
            height: 0.0,
            radius: 0.05,
            begin: 0.0,
            density: 1000.0,
            viscosity: 1e-3,
            permeability: 1.0,
            tension: 0.0,
            contact_angle: 0.0,
        }
    }
}

impl Effect for Liquid {
    fn path(&self) -> &'static str {
        "effects.liquid"
    }

    fn check(&self) -> Result<(), SceneError> {
        non_negative("effects.liquid.height", self.height)?;
        positive("effects.liquid.radius", self.radius)?;
        non_negative("effects.liquid.begin", self.begin)?;
        positive("effects.liquid.density", self.density)?;
        non_negative("effects.liquid.viscosity", self.viscosity)?;
        positive("effects.liquid.permeability", self.permeability)?;
        non_negative("effects.liquid.tension", self.tension)?;
        if !(0.0..=PI).contains(&self.contact_angle) {
            let (name, got) = ("effects.liquid.contact_angle", self.contact_angle);
            return Err(SceneError::range(name, got, "in [0, pi]"));
        }
        Ok(())
    }

    fn is_on(&self) -> bool {
        self.height > 0.0
    }
}

impl Liquid {
    /// Height by which menisci between packed grains of a `diameter` `[m]` draw the liquid up, `6 gamma (1 - eps) /
    /// (eps d rho_f g)` with eps = 0.4 between them, which it wets `[m]`.
    ///
    /// Source: tension times the surface of the grains over the volume between them, Haines, J. Agricultural Science 20
    /// (1930) 97, doi:10.1017/S002185960008864X.
    pub fn suction(&self, diameter: f64, gravity: f64) -> f64 {
        6.0 * self.tension * 0.6 / (0.4 * diameter * self.density * gravity)
    }

    /// Thickness of a puddle that neither advances nor recedes, `e = 2 sqrt(gamma / (rho_f g)) sin(theta / 2)` `[m]`.
    ///
    /// Source: de Gennes, Brochard-Wyart and Quéré, Capillarity and Wetting Phenomena (2004), section 2.2.
    pub fn puddle(&self, gravity: f64) -> f64 {
        let length = (self.tension / (self.density * gravity)).sqrt();
        2.0 * length * (0.5 * self.contact_angle).sin()
    }
}
