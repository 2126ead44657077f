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
//! motion round. What slides past each other at u_t is resisted likewise, by an impulse at both surfaces,
//!
//! ```text
//! J_t = -k_t u_t / (1 + (1 + 5/2) k_t (w_i + w_j))
//! ```

use std::f64::consts::PI;
use std::sync::Arc;

use granulcal_scene::{Effect, Scene};

use super::acts::{Acts, EffectContext};
use super::bridges::Bridges;
use super::drag;
use super::near::{Near, at_walls, pairs};
use crate::law::INVERSE_INERTIA;
use crate::particles::Particles;
use crate::wall::Walls;

/// The film of a scene.
#[derive(Clone, Debug)]
struct Film {
    /// F max(h, h_0) / (v_n m R^2) with R = 2 R_eff the radius of Derjaguin `[1/(m s)]`.
    strength: f64,
    /// F_t over r Y ln(s / h) u_t m `[1/(m s)]`.
    shear: f64,
    /// h_0 and how far it reaches `[m]`.
    roughness: f64,
    range: f64,
}

/// The film of a scene, if there is one.
pub(super) fn of(scene: &Scene) -> Option<Arc<dyn Acts>> {
    let (film, radius) = (scene.effects.lubrication, scene.grains.radius());
    let mass = scene.grains.density * 4.0 / 3.0 * PI * radius.powi(3);
    let mobility = PI * film.viscosity / mass * drag::inverse_inertia(scene);
    let made = || Film {
        strength: 1.5 * mobility,
        shear: 6.0 * mobility * film.shear,
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
        let normal = near.normal;
        let (other, inverse_mass) = if near.is_wall {
            let wall = walls.wall(j - count as usize);
            (wall.motion_at(&near.point).0, particles.inverse_mass[i])
        } else {
            (particles.velocity(j), particles.inverse_mass[i] + particles.inverse_mass[j])
        };
        let opening = (particles.velocity(i) - other).dot(&normal);
        // The gap at the middle of the substep: with that at its begin a film would take a tenth too little.
        let gap = (near.gap + 0.5 * dt * opening).max(self.roughness);
        let k = self.strength * near.derjaguin.powi(2) / gap * dt;
        let impulse = -k * opening / (1.0 + k * inverse_mass) * normal;
        particles.kick(i, &impulse);
        if !near.is_wall {
            particles.kick(j, &-impulse);
        }
        if self.shear > 0.0 {
            // The surface of a wall moves as its point does, that of a grain turns as well.
            let surface =
                if near.is_wall { other } else { other + particles.spin(j).cross(&normal) };
            let sliding = particles.velocity(i) - particles.spin(i).cross(&normal) - surface;
            let sliding = sliding - sliding.dot(&normal) * normal;
            let other = (!near.is_wall).then(|| particles.radius(j));
            let k = self.shear * dt * shear_over_viscosity(particles.radius(i), other, gap);
            let impulse = -k / (1.0 + (1.0 + INVERSE_INERTIA) * k * inverse_mass) * sliding;
            particles.kick_at(i, &impulse, &-normal);
            if !near.is_wall {
                particles.kick_at(j, &-impulse, &normal);
            }
        }
    }
}

/// Force on surfaces that slide past each other over 6 pi mu u_t `[m]`: of two spheres, or of one at a wall.
fn shear_over_viscosity(radius: f64, other: Option<f64>, gap: f64) -> f64 {
    let (y, scale) = other.map_or((8.0 / 15.0, radius), |other| {
        let b = other / radius;
        let y = 4.0 * b * (2.0 + b + 2.0 * b * b) / (15.0 * (1.0 + b).powi(3));
        (y, 0.5 * (radius + other))
    });
    radius * y * (scale / gap).ln().max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_force_is_that_of_both_spheres_and_of_a_wall() {
        let (a, b, gap) = (2e-3, 3e-3, 1e-5);
        let of = |a, b| shear_over_viscosity(a, b, gap);
        assert!((of(a, Some(b)) / of(b, Some(a)) - 1.0).abs() < 1e-12);
        // pi mu a ln(a / h) of equal spheres; a large sphere is a wall but for the length in the logarithm.
        assert!((6.0 * of(a, Some(a)) / (a * (a / gap).ln()) - 1.0).abs() < 1e-12);
        let logs = |b: Option<f64>| (b.map_or(a, |b| 0.5 * (a + b)) / gap).ln();
        let large = Some(1e4 * a);
        assert!((of(a, large) / logs(large) / (of(a, None) / logs(None)) - 1.0).abs() < 1e-3);
        assert_eq!(shear_over_viscosity(a, None, 2.0 * a), 0.0);
    }
}
