//! How fast a wall that turns sweeps: the speed of its surface along its own normal. A drum that turns about its own
//! axis sweeps nothing, the tip of a blade as fast as it goes. A trajectory drifts besides, as seen from the wall.
//!
//! With the spin ω about a point p, x of the surface and n its normal there, the speed is n · (ω × (x - p)). Across a
//! triangle it is linear, and largest at a corner. At a cone or cylinder x = c + r u, c on its axis a and u across it,
//! and u · (ω × r u) = 0, so that what is left is of ω × (c - p), largest at an end, and, where n leans along the axis,
//! of a · (ω × r u).

use nalgebra::Vector3;

use crate::error::SceneError;
use crate::motion::Motion;
use crate::walls::{BoxSide, Shape, Wall};

/// Moments of the way between two poses at which a trajectory's drift is seen from the wall that turns.
const SEEN: u32 = 4;

/// How the points of a wall go at a moment, in the axes and from the place that its shape states.
struct Turn {
    /// A point of the axis `[m]`.
    point: Vector3<f64>,
    /// `[rad/s]`
    spin: Vector3<f64>,
    /// Velocity of that point `[m/s]`.
    drift: Vector3<f64>,
}

impl Turn {
    fn velocity(&self, at: &Vector3<f64>) -> Vector3<f64> {
        self.drift + self.spin.cross(&(at - self.point))
    }

    /// No point of the shape is faster `[m/s]`.
    fn bound(&self, shape: &Shape) -> f64 {
        let (centre, reach) = shape.ball();
        self.velocity(&centre).norm() + reach * self.spin.norm()
    }
}

impl Motion {
    /// How it turns: once of a spin, at moments of a trajectory between poses that are turned unlike.
    fn turns(&self) -> Vec<Turn> {
        match self {
            &Self::Spin { point, axis, rate, .. } => {
                let spin = rate * Vector3::from(axis).normalize();
                vec![Turn { point: point.into(), spin, drift: Vector3::zeros() }]
            }
            Self::Trajectory { knots, .. } => knots
                .windows(2)
                .flat_map(|pair| self.turns_between(pair[0][0], pair[1][0]))
                .collect(),
            Self::Still {} | Self::Lift { .. } | Self::Shake { .. } => Vec::new(),
        }
    }

    /// Those between two knots of a trajectory, at times `from` and `to` `[s]`.
    fn turns_between(&self, from: f64, to: f64) -> Vec<Turn> {
        let (time, [begin, end]) = (to - from, [from, to].map(|at| self.pose(at)));
        let spin = begin.rotation.rotation_to(&end.rotation).scaled_axis() / time;
        if spin == Vector3::zeros() {
            return Vec::new();
        }
        // A turn about an axis that the scene has, and so the wall.
        let spin = begin.rotation.inverse() * spin;
        let speed = (end.translation.vector - begin.translation.vector) / time;
        let seen = |moment: u32| {
            let pose = self.pose(from + time * f64::from(moment) / f64::from(SEEN));
            Turn { point: Vector3::zeros(), spin, drift: pose.rotation.inverse() * speed }
        };
        (0..=SEEN).map(seen).collect()
    }
}

impl Wall {
    /// Refuses a wall that jumps over grains: as its motion does, and one whose surface goes farther along its normal
    /// in a substep of `dt` `[s]` than a grain is thick.
    pub(crate) fn check_jumps(&self, name: &str, dt: f64, diameter: f64) -> Result<(), SceneError> {
        self.motion.check_jumps(name, dt, diameter)?;
        let fast = |turn: &Turn| turn.bound(&self.shape) * dt > diameter;
        let turns = self.motion.turns().into_iter().filter(fast);
        let speed = turns.map(|turn| self.shape.sweeps_by(&turn)).fold(0.0, f64::max);
        if speed * dt <= diameter {
            return Ok(());
        }
        let allowed = "at most a grain's diameter in a substep: a lower rate, or a preset with a shorter substep";
        Err(SceneError::range(format!("{name}.motion (speed of its tip) [m/s]"), speed, allowed))
    }
}

impl Shape {
    /// The middle and the radius `[m]` of a ball that holds it; of a plane, which has no end, its point.
    fn ball(&self) -> (Vector3<f64>, f64) {
        let middle = |a: &[f64; 3], b: &[f64; 3]| 0.5 * (Vector3::from(*a) + Vector3::from(*b));
        let half =
            |a: &[f64; 3], b: &[f64; 3]| 0.5 * (Vector3::from(*b) - Vector3::from(*a)).norm();
        match self {
            Self::Plane { point, .. } => ((*point).into(), 0.0),
            Self::Cone { from, to, radius_from, radius_to, .. } => {
                (middle(from, to), half(from, to).hypot(radius_from.max(*radius_to)))
            }
            Self::Cylinder { from, to, radius, .. } => {
                (middle(from, to), half(from, to).hypot(*radius))
            }
            Self::Disc { centre, radius, .. } => ((*centre).into(), *radius),
            Self::Box { min, max, .. } => (middle(min, max), half(min, max)),
            Self::Mesh(file) => file.mesh.as_ref().map_or((Vector3::zeros(), 0.0), |mesh| {
                let corners = || mesh.vertices().iter().map(|v| file.unit * Vector3::from(*v));
                let low = corners().fold(Vector3::repeat(f64::MAX), |low, v| low.inf(&v));
                let high = corners().fold(Vector3::repeat(f64::MIN), |high, v| high.sup(&v));
                (0.5 * (low + high), 0.5 * (high - low).norm())
            }),
        }
    }

    /// The largest speed along its own normal while it turns so `[m/s]`; 0 of a plane, which has no other side.
    fn sweeps_by(&self, turn: &Turn) -> f64 {
        let (spin, velocity) = (turn.spin, |at: &[f64; 3]| turn.velocity(&Vector3::from(*at)));
        let triangle = |[a, b, c]: [[f64; 3]; 3]| {
            let [on, u, v] = [a, b, c].map(Vector3::from);
            let normal = (u - on).cross(&(v - on)).normalize();
            [a, b, c].iter().map(|at| normal.dot(&velocity(at)).abs()).fold(0.0, f64::max)
        };
        let disc = |centre: &[f64; 3], normal: &Vector3<f64>, radius: f64| {
            normal.dot(&velocity(centre)).abs() + radius * normal.cross(&spin).norm()
        };
        let ends = |[from, to]: [&[f64; 3]; 2], radii: [f64; 2], closed: [bool; 2]| {
            let along = Vector3::from(*to) - Vector3::from(*from);
            let (along, length) = (along.normalize(), along.norm());
            let slope = (radii[1] - radii[0]).atan2(length).sin().abs();
            let end = |(centre, (radius, closed)): (&[f64; 3], (f64, bool))| {
                let v = velocity(centre);
                let (aside, of_end) = (v.cross(&along).norm(), disc(centre, &along, radius));
                let shell = aside + slope * of_end;
                if closed { shell.max(of_end) } else { shell }
            };
            [from, to].into_iter().zip(radii.into_iter().zip(closed)).map(end).fold(0.0, f64::max)
        };
        match self {
            Self::Plane { .. } => 0.0,
            Self::Cone { from, to, radius_from, radius_to, closed } => {
                let closed = [closed.at_from(), closed.at_to()];
                ends([from, to], [*radius_from, *radius_to], closed)
            }
            Self::Cylinder { from, to, radius, closed } => {
                ends([from, to], [*radius; 2], [closed.at_from(), closed.at_to()])
            }
            Self::Disc { centre, normal, radius } => {
                disc(centre, &Vector3::from(*normal).normalize(), *radius)
            }
            Self::Box { min, max, open } => {
                let corner = |number: u32| {
                    std::array::from_fn(
                        |axis| if number >> axis & 1 == 0 { min[axis] } else { max[axis] },
                    )
                };
                let sides = BoxSide::ALL.iter().filter(|side| !open.contains(side));
                let triangles = sides.flat_map(|side| side.triangles());
                triangles.map(|of| triangle(of.map(corner))).fold(0.0, f64::max)
            }
            Self::Mesh(file) => file.mesh.as_ref().map_or(0.0, |mesh| {
                let corner = |number: u32| mesh.vertices()[number as usize].map(|c| file.unit * c);
                mesh.triangles().iter().map(|of| triangle(of.map(corner))).fold(0.0, f64::max)
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::WallMaterial;
    use crate::scene::Scene;
    use crate::walls::Ends;

    impl Shape {
        fn sweeps(&self, motion: &Motion) -> f64 {
            motion.turns().iter().map(|turn| self.sweeps_by(turn)).fold(0.0, f64::max)
        }
    }

    fn spin(axis: [f64; 3]) -> Motion {
        Motion::Spin { point: [0.0, 0.0, 0.1], axis, rate: 20.0, begin: 0.0, end: None }
    }

    #[test]
    fn a_drum_sweeps_nothing_and_a_blade_as_fast_as_its_tip() {
        let (from, to) = ([0.0, -0.05, 0.1], [0.0, 0.05, 0.1]);
        let drum = |closed| Shape::Cylinder { from, to, radius: 0.1, closed };
        let (about_it, across) = (spin([0.0, 2.0, 0.0]), spin([1.0, 0.0, 0.0]));
        assert_eq!(drum(Ends::Both).sweeps(&about_it), 0.0);
        // Its ends go at 20 rad/s times .05 m, the rims of their lids at 20 times .1 along the axis.
        assert!((drum(Ends::None).sweeps(&across) - 1.0).abs() < 1e-12);
        assert!((drum(Ends::Both).sweeps(&across) - 2.0).abs() < 1e-12);
        assert_eq!(drum(Ends::Both).sweeps(&Motion::default()), 0.0);
        let (radius_from, radius_to) = (0.02, 0.05);
        let cone = Shape::Cone { from, to, radius_from, radius_to, closed: Ends::None };
        assert_eq!(cone.sweeps(&about_it), 0.0);
        let blade =
            Shape::Box { min: [0.0, -0.01, 0.1], max: [0.3, 0.01, 0.102], open: Vec::new() };
        assert!((blade.sweeps(&about_it) - 6.0).abs() < 1e-12);
        // About z its long sides go along their normals.
        let flat = blade.sweeps(&spin([0.0, 0.0, 1.0]));
        assert!((flat - 6.0).abs() < 1e-12, "{flat}");
        let disc = Shape::Disc { centre: [0.0, 0.0, 0.1], normal: [0.0, 3.0, 0.0], radius: 0.1 };
        assert_eq!(disc.sweeps(&about_it), 0.0);
        assert!((disc.sweeps(&across) - 2.0).abs() < 1e-12);
    }

    /// A turn by `angle` about an axis along y through a point, in steps, `rate` rad/s fast.
    fn trajectory(point: [f64; 3], angle: f64, rate: f64) -> Motion {
        let spin = Motion::Spin { point, axis: [0.0, 1.0, 0.0], rate, begin: 0.0, end: None };
        let (steps, time) = (64, angle / rate);
        let knot = |step: u32| {
            let at = time * f64::from(step) / f64::from(steps);
            let (pose, [x, y, z]) = (spin.pose(at), spin.pose(at).translation.vector.into());
            let turn = pose.rotation.coords;
            [at, x, y, z, turn.x, turn.y, turn.z, turn.w]
        };
        Motion::Trajectory { file: None, knots: (0..=steps).map(knot).collect() }
    }

    #[test]
    fn a_trajectory_that_turns_sweeps_as_the_spin_that_it_is() {
        let (from, to) = ([0.3, -0.05, 0.1], [0.3, 0.05, 0.1]);
        let drum = Shape::Cylinder { from, to, radius: 0.1, closed: Ends::Both };
        let blade =
            Shape::Box { min: [0.0, -0.01, 0.1], max: [0.3, 0.01, 0.102], open: Vec::new() };
        for (point, angle) in [([0.0; 3], 1.0), ([0.0, 0.0, 0.1], 3.0), ([0.3, 0.2, 0.1], 2.0)] {
            let axis = [0.0, 1.0, 0.0];
            let spin = Motion::Spin { point, axis, rate: 20.0, begin: 0.0, end: None };
            let trajectory = trajectory(point, angle, 20.0);
            for shape in [&drum, &blade] {
                let (exact, found) = (shape.sweeps(&spin), shape.sweeps(&trajectory));
                assert!((found - exact).abs() < 0.2, "{point:?}: {found} of {exact}");
                for turn in trajectory.turns() {
                    assert!(turn.bound(shape) >= shape.sweeps_by(&turn) - 1e-12);
                }
            }
        }
    }

    #[test]
    fn a_trajectory_whose_tip_jumps_over_grains_is_refused_as_a_spin_is() {
        let blade =
            Shape::Box { min: [0.9, -0.01, 0.1], max: [1.0, 0.01, 0.102], open: Vec::new() };
        let check = |rate| {
            let mut wall = Wall::fixed(blade.clone(), WallMaterial::default());
            wall.motion = trajectory([0.0; 3], 0.5, rate);
            Scene { walls: vec![wall], ..Scene::drop(0.1) }.check()
        };
        check(7.0).unwrap();
        // 9 m/s in a substep of 0.5 ms are more than the 4 mm of a grain; the origin, which turns, stays where it is.
        let refused = check(9.0).unwrap_err().to_string();
        assert!(refused.contains("walls.0.motion (speed of its tip)"), "{refused}");
    }
}
