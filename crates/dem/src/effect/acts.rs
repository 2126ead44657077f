//! What an effect can do in a substep: each has a file that says what it does, and a line in the list of `effect.rs`.

use std::fmt::Debug;

use nalgebra::Vector3;

use super::bridges::Bridges;
use crate::contact::ContactLaw;
use crate::contact_set::ContactSet;
use crate::particles::Particles;
use crate::wall::Walls;

/// What an effect sees of a substep besides the grains.
pub(crate) struct EffectContext<'a> {
    /// The pairs of grains that may touch within the substep, or are within [`Acts::reach`].
    pub pairs: &'a ContactSet,
    /// The grains at walls, likewise.
    pub at_walls: &'a ContactSet,
    pub walls: &'a Walls,
    /// Gravity in this substep `[m/s^2]`.
    pub gravity: Vector3<f64>,
    /// Radius of a typical grain `[m]`.
    pub radius: f64,
    /// Length of the substep `[s]`.
    pub dt: f64,
}

/// The moments of a substep at which an effect can act, in their order; by itself it does nothing at any of them.
pub(crate) trait Acts: Debug + Send + Sync {
    /// What it makes of gravity, in the frame of the table `[m/s^2]`.
    fn gravity(&self, gravity: Vector3<f64>) -> Vector3<f64> {
        gravity
    }

    /// What it adds to gravity at `time` `[m/s^2]`; None if it never adds anything.
    fn added_gravity(&self, _time: f64) -> Option<Vector3<f64>> {
        None
    }

    /// Changes velocities as they are at the begin of the substep, before gravity acts; returns the work of moving
    /// walls, per typical mass `[m^2/s^2]`.
    fn act_before_gravity(&self, _particles: &mut Particles, _context: &EffectContext<'_>) -> f64 {
        0.0
    }

    /// Changes velocities once gravity has acted, before contacts are assembled; returns the energy that it gives, per
    /// typical mass `[m^2/s^2]`.
    fn act_with_gravity(&self, _particles: &mut Particles, _context: &EffectContext<'_>) -> f64 {
        0.0
    }

    /// The restitution of an impact at `speed` `[m/s]` that would be `restitution` without it.
    fn restitution_at(&self, restitution: f64, _speed: f64) -> f64 {
        restitution
    }

    /// Changes velocities after the impacts; `bridges` is what is remembered of pairs that have touched. Returns the
    /// energy that it gives and the work of moving walls, per typical mass `[m^2/s^2]`.
    fn act_across_gaps(
        &self,
        _particles: &mut Particles,
        _context: &EffectContext<'_>,
        _bridges: &mut Bridges,
    ) -> f64 {
        0.0
    }

    /// How far its force across a gap reaches `[m]`: so far pairs are listed.
    fn reach(&self) -> f64 {
        0.0
    }

    /// Changes the coefficients of a contact.
    fn change_law(&self, _law: &mut ContactLaw) {}

    /// Whether it has contacts of its own, which are solved beside those of grains and walls; one effect has.
    fn has_contacts(&self) -> bool {
        false
    }

    /// Lists its contacts; see [`Acting::assemble`](super::Acting::assemble).
    fn assemble(
        &self,
        _set: &mut ContactSet,
        _particles: &Particles,
        _dt: f64,
        _ground: &dyn Fn(usize) -> ContactLaw,
    ) {
    }

    /// What it holds as a spring does, per typical mass `[m^2/s^2]`.
    fn energy(&self, _particles: &Particles) -> f64 {
        0.0
    }
}
