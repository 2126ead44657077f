//! Where a moving wall is in a substep, and how fast (docs/theory/contact.md, "Walls that move").

use granulcal_scene::Motion;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

/// Pose of a wall at the begin of a substep, and the pose that it has moved by at the end.
#[derive(Clone, Debug)]
pub(crate) struct Placement {
    motion: Motion,
    pose: Isometry3<f64>,
    /// From the pose at the begin of the substep to that at its end.
    step: Isometry3<f64>,
    dt: f64,
    /// What bounds how far a point goes in the coming interval between two lists: a length `[m]`, and an angle by which
    /// its distance from the scene's origin counts.
    reach: (f64, f64),
}

/// Poses that are tried for the bound of an interval.
const SAMPLES: usize = 8;
/// What the samples may miss: a swing's crest lies between two of them.
const BETWEEN_SAMPLES: f64 = 1.2;

impl Placement {
    /// A wall in motion, none for one that is still.
    pub fn new(motion: &Motion) -> Option<Self> {
        (!motion.is_still()).then(|| Self {
            motion: motion.clone(),
            pose: motion.pose(0.0),
            step: Isometry3::identity(),
            dt: 1.0,
            reach: (0.0, 0.0),
        })
    }

    /// Takes it to the substep of length `dt` that begins at `time` `[s]`.
    pub fn move_to(&mut self, time: f64, dt: f64) {
        self.pose = self.motion.pose(time);
        self.step = self.motion.pose(time + dt) * self.pose.inverse();
        self.dt = dt;
    }

    /// Looks ahead over the coming `interval` `[s]`.
    pub fn look_ahead(&mut self, time: f64, interval: f64) {
        let back = self.pose.inverse();
        self.reach = (0.0, 0.0);
        for sample in 1..=SAMPLES {
            let share = sample as f64 / SAMPLES as f64;
            let moved = self.motion.pose(time + share * interval) * back;
            self.reach.0 = self.reach.0.max(BETWEEN_SAMPLES * moved.translation.vector.norm());
            self.reach.1 = self.reach.1.max(BETWEEN_SAMPLES * moved.rotation.angle());
        }
    }

    /// How far a point of the wall here can go until the next list, at most `[m]`.
    pub fn reach_at(&self, x: &Vector3<f64>) -> f64 {
        self.reach.0 + self.reach.1 * x.norm()
    }

    /// Whether it moves in this substep.
    pub fn moves(&self) -> bool {
        self.step != Isometry3::identity()
    }

    /// Mean velocity in the substep of the wall's point that is at `x` at its begin `[m/s]`.
    pub fn velocity_at(&self, x: &Vector3<f64>) -> Vector3<f64> {
        (self.step.rotation * x + self.step.translation.vector - x) / self.dt
    }

    /// Mean angular velocity in the substep `[rad/s]`.
    pub fn angular_velocity(&self) -> Vector3<f64> {
        self.step.rotation.scaled_axis() / self.dt
    }

    /// A place at `now` `[s]` into the substep, seen from the wall where its shape is stated.
    pub fn seen(&self, x: &Vector3<f64>, now: f64) -> Vector3<f64> {
        let at_begin = x - now * self.velocity_at(x);
        self.pose.rotation.inverse() * (at_begin - self.pose.translation.vector)
    }

    /// From directions of the scene to those of the stated shape.
    pub fn stated(&self) -> UnitQuaternion<f64> {
        self.pose.rotation.inverse()
    }

    /// A direction of the stated shape where the wall is now.
    pub fn turned(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        self.pose.rotation * direction
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn velocities_are_those_of_the_motion() {
        let (point, axis) = ([0.1, 0.0, 0.3], [0.0, 1.0, 0.0]);
        let motion = Motion::Spin { point, axis, rate: 3.0, begin: 0.0, end: None };
        let mut placement = Placement::new(&motion).unwrap();
        let (time, dt) = (0.7, 1e-6);
        placement.move_to(time, dt);
        let x = Vector3::new(0.2, 0.1, -0.1);
        let omega: Vector3<f64> = 3.0 * Vector3::y();
        let expected = omega.cross(&(x - Vector3::from(point)));
        assert!((placement.velocity_at(&x) - expected).norm() < 1e-5);
        assert!((placement.angular_velocity() - omega).norm() < 1e-6);
        // A point that moves along stays where it is, seen from the wall.
        let stated = placement.seen(&x, 0.0);
        let along = x + dt * placement.velocity_at(&x);
        assert!((placement.seen(&along, dt) - stated).norm() < 1e-11);
        placement.look_ahead(time, 0.01);
        assert!(placement.reach_at(&x) >= 0.01 * expected.norm());
    }

    #[test]
    fn a_still_wall_has_no_placement() {
        assert!(Placement::new(&Motion::default()).is_none());
    }
}
