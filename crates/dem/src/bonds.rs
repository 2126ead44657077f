//! Bonds between grains that hold until they break (docs/theory/effects.md, "Bonds").
//!
//! ```text
//! F = bond m g 2 R_eff / R   until S > S_min + range or |s| > range,   then none, for good
//! ```
//!
//! S is the gap, S_min the least that it has been since the pair was joined, and s how far its surfaces have slid past
//! each other. With a steady pull among the forces a contact opens where it is drawn by more than F, and is sheared
//! against mu (lambda_n + F).
//!
//! In a substep the impulse F dt acts right after the impacts, at their time, and before the contact solve. Of a bond
//! that breaks within the substep what takes the energy that is left of F range acts, so that parting costs the same at
//! any speed.

use granulcal_scene::{Effect, Scene};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::effect::inverse_inertia;
use crate::neighbor::PairSearch;
use crate::parallel::Threads;
use crate::particles::Particles;
use crate::path::{Path, Reach};

/// The bonds of a scene.
#[derive(Clone, Debug)]
pub(crate) struct Bonds {
    spec: granulcal_scene::Bonds,
    /// F over the mass of a typical grain with what of a fluid goes with it `[m/s^2]`, and that grain's radius `[m]`.
    pull: f64,
    radius: f64,
    /// Grains from this number on are never joined: those of a bed, and an intruder.
    count: usize,
    /// None before their begin.
    joined: Option<Vec<Bond>>,
}

/// A pair that is joined.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Bond {
    i: u32,
    j: u32,
    /// S_min `[m]`.
    nearest: f64,
    /// s `[m]`.
    slid: [f64; 3],
}

/// Two grains as their bond sees them.
#[derive(Clone, Copy, Debug)]
struct Apart {
    gap: f64,
    /// From the second to the first.
    normal: Vector3<f64>,
    /// F over that of two typical grains `[-]`.
    share: f64,
    /// Sum of both inverse masses, in those of a typical grain `[-]`.
    inverse_mass: f64,
}

impl Bonds {
    /// The bonds of a scene, if there are any.
    pub fn of(scene: &Scene) -> Option<Self> {
        let spec = scene.effects.bonds;
        let weight = Vector3::from(scene.gravity).norm();
        spec.is_on().then(|| Self {
            spec,
            pull: spec.bond * weight * inverse_inertia(scene),
            radius: scene.grains.radius(),
            count: scene.grains.count,
            joined: None,
        })
    }

    /// What changes as they break.
    pub fn state(&self) -> Option<&[Bond]> {
        self.joined.as_deref()
    }

    /// Goes on from a state.
    ///
    /// # Errors
    /// What is wrong.
    pub fn take(&mut self, state: Option<Vec<Bond>>) -> Result<(), &'static str> {
        let is_like = |bond: &Bond| bond.i != bond.j && bond.i.max(bond.j) < self.count as u32;
        if !state.as_ref().is_none_or(|bonds| bonds.iter().all(is_like)) {
            return Err("bonds that are not the scene's");
        }
        self.joined = state;
        Ok(())
    }

    /// Joins what is near once their time has come; returns the energy that this brings, per typical mass `[m^2/s^2]`.
    pub fn join(&mut self, particles: &Particles, time: f64) -> f64 {
        if self.joined.is_some() || time < self.spec.begin {
            return 0.0;
        }
        let paths = Path::all_of(particles);
        let far = self.spec.gap * self.radius;
        let (reach, mut found) = (Reach { interval: 0.0, near: far, far }, Vec::new());
        let alone = Threads::default();
        PairSearch::default().pairs(particles, &paths, reach, &alone, &mut found);
        let pairs = found.iter().map(|pair| (pair.i.min(pair.j), pair.i.max(pair.j)));
        let mut pairs: Vec<_> = pairs.filter(|&(_, j)| (j as usize) < self.count).collect();
        pairs.sort_unstable();
        let bond = |(i, j)| {
            let nearest = self.apart(particles, i, j).gap.max(0.0);
            Bond { i, j, nearest, slid: [0.0; 3] }
        };
        self.joined = Some(pairs.into_iter().map(bond).collect());
        self.energy(particles)
    }

    /// Pulls what is joined together for `dt` `[s]`.
    pub fn pull(&self, particles: &mut Particles, dt: f64) {
        for bond in self.joined.iter().flatten() {
            let (i, j) = (bond.i as usize, bond.j as usize);
            let apart = self.apart(particles, bond.i, bond.j);
            let opening = (particles.velocity(i) - particles.velocity(j)).dot(&apart.normal);
            let slowed = self.slowed(bond, &apart, opening, dt);
            let impulse = slowed / apart.inverse_mass * apart.normal;
            particles.kick(i, &-impulse);
            particles.kick(j, &impulse);
        }
    }

    /// By how much its pull slows the `opening` of a pair in a substep `[m/s]`.
    fn slowed(&self, bond: &Bond, apart: &Apart, opening: f64, dt: f64) -> f64 {
        let range = self.spec.range * self.radius;
        let rate = self.pull * apart.share * apart.inverse_mass;
        let (left, whole) = (bond.nearest + range - apart.gap, rate * dt);
        if left <= 0.0 {
            return 0.0;
        }
        if (opening - whole) * dt <= left {
            return whole;
        }
        // Velocities live half a substep before, and places now.
        let speed = opening - 0.5 * whole;
        let energy = speed * speed - 2.0 * rate * left;
        (opening - energy.max(0.0).sqrt()).min(whole)
    }

    /// Breaks what has parted or slid too far, once the grains have moved for `dt` `[s]`.
    pub fn follow(&mut self, particles: &Particles, dt: f64) {
        let Some(mut joined) = self.joined.take() else { return };
        let range = self.spec.range * self.radius;
        joined.retain_mut(|bond| {
            let apart = self.apart(particles, bond.i, bond.j);
            bond.nearest = bond.nearest.min(apart.gap.max(0.0));
            let slid =
                Vector3::from(bond.slid) + dt * surface_motion(particles, bond, &apart.normal);
            let slid = slid - slid.dot(&apart.normal) * apart.normal;
            bond.slid = slid.into();
            let holds = apart.gap <= bond.nearest + range && slid.norm() <= range;
            holds && ![bond.i, bond.j].iter().any(|&grain| particles.has_left(grain as usize))
        });
        self.joined = Some(joined);
    }

    /// What they hold as springs of a steady force do, per typical mass `[m^2/s^2]`.
    pub fn energy(&self, particles: &Particles) -> f64 {
        let held = |bond: &Bond| {
            let apart = self.apart(particles, bond.i, bond.j);
            apart.share * apart.gap
        };
        self.pull * self.joined.iter().flatten().map(held).sum::<f64>()
    }

    fn apart(&self, particles: &Particles, i: u32, j: u32) -> Apart {
        let (i, j) = (i as usize, j as usize);
        // As they are when the later one of their last impacts happened.
        let clock = particles.clocks[i].max(particles.clocks[j]);
        let [at_i, at_j] = [i, j].map(|grain| particles.sphere_at(grain, clock).vector());
        let apart = particles.nearest(at_i - at_j);
        let (distance, [a, b]) = (apart.norm(), [particles.radius(i), particles.radius(j)]);
        Apart {
            gap: distance - a - b,
            normal: if distance > 0.0 { apart / distance } else { Vector3::z() },
            share: 2.0 * a * b / ((a + b) * self.radius),
            inverse_mass: particles.inverse_mass[i] + particles.inverse_mass[j],
        }
    }
}

/// How the surface of the first grain of a pair moves against that of the second `[m/s]`.
fn surface_motion(particles: &Particles, bond: &Bond, normal: &Vector3<f64>) -> Vector3<f64> {
    let (i, j) = (bond.i as usize, bond.j as usize);
    let spins = particles.spin(i) + particles.spin(j);
    particles.velocity(i) - particles.velocity(j) - spins.cross(normal)
}
