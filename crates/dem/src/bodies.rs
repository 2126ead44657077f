//! Grains that are not round: convex rigid bodies. Equations and the box of a substep are in `docs/theory/bodies.md`.
//!
//! | file | what |
//! |---|---|
//! | `grain_shape` | what a scene states; corners, faces, volume and inertia of it |
//! | `body` | place, turn, momentum; what an impulse does |
//! | `around` | shape, walls and material in a substep; how far bodies search for each other |
//! | `collide` | points of contact |
//! | `contact` | the law at a point |
//! | `impact` | impacts, each at its time |
//! | `rims` | points of contact at the rims of walls |

mod around;
mod body;
mod collide;
mod contact;
#[cfg(test)]
mod exams;
mod impact;
mod rims;

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::turns::turns;
use crate::wall::Walls;
use around::Around;
use body::{Moving, RigidBody};
use contact::{Point, WALL};
use granulcal_scene::Material;
use granulcal_scene::Scene;
use granulcal_scene::Solid;

/// Keeps the orientations of a seed apart from its places.
const STREAM: u64 = 0xbb67_ae85_84ca_a73b;

/// A point is known again within this distance from where it was on its body, in its reach `[-]`.
const KNOWN: f64 = 0.15;

/// How often impacts are resolved in a substep and its points are swept, at most: after each time what is foreseen may
/// add points.
const ROUNDS: usize = 3;

/// When the sweeps over all points of a substep end: the rule of spheres (`solver/nsgs.rs`).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sweeps {
    /// At least, unless the impulses have settled.
    pub least: usize,
    /// At most.
    pub most: usize,
    /// Largest change of an impulse in a sweep that has settled `[m/s]`.
    pub settled: f64,
    /// Fastest that a point may close beyond what its gap allows `[m/s]`.
    pub closing: f64,
}

/// Where a point was on its body, and its impulse.
type Mark = ([f64; 3], [f64; 3]);
/// The points of each manifold, by its bodies and its wall's surface.
type Known = BTreeMap<(usize, usize, usize), Vec<Mark>>;

/// What of the bodies changes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct BodiesState {
    all: Vec<RigidBody>,
    known: Known,
}

/// What a substep has done.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Step {
    pub impacts: usize,
    pub sweeps: usize,
    pub points: usize,
    /// Deepest overlap `[m]`.
    pub deepest: f64,
    /// Change of the impulses in the last sweep over the normal ones, both as root mean squares `[-]`.
    pub residual: f64,
    /// Whether the impulses had not settled when the sweeps were used up.
    pub unconverged: bool,
    /// What moving walls have put in, over the mass `[m^2/s^2]`.
    pub work_of_walls: f64,
}

/// All bodies of a simulation, of one shape.
#[derive(Clone, Debug)]
pub(crate) struct Bodies {
    pub solid: Arc<Solid>,
    all: Vec<RigidBody>,
    known: Known,
}

impl Bodies {
    fn new(solid: Arc<Solid>, all: Vec<RigidBody>) -> Self {
        Self { solid, all, known: Known::new() }
    }

    /// The bodies of a scene, turned at random, if its grains have a shape.
    pub fn of(scene: &Scene, seed: u64) -> Option<Self> {
        let solid = scene.grains.solid()?;
        let mut turn = turns(seed ^ STREAM);
        let still = |centre| {
            let [i, j, k, w] = turn();
            RigidBody::still(centre, UnitQuaternion::new_normalize(Quaternion::new(w, i, j, k)))
        };
        Some(Self::new(solid, scene.starting_positions(seed).into_iter().map(still).collect()))
    }

    /// Turns of all bodies, from their axes to the scene's.
    pub fn orientations(&self) -> Vec<UnitQuaternion<f64>> {
        self.all.iter().map(RigidBody::turned).collect()
    }

    /// Place, velocity and angular velocity of all `[m]`, `[m/s]`, `[rad/s]`.
    pub fn motions(&self) -> impl Iterator<Item = [Vector3<f64>; 3]> + '_ {
        let of = |body| Moving::of(body, &self.solid);
        self.all.iter().map(of).map(|m| [m.centre, m.velocity, m.omega])
    }

    /// Sets a body in motion; returns the kinetic energy that this adds, over the mass `[m^2/s^2]`.
    pub fn set_motion(
        &mut self,
        body: usize,
        velocity: &Vector3<f64>,
        omega: &Vector3<f64>,
    ) -> f64 {
        let before = self.all[body].kinetic_energy(&self.solid);
        let turned = self.all[body].turned();
        let momentum = (turned.inverse() * omega).component_mul(&self.solid.inertia);
        self.all[body].velocity = (*velocity).into();
        self.all[body].momentum = (turned * momentum).into();
        self.all[body].kinetic_energy(&self.solid) - before
    }

    pub fn state(&self) -> BodiesState {
        BodiesState { all: self.all.clone(), known: self.known.clone() }
    }

    /// Takes a state over that [`Self::state`] gave of as many bodies.
    ///
    /// # Errors
    /// What is wrong.
    pub fn take(&mut self, state: BodiesState) -> Result<(), &'static str> {
        let count = self.all.len();
        let is_there = |(i, j, _): &(usize, usize, usize)| *i < count && (*j < count || *j == WALL);
        if state.all.len() != count || !state.known.keys().all(is_there) {
            return Err("another number of bodies");
        }
        (self.all, self.known) = (state.all, state.known);
        Ok(())
    }

    /// One substep: gravity, points of contact, impacts, sweeps, motion.
    pub fn step(
        &mut self,
        gravity: &Vector3<f64>,
        walls: &Walls,
        material: &Material,
        dt: f64,
        sweeps: Sweeps,
    ) -> Step {
        let solid = Arc::clone(&self.solid);
        let mut moving: Vec<_> = self.all.iter().map(|body| Moving::of(body, &solid)).collect();
        for body in &mut moving {
            body.velocity += dt * gravity;
        }
        let around = Around { solid: &solid, walls, material, dt };
        let mut contacts = collide::contacts(&around, &moving);
        let mut step = Step::default();
        let depths = contacts.points.iter().map(|point| -point.gap);
        step.deepest = depths.fold(0.0, f64::max);
        for round in 0..ROUNDS {
            contacts.points.iter_mut().for_each(|point| point.assemble(&moving));
            let (impacts, work) = impact::resolve(&mut contacts.points, &mut moving, dt);
            step.impacts += impacts;
            step.work_of_walls += work;
            if round + 1 == ROUNDS || !contacts.foresee(&around, &moving) {
                break;
            }
        }
        self.recall(&mut contacts.points);
        contacts.points.iter().for_each(|point| point.give(&mut moving, &point.impulse));
        for round in 0..ROUNDS {
            for point in &mut contacts.points {
                point.assemble(&moving);
                point.aim(&moving, dt);
            }
            settle(&mut contacts.points, &mut moving, sweeps, &mut step);
            if round + 1 == ROUNDS || !contacts.foresee(&around, &moving) {
                break;
            }
        }
        let points = contacts.points;
        step.points = points.len();
        let work = |point: &Point| point.impulse.dot(&point.wall_velocity);
        step.work_of_walls += points.iter().map(work).sum::<f64>();
        self.remember(&points);
        self.all = moving.iter().map(|body| body.moved(&solid, dt)).collect();
        step
    }

    /// Warm start: a point that is where one was begins with its impulse.
    fn recall(&mut self, points: &mut [Point]) {
        let near = KNOWN * self.solid.reach;
        for point in points {
            let name = (point.i, point.j, point.surface);
            let Some(before) = self.known.get_mut(&name) else { continue };
            let distances =
                before.iter().map(|(mark, _)| (Vector3::from(*mark) - point.mark).norm());
            let nearest = distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((number, distance)) = nearest
                && distance < near
            {
                // No two points go on from one.
                let impulse = Vector3::from(before.swap_remove(number).1);
                // The part along the new normal, and what is left across it.
                let along = point.normal.dot(&impulse);
                let (normal, across) = (along.max(0.0), impulse - along * point.normal);
                let (limit, length) = (point.friction * normal, across.norm());
                let scale = if length > limit { limit / length } else { 1.0 };
                point.impulse = normal * point.normal + scale * across;
            }
        }
    }

    fn remember(&mut self, points: &[Point]) {
        self.known.clear();
        for point in points.iter().filter(|point| point.impulse != Vector3::zeros()) {
            let name = (point.i, point.j, point.surface);
            self.known.entry(name).or_default().push((point.mark.into(), point.impulse.into()));
        }
    }

    /// Kinetic and potential energy over the mass of a body `[m^2/s^2]`.
    pub fn energy(&self, gravity: &Vector3<f64>) -> f64 {
        let of = |body: &RigidBody| {
            body.kinetic_energy(&self.solid) - gravity.dot(&Vector3::from(body.centre))
        };
        self.all.iter().map(of).sum()
    }
}

/// Sweeps over all points by the rule of spheres (`solver/nsgs.rs`).
fn settle(points: &mut [Point], bodies: &mut [Moving], rule: Sweeps, step: &mut Step) {
    step.unconverged = !points.is_empty();
    let mut has_settled = false;
    for sweeps in 1..=rule.most {
        if points.is_empty() {
            return;
        }
        let worst = sweep(points, bodies, sweeps % 2 == 0);
        step.sweeps += 1;
        step.residual = worst.residual;
        let is_enough = has_settled || sweeps >= rule.least;
        if is_enough && worst.closing <= rule.closing {
            step.unconverged = false;
            return;
        }
        has_settled = worst.change <= rule.settled;
    }
}

/// The worst of a sweep.
#[derive(Clone, Copy, Debug, Default)]
struct Progress {
    /// Largest change of an impulse `[m/s]`.
    change: f64,
    /// Fastest that a point closed beyond what its gap allows `[m/s]`.
    closing: f64,
    /// Root mean square of all changes over that of the normal impulses `[-]`.
    residual: f64,
}

/// Solves every point once, forwards or backwards.
fn sweep(points: &mut [Point], bodies: &mut [Moving], backwards: bool) -> Progress {
    let (mut worst, mut changes, mut normals) = (Progress::default(), 0.0, 0.0);
    let mut one = |point: &mut Point| {
        // One round: the next sweep goes on with it.
        let change = point.solve(bodies, point.bias, 1);
        worst.change = worst.change.max(change.impulse);
        worst.closing = worst.closing.max(change.closing);
        changes += change.impulse * change.impulse;
        normals += point.normal.dot(&point.impulse).powi(2);
    };
    if backwards {
        points.iter_mut().rev().for_each(&mut one);
    } else {
        points.iter_mut().for_each(&mut one);
    }
    worst.residual = if normals > 0.0 { (changes / normals).sqrt() } else { 0.0 };
    worst
}
