//! How fast a wall that spins sweeps: the speed of its surface along its own normal. A drum that turns about its own axis
//! sweeps nothing, the tip of a blade as fast as it goes.
//!
//! With the spin ω about a point p, x of the surface and n its normal there, the speed is n · (ω × (x - p)). Across a
//! triangle it is linear, and largest at a corner. At a cone or cylinder x = c + r u, c on its axis a and u across it, and
//! u · (ω × r u) = 0, so that what is left is of ω × (c - p), largest at an end, and, where n leans along the axis, of
//! a · (ω × r u).

use nalgebra::Vector3;

use crate::error::SceneError;
use crate::motion::Motion;
use crate::walls::{BoxSide, Shape, Wall};

impl Wall {
    /// Refuses a wall that jumps over grains: as its motion does, and one whose surface goes farther along its normal in a
    /// substep of `dt` `[s]` than a grain is thick.
    pub(crate) fn check_jumps(&self, name: &str, dt: f64, diameter: f64) -> Result<(), SceneError> {
        self.motion.check_jumps(name, dt, diameter)?;
        let speed = self.shape.sweeps(&self.motion);
        if speed * dt <= diameter {
            return Ok(());
        }
        let allowed = "at most a grain's diameter in a substep: a lower rate, or a preset with a shorter substep";
        Err(SceneError::range(format!("{name}.motion (speed of its tip) [m/s]"), speed, allowed))
    }
}

impl Shape {
    /// The largest speed along its own normal while it spins `[m/s]`; 0 of a plane, which has no other side, and of every
    /// other motion.
    fn sweeps(&self, motion: &Motion) -> f64 {
        let &Motion::Spin { point, axis, rate, .. } = motion else { return 0.0 };
        let (point, spin) = (Vector3::from(point), rate * Vector3::from(axis).normalize());
        let velocity = |at: &[f64; 3]| spin.cross(&(Vector3::from(*at) - point));
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
    use crate::walls::Ends;

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
}
