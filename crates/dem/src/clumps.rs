//! Rigid bodies of several spheres, by splitting their mass.
//!
//! Every sphere of a clump is a body of its own to the contact solver, with an equal share of the mass. After each
//! sweep the impulses that the spheres have got are the clump's, and its spheres get the velocities of a rigid motion:
//!
//! ```text
//! P <- P + sum m_i dv_i,   L <- L + sum (r_i x m_i dv_i + 2/5 m_i rho^2 d(omega_i)),   V = P / m,   omega = I^-1 L
//! v_i = V + omega x r_i,   omega_i = omega
//! ```
//!
//! A sphere by itself is easier to move than its clump, so that a sweep goes less far than it might, never too far, and
//! what does not change any more is the solution for rigid bodies. Source: mass splitting, Tonge et al., ACM Trans.
//! Graph. 31 (2012) 105, doi:10.1145/2185520.2185601. Angular momentum is what is kept in flight, in a frame that does
//! not turn.

use granulcal_scene::{ClumpShape, Effect, Scene};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::body::Body;
use crate::energy::{Energy, Falling};
use crate::lanes::Row;
use crate::law::INVERSE_INERTIA;
use crate::particles::Particles;
use crate::turning::{inverse_inertia, turned_on};
use crate::turns::turns;

/// Keeps the orientations of a seed apart from its places.
const STREAM: u64 = 0x6a09_e667_f3bc_c909;

/// A clump in motion; its mass is 1, that of a typical grain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Rigid {
    /// `[m]`
    centre: [f64; 3],
    /// `[m/s]`
    velocity: [f64; 3],
    /// From the body's axes to the scene's: i, j, k, w.
    turned: [f64; 4],
    /// Angular momentum about the centre `[m^2/s]`.
    momentum: [f64; 3],
}

impl Rigid {
    fn turned(&self) -> UnitQuaternion<f64> {
        let [i, j, k, w] = self.turned;
        UnitQuaternion::new_normalize(nalgebra::Quaternion::new(w, i, j, k))
    }
}

/// All clumps of a simulation: the spheres of the first, of the second, and so on.
#[derive(Clone, Debug)]
pub(crate) struct Clumps {
    shape: ClumpShape,
    bodies: Vec<Rigid>,
    /// Of each sphere, from its clump's centre `[m]`.
    arms: Vec<Vector3<f64>>,
    /// Inverse of each clump's tensor of inertia in the scene's axes `[1/m^2]`.
    inverse_inertia: Vec<Matrix3<f64>>,
}

/// What of the clumps changes.
pub(crate) type ClumpState = Vec<([f64; 3], [f64; 3], [f64; 4], [f64; 3])>;

impl Clumps {
    /// The clumps of a scene, turned at random, if it has any.
    pub fn of(scene: &Scene, seed: u64) -> Option<Self> {
        let clump = &scene.effects.clump;
        if !clump.is_on() {
            return None;
        }
        let mut turn = turns(seed ^ STREAM);
        let still = |centre: Vector3<f64>| Rigid {
            centre: centre.into(),
            velocity: [0.0; 3],
            turned: turn(),
            momentum: [0.0; 3],
        };
        let bodies = scene.starting_positions(seed).into_iter().map(still).collect();
        let (shape, arms, inverse_inertia) = (clump.shape(&scene.grains), Vec::new(), Vec::new());
        let mut clumps = Self { shape, bodies, arms, inverse_inertia };
        clumps.place();
        Some(clumps)
    }

    /// Works out what hangs on how the clumps are turned.
    fn place(&mut self) {
        let Self { shape, bodies, arms, inverse_inertia: inverse } = self;
        arms.clear();
        inverse.clear();
        for turned in bodies.iter().map(Rigid::turned) {
            arms.extend(shape.offsets.iter().map(|offset| turned * offset));
            inverse.push(inverse_inertia(turned.to_rotation_matrix().matrix(), &shape.inertia));
        }
    }

    /// Spheres of a clump.
    pub fn members(&self) -> usize {
        self.shape.offsets.len()
    }

    /// Centre and radius of every sphere.
    pub fn spheres(&self) -> Vec<Row> {
        let mut spheres = Vec::with_capacity(self.arms.len());
        for (body, arms) in self.bodies.iter().zip(self.arms.chunks(self.members())) {
            let centre = Vector3::from(body.centre);
            spheres.extend(arms.iter().map(|arm| Row::new(&(centre + arm), self.shape.radius)));
        }
        spheres
    }

    /// Takes what the spheres have got since they moved as one, and lets them move as one again.
    pub fn join(&mut self, bodies: &mut [Body]) {
        let (members, radius) = (self.members(), self.shape.radius);
        let share = 1.0 / members as f64;
        let spin_share = share * radius / INVERSE_INERTIA;
        for number in 0..self.bodies.len() {
            let (rigid, inverse) = (self.bodies[number], &self.inverse_inertia[number]);
            let (mut velocity, mut momentum) =
                (Vector3::from(rigid.velocity), Vector3::from(rigid.momentum));
            let (before, omega) = (velocity, inverse * momentum);
            let own = number * members..(number + 1) * members;
            let (spheres, arms) = (&mut bodies[own.clone()], &self.arms[own]);
            for (body, arm) in spheres.iter().zip(arms) {
                let got = share * (body.velocity.vector() - before - omega.cross(arm));
                velocity += got;
                momentum += arm.cross(&got);
                momentum += spin_share * (body.spin.vector() - radius * omega);
            }
            let omega = inverse * momentum;
            for (body, arm) in spheres.iter_mut().zip(arms) {
                body.velocity = Row::new(&(velocity + omega.cross(arm)), 0.0);
                body.spin = Row::new(&(radius * omega), 0.0);
            }
            let rigid = &mut self.bodies[number];
            (rigid.velocity, rigid.momentum) = (velocity.into(), momentum.into());
        }
    }

    /// Where a clump's centre is, and how it is turned, once it has moved for `dt`.
    fn moved(&self, clump: usize, dt: f64) -> (Vector3<f64>, UnitQuaternion<f64>) {
        let rigid = &self.bodies[clump];
        let momentum = Vector3::from(rigid.momentum);
        let omega = self.inverse_inertia[clump] * momentum;
        let (moments, unhit) = (&self.shape.inertia, Vector3::zeros());
        let turned = turned_on(&rigid.turned(), moments, [&momentum, &omega], &unhit, dt);
        (Vector3::from(rigid.centre) + dt * Vector3::from(rigid.velocity), turned)
    }

    /// Where the centre of every sphere will be once the clumps have moved for `dt` `[m]`.
    pub fn ends(&self, dt: f64) -> Vec<Vector3<f64>> {
        let mut ends = Vec::with_capacity(self.arms.len());
        for clump in 0..self.bodies.len() {
            let (centre, turned) = self.moved(clump, dt);
            ends.extend(self.shape.offsets.iter().map(|offset| centre + turned * offset));
        }
        ends
    }

    /// Moves and turns the clumps, once they are joined, and puts their spheres where they belong.
    pub fn move_on(&mut self, particles: &mut Particles, dt: f64) {
        for clump in 0..self.bodies.len() {
            let (centre, turned) = self.moved(clump, dt);
            let rigid = &mut self.bodies[clump];
            (rigid.centre, rigid.turned) = (centre.into(), turned.coords.into());
        }
        self.place();
        let (members, radius) = (self.members(), self.shape.radius);
        for (number, arm) in self.arms.iter().enumerate() {
            let (rigid, inverse) = (&self.bodies[number / members], &self.inverse_inertia);
            // With the turned axes another angular velocity belongs to the same angular momentum.
            let omega = inverse[number / members] * Vector3::from(rigid.momentum);
            let velocity = Vector3::from(rigid.velocity) + omega.cross(arm);
            particles.spheres[number] = Row::new(&(Vector3::from(rigid.centre) + arm), radius);
            particles.bodies[number] =
                Body { velocity: Row::new(&velocity, 0.0), spin: Row::new(&(radius * omega), 0.0) };
        }
    }

    /// Energy per typical mass.
    pub fn energy(&self, falling: &Falling) -> Energy {
        let of = |clump: usize| {
            let rigid = &self.bodies[clump];
            let (velocity, half) = (Vector3::from(rigid.velocity), falling.half());
            Energy {
                kinetic: self.kinetic_energy(clump) + half.dot(&(velocity + 0.5 * half)),
                potential: falling.potential(&rigid.centre.into()),
            }
        };
        (0..self.bodies.len()).map(of).sum()
    }

    fn kinetic_energy(&self, clump: usize) -> f64 {
        let rigid = &self.bodies[clump];
        let momentum = Vector3::from(rigid.momentum);
        let turning = momentum.dot(&(self.inverse_inertia[clump] * momentum));
        0.5 * (Vector3::from(rigid.velocity).norm_squared() + turning)
    }

    /// Sets a clump in motion; returns the kinetic energy that this adds, per typical mass `[m^2/s^2]`.
    pub fn set_motion(
        &mut self,
        particles: &mut Particles,
        clump: usize,
        velocity: &Vector3<f64>,
        angular: &Vector3<f64>,
    ) -> f64 {
        let before = self.kinetic_energy(clump);
        let turned = self.bodies[clump].turned();
        let local = turned.inverse() * angular;
        let momentum = turned * local.component_mul(&self.shape.inertia);
        let rigid = &mut self.bodies[clump];
        (rigid.velocity, rigid.momentum) = ((*velocity).into(), momentum.into());
        self.move_on(particles, 0.0);
        self.kinetic_energy(clump) - before
    }

    /// Velocity of a clump's centre `[m/s]`.
    pub fn velocity(&self, clump: usize) -> Vector3<f64> {
        self.bodies[clump].velocity.into()
    }

    /// Number of clumps.
    pub fn count(&self) -> usize {
        self.bodies.len()
    }

    /// The state as numbers.
    pub fn state(&self) -> ClumpState {
        let of = |r: &Rigid| (r.centre, r.velocity, r.turned, r.momentum);
        self.bodies.iter().map(of).collect()
    }

    /// Takes a state over that [`Self::state`] gave of as many clumps.
    ///
    /// # Errors
    /// What is wrong.
    pub fn take(&mut self, state: &ClumpState) -> Result<(), &'static str> {
        if state.len() != self.bodies.len() {
            return Err("another number of clumps");
        }
        for (rigid, &(centre, velocity, turned, momentum)) in self.bodies.iter_mut().zip(state) {
            *rigid = Rigid { centre, velocity, turned, momentum };
        }
        self.place();
        Ok(())
    }
}
