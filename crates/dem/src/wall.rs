//! Walls as the solver sees them: distance and normal of the nearest point to a grain's centre.
//!
//! A frustum (cone or cylinder) is a thin shell of revolution. In the half plane through its axis and
//! the grain it is a straight segment, so the nearest point is the nearest point of a segment.

use nalgebra::Vector3;

use crate::scene::{Scene, Shape};
use crate::{Material, WallMaterial};

/// A wall with its resolved material.
#[derive(Clone, Debug)]
pub(crate) struct Wall {
    pub surface: Surface,
    pub material: Material,
}

/// The surfaces that the solver knows.
#[derive(Clone, Debug)]
pub(crate) enum Surface {
    /// The half space below a plane.
    Plane { point: Vector3<f64>, normal: Vector3<f64> },
    /// The shell of a truncated cone or cylinder.
    Frustum(Frustum),
}

/// A shell of revolution whose generator is a segment.
#[derive(Clone, Debug)]
pub(crate) struct Frustum {
    from: Vector3<f64>,
    axis: Vector3<f64>,
    radius_from: f64,
    /// The generator in the half plane (along the axis, away from it).
    generator: Vector2,
    /// Ball about the middle of the axis that holds the shell: a cheap first test.
    middle: Vector3<f64>,
    reach: f64,
}

type Vector2 = nalgebra::Vector2<f64>;

/// The nearest point of a wall.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Nearest {
    /// Distance from the grain's centre to the surface; negative below a plane `[m]`.
    pub distance: f64,
    /// Unit vector from the wall to the grain's centre.
    pub normal: Vector3<f64>,
    /// Which side of a shell's generator the centre is on, 0 beyond its ends; a change is a passage through the wall.
    pub side: i8,
}

impl Surface {
    /// The nearest point to `centre`.
    pub fn nearest(&self, centre: &Vector3<f64>) -> Nearest {
        match self {
            Self::Plane { point, normal } => {
                let distance = (centre - point).dot(normal);
                let side = if distance < 0.0 { -1 } else { 1 };
                Nearest { distance, normal: *normal, side }
            }
            Self::Frustum(shell) => shell.nearest(centre),
        }
    }

    /// Whether the surface may be nearer than `range` `[m]`; false only when it surely is not.
    pub fn may_reach(&self, centre: &Vector3<f64>, range: f64) -> bool {
        match self {
            Self::Plane { point, normal } => (centre - point).dot(normal) < range,
            Self::Frustum(shell) => {
                let reach = shell.reach + range;
                (centre - shell.middle).norm_squared() < reach * reach
                    && shell.nearest(centre).distance < range
            }
        }
    }
}

impl Frustum {
    fn new(from: Vector3<f64>, to: Vector3<f64>, radius_from: f64, radius_to: f64) -> Self {
        let length = (to - from).norm();
        let generator = Vector2::new(length, radius_to - radius_from);
        let reach = (0.5 * length).hypot(radius_from.max(radius_to));
        let middle = 0.5 * (from + to);
        Self { from, axis: (to - from) / length, radius_from, generator, middle, reach }
    }

    fn nearest(&self, centre: &Vector3<f64>) -> Nearest {
        let offset = centre - self.from;
        let along = offset.dot(&self.axis);
        let outward = offset - along * self.axis;
        let radius = outward.norm();
        // On the axis every direction is as near as any other: take one at right angles to it.
        let outward = if radius > 0.0 { outward / radius } else { any_normal(&self.axis) };

        let in_plane = Vector2::new(along, radius - self.radius_from);
        let share = in_plane.dot(&self.generator) / self.generator.norm_squared();
        let gap = in_plane - share.clamp(0.0, 1.0) * self.generator;
        let distance = gap.norm();
        let cross = self.generator.x * in_plane.y - self.generator.y * in_plane.x;
        let beyond_the_ends = share <= 0.0 || share >= 1.0;
        let side = if beyond_the_ends { 0 } else { cross.signum() as i8 };
        // A centre on the shell itself is pushed inwards.
        let inwards = Vector2::new(self.generator.y, -self.generator.x);
        let direction = if distance > 0.0 { gap / distance } else { inwards.normalize() };
        let normal = direction.x * self.axis + direction.y * outward;
        Nearest { distance, normal, side }
    }
}

fn any_normal(axis: &Vector3<f64>) -> Vector3<f64> {
    let other = if axis.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    axis.cross(&other).normalize()
}

/// Every wall of a scene, the ground first.
pub(crate) fn walls_of(scene: &Scene) -> Vec<Wall> {
    let ground = Shape::Plane { point: [0.0; 3], normal: [0.0, 0.0, 1.0] };
    let resolve = |shape: &Shape, material: &WallMaterial| Wall {
        surface: surface(shape),
        material: material.over(&scene.material),
    };
    let mut walls = vec![resolve(&ground, &scene.ground.material)];
    if let Some(funnel) = &scene.funnel {
        walls.extend(funnel.walls().iter().map(|wall| resolve(&wall.shape, &wall.material)));
    }
    walls.extend(scene.walls.iter().map(|wall| resolve(&wall.shape, &wall.material)));
    walls
}

fn surface(shape: &Shape) -> Surface {
    match *shape {
        Shape::Plane { point, normal } => {
            Surface::Plane { point: point.into(), normal: Vector3::from(normal).normalize() }
        }
        Shape::Cone { from, to, radius_from, radius_to } => {
            Surface::Frustum(Frustum::new(from.into(), to.into(), radius_from, radius_to))
        }
        Shape::Cylinder { from, to, radius } => {
            Surface::Frustum(Frustum::new(from.into(), to.into(), radius, radius))
        }
    }
}
