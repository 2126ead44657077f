//! How a wall moves: from the place that its shape states, rigidly, by a stated law of time.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::check::{finite, non_negative, positive, seen_to_swing};
use crate::error::SceneError;

/// How far a wall may turn in a substep `[rad]`.
const LARGEST_TURN: f64 = 0.1;

/// The motion of a wall from its stated place. Times are simulated times `[s]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Motion {
    /// It stays where it is. Braces, for a variant without them takes any key.
    Still {},
    /// It moves at a constant velocity, for example a tube that is lifted off a column.
    Lift {
        /// `[m/s]`
        velocity: [f64; 3],
        /// When it begins `[s]`.
        #[serde(default)]
        begin: f64,
        /// When it ends `[s]`.
        end: f64,
    },
    /// It turns about an axis at a constant rate, for example a drum.
    Spin {
        /// A point of the axis `[m]`.
        point: [f64; 3],
        /// The axis' direction, about which it turns by the right hand; any length but zero.
        axis: [f64; 3],
        /// `[rad/s]`
        rate: f64,
        /// When it begins `[s]`.
        #[serde(default)]
        begin: f64,
        /// When it ends `[s]`; never if not stated.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        end: Option<f64>,
    },
    /// It swings: displacement `amplitude sin(2 pi frequency (t - begin))`.
    Shake {
        /// `[m]`
        amplitude: [f64; 3],
        /// `[Hz]`
        frequency: f64,
        /// When it begins `[s]`.
        #[serde(default)]
        begin: f64,
        /// When it ends, with the wall where it is then `[s]`; never if not stated.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        end: Option<f64>,
    },
    /// It goes through listed poses, straight and at constant speed between them, and rests before the first and after
    /// the last.
    Trajectory {
        /// A CSV file of the knots that is still to be read; a relative path is from the scene's file.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        file: Option<String>,
        /// Each knot: time `[s]`, displacement from the stated place (3) `[m]`, rotation about the scene's
        /// origin as a unit quaternion (x, y, z, w).
        #[serde(default)]
        knots: Vec<[f64; 8]>,
    },
}

impl Default for Motion {
    fn default() -> Self {
        Self::Still {}
    }
}

impl Motion {
    /// Whether it never moves.
    pub fn is_still(&self) -> bool {
        *self == Self::Still {}
    }

    /// When the last of its motion is over `[s]`; infinite for one that never ends.
    pub fn end(&self) -> f64 {
        match self {
            Self::Still {} => 0.0,
            &Self::Lift { end, .. } => end,
            &Self::Spin { end, .. } | &Self::Shake { end, .. } => end.unwrap_or(f64::INFINITY),
            Self::Trajectory { knots, .. } => knots.last().map_or(0.0, |knot| knot[0]),
        }
    }

    /// Where it takes a point of the stated place at `time` `[s]`.
    pub fn pose(&self, time: f64) -> Isometry3<f64> {
        let since = |begin: f64, end: f64| (time.min(end) - begin).max(0.0);
        match self {
            Self::Still {} => Isometry3::identity(),
            &Self::Lift { velocity, begin, end } => {
                Translation3::from(since(begin, end) * Vector3::from(velocity)).into()
            }
            &Self::Spin { point, axis, rate, begin, end } => {
                let turn = rate * since(begin, end.unwrap_or(f64::INFINITY));
                let axis = Vector3::from(axis).normalize();
                let rotation = UnitQuaternion::from_scaled_axis(turn * axis);
                let point = Vector3::from(point);
                Isometry3::from_parts((point - rotation * point).into(), rotation)
            }
            &Self::Shake { amplitude, frequency, begin, end } => {
                let phase = frequency * since(begin, end.unwrap_or(f64::INFINITY));
                let swing = (std::f64::consts::TAU * phase).sin();
                Translation3::from(swing * Vector3::from(amplitude)).into()
            }
            Self::Trajectory { knots, .. } => pose_between(knots, time),
        }
    }

    /// The fastest that it moves without turning `[m/s]`.
    fn fastest(&self) -> f64 {
        match self {
            Self::Still {} | Self::Spin { .. } => 0.0,
            Self::Lift { velocity, .. } => Vector3::from(*velocity).norm(),
            Self::Shake { amplitude, frequency, .. } => {
                std::f64::consts::TAU * frequency * Vector3::from(*amplitude).norm()
            }
            Self::Trajectory { knots, .. } => {
                let speed = |pair: &[[f64; 8]]| {
                    let [from, to] = [&pair[0], &pair[1]].map(|k| Vector3::new(k[1], k[2], k[3]));
                    (to - from).norm() / (pair[1][0] - pair[0][0])
                };
                knots.windows(2).map(speed).fold(0.0, f64::max)
            }
        }
    }

    /// The fastest that it turns `[rad/s]`.
    fn fastest_turn(&self) -> f64 {
        match self {
            Self::Still {} | Self::Lift { .. } | Self::Shake { .. } => 0.0,
            Self::Spin { rate, .. } => rate.abs(),
            Self::Trajectory { knots, .. } => {
                let rate = |pair: &[[f64; 8]]| {
                    let turn = pose_of(&pair[0]).rotation.angle_to(&pose_of(&pair[1]).rotation);
                    turn / (pair[1][0] - pair[0][0])
                };
                knots.windows(2).map(rate).fold(0.0, f64::max)
            }
        }
    }

    /// Refuses a wall that jumps over grains: in a substep of `dt` `[s]` it may go as far as a grain is thick, turn by
    /// [`LARGEST_TURN`] and swing by a part of a period, so that the steps show how it moves.
    pub(crate) fn check_jumps(&self, name: &str, dt: f64, diameter: f64) -> Result<(), SceneError> {
        let refuse = |what: &str, got: f64, allowed: &'static str| {
            Err(SceneError::range(format!("{name}.motion{what}"), got, allowed))
        };
        if self.fastest() * dt > diameter {
            let allowed = "at most a grain's diameter in a substep";
            return refuse(" (speed) [m/s]", self.fastest(), allowed);
        }
        if self.fastest_turn() * dt > LARGEST_TURN {
            let allowed = "at most 0.1 rad in a substep, 200 rad/s with preset default";
            return refuse(" (rate) [rad/s]", self.fastest_turn(), allowed);
        }
        match self {
            &Self::Shake { frequency, .. } => {
                seen_to_swing(&format!("{name}.motion.frequency"), frequency, dt)
            }
            _ => Ok(()),
        }
    }

    pub(crate) fn check(&self, name: &str) -> Result<(), SceneError> {
        let all_finite = |field: &str, values: &[f64]| {
            values.iter().try_for_each(|&value| finite(&format!("{name}.motion.{field}"), value))
        };
        let is_after = |begin: f64, end: Option<f64>| {
            non_negative(&format!("{name}.motion.begin"), begin)?;
            match end {
                Some(end) if !(end >= begin && end.is_finite()) => {
                    Err(SceneError::range(format!("{name}.motion.end"), end, "at least begin"))
                }
                _ => Ok(()),
            }
        };
        match self {
            Self::Still {} => Ok(()),
            &Self::Lift { velocity, begin, end } => {
                all_finite("velocity", &velocity)?;
                is_after(begin, Some(end))
            }
            &Self::Spin { point, axis, rate, begin, end } => {
                all_finite("point", &point)?;
                all_finite("axis", &axis)?;
                all_finite("rate", &[rate])?;
                positive(&format!("{name}.motion.axis (length)"), Vector3::from(axis).norm())?;
                is_after(begin, end)
            }
            &Self::Shake { amplitude, frequency, begin, end } => {
                all_finite("amplitude", &amplitude)?;
                non_negative(&format!("{name}.motion.frequency"), frequency)?;
                is_after(begin, end)
            }
            Self::Trajectory { knots, .. } => check_knots(name, knots),
        }
    }
}

/// The listed pose of a knot.
fn pose_of(knot: &[f64; 8]) -> Isometry3<f64> {
    let [_, x, y, z, qx, qy, qz, qw] = *knot;
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(qw, qx, qy, qz));
    Isometry3::from_parts(Translation3::new(x, y, z), rotation)
}

fn pose_between(knots: &[[f64; 8]], time: f64) -> Isometry3<f64> {
    let after = knots.partition_point(|knot| knot[0] <= time);
    let Some(before) = after.checked_sub(1) else { return pose_of(&knots[0]) };
    let (from, Some(to)) = (&knots[before], knots.get(after)) else {
        return pose_of(&knots[before]);
    };
    let share = (time - from[0]) / (to[0] - from[0]);
    let (from, to) = (pose_of(from), pose_of(to));
    let translation = from.translation.vector.lerp(&to.translation.vector, share);
    // Half a turn between two knots has no shortest way; the checks refuse it.
    let rotation = from.rotation.try_slerp(&to.rotation, share, 0.0).unwrap_or(from.rotation);
    Isometry3::from_parts(translation.into(), rotation)
}

fn check_knots(name: &str, knots: &[[f64; 8]]) -> Result<(), SceneError> {
    let number = |knot: usize, what: &str| format!("{name}.motion.knots.{knot}.{what}");
    if knots.is_empty() {
        return Err(SceneError::range(format!("{name}.motion.knots (number)"), 0.0, "at least 1"));
    }
    for (index, knot) in knots.iter().enumerate() {
        knot.iter()
            .try_for_each(|&value| finite(&format!("{name}.motion.knots.{index}"), value))?;
        let norm = Vector3::new(knot[4], knot[5], knot[6]).norm().hypot(knot[7]);
        if (norm - 1.0).abs() > 1e-3 {
            let allowed = "1 to a thousandth (qx, qy, qz, qw)";
            return Err(SceneError::range(number(index, "quaternion (length)"), norm, allowed));
        }
        let Some(before) = index.checked_sub(1).map(|before| &knots[before]) else { continue };
        if knot[0] <= before[0] {
            let allowed = "later than the knot before";
            return Err(SceneError::range(number(index, "time"), knot[0], allowed));
        }
        let turn = pose_of(before).rotation.angle_to(&pose_of(knot).rotation);
        if turn > 0.9 * std::f64::consts::PI {
            let allowed = "less than 0.9 pi from the knot before";
            return Err(SceneError::range(number(index, "rotation [rad]"), turn, allowed));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    fn at(motion: &Motion, time: f64, point: [f64; 3]) -> Vector3<f64> {
        (motion.pose(time) * Point3::from(point)).coords
    }

    #[test]
    fn each_motion_is_its_formula() {
        let lift = Motion::Lift { velocity: [0.0, 0.0, 0.5], begin: 1.0, end: 3.0 };
        for (time, z) in [(0.5, 0.1), (2.0, 0.6), (9.0, 1.1)] {
            assert!((at(&lift, time, [0.0, 0.0, 0.1]).z - z).abs() < 1e-15);
        }
        let (point, axis) = ([0.0, 0.0, 1.0], [0.0, 2.0, 0.0]);
        let spin = Motion::Spin { point, axis, rate: 2.0, begin: 0.0, end: None };
        // A quarter turn about y through (0, 0, 1) takes +z to +x.
        let moved = at(&spin, std::f64::consts::FRAC_PI_4, [0.0, 0.0, 1.5]);
        assert!((moved - Vector3::new(0.5, 0.0, 1.0)).norm() < 1e-15, "{moved}");
        let amplitude = [0.01, 0.0, 0.0];
        let shake = Motion::Shake { amplitude, frequency: 50.0, begin: 0.0, end: Some(0.105) };
        assert!(at(&shake, 0.01, [0.0; 3]).x.abs() < 1e-15);
        assert!((at(&shake, 0.005, [0.0; 3]).x - 0.01).abs() < 1e-15);
        assert!((at(&shake, 1.0, [0.0; 3]).x - 0.01).abs() < 1e-12);
        assert_eq!((spin.end(), shake.end(), Motion::default().end()), (f64::INFINITY, 0.105, 0.0));
    }

    #[test]
    fn a_trajectory_goes_through_its_knots() {
        let half = 0.5f64.sqrt();
        let knots = vec![
            [1.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
            [2.0, 0.3, 0.0, 0.0, 0.0, 0.0, half, half],
        ];
        let motion = Motion::Trajectory { file: None, knots };
        motion.check("walls.0").unwrap();
        assert!((at(&motion, 0.0, [0.0; 3]).x - 0.1).abs() < 1e-15);
        assert!((at(&motion, 1.5, [0.0; 3]).x - 0.2).abs() < 1e-15);
        let turned = at(&motion, 1.5, [1.0, 0.0, 0.0]) - Vector3::new(0.2, 0.0, 0.0);
        assert!((turned - Vector3::new(half, half, 0.0)).norm() < 1e-12, "{turned}");
        assert!((at(&motion, 7.0, [1.0, 0.0, 0.0]) - Vector3::new(0.3, 1.0, 0.0)).norm() < 1e-12);
    }

    #[test]
    fn a_wall_that_jumps_over_grains_is_refused() {
        let still = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        let mut there = still;
        (there[0], there[1]) = (1e-3, 0.05);
        let jump = Motion::Trajectory { file: None, knots: vec![still, there] };
        let (dt, diameter) = (5e-4, 4e-3);
        let message = jump.check_jumps("walls.2", dt, diameter).unwrap_err().to_string();
        assert!(message.contains("walls.2.motion (speed)") && message.contains("50"), "{message}");
        there[0] = 0.1;
        let slow = Motion::Trajectory { file: None, knots: vec![still, there] };
        slow.check_jumps("walls.2", dt, diameter).unwrap();
    }

    #[test]
    fn a_wall_that_turns_or_swings_between_two_substeps_is_refused() {
        let (dt, diameter) = (5e-4, 4e-3);
        let (point, axis) = ([0.0; 3], [0.0, 0.0, 1.0]);
        let spin = |rate| Motion::Spin { point, axis, rate, begin: 0.0, end: None };
        let shake = |frequency| {
            let amplitude = [1e-4, 0.0, 0.0];
            Motion::Shake { amplitude, frequency, begin: 0.0, end: None }
        };
        // One turn a substep would look like none.
        let whole = spin(std::f64::consts::TAU / dt);
        let message = whole.check_jumps("walls.2", dt, diameter).unwrap_err().to_string();
        assert!(
            message.contains("walls.2.motion (rate)") && message.contains("12566"),
            "{message}"
        );
        let message = shake(2000.0).check_jumps("walls.2", dt, diameter).unwrap_err().to_string();
        assert!(message.contains("walls.2.motion.frequency"), "{message}");
        for motion in [spin(-199.0), shake(200.0)] {
            motion.check_jumps("walls.2", dt, diameter).unwrap();
        }
    }

    #[test]
    fn what_is_no_motion_is_named() {
        let still = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        let mut turned = still;
        (turned[0], turned[6], turned[7]) = (1.0, 1.0, 0.0);
        let mut long = still;
        long[7] = 1.1;
        let knots = |knots: &[[f64; 8]]| Motion::Trajectory { file: None, knots: knots.to_vec() };
        let axis = [0.0; 3];
        for (motion, named) in [
            (knots(&[]), "knots (number)"),
            (knots(&[still, still]), "knots.1.time"),
            (knots(&[still, turned]), "knots.1.rotation"),
            (knots(&[long]), "knots.0.quaternion"),
            (Motion::Spin { point: axis, axis, rate: 1.0, begin: 0.0, end: None }, "axis"),
            (Motion::Lift { velocity: axis, begin: 2.0, end: 1.0 }, "motion.end"),
        ] {
            let message = motion.check("walls.3").unwrap_err().to_string();
            assert!(message.contains("walls.3.motion") && message.contains(named), "{message}");
        }
    }
}
