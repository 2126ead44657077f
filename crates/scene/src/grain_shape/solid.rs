//! A convex body at rest in its own axes: what it is made of, its volume and inertia, and how parry sees it.
//!
//! A polyhedron of triangles (a, b, c), outward, is the sum of the tetrahedra (0, a, b, c):
//!
//! ```text
//! V = sum d / 6,   V x = sum d (a + b + c) / 24,   d = a . (b x c)
//! int x x^T dV = sum d / 120 (s s^T + a a^T + b b^T + c c^T),   s = a + b + c
//! I / m = (tr C) 1 - C,   C = int x x^T dV / V about the centre of mass
//! ```
//!
//! The body's axes are the principal ones, so that I is diagonal. The only file that names parry's shapes.

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};
use parry3d_f64::math::Vector as ParryVector;
use parry3d_f64::shape::{ConvexPolyhedron, Cuboid, Cylinder, SharedShape};
use parry3d_f64::transformation::try_convex_hull;

use super::GrainShape;
use crate::error::SceneError;

/// Faces nearer than this to one plane are one face, as the scalar product of their unit normals `[-]`.
const SAME_PLANE: f64 = 1.0 - 1e-9;

/// A convex body in its principal axes, about its centre of mass.
#[derive(Clone)]
pub struct Solid {
    /// Corners `[m]`; of a cylinder none.
    pub corners: Vec<Vector3<f64>>,
    /// Outward unit normals and distances from the centre of its faces `[m]`; of a cylinder its two ends.
    pub faces: Vec<(Vector3<f64>, f64)>,
    /// Radius and half of the length of a cylinder about the y axis `[m]`.
    pub round: Option<(f64, f64)>,
    /// `[m^3]`
    pub volume: f64,
    /// Moments of inertia about the axes over the mass `[m^2]`.
    pub inertia: Vector3<f64>,
    /// Half the edges of the box about the centre, along the axes, that holds it `[m]`.
    pub half_extents: Vector3<f64>,
    /// Radius of the ball about the centre that holds it `[m]`.
    pub reach: f64,
    /// Its centre of mass where the shape is stated, in units of the scene `[m]`.
    pub centre: Vector3<f64>,
    /// Its axes there, a column each, right-handed: the shape's own of a box and a cylinder.
    pub axes: Matrix3<f64>,
    /// The body scaled so that `reach` is 1: parry's tolerances are absolute.
    pub unit: SharedShape,
}

impl std::fmt::Debug for Solid {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Solid")
            .field("corners", &self.corners.len())
            .field("volume", &self.volume)
            .field("inertia", &self.inertia)
            .finish_non_exhaustive()
    }
}

impl Solid {
    /// The body of a shape whose size is `diameter` `[m]`.
    ///
    /// # Errors
    /// What [`GrainShape::check`] says.
    pub fn new(shape: &GrainShape, diameter: f64) -> Result<Arc<Self>, SceneError> {
        shape.check()?;
        Ok(Arc::new(match shape {
            GrainShape::Box { aspect } => Self::cuboid(diameter * Vector3::from(*aspect)),
            GrainShape::Cylinder { aspect } => {
                Self::cylinder(0.5 * diameter, 0.5 * diameter * aspect)
            }
            GrainShape::Superquadric { .. } | GrainShape::Hull { .. } => {
                Self::hull(&shape.points(diameter))?
            }
        }))
    }

    fn cuboid(edges: Vector3<f64>) -> Self {
        let half = 0.5 * edges;
        let corner = |number: usize| {
            let side = |axis: usize| if number >> axis & 1 == 1 { half[axis] } else { -half[axis] };
            Vector3::new(side(0), side(1), side(2))
        };
        let squares = edges.component_mul(&edges);
        let normals = (0..3).flat_map(|axis| [Vector3::ith(axis, 1.0), Vector3::ith(axis, -1.0)]);
        let reach = half.norm();
        Self {
            corners: (0..8).map(corner).collect(),
            faces: normals.map(|n| (n, half.dot(&n.abs()))).collect(),
            round: None,
            volume: edges.product(),
            inertia: Vector3::new(
                squares.y + squares.z,
                squares.z + squares.x,
                squares.x + squares.y,
            ) / 12.0,
            half_extents: half,
            reach,
            centre: Vector3::zeros(),
            axes: Matrix3::identity(),
            unit: SharedShape::new(Cuboid::new(parry(&(half / reach)))),
        }
    }

    fn cylinder(radius: f64, half: f64) -> Self {
        let reach = radius.hypot(half);
        let across = radius * radius / 4.0 + half * half / 3.0;
        Self {
            corners: Vec::new(),
            faces: vec![(Vector3::y(), half), (-Vector3::y(), half)],
            round: Some((radius, half)),
            volume: std::f64::consts::PI * radius * radius * 2.0 * half,
            inertia: Vector3::new(across, radius * radius / 2.0, across),
            half_extents: Vector3::new(radius, half, radius),
            reach,
            centre: Vector3::zeros(),
            axes: Matrix3::identity(),
            unit: SharedShape::new(Cylinder::new(half / reach, radius / reach)),
        }
    }

    /// The convex hull of points, moved to its centre of mass and turned to its principal axes.
    fn hull(points: &[Vector3<f64>]) -> Result<Self, SceneError> {
        let flat = |_| SceneError::BadShape { what: "no volume: its points lie in a plane" };
        // In units of the largest coordinate: parry's tolerances are absolute.
        let unit = points.iter().map(Vector3::amax).fold(f64::MIN_POSITIVE, f64::max);
        let scaled: Vec<_> = points.iter().map(|p| parry(&(p / unit))).collect();
        let (corners, triangles) = try_convex_hull(&scaled).map_err(flat)?;
        let corners: Vec<_> = corners.iter().map(|c| unit * Vector3::new(c.x, c.y, c.z)).collect();
        let (volume, centre, second) = moments(&corners, &triangles);
        if volume.is_nan() || volume <= 1e-6 * unit.powi(3) {
            return Err(SceneError::BadShape { what: "no volume: its points lie in a plane" });
        }
        let covariance = second / volume - centre * centre.transpose();
        let tensor = Matrix3::from_diagonal_element(covariance.trace()) - covariance;
        let eigen = tensor.symmetric_eigen();
        let mut axes = eigen.eigenvectors;
        if axes.determinant() < 0.0 {
            axes.column_mut(2).neg_mut();
        }
        let corners: Vec<_> = corners.iter().map(|c| axes.tr_mul(&(c - centre))).collect();
        let reach = corners.iter().map(Vector3::norm).fold(0.0, f64::max);
        let scaled: Vec<_> = corners.iter().map(|c| parry(&(c / reach))).collect();
        let body = ConvexPolyhedron::from_convex_mesh(scaled, &triangles)
            .ok_or(SceneError::BadShape { what: "a hull whose faces do not close" })?;
        Ok(Self {
            faces: faces(&corners, &triangles),
            half_extents: corners.iter().fold(Vector3::zeros(), |most, c| most.sup(&c.abs())),
            corners,
            round: None,
            volume,
            inertia: eigen.eigenvalues,
            reach,
            centre,
            axes,
            unit: SharedShape::new(body),
        })
    }

    /// Points whose hull it is, in its own axes `[m]`: its corners, or as many points as asked for on each rim of a
    /// cylinder.
    pub fn vertices(&self, on_rim: usize) -> Vec<Vector3<f64>> {
        let Some((radius, half)) = self.round else { return self.corners.clone() };
        let at = |number: usize, y: f64| {
            let angle = std::f64::consts::TAU * number as f64 / on_rim as f64;
            Vector3::new(radius * angle.cos(), y, radius * angle.sin())
        };
        [-half, half].iter().flat_map(|&y| (0..on_rim).map(move |number| at(number, y))).collect()
    }

    /// Whether it is a box, of [`Self::half_extents`].
    pub fn is_box(&self) -> bool {
        self.unit.as_cuboid().is_some()
    }

    /// The points of the body that may touch a surface whose normal, towards the body, is `-direction`: of a polyhedron
    /// its corners, of a cylinder the ends of the generator that is farthest, and three more points of that end's rim.
    pub fn extremes(&self, direction: &Vector3<f64>, mut found: impl FnMut(Vector3<f64>)) {
        let Some((radius, half)) = self.round else {
            self.corners.iter().for_each(|corner| found(*corner));
            return;
        };
        let across = Vector3::new(direction.x, 0.0, direction.z);
        let length = across.norm();
        // A cylinder that stands has no farthest generator: any square on its rim holds it.
        let out = if length > 1e-9 { radius / length * across } else { radius * Vector3::x() };
        let side = Vector3::y().cross(&out);
        let end = half * direction.y.signum();
        found(Vector3::new(out.x, end, out.z));
        found(Vector3::new(out.x, -end, out.z));
        for rim in [side, -out, -side] {
            found(Vector3::new(rim.x, end, rim.z));
        }
    }

    /// How far a point of its own axes is above the face that it is highest over, negative inside `[m]`; and that
    /// face's outward unit normal.
    pub fn height(&self, point: &Vector3<f64>) -> (f64, Vector3<f64>) {
        self.height_over(point, |_| true)
    }

    /// The same of those faces alone whose normals are admitted: infinitely far below if none is.
    pub fn height_over(
        &self,
        point: &Vector3<f64>,
        admits: impl Fn(&Vector3<f64>) -> bool,
    ) -> (f64, Vector3<f64>) {
        let above =
            self.faces.iter().map(|(normal, distance)| (normal.dot(point) - distance, *normal));
        let round = self.round.map(|(radius, _)| {
            let across = Vector3::new(point.x, 0.0, point.z);
            let length = across.norm();
            // On the axis every way out is as long as any other.
            let outward = if length > 0.0 { across / length } else { Vector3::x() };
            (length - radius, outward)
        });
        let first = (f64::NEG_INFINITY, Vector3::zeros());
        let higher = |next: &(f64, Vector3<f64>), most: f64| next.0 > most && admits(&next.1);
        above.chain(round).fold(first, |most, next| if higher(&next, most.0) { next } else { most })
    }

    /// Density-free energy of turning, `omega . I omega / 2 m`, from the angular momentum over the mass in the body's
    /// axes.
    pub fn turning_energy(&self, momentum: &Vector3<f64>) -> f64 {
        0.5 * momentum.component_mul(momentum).component_div(&self.inertia).sum()
    }
}

/// Volume, centre of mass and second moments about the origin of a closed surface of outward triangles.
fn moments(corners: &[Vector3<f64>], triangles: &[[u32; 3]]) -> (f64, Vector3<f64>, Matrix3<f64>) {
    let (mut volume, mut first, mut second) = (0.0, Vector3::zeros(), Matrix3::zeros());
    for triangle in triangles {
        let [a, b, c] = triangle.map(|index| corners[index as usize]);
        let d = a.dot(&b.cross(&c));
        let s = a + b + c;
        volume += d / 6.0;
        first += d / 24.0 * s;
        let own = a * a.transpose() + b * b.transpose() + c * c.transpose();
        second += d / 120.0 * (s * s.transpose() + own);
    }
    (volume, first / volume, second)
}

/// The planes of the triangles, each once.
fn faces(corners: &[Vector3<f64>], triangles: &[[u32; 3]]) -> Vec<(Vector3<f64>, f64)> {
    let mut faces: Vec<(Vector3<f64>, f64)> = Vec::new();
    for triangle in triangles {
        let [a, b, c] = triangle.map(|index| corners[index as usize]);
        let across = (b - a).cross(&(c - a));
        let length = across.norm();
        if length == 0.0 {
            continue;
        }
        let normal = across / length;
        if !faces.iter().any(|(known, _)| known.dot(&normal) > SAME_PLANE) {
            faces.push((normal, normal.dot(&a)));
        }
    }
    faces
}

/// Into parry's vector.
pub fn parry(v: &Vector3<f64>) -> ParryVector {
    ParryVector::new(v.x, v.y, v.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[allow(clippy::needless_pass_by_value)] // shapes are written where they are asked about
    fn of(shape: GrainShape) -> Arc<Solid> {
        Solid::new(&shape, 4e-3).unwrap()
    }

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-9 * b.abs()
    }

    #[test]
    fn a_box_has_the_volume_and_inertia_of_a_box() {
        let brick = of(GrainShape::Box { aspect: [1.0, 2.0, 3.0] });
        assert!(close(brick.volume, 6.0 * 64e-9));
        for (got, expected) in brick.inertia.iter().zip([13.0, 10.0, 5.0]) {
            assert!(close(*got, expected * 16e-6 / 12.0), "{got}");
        }
    }

    #[test]
    fn the_hull_of_a_box_is_the_box_in_its_principal_axes() {
        let corner = |n: usize| {
            let side = |axis: usize, half: f64| if n >> axis & 1 == 1 { half } else { -half };
            let turn = nalgebra::Rotation3::from_euler_angles(0.3, 0.5, -0.7);
            let at = turn * Vector3::new(side(0, 0.5), side(1, 1.0), side(2, 1.5));
            (at + Vector3::new(5.0, -2.0, 1.0)).into()
        };
        let points: Vec<[f64; 3]> = (0..8).map(corner).collect();
        let hull = of(GrainShape::Hull { points: points.clone() });
        // The longest extent of the points is not that of the box: the size is set by the points as they are.
        let scale = (hull.volume / 6.0).cbrt();
        let mut moments: Vec<_> = hull.inertia.iter().map(|m| 12.0 * m / scale.powi(2)).collect();
        moments.sort_by(f64::total_cmp);
        for (got, expected) in moments.iter().zip([5.0, 10.0, 13.0]) {
            assert!((got - expected).abs() < 1e-6, "{moments:?}");
        }
        assert_eq!((hull.corners.len(), hull.faces.len()), (8, 6));
        // Back where they were stated, in metres.
        let shape = GrainShape::Hull { points };
        for stated in shape.points(4e-3) {
            let back = |c: &Vector3<f64>| (hull.axes * c + hull.centre - stated).norm();
            assert!(hull.vertices(0).iter().map(back).fold(f64::MAX, f64::min) < 1e-12);
        }
        assert!((hull.axes.determinant() - 1.0).abs() < 1e-12);
        for (normal, distance) in &hull.faces {
            let farthest = hull.corners.iter().map(|c| c.dot(normal)).fold(f64::MIN, f64::max);
            assert!(close(farthest, *distance), "{farthest} {distance}");
        }
    }

    #[test]
    fn a_cylinder_has_the_inertia_of_a_cylinder() {
        let can = of(GrainShape::Cylinder { aspect: 1.5 });
        assert!(close(can.volume, std::f64::consts::PI * 4e-6 * 6e-3));
        assert!(close(can.inertia.y, 2e-6));
        assert!(close(can.inertia.x, 1e-6 + 3e-6));
    }

    #[test]
    fn heights_are_those_over_the_faces() {
        let can = of(GrainShape::Cylinder { aspect: 1.5 });
        let (height, normal) = can.height(&Vector3::new(0.0, 2e-3, 1e-3));
        assert!(close(height, -1e-3), "{height} {normal}");
        let (height, normal) = can.height(&Vector3::new(0.0, 1e-3, 3e-3));
        assert!(close(height, 1e-3) && normal == Vector3::z(), "{height} {normal}");
        let brick = of(GrainShape::Box { aspect: [1.0, 2.0, 3.0] });
        let (height, normal) = brick.height(&Vector3::new(1.9e-3, -3.9e-3, 5e-3));
        assert!((height + 1e-4).abs() < 1e-12 && normal != Vector3::z(), "{height} {normal}");
    }

    #[test]
    fn a_round_superquadric_is_nearly_a_ball() {
        let ball = of(GrainShape::Superquadric { aspect: [1.0; 3], exponents: [2.0, 2.0] });
        let volume = std::f64::consts::PI / 6.0 * 64e-9;
        // The hull of points on a ball lies inside of it: 146 of them leave out 5 %.
        assert!((ball.volume / volume - 0.95).abs() < 0.01, "{}", ball.volume / volume);
        let moments = ball.inertia / (0.4 * 4e-6);
        assert!(moments.iter().all(|m| (m - 0.96).abs() < 0.04), "{moments}");
    }
}
