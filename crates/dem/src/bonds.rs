//! Bonds between grains that hold until they break (docs/theory/effects.md, "Bonds").
//!
//! ```text
//! |P| <= F,   P = -F w / |w| where w = max(0, w_n) n + u_t is not 0,   F = bond m g 2 R_eff / R
//! until S > S_min + range or |s| > range, then none, for good
//! ```
//!
//! Rigid and plastic: a bond keeps two surfaces from parting (w_n) and from sliding past each other (u_t) by whatever
//! force that takes up to F, and gives way at F. S is the gap, S_min the least that it has been since the pair was joined,
//! and s how far its surfaces have slid. It only ever takes energy.
//!
//! In a substep the impulses act right after the impacts, at their time, and before the contact solve: two passes over the
//! bonds, forth and back, each of which stops its pair's motion against the present velocities within what its impulses may
//! sum up to, F dt. One that breaks within the substep takes the energy that is left of F range, so that parting costs the
//! same at any speed.

use granulcal_scene::{Effect, Scene};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::law::INVERSE_INERTIA;
use crate::neighbor::PairSearch;
use crate::parallel::Threads;
use crate::particles::Particles;
use crate::path::{Path, Reach};

/// How far a pair has parted or slid that did so before this substep, in ranges `[-]`.
const STARTED: f64 = 1e-3;

/// The bonds of a scene.
#[derive(Clone, Debug)]
pub(crate) struct Bonds {
    spec: granulcal_scene::Bonds,
    /// F over the mass of a typical grain `[m/s^2]`, and that grain's radius `[m]`.
    strength: f64,
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
    /// Of the centres `[m]`.
    distance: f64,
    /// From the second to the first.
    normal: Vector3<f64>,
    /// F over that of two typical grains `[-]`.
    share: f64,
    /// Sum of both inverse masses, in those of a typical grain `[-]`.
    inverse_mass: f64,
}

/// What a bond does in a substep.
#[derive(Clone, Copy, Debug)]
struct Hold {
    apart: Apart,
    /// The largest impulse, and that so far, on the first grain, over a typical mass `[m/s]`.
    most: f64,
    impulse: Vector3<f64>,
}

impl Bonds {
    /// The bonds of a scene, if there are any.
    pub fn of(scene: &Scene) -> Option<Self> {
        let spec = scene.effects.bonds;
        let weight = Vector3::from(scene.gravity).norm();
        spec.is_on().then(|| Self {
            spec,
            strength: spec.bond * weight,
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

    /// Joins what is near once their time has come.
    pub fn join(&mut self, particles: &Particles, time: f64) {
        if self.joined.is_some() || time < self.spec.begin {
            return;
        }
        let still = |i| Path { from: particles.position(i), velocity: Vector3::zeros() };
        let paths: Vec<_> = (0..particles.count()).map(still).collect();
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
    }

    /// Holds what is joined.
    pub fn hold(&self, particles: &mut Particles, dt: f64) {
        let bonds = self.joined.as_deref().unwrap_or_default();
        // Spheres rest while velocities change.
        let mut holds: Vec<_> =
            bonds.iter().map(|bond| self.prepare(particles, bond, dt)).collect();
        let count = bonds.len();
        for bond in (0..count).chain((0..count).rev()) {
            hold_one(particles, &bonds[bond], &mut holds[bond], dt);
        }
    }

    fn prepare(&self, particles: &Particles, bond: &Bond, dt: f64) -> Hold {
        let apart = self.apart(particles, bond.i, bond.j);
        let (opening, sliding) = parts(particles, bond, &apart, dt);
        let most = self.most(bond, &apart, opening.max(0.0).hypot(sliding.norm()), dt);
        Hold { apart, most, impulse: Vector3::zeros() }
    }

    /// The largest impulse of a pair whose surfaces part and slide at `speed`, over a typical mass `[m/s]`.
    fn most(&self, bond: &Bond, apart: &Apart, speed: f64, dt: f64) -> f64 {
        let range = self.spec.range * self.radius;
        let strength = self.strength * apart.share;
        let gone = (apart.gap - bond.nearest).max(Vector3::from(bond.slid).norm());
        let slowing = strength * apart.inverse_mass;
        // Velocities live at the middle of substeps: what has just been torn is held from there on.
        let (acts, before) = if gone > STARTED * range { (dt, 0.5 * dt) } else { (0.5 * dt, 0.0) };
        let left = (range - gone).max(0.0);
        if (speed - slowing * acts) * dt <= left {
            return strength * acts;
        }
        let now = speed - slowing * before;
        (speed - (now * now - 2.0 * slowing * left).sqrt()) / apart.inverse_mass
    }

    /// Breaks what has parted or slid too far, once the grains have moved for `dt` `[s]`.
    pub fn follow(&mut self, particles: &Particles, dt: f64) {
        let Some(mut joined) = self.joined.take() else { return };
        let range = self.spec.range * self.radius;
        joined.retain_mut(|bond| {
            let apart = self.apart(particles, bond.i, bond.j);
            bond.nearest = bond.nearest.min(apart.gap.max(0.0));
            let slid = Vector3::from(bond.slid) + dt * surface_motion(particles, bond, &apart);
            let slid = slid - slid.dot(&apart.normal) * apart.normal;
            bond.slid = slid.into();
            let holds = apart.gap <= bond.nearest + range && slid.norm() <= range;
            holds && ![bond.i, bond.j].iter().any(|&grain| particles.has_left(grain as usize))
        });
        self.joined = Some(joined);
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
            distance,
            normal: if distance > 0.0 { apart / distance } else { Vector3::z() },
            share: 2.0 * a * b / ((a + b) * self.radius),
            inverse_mass: particles.inverse_mass[i] + particles.inverse_mass[j],
        }
    }
}

/// Stops the motion of one pair within what its bond bears.
fn hold_one(particles: &mut Particles, bond: &Bond, hold: &mut Hold, dt: f64) {
    let Apart { normal, inverse_mass, .. } = hold.apart;
    let (opening, sliding) = parts(particles, bond, &hold.apart, dt);
    let along = hold.impulse - sliding / ((1.0 + INVERSE_INERTIA) * inverse_mass);
    let wanted = along - opening / inverse_mass * normal;
    // It holds back, and never pushes apart.
    let wanted = wanted - wanted.dot(&normal).max(0.0) * normal;
    let size = wanted.norm();
    let held = if size > hold.most { wanted * (hold.most / size) } else { wanted };
    let impulse = held - hold.impulse;
    if impulse != Vector3::zeros() {
        hold.impulse = held;
        particles.kick_at(bond.i as usize, &impulse, &-normal);
        particles.kick_at(bond.j as usize, &-impulse, &normal);
    }
}

/// How fast a pair parts in a substep, on its mean, and how fast its surfaces slide `[m/s]`.
///
/// Centres that pass each other part by `w_t^2 dt / (2 d)` more than along their first normal.
fn parts(particles: &Particles, bond: &Bond, apart: &Apart, dt: f64) -> (f64, Vector3<f64>) {
    let normal = &apart.normal;
    let centres = particles.velocity(bond.i as usize) - particles.velocity(bond.j as usize);
    let along = centres.dot(normal);
    let across = centres.norm_squared() - along * along;
    let opening = along + 0.5 * dt * across / apart.distance;
    let motion = surface_motion(particles, bond, apart);
    (opening, motion - motion.dot(normal) * normal)
}

/// How the surface of the first grain of a pair moves against that of the second `[m/s]`.
fn surface_motion(particles: &Particles, bond: &Bond, apart: &Apart) -> Vector3<f64> {
    let (i, j) = (bond.i as usize, bond.j as usize);
    let spins = particles.spin(i) + particles.spin(j);
    particles.velocity(i) - particles.velocity(j) - spins.cross(&apart.normal)
}
