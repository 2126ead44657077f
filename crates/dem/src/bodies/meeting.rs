//! Where two bodies meet: what is asked, what boxes or parry answer, and the points of contact in it.

use nalgebra::Vector3;

use super::around::Around;
use super::contact::{Other, Point};

/// Two bodies, and how near they are to be for their points to be of interest `[m]`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asked {
    pub i: usize,
    pub j: usize,
    pub range: f64,
}

/// What is known of two bodies that are apart.
#[derive(Clone, Copy, Debug)]
pub(super) enum Nearest {
    /// The nearest points of the first and the second, and the direction from one to the other.
    Points([Vector3<f64>; 2], Vector3<f64>),
    /// They are farther apart than was asked.
    Farther,
}

/// Where two bodies are near each other.
#[derive(Clone, Debug, Default)]
pub(super) struct Meeting {
    /// Unit, from the first to the second.
    pub normal: Vector3<f64>,
    pub spots: Vec<Spot>,
}

/// Two places that face each other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    /// On the first body, in its own axes `[m]`.
    pub mark: Vector3<f64>,
    /// The same from its centre, in the scene's axes `[m]`.
    pub on_a: Vector3<f64>,
    /// On the second body, from its centre `[m]`.
    pub on_b: Vector3<f64>,
    /// `[m]`
    pub gap: f64,
}

impl Meeting {
    /// Gives the points of contact: half way between the two places of those that are near enough.
    pub fn points(&self, around: &Around<'_>, asked: &Asked, mut found: impl FnMut(Point)) {
        for spot in self.spots.iter().filter(|spot| spot.gap <= asked.range) {
            let aside = 0.5 * spot.gap * self.normal;
            let other = Other::Body { j: asked.j as u32, arm: spot.on_b - aside };
            let mut point = Point::new(asked.i, other, -self.normal, spot.gap);
            (point.arm, point.mark) = (spot.on_a + aside, spot.mark);
            (point.friction, point.restitution) =
                (around.material.sliding_friction, around.material.restitution);
            found(point);
        }
    }
}
