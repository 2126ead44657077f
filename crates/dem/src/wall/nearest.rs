//! What is asked of every surface: its nearest point to a place, and where a way goes through it.

use nalgebra::Vector3;

/// The nearest point of a wall.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Nearest {
    /// Distance from the grain's centre to the surface; negative below a plane `[m]`.
    pub distance: f64,
    /// Unit vector from the wall to the grain's centre.
    pub normal: Vector3<f64>,
    /// Which side of a shell's generator the centre is on, 0 beyond its ends; a change is a passage through the wall.
    pub side: i8,
    /// Whether the surface bends here, or ends: the distance then changes to second order with a motion across the
    /// normal.
    pub bends: bool,
}

/// A straight way through a wall.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Passage {
    /// How far its end is behind the surface, or what would go on beyond it there `[m]`.
    pub depth: f64,
    /// Unit, away from the surface on the side on which the way begins.
    pub normal: Vector3<f64>,
    /// The circle beyond which its end is, if it is beyond an end of the surface: centre and radius `[m]`.
    pub beyond: Option<(Vector3<f64>, f64)>,
}

/// A unit vector at right angles to an axis.
pub(crate) fn any_normal(axis: &Vector3<f64>) -> Vector3<f64> {
    let other = if axis.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    axis.cross(&other).normalize()
}
