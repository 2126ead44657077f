//! A fluid around the grains: buoyancy, drag and added mass; air is one.
//!
//! ```text
//! (m + C_a m_f) dv/dt = (m - m_f) g - C_D/8 pi rho_f d^2 |w| w eps^(-chi-1),   m_f = rho_f pi d^3 / 6,   w = eps (v - u)
//! C_D = 24/Re (1 + 0.15 Re^0.687) up to Re = rho_f |w| d / mu = 1000, then 0.44
//! chi = crowding (3.7 - 0.65 exp(-(1.5 - log10 Re)^2 / 2)),   eps = 1 - 0.6 phi,   u = entrained phi <v>
//! 0.4 (m + C_a m_f) r^2 d(omega)/dt = -8 pi mu r^3 omega
//! ```
//!
//! Source: Schiller and Naumann 1933 as in Clift, Grace and Weber, Bubbles, Drops and Particles (1978), table 5.1; the
//! moment is Stokes'; chi and the superficial velocity w are Di Felice's (Int. J. Multiphase Flow 20 (1994) 153,
//! doi:10.1016/0301-9322(94)90011-6), whose drag agrees with Ergun's in a packing. phi, between 0 and 1, is how crowded
//! a grain is: its neighbours over those inside a packing; `<v>` is their mean velocity. `crowding` 0 is the drag of a
//! lone grain, `entrained` 0 a fluid at rest, and with both at 0 eps is 1. With `entrained` 1 the fluid inside a
//! packing goes with the grains, as it must where it cannot seep as fast as they fall, and only the outer grains are
//! dragged. The fluid has no inertia but the added mass.
//!
//! `saturated` 1 is a fluid that fills the grains up to their own surface h(x, y) (`pore_surface.rs`), as a column that
//! stands in air holds it: with the pressure of a fluid at rest below that surface, `p = rho_f g (h - z)`, a grain and
//! the fluid between it and the next get buoyancy and a push down the slope of the surface,
//!
//! ```text
//! -grad p V / 0.6 = rho_f g (V / 0.6) (z - phi grad h)
//! ```
//!
//! and the fluid goes with the neighbours alone, the ground among them: outside there is none. Source: hydrostatic pore
//! pressure as in Iverson, Rev. Geophys. 35 (1997) 245, doi:10.1029/97RG00426; the inertia of the fluid between grains
//! is an added mass of 0.4 / 0.6. The added mass turns with the grain here (the solver's spheres are solid), so that
//! spin is too inert by C_a rho_f / rho; a perfect fluid would not turn. Dimensional screen: drag matters where the
//! terminal speed is not far above the speed of the fall; for couscous in air at 12 cm it takes 0.6 % of the speed.

use std::sync::Arc;

use granulcal_scene::{Effect, Fluid, Grains, Scene};
use nalgebra::Vector3;

use super::acts::{Acts, EffectContext};
use super::neighbours::neighbours;
use super::pore_surface::{PACKED, PoreSurface};
use crate::particles::Particles;

/// Reynolds number from which on the drag coefficient is constant.
const NEWTON: f64 = 1000.0;
/// The drag coefficient there.
const NEWTON_DRAG: f64 = 0.44;

/// What a fluid does to grains of a density.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drag {
    fluid: Fluid,
    /// Mass of a grain with its added mass, over its volume `[kg/m^3]`.
    inertia: f64,
    /// Weight less buoyancy over the weight of the same inertia `[-]`.
    weight: f64,
    /// Mass of a grain over that with its added mass `[-]`.
    inverse_inertia: f64,
    /// Acceleration down a slope of 1 by the pressure of a fluid that fills the grains, `rho_f g / 0.6` over the
    /// inertia of a volume of grain `[m/s^2]`.
    push: f64,
}

/// The fluid of a scene, if there is one.
pub(super) fn of(scene: &Scene) -> Option<Arc<dyn Acts>> {
    drag_of(scene).map(|drag| Arc::new(drag) as _)
}

/// Mass of a grain over its mass with what of the fluid moves with it `[-]`; 1 without a fluid.
pub(crate) fn inverse_inertia(scene: &Scene) -> f64 {
    drag_of(scene).map_or(1.0, |drag| drag.inverse_inertia)
}

fn drag_of(scene: &Scene) -> Option<Drag> {
    let fluid = scene.effects.fluid;
    fluid.is_on().then(|| Drag::of(fluid, &scene.grains, scene.gravity[2].abs()))
}

impl Drag {
    /// `gravity`: its magnitude along the vertical `[m/s^2]`.
    pub fn of(fluid: Fluid, grains: &Grains, gravity: f64) -> Self {
        let inertia = grains.density + fluid.added_mass * fluid.density;
        Self {
            fluid,
            inertia,
            weight: (grains.density - fluid.density) / inertia,
            inverse_inertia: grains.density / inertia,
            push: fluid.saturated * fluid.density * gravity / (PACKED * inertia),
        }
    }

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

    /// The rates of [`Drag::rates`] among neighbours, `crowd` between 0 and 1.
    pub fn crowded_rates(&self, radius: f64, speed: f64, crowd: f64) -> [f64; 2] {
        let crowding = self.fluid.crowding;
        if crowd == 0.0 || crowding == 0.0 {
            return self.rates(radius, speed);
        }
        let void = 1.0 - PACKED * crowd;
        let [linear, angular] = self.rates(radius, void * speed);
        let Fluid { density, viscosity, .. } = self.fluid;
        // Where nothing is viscous the exponent is its limit of fast flow.
        let reynolds = 2.0 * radius * density * void * speed / viscosity;
        let bell = 1.5 - reynolds.max(f64::MIN_POSITIVE).log10();
        let exponent = crowding * (3.7 - 0.65 * (-0.5 * bell * bell).exp());
        // One eps is of w, one of the pressure that drives the flow, which acts on the grains as well (model B).
        [linear * void.powf(-exponent), angular]
    }
}

impl Acts for Drag {
    fn gravity(&self, gravity: Vector3<f64>) -> Vector3<f64> {
        gravity * self.weight
    }

    /// What the fluid does to every grain within a substep after gravity has acted:
    /// `v + g dt -> u + (v + g dt - u) / (1 + k(v - u) dt)`, implicit in the velocity, so that no step is too long and
    /// the terminal speed is exact; and the push of its pressure. Returns the energy that a fluid in motion gives.
    fn act_with_gravity(&self, particles: &mut Particles, context: &EffectContext<'_>) -> f64 {
        let EffectContext { pairs, gravity, radius, dt, .. } = *context;
        let Fluid { crowding, entrained, saturated, .. } = self.fluid;
        let is_alone = crowding == 0.0 && entrained == 0.0 && saturated == 0.0;
        let fall = dt * gravity;
        let around = if is_alone { Vec::new() } else { neighbours(particles, pairs, &fall) };
        let surface = (saturated > 0.0).then(|| PoreSurface::of(particles, radius));
        let mut given = 0.0;
        for grain in 0..particles.count() {
            let near = around.get(grain).copied().unwrap_or_default();
            let (crowd, mean) = near.crowd_and_mean();
            let share = entrained * crowd;
            let flow = (share + saturated * (1.0 - share)) * mean;
            let energy = particles.kinetic_energy(grain);
            let before = particles.velocity(grain) - fall - flow;
            let is_dry = saturated == 1.0 && near.count == 0.0;
            let [linear, angular] = if is_dry {
                [0.0; 2]
            } else {
                self.crowded_rates(particles.radius(grain), before.norm(), crowd)
            };
            let place = particles.position(grain);
            let body = &mut particles.bodies[grain];
            body.velocity.add(&-flow);
            body.velocity.scale(1.0 / (1.0 + dt * linear));
            body.velocity.add(&flow);
            body.spin.scale(1.0 / (1.0 + dt * angular));
            if let Some(surface) = &surface {
                let [x, y] = surface.slope(place.x, place.y);
                body.velocity.add(&(-dt * crowd * self.push * Vector3::new(x, y, 0.0)));
            }
            given += particles.kinetic_energy(grain) - energy;
        }
        if is_alone { 0.0 } else { given.max(0.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRAINS: Grains = Grains::balls(1, 4e-3, 2500.0);

    fn drag(fluid: Fluid) -> Drag {
        Drag::of(fluid, &GRAINS, 9.81)
    }

    #[test]
    fn drag_is_stokes_when_slow_and_newtons_when_fast() {
        let glycerol =
            drag(Fluid { density: 1260.0, viscosity: 1.4, added_mass: 0.5, ..Fluid::default() });
        let (radius, volume) = (2e-3, 4.0 / 3.0 * std::f64::consts::PI * 8e-9);
        let stokes = 6.0 * std::f64::consts::PI * 1.4 * radius / (glycerol.inertia * volume);
        let [linear, angular] = glycerol.rates(radius, 1e-9);
        assert!((linear / stokes - 1.0).abs() < 1e-6);
        let moment = 8.0 * std::f64::consts::PI * 1.4 * radius.powi(3);
        let turned = moment / (0.4 * glycerol.inertia * volume * radius * radius);
        assert!((angular / turned - 1.0).abs() < 1e-12);
        // C_D/8 pi rho_f d^2 |v| over the mass, at Re = 4000.
        let water =
            drag(Fluid { density: 1000.0, viscosity: 1e-3, added_mass: 0.5, ..Fluid::default() });
        let area = std::f64::consts::PI * 16e-6;
        let fast = 0.44 / 8.0 * 1000.0 * area * 1.0 / (water.inertia * volume);
        assert!((water.rates(radius, 1.0)[0] / fast - 1.0).abs() < 1e-12);
        // Both meet at Re = 1000 within the two fits' difference.
        let [below, above] = [0.2499, 0.2501].map(|v| water.rates(radius, v)[0]);
        assert!((below / above - 1.0).abs() < 0.01);
    }

    #[test]
    fn drag_in_a_packing_is_ergun_s_within_a_third() {
        // Source: Ergun, Chem. Eng. Prog. 48 (1952) 89: pressure drop over the solid fraction, per slip.
        let (radius, void): (f64, f64) = (2e-3, 0.4);
        let diameter = 2.0 * radius;
        for (viscosity, slip) in [(1.0, 1e-3), (1e-3, 5e-3), (1e-3, 0.1)] {
            let fluid = Fluid { density: 1000.0, viscosity, crowding: 1.0, ..Fluid::default() };
            let drag = drag(fluid);
            let [rate, _] = drag.crowded_rates(radius, slip, 1.0);
            let ergun = 150.0 * (1.0 - void) * viscosity / (void * diameter).powi(2)
                + 1.75 * 1000.0 * slip / (void * diameter);
            let ratio = rate * drag.inertia / ergun;
            assert!((0.67..1.5).contains(&ratio), "{viscosity} {slip}: {ratio}");
        }
    }

    #[test]
    fn weight_has_buoyancy_and_added_mass() {
        let water =
            drag(Fluid { density: 1000.0, viscosity: 1e-3, added_mass: 0.5, ..Fluid::default() });
        assert_eq!(water.weight, 1500.0 / 3000.0);
        assert_eq!(water.inverse_inertia, 2500.0 / 3000.0);
    }
}
