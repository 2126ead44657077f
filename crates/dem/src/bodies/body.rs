//! One rigid body in motion. Its mass is 1, that of every other: impulses are velocities.
//!
//! ```text
//! dx/dt = v,   dq/dt = (0, omega) q / 2,   omega = R I^-1 R^T L,   dL/dt = torque
//! ```
//!
//! What is kept in flight is the angular momentum L in the axes of the scene; that omega changes although L does not is
//! the gyroscopic term (`turning.rs`).

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::pose::Pose;
use crate::turning::{inverse_inertia, turn_by, turned_on, turns_alike};
use granulcal_scene::Solid;

/// Place and motion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct RigidBody {
    /// Centre of mass `[m]`.
    pub centre: [f64; 3],
    /// `[m/s]`
    pub velocity: [f64; 3],
    /// From the body's axes to the scene's: i, j, k, w.
    pub turned: [f64; 4],
    /// Angular momentum about the centre over the mass `[m^2/s]`.
    pub momentum: [f64; 3],
}

impl RigidBody {
    /// At rest.
    pub fn still(centre: Vector3<f64>, turned: UnitQuaternion<f64>) -> Self {
        Self {
            centre: centre.into(),
            velocity: [0.0; 3],
            turned: turned.coords.into(),
            momentum: [0.0; 3],
        }
    }

    pub fn turned(&self) -> UnitQuaternion<f64> {
        let [i, j, k, w] = self.turned;
        UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k))
    }

    /// `[rad/s]`
    pub fn angular_velocity(&self, solid: &Solid) -> Vector3<f64> {
        let momentum = Vector3::from(self.momentum);
        if turns_alike(&solid.inertia) {
            return 1.0 / solid.inertia.x * momentum;
        }
        self.pose().inverse_inertia(&solid.inertia) * momentum
    }

    fn pose(&self) -> Pose {
        Pose::new(self.centre.into(), self.turned())
    }

    /// Kinetic energy over the mass `[m^2/s^2]`.
    pub fn kinetic_energy(&self, solid: &Solid) -> f64 {
        let momentum = self.turned().inverse() * Vector3::from(self.momentum);
        0.5 * Vector3::from(self.velocity).norm_squared() + solid.turning_energy(&momentum)
    }
}

/// A body as the contact solve sees it: velocities, and what an impulse does to them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moving {
    /// At the begin of the substep.
    pub pose: Pose,
    pub velocity: Vector3<f64>,
    /// `[rad/s]`
    pub omega: Vector3<f64>,
    /// Of the tensor of inertia over the mass, in the scene's axes `[1/m^2]`.
    pub inverse_inertia: Matrix3<f64>,
    /// By how much impacts within the substep move the body more than its last velocity does `[m]`.
    pub shift: Vector3<f64>,
    /// By how much they turn it more than its last angular velocity does `[rad]`.
    pub twist: Vector3<f64>,
    /// When the last of them was, from the begin of the substep; 0 if there was none `[s]`.
    pub hit: f64,
    /// How it was turned then, and the angular velocity with which it went on `[rad/s]`; as at the begin if there was
    /// none.
    left: (UnitQuaternion<f64>, Vector3<f64>),
}

impl Moving {
    pub fn of(body: &RigidBody, solid: &Solid) -> Self {
        let pose = body.pose();
        let inverse_inertia = pose.inverse_inertia(&solid.inertia);
        let omega = inverse_inertia * Vector3::from(body.momentum);
        Self {
            pose,
            velocity: body.velocity.into(),
            omega,
            inverse_inertia,
            shift: Vector3::zeros(),
            twist: Vector3::zeros(),
            hit: 0.0,
            left: (pose.turned, omega),
        }
    }

    /// Where it is at the end of a substep if nothing more meets it.
    pub fn foreseen(&self, dt: f64) -> Pose {
        let (goes, turns) = self.way(dt);
        Pose::new(self.pose.centre + goes, turn_by(&turns) * self.pose.turned)
    }

    /// How far it goes within `dt` `[m]`, and turns `[rad]`.
    pub fn way(&self, dt: f64) -> (Vector3<f64>, Vector3<f64>) {
        (dt * self.velocity + self.shift, dt * self.omega + self.twist)
    }

    /// Velocity of its point at `arm` from the centre `[m/s]`.
    #[inline(always)]
    pub fn velocity_at(&self, arm: &Vector3<f64>) -> Vector3<f64> {
        self.velocity + self.omega.cross(arm)
    }

    /// By how much impacts move its point at `arm` from the centre more than its last velocity does `[m]`.
    pub fn shift_at(&self, arm: &Vector3<f64>) -> Vector3<f64> {
        self.shift + self.twist.cross(arm)
    }

    /// The body `time` into the substep `[s]`, not before it was hit the last time: as it lies then, it takes impulses
    /// and has its angular velocity.
    pub fn at(&self, time: f64, solid: &Solid) -> Self {
        if turns_alike(&solid.inertia) {
            return Self { pose: self.foreseen(time), ..*self };
        }
        let momentum = self.momentum(solid);
        let turned = self.turned_on(&momentum, &Vector3::zeros(), time - self.hit, solid);
        let pose = Pose::new(self.pose.centre + self.way(time).0, turned);
        let inverse_inertia = pose.inverse_inertia(&solid.inertia);
        Self { pose, omega: inverse_inertia * momentum, inverse_inertia, ..*self }
    }

    /// Was hit at `time` `[s]`, after which it moves like `then`, the body as it lies at that time.
    pub fn was_hit(&mut self, time: f64, then: &Self, solid: &Solid) {
        let (velocity, omega) = (self.velocity, self.omega);
        self.velocity = then.velocity;
        self.omega = if turns_alike(&solid.inertia) {
            then.omega
        } else {
            self.inverse_inertia * then.momentum(solid)
        };
        self.shift += time * (velocity - self.velocity);
        self.twist += time * (omega - self.omega);
        self.hit = time;
        self.left = (then.pose.turned, self.omega);
    }

    /// Angular momentum about the centre over the mass `[m^2/s]`.
    fn momentum(&self, solid: &Solid) -> Vector3<f64> {
        self.pose.axes * self.pose.seen(&self.omega).component_mul(&solid.inertia)
    }

    /// Takes an impulse at `arm`.
    #[inline(always)]
    pub fn push(&mut self, arm: &Vector3<f64>, impulse: &Vector3<f64>) {
        self.velocity += impulse;
        self.omega += product(&self.inverse_inertia, &arm.cross(impulse));
    }

    /// What an impulse at the arm `of` does to the velocity at `at`: `1 - [at] I^-1 [of]`.
    pub fn response(&self, at: &Vector3<f64>, of: &Vector3<f64>) -> Matrix3<f64> {
        Matrix3::identity() - at.cross_matrix() * self.inverse_inertia * of.cross_matrix()
    }

    /// How it is turned `time` after it was hit the last time `[s]`, with this angular momentum; `twist` is by how much
    /// it turns besides `[rad]`.
    fn turned_on(
        &self,
        momentum: &Vector3<f64>,
        twist: &Vector3<f64>,
        time: f64,
        solid: &Solid,
    ) -> UnitQuaternion<f64> {
        let turned = self.left.0;
        let axes = turned.to_rotation_matrix();
        let omega = inverse_inertia(axes.matrix(), &solid.inertia) * momentum;
        turned_on(&turned, &solid.inertia, [momentum, &omega], twist, time)
    }

    /// The body a substep later.
    pub fn moved(&self, solid: &Solid, dt: f64) -> RigidBody {
        let momentum = self.momentum(solid);
        let turned = if self.hit == 0.0 || turns_alike(&solid.inertia) {
            let spin = [&momentum, &self.omega];
            turned_on(&self.pose.turned, &solid.inertia, spin, &self.twist, dt)
        } else {
            // What sweeps have changed since it was hit acts from the begin on.
            let twist = self.hit * (self.omega - self.left.1);
            self.turned_on(&momentum, &twist, dt - self.hit, solid)
        };
        // Products of unit quaternions stay of unit length to rounding only.
        let turned = UnitQuaternion::new_normalize(turned.into_inner());
        RigidBody {
            centre: (self.pose.centre + self.way(dt).0).into(),
            velocity: self.velocity.into(),
            turned: turned.coords.into(),
            momentum: momentum.into(),
        }
    }
}

/// When the later of the last impacts of two bodies was, or of one at a wall, 0 if there was none `[s]`.
#[inline(always)]
pub(super) fn last_hit(bodies: &[Moving], i: usize, j: Option<usize>) -> f64 {
    bodies[i].hit.max(j.map_or(0.0, |j| bodies[j].hit))
}

/// `matrix * vector`, which must be inlined in the innermost loop.
#[inline(always)]
pub(super) fn product(m: &Matrix3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(
        m.m11 * v.x + m.m12 * v.y + m.m13 * v.z,
        m.m21 * v.x + m.m22 * v.y + m.m23 * v.z,
        m.m31 * v.x + m.m32 * v.y + m.m33 * v.z,
    )
}
