//! A fluid film between surfaces that come near: `scene/effects/lubrication.rs` has its law.
//!
//! Implicit in the speed at which a gap closes, one pair after the other: with k = F dt / (m v_n), m a typical mass,
//! and the inverse masses w of both,
//!
//! ```text
//! J = -k v_n / (1 + k (w_i + w_j)),   v_n -> v_n / (1 + k (w_i + w_j))
//! ```
//!
//! the gap being that at the middle of the substep, so that no film is too thick for the substep, and none can turn a
//! motion round.

use std::f64::consts::PI;
use std::sync::Arc;

use granulcal_scene::{Effect, Scene};

use super::acts::{Acts, EffectContext};
use super::bridges::Bridges;
use super::drag;
use super::near::{Near, at_walls, pairs};
use crate::particles::Particles;
use crate::wall::Walls;

/// The film of a scene.
#[derive(Clone, Debug)]
struct Film {
    /// F max(h, h_0) / (v_n m R^2) with R = 2 R_eff the radius of Derjaguin `[1/(m s)]`.
    strength: f64,
    /// h_0 and how far it reaches `[m]`.
    roughness: f64,
    range: f64,
}

/// The film of a scene, if there is one.
pub(super) fn of(scene: &Scene) -> Option<Arc<dyn Acts>> {
    let (film, radius) = (scene.effects.lubrication, scene.grains.radius());
    let mass = scene.grains.density * 4.0 / 3.0 * PI * radius.powi(3);
    let made = || Film {
        strength: 1.5 * PI * film.viscosity / mass * drag::inverse_inertia(scene),
        roughness: film.roughness * radius,
        range: film.range * radius,
    };
    film.is_on().then(|| Arc::new(made()) as _)
}

impl Acts for Film {
    fn reach(&self) -> f64 {
        self.range
    }

    /// Resists what comes together and what parts: pairs of grains and grains at walls.
    fn act_across_gaps(
        &self,
        particles: &mut Particles,
        context: &EffectContext<'_>,
        _bridges: &mut Bridges,
    ) {
        // Velocities change while the film acts, spheres do not.
        let spheres = particles.spheres.clone();
        let between = pairs(context.pairs, &spheres, particles.period);
        let count = particles.count() as u32;
        for near in between.chain(at_walls(context.at_walls, &spheres, count, context.walls)) {
            if near.gap < self.range {
                self.resist(particles, context.walls, &near, count, context.dt);
            }
        }
    }
}

impl Film {
    fn resist(&self, particles: &mut Particles, walls: &Walls, near: &Near, count: u32, dt: f64) {
        let (i, j) = (near.pair.0 as usize, near.pair.1 as usize);
        let (other, inverse_mass) = if near.is_wall {
            let wall = walls.wall(j - count as usize);
            (wall.motion_at(&near.point).0, particles.inverse_mass[i])
        } else {
            (particles.velocity(j), particles.inverse_mass[i] + particles.inverse_mass[j])
        };
        let opening = (particles.velocity(i) - other).dot(&near.normal);
        // The gap at the middle of the substep: with that at its begin a film would take a tenth too little.
        let gap = (near.gap + 0.5 * dt * opening).max(self.roughness);
        let k = self.strength * near.derjaguin.powi(2) / gap * dt;
        let impulse = -k * opening / (1.0 + k * inverse_mass) * near.normal;
        particles.kick(i, &impulse);
        if !near.is_wall {
            particles.kick(j, &-impulse);
        }
    }
}
