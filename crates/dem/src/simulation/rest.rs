//! What tells rest from the slow moments of a fall: docs/theory/contact.md, "End and health".

use granulcal_scene::{Effect, Scene};
use nalgebra::Vector3;

/// What rest is in a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rest {
    /// Largest mean |v|^2 / 2 `[m^2/s^2]`.
    pub energy: f64,
    /// Above this mean |v|^2 / 2 grains have fallen since they last seemed at rest `[m^2/s^2]`.
    pub falling: f64,
    /// Looks in a row that may find a falling grain slow.
    pub looks: usize,
}

impl Rest {
    /// Of a scene under `gravity` less buoyancy `[m/s^2]`, at which is looked every `look` seconds.
    ///
    /// A grain that flies freely is slower than v_0 = sqrt(2 energy) for 2 v_0 / g at most, from -v_0 to v_0. Of two
    /// looks one finds it at g look / 2 or more, wherever its turning point is. In a fluid it gets no faster than
    /// Stokes' v_t = |rho - rho_f| g d^2 / (18 mu): rest is slower than half of that.
    pub fn of(scene: &Scene, gravity: f64, look: f64) -> Self {
        let (fluid, grains) = (scene.effects.fluid, &scene.grains);
        let slow = (2.0 * scene.end.kinetic_energy).sqrt();
        let weight = (grains.density - fluid.density).abs() * Vector3::from(scene.gravity).norm();
        let terminal = weight * grains.diameter.powi(2) / (18.0 * fluid.viscosity);
        let sinks = fluid.is_on() && terminal > 0.0;
        let energy = if sinks && 0.5 * terminal < slow {
            0.125 * terminal * terminal
        } else {
            scene.end.kinetic_energy
        };
        if gravity == 0.0 {
            return Self { energy, falling: f64::INFINITY, looks: 1 };
        }
        let flight = 2.0 * (2.0 * energy).sqrt() / gravity;
        let falling = 0.125 * (gravity * look).powi(2);
        Self {
            energy,
            falling: falling.max(energy),
            looks: (flight / look).ceil().max(1.0) as usize,
        }
    }
}
