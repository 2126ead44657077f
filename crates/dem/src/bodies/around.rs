//! What bodies are of, what is around them in a substep, and how far they search for each other.

use super::corners::Corners;
use super::motion::Motion;
use crate::law::Small;
use crate::wall::Walls;
use granulcal_scene::{Material, Solid};
use nalgebra::Vector3;

/// Bodies search for each other at least so far, in their reach `[-]`.
const LEAST_MARGIN: f64 = 0.02;

/// What the bodies are of, and what is around them in a substep.
pub(super) struct Around<'a> {
    pub solid: &'a Solid,
    /// Of a polyhedron.
    pub corners: Option<&'a Corners>,
    pub walls: &'a Walls,
    pub material: &'a Material,
    pub dt: f64,
    /// By how much a point may close beyond its gap in a substep, as far as sweeps see to it `[m]`.
    pub may_close: f64,
    pub small: &'a Small,
}

impl Around<'_> {
    /// How far bodies search for each other at least `[m]`.
    pub fn least(&self) -> f64 {
        LEAST_MARGIN * self.solid.reach
    }

    /// How far walls that move go in a substep at a body that is here, at most `[m]`.
    pub fn way_of_walls(&self, centre: &Vector3<f64>) -> f64 {
        self.dt * self.walls.fastest_near(centre, self.solid.reach)
    }

    /// How far the points of a body go in a substep relative to those of another, and a little more `[m]`.
    pub fn range(&self, a: &Motion, b: Option<&Motion>) -> f64 {
        self.least() + self.dt * b.map_or_else(|| a.fastest(), |b| a.beside(b))
    }
}
