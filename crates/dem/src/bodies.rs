//! Grains that are not round: convex rigid bodies. Equations and the box of a substep are in `docs/theory/bodies.md`.
//!
//! | file | what |
//! |---|---|
//! | `grain_shape` | what a scene states; corners, faces, volume and inertia of it |
//! | `pose` | where a body is and how it is turned |
//! | `body` | place, turn, momentum; what an impulse does |
//! | `around` | shape, walls and material in a substep; how far bodies search for each other |
//! | `motion` | how far a body goes in a substep |
//! | `pairs` | which bodies may meet in a substep |
//! | `collide` | points of contact |
//! | `foresee` | points of contact that show only where bodies will be |
//! | `meeting` | what is asked of two bodies and answered |
//! | `boxes` | where two boxes meet, eight pairs at a time |
//! | `polygon` | what two faces share |
//! | `corners` | which corner of a hull is farthest along a direction |
//! | `cylinders` | the nearest points of two cylinders |
//! | `manifold` | where two bodies that are no boxes meet, by parry |
//! | `contact` | the law at a point |
//! | `manifolds` | which points lie between the same two |
//! | `marks` | the impulses that points go on with |
//! | `impact` | impacts, each at its time |
//! | `rims` | points of contact at the rims of walls |
//! | `edges` | points of contact at the edges of boxes and meshes |
//! | `lever` | what a point's arm does where the inertia is 1 |
//! | `batch` | eight points, and one round of the law for them |
//! | `sweeps` | sweeps over all points |

mod around;
mod batch;
mod body;
mod boxes;
mod collide;
mod contact;
mod corners;
mod cylinders;
mod edges;
#[cfg(test)]
mod exams;
mod foresee;
mod impact;
mod lever;
mod manifold;
mod manifolds;
mod marks;
mod meeting;
mod motion;
mod pairs;
mod polygon;
mod pose;
mod rims;
mod sweeps;

use std::sync::Arc;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::energy::{Energy, Falling};
use crate::law::Small;
use crate::turns::turns;
use crate::wall::Walls;
use around::Around;
use body::{Moving, RigidBody};
use contact::{Other, Point};
use corners::Corners;
use granulcal_scene::Material;
use granulcal_scene::Scene;
use granulcal_scene::Solid;
use marks::Marks;
use pairs::Neighbours;
use sweeps::Batches;
pub(crate) use sweeps::Sweeps;

/// Keeps the orientations of a seed apart from its places.
const STREAM: u64 = 0xbb67_ae85_84ca_a73b;

/// How often impacts are resolved in a substep and its points are swept, at most: after each time what is foreseen may
/// add points.
const ROUNDS: usize = 3;

/// What of the bodies changes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct BodiesState {
    all: Vec<RigidBody>,
    known: Marks,
}

/// What a body is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Within {
    /// A surface of the walls.
    Wall(usize),
    Body(usize),
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
    small: Small,
    /// None of a cylinder.
    corners: Option<Corners>,
    all: Vec<RigidBody>,
    known: Marks,
    // Only their memory goes from substep to substep.
    points: Vec<Point>,
    batches: Batches,
    neighbours: Neighbours,
}

impl Bodies {
    fn new(solid: Arc<Solid>, small: Small, all: Vec<RigidBody>) -> Self {
        let batches = Batches::of(&solid);
        Self {
            corners: Corners::of(&solid),
            small,
            solid,
            all,
            known: Marks::default(),
            points: Vec::new(),
            batches,
            neighbours: Neighbours::default(),
        }
    }

    /// The bodies of a scene, turned at random or as its start states, if its grains have a shape.
    pub fn of(scene: &Scene, seed: u64) -> Option<Self> {
        let solid = scene.grains.solid()?;
        let mut turn = turns(seed ^ STREAM);
        let still = |centre| {
            let [i, j, k, w] = turn();
            RigidBody::still(centre, UnitQuaternion::new_normalize(Quaternion::new(w, i, j, k)))
        };
        let centres = scene.starting_positions(seed).into_iter();
        let all = match scene.starting_orientations() {
            Some(stated) => {
                centres.zip(stated).map(|(at, turn)| RigidBody::still(at, turn)).collect()
            }
            None => centres.map(still).collect(),
        };
        Some(Self::new(solid, Small::of(scene), all))
    }

    /// Turns of all bodies, from their axes to the scene's.
    pub fn orientations(&self) -> Vec<UnitQuaternion<f64>> {
        self.all.iter().map(RigidBody::turned).collect()
    }

    /// Place, velocity and angular velocity of all `[m]`, `[m/s]`, `[rad/s]`.
    pub fn motions(&self) -> impl Iterator<Item = [Vector3<f64>; 3]> + '_ {
        let of = |body: &RigidBody| {
            [body.centre.into(), body.velocity.into(), body.angular_velocity(&self.solid)]
        };
        self.all.iter().map(of)
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
        if state.all.len() != count || !state.known.are_of(count) {
            return Err("another number of bodies");
        }
        (self.all, self.known) = (state.all, state.known);
        Ok(())
    }

    /// How deep bodies are in walls and in each other as they are: body, what it is in, depth `[m]`.
    pub fn overlaps(&self, walls: &Walls, material: &Material) -> Vec<(usize, Within, f64)> {
        let (solid, corners, small) = (&*self.solid, self.corners.as_ref(), &self.small);
        // At rest: only what is now.
        let around = Around { solid, corners, walls, material, dt: 0.0, may_close: 0.0, small };
        let still = |body: &RigidBody| Moving::of(body, solid);
        let bodies: Vec<_> = self.all.iter().map(still).collect();
        let mut neighbours = Neighbours::default();
        let points = collide::contacts(&around, &bodies, &mut neighbours, Vec::new()).points;
        let of = |point: &Point| {
            let within = match point.other {
                Other::Wall { surface, .. } => Within::Wall(surface as usize),
                Other::Body { j, .. } => Within::Body(j as usize),
            };
            (point.i(), within, -point.gap)
        };
        points.iter().filter(|point| point.gap < 0.0).map(of).collect()
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
        let corners = self.corners.as_ref();
        let small = self.small;
        let may_close = sweeps.closing * dt;
        let around =
            Around { solid: &solid, corners, walls, material, dt, may_close, small: &small };
        let (points, neighbours) = (std::mem::take(&mut self.points), &mut self.neighbours);
        let mut contacts = collide::contacts(&around, &moving, neighbours, points);
        let mut step = Step { deepest: contacts.deepest, ..Step::default() };
        for round in 1..=ROUNDS {
            let (impacts, work) = impact::resolve(
                (contacts.manifolds.all_mut(), &contacts.points),
                &mut moving,
                &solid,
                dt,
                &small,
            );
            step.impacts += impacts;
            step.work_of_walls += work;
            if round == ROUNDS || !contacts.foresee(&around, &moving, &mut self.neighbours) {
                break;
            }
            contacts.merge();
        }
        contacts.carry(&moving);
        let of_manifolds = (&contacts.manifolds, &mut contacts.points[..]);
        self.known.recall(of_manifolds, &mut moving, solid.reach);
        let sorted = contacts.points.len();
        let mut known = 0;
        contacts.corrected.clear();
        for round in 1..=ROUNDS {
            let again = (known, &contacts.corrected[..]);
            let settled = self.batches.solve(&contacts.points, again, &mut moving, &around, sweeps);
            step.sweeps += settled.sweeps;
            (step.residual, step.unconverged) = (settled.residual, settled.unconverged);
            known = contacts.points.len();
            if round == ROUNDS || !contacts.foresee(&around, &moving, &mut self.neighbours) {
                break;
            }
            contacts.carry_from(known, &moving);
        }
        self.known.clear();
        self.batches.put_back(&mut contacts.points, |point| self.known.keep(point));
        let points = contacts.points;
        step.points = points.len();
        if sorted < points.len() {
            self.known.sort();
        }
        let at_walls = points[..sorted].iter().take_while(|point| point.j().is_none());
        let work = at_walls.chain(&points[sorted..]).map(Point::work_of_wall);
        step.work_of_walls += work.sum::<f64>();
        self.points = points;
        self.all = moving.iter().map(|body| body.moved(&solid, dt)).collect();
        step
    }

    /// Energy over the mass of a body.
    pub fn energy(&self, falling: &Falling) -> Energy {
        let half = falling.half();
        let of = |body: &RigidBody| Energy {
            kinetic: body.kinetic_energy(&self.solid)
                + half.dot(&(Vector3::from(body.velocity) + 0.5 * half)),
            potential: falling.potential(&body.centre.into()),
        };
        self.all.iter().map(of).sum()
    }
}
