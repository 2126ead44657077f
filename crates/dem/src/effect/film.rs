//! A fluid film between surfaces that come near: `crates/scene/src/effects/lubrication.rs` has its law.
//!
//! The force is `-C v_n / h` at an opening speed v_n, with C over the pair's mass and the gap cut at h_0. Along the way
//! of a substep that is `dv = -C dh / h`, hence, whatever the way and the step,
//!
//! ```text
//! v' = v - C (Phi(h') - Phi(h)),   h' = h + v' dt,   Phi(h) = ln(h / h_0) from h_0 on, (h - h_0) / h_0 below
//! ```
//!
//! one pair after the other: no film is too thick for the substep, and none can turn a motion round. What comes
//! together is slowed before gravity acts and impacts are looked for, up to the contact; what parts, after both, from
//! the contact on. So grains that rest on each other, which gravity brings together for the length of a substep, have
//! no film between them that would carry them. What slides past each other at u_t is resisted by an impulse at both
//! surfaces,
//!
//! ```text
//! J_t = -k_t u_t / (1 + (1 + 5/2) k_t (w_i + w_j))
//! ```

use std::f64::consts::PI;
use std::sync::Arc;

use granulcal_scene::{Effect, Scene};
use nalgebra::Vector3;

use super::acts::{Acts, EffectContext};
use super::bridges::Bridges;
use super::drag;
use super::near::{self, Meeting, Near};
use crate::law::INVERSE_INERTIA;
use crate::particles::Particles;

/// Newton's steps to a speed at most; a few do.
const STEPS: usize = 50;
/// Part of a speed by which the last of Newton's steps may change it: its square is what is left `[-]`.
const CLOSE: f64 = 1e-9;

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

    /// Resists what comes together, and what slides.
    fn act_before_gravity(&self, particles: &mut Particles, context: &EffectContext<'_>) -> f64 {
        self.resist(particles, context, |particles, near, meeting| {
            let slid = self.resist_sliding(particles, near, meeting, context.dt);
            if meeting.opening < 0.0 {
                slid + self.slow(particles, near, meeting, context.dt)
            } else {
                slid
            }
        })
    }

    /// Resists what parts.
    fn act_across_gaps(
        &self,
        particles: &mut Particles,
        context: &EffectContext<'_>,
        _bridges: &mut Bridges,
    ) -> f64 {
        self.resist(particles, context, |particles, near, meeting| {
            if meeting.opening > 0.0 {
                self.slow(particles, near, meeting, context.dt)
            } else {
                0.0
            }
        })
    }
}

impl Film {
    /// Lets `by` act on all that the film reaches; returns the sum.
    fn resist(
        &self,
        particles: &mut Particles,
        context: &EffectContext<'_>,
        by: impl Fn(&mut Particles, &Near, &Meeting) -> f64,
    ) -> f64 {
        near::each(particles, context, |particles, near| {
            if near.gap >= self.range {
                return 0.0;
            }
            let meeting = Meeting::of(near, particles, context.walls);
            by(particles, near, &meeting)
        })
    }

    /// Slows the opening or closing of a pair along its way in a substep; returns the work of a wall.
    fn slow(&self, particles: &mut Particles, near: &Near, meeting: &Meeting, dt: f64) -> f64 {
        let c = self.strength * near.derjaguin.powi(2) * meeting.inverse_mass;
        let slowed = self.slowed(c, near.gap, meeting.opening, dt);
        let impulse = (slowed - meeting.opening) / meeting.inverse_mass * near.normal;
        meeting.push(particles, near, &impulse)
    }

    /// The speed v' that is left of an opening speed `v`, of C `c` `[m/s]`: the root of
    ///
    /// ```text
    /// f(v') = v' - v + C (Phi(h + v' dt) - Phi(h))
    /// ```
    ///
    /// which grows with v' and bends downwards as long as the way ends at a gap, so that Newton's steps come to the
    /// root from below, once they are there, and do not pass it.
    fn slowed(&self, c: f64, gap: f64, v: f64, dt: f64) -> f64 {
        let start = self.phi(gap.max(0.0));
        // The way ends in the contact, out of the film's reach, or where the force is no longer larger.
        let touching = v + c * (start - self.phi(0.0));
        if gap + touching * dt <= 0.0 {
            return touching;
        }
        let free = v + c * (start - self.phi(self.range));
        if gap + free * dt >= self.range {
            return free;
        }
        let steepest = c * dt / self.roughness;
        let near = (v + c * (start + 1.0 - gap / self.roughness)) / (1.0 + steepest);
        if gap + near * dt < self.roughness {
            return near;
        }
        let least = (self.roughness - gap) / dt;
        let grown = |way: f64| {
            if gap < self.roughness { self.phi(gap + way) - start } else { (way / gap).ln_1p() }
        };
        let mut speed = least.max(0.0);
        for _ in 0..STEPS {
            let off = speed - v + c * grown(speed * dt);
            let next = (speed - off / (1.0 + c * dt / (gap + speed * dt))).max(least);
            let is_there = (next - speed).abs() <= CLOSE * next.abs();
            speed = next;
            if is_there {
                break;
            }
        }
        speed
    }

    /// The integral of 1 / max(h, h_0) from h_0 to a gap `[-]`.
    fn phi(&self, gap: f64) -> f64 {
        let ratio = gap / self.roughness;
        if ratio < 1.0 { ratio - 1.0 } else { ratio.ln() }
    }

    /// Resists what slides past each other; returns the work of a wall.
    fn resist_sliding(
        &self,
        particles: &mut Particles,
        near: &Near,
        meeting: &Meeting,
        dt: f64,
    ) -> f64 {
        if self.shear == 0.0 {
            return 0.0;
        }
        let (i, j, normal) = (near.pair.0 as usize, near.pair.1 as usize, near.normal);
        // The gap at the middle of the substep.
        let gap = (near.gap + 0.5 * dt * meeting.opening).max(self.roughness);
        // The surface of a wall moves as its point does, that of a grain turns as well.
        let spin = if near.is_wall { Vector3::zeros() } else { particles.spin(j) };
        let surface = meeting.other + spin.cross(&normal);
        let sliding = particles.velocity(i) - particles.spin(i).cross(&normal) - surface;
        let sliding = sliding - sliding.dot(&normal) * normal;
        let other = (!near.is_wall).then(|| particles.radius(j));
        let k = self.shear * dt * shear_over_viscosity(particles.radius(i), other, gap);
        let impulse = -k / (1.0 + (1.0 + INVERSE_INERTIA) * k * meeting.inverse_mass) * sliding;
        particles.kick_at(i, &impulse, &-normal);
        if near.is_wall {
            return impulse.dot(&meeting.other);
        }
        particles.kick_at(j, &-impulse, &normal);
        0.0
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
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Whatever the film, the gap and the way: what is left of the speed is what the way took from it.
        #[test]
        fn the_speed_that_is_left_is_that_of_its_way(
            strength in -9f64..3.0, gap in -1e-4f64..6e-4, v in -2f64..2.0, dt in 1e-5f64..1e-3,
        ) {
            let film = Film { strength: 0.0, shear: 0.0, roughness: 1e-6, range: 6e-4 };
            let c = 10f64.powf(strength);
            let left = film.slowed(c, gap, v, dt);
            let end = |speed: f64| film.phi((gap + speed * dt).clamp(0.0, film.range));
            let of_way = |speed: f64| v - c * (end(speed) - film.phi(gap.max(0.0)));
            prop_assert!(left * v >= 0.0 && left.abs() <= v.abs(), "{left} of {v}");
            // A little slower, more would be left; a little faster, less.
            let (slower, faster) = (left * (1.0 - 1e-7), left * (1.0 + 1e-7));
            prop_assert!((of_way(slower) - slower) * v.signum() >= -1e-15 * v.abs());
            prop_assert!((of_way(faster) - faster) * v.signum() <= 1e-15 * v.abs());
        }
    }

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
