//! A fluid at rest around the grains: buoyancy, drag and added mass; air is one.
//!
//! ```text
//! (m + C_a m_f) dv/dt = (m - m_f) g - C_D/8 pi rho_f d^2 |v| v,   m_f = rho_f pi d^3 / 6
//! C_D = 24/Re (1 + 0.15 Re^0.687) up to Re = rho_f |v| d / mu = 1000, then 0.44
//! 0.4 (m + C_a m_f) r^2 d(omega)/dt = -8 pi mu r^3 omega
//! ```
//!
//! Source: Schiller and Naumann 1933 as in Clift, Grace and Weber, Bubbles, Drops and Particles (1978), table 5.1; the moment
//! is Stokes'. The fluid does not move: what grains set in motion of it, and what flows between packed grains, is not in
//! this model. The added mass turns with the grain here (the solver's spheres are solid), so that spin is too
//! inert by C_a rho_f / rho; a perfect fluid would not turn. Dimensional screen: drag matters where the terminal
//! speed is not far above the speed of the fall; for couscous in air at 12 cm it takes 0.6 % of the speed.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::DemError;
use crate::bed::Bed;
use crate::scene::{Grains, non_negative};

/// Reynolds number from which on the drag coefficient is constant.
const NEWTON: f64 = 1000.0;
/// The drag coefficient there.
const NEWTON_DRAG: f64 = 0.44;

/// A fluid; known, or a prior of its viscosity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Fluid {
    /// Density rho_f `[kg/m^3]`.
    pub density: f64,
    /// Dynamic viscosity mu `[Pa s]`.
    pub viscosity: f64,
    /// Added mass C_a over the displaced mass `[-]`: 1/2 for a sphere.
    pub added_mass: f64,
}

impl Default for Fluid {
    fn default() -> Self {
        Self { density: 0.0, viscosity: 0.0, added_mass: 0.5 }
    }
}

/// What a fluid does to grains of a density.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drag {
    fluid: Fluid,
    /// Mass of a grain with its added mass, over its volume `[kg/m^3]`.
    inertia: f64,
    /// Weight less buoyancy over the weight of the same inertia `[-]`.
    pub weight: f64,
    /// Mass of a grain over that with its added mass `[-]`.
    pub inverse_inertia: f64,
}

impl Fluid {
    pub(super) fn check(&self) -> Result<(), DemError> {
        non_negative("effects.fluid.density", self.density)?;
        non_negative("effects.fluid.viscosity", self.viscosity)?;
        non_negative("effects.fluid.added_mass", self.added_mass)
    }

    pub(super) fn is_on(&self) -> bool {
        self.density > 0.0 || self.viscosity > 0.0
    }

    pub(super) fn drag(self, grains: &Grains) -> Drag {
        let inertia = grains.density + self.added_mass * self.density;
        Drag {
            fluid: self,
            inertia,
            weight: (grains.density - self.density) / inertia,
            inverse_inertia: grains.density / inertia,
        }
    }
}

impl Drag {
    /// Rates at which a grain of `radius` `[m]` at `speed` `[m/s]` loses its velocity and its spin `[1/s]`.
    fn rates(&self, radius: f64, speed: f64) -> [f64; 2] {
        let Fluid { density, viscosity, .. } = self.fluid;
        let stokes = 4.5 * viscosity / (self.inertia * radius * radius);
        // Re < 1000, without a division by a viscosity of zero.
        let is_slow = 2.0 * radius * density * speed < NEWTON * viscosity;
        let linear = if is_slow {
            let reynolds = 2.0 * radius * density * speed / viscosity;
            stokes * (1.0 + 0.15 * reynolds.powf(0.687))
        } else {
            // C_D/8 pi rho_f d^2 |v| over the inertia of a sphere.
            0.375 * NEWTON_DRAG * density * speed / (self.inertia * radius)
        };
        // 8 pi mu r^3 over 0.4 of the inertia times r^2 is 10/3 of Stokes' rate.
        [linear, 10.0 / 3.0 * stokes]
    }

    /// Slows every grain for `dt` `[s]` after `gravity` `[m/s^2]` has acted: `v + g dt -> (v + g dt) / (1 + k(v) dt)`. Implicit
    /// in the velocity, so that no step is too long; the terminal speed is exact.
    pub fn act(&self, bed: &mut Bed, gravity: &Vector3<f64>, dt: f64) {
        for grain in 0..bed.count() {
            let before = bed.velocity(grain) - dt * gravity;
            let [linear, angular] = self.rates(bed.radius(grain), before.norm());
            let body = &mut bed.bodies[grain];
            body.velocity.scale(1.0 / (1.0 + dt * linear));
            body.spin.scale(1.0 / (1.0 + dt * angular));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRAINS: Grains = Grains { count: 1, diameter: 4e-3, density: 2500.0 };

    #[test]
    fn drag_is_stokes_when_slow_and_newtons_when_fast() {
        let glycerol = Fluid { density: 1260.0, viscosity: 1.4, added_mass: 0.5 }.drag(&GRAINS);
        let (radius, volume) = (2e-3, 4.0 / 3.0 * std::f64::consts::PI * 8e-9);
        let stokes = 6.0 * std::f64::consts::PI * 1.4 * radius / (glycerol.inertia * volume);
        let [linear, angular] = glycerol.rates(radius, 1e-9);
        assert!((linear / stokes - 1.0).abs() < 1e-6);
        let moment = 8.0 * std::f64::consts::PI * 1.4 * radius.powi(3);
        let turned = moment / (0.4 * glycerol.inertia * volume * radius * radius);
        assert!((angular / turned - 1.0).abs() < 1e-12);
        // C_D/8 pi rho_f d^2 |v| over the mass, at Re = 4000.
        let water = Fluid { density: 1000.0, viscosity: 1e-3, added_mass: 0.5 }.drag(&GRAINS);
        let area = std::f64::consts::PI * 16e-6;
        let fast = 0.44 / 8.0 * 1000.0 * area * 1.0 / (water.inertia * volume);
        assert!((water.rates(radius, 1.0)[0] / fast - 1.0).abs() < 1e-12);
        // Both meet at Re = 1000 within the two fits' difference.
        let [below, above] = [0.2499, 0.2501].map(|v| water.rates(radius, v)[0]);
        assert!((below / above - 1.0).abs() < 0.01);
    }

    #[test]
    fn weight_has_buoyancy_and_added_mass() {
        let water = Fluid { density: 1000.0, viscosity: 1e-3, added_mass: 0.5 }.drag(&GRAINS);
        assert_eq!(water.weight, 1500.0 / 3000.0);
        assert_eq!(water.inverse_inertia, 2500.0 / 3000.0);
    }
}
