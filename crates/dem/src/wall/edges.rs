//! Edges of triangles where a mesh ends or bends, as faces of bodies that are not round meet them (`bodies/edges.rs`), and
//! which ways lead round them.

use nalgebra::Vector3;

use super::facets::Across;
use super::{Part, Wall, Walls};

/// A way that leads into a body by less than this leads along it, as a sine `[-]`: a face lies flat on an edge of what it
/// lies on, but for rounding.
const ALONG: f64 = 0.02;

/// An edge where a mesh ends or bends, where its wall is stated.
pub(crate) struct Edge<'a> {
    /// Its begin `[m]`.
    pub from: Vector3<f64>,
    /// Unit.
    pub along: Vector3<f64>,
    /// `[m]`
    pub length: f64,
    /// From it into its own triangle, at right angles to it.
    inwards: Vector3<f64>,
    /// What else has it.
    across: &'a [Across],
    /// Directions in which edges leave its begin and its end.
    leaving: [&'a [Vector3<f64>]; 2],
}

impl<'a> Edge<'a> {
    pub(super) fn new(
        [from, to]: [Vector3<f64>; 2],
        third: Vector3<f64>,
        across: &'a [Across],
        leaving: [&'a [Vector3<f64>]; 2],
    ) -> Self {
        let length = (to - from).norm();
        let along = (to - from) / length;
        let inwards = (third - from) - (third - from).dot(&along) * along;
        Self { from, along, length, inwards, across, leaving }
    }

    /// Whether a thing that lies towards `normal` of the edge touches it and not a triangle beside it: into each of them
    /// the way leads off it.
    pub fn holds(&self, normal: &Vector3<f64>) -> bool {
        let others = self.across.iter().map(|other| &other.inwards);
        others.chain([&self.inwards]).all(|into| leads_off(normal, into))
    }

    /// The same of its begin or its end, and of what leaves them.
    pub fn holds_at(&self, end: usize, normal: &Vector3<f64>) -> bool {
        self.leaving[end].iter().all(|into| leads_off(normal, into))
    }
}

fn leads_off(normal: &Vector3<f64>, into: &Vector3<f64>) -> bool {
    normal.dot(into) <= ALONG * into.norm()
}

/// How a way leads to the other side of a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Led {
    /// Through it, through another of its mesh that does not see its end, or through one of another wall that goes on
    /// there.
    Through,
    /// Round the end of its mesh.
    Round,
    /// Through another of its mesh that has the end before it, or so near to an edge that the edge tells.
    Elsewhere,
}

impl Walls {
    /// Calls `found` for every edge of a wall's triangles that may be nearer to a place than `range` `[m]` at `now` `[s]`
    /// into the substep, with the number after all surfaces and rims that the edges of its wall have in common.
    pub fn edges(
        &self,
        place: &Vector3<f64>,
        range: f64,
        now: f64,
        mut found: impl FnMut(usize, &Wall, &Edge<'_>),
    ) {
        for (number, wall) in self.all.iter().enumerate() {
            let Some(facets) = &wall.facets else { continue };
            let name = self.surfaces() + self.rims.len() + number;
            facets.reached(&wall.stated_place(place, now), range, |facet| {
                facets.sharp_edges(facet).for_each(|edge| found(name, wall, &edge));
            });
        }
    }

    /// Whether a place is nearest to an edge or a corner of a triangle where its mesh ends or bends.
    pub fn is_sharp_at(&self, surface: usize, place: &Vector3<f64>, now: f64) -> bool {
        let (_, wall, number) = self.found(surface);
        let Part::Triangle(facets, number) = wall.part(number) else { return false };
        facets.is_sharp_at(number, &wall.stated_place(place, now))
    }

    /// How the way from one place to another, at `now` `[s]` into a substep, that ends on the other side of a triangle leads
    /// there. What crosses its plane nearer to it than `least` `[m]` has not surely gone round.
    pub fn way(&self, surface: usize, [from, to]: [&Vector3<f64>; 2], now: f64, least: f64) -> Led {
        let (owner, wall, number) = self.found(surface);
        let Part::Triangle(facets, number) = wall.part(number) else { return Led::Through };
        let seen = |wall: &Wall| [from, to].map(|x| wall.stated_place(x, now));
        let [begin, end] = seen(wall);
        let Some((beside, place)) = facets.crossed_beside(number, &begin, &end) else {
            // The way begins in its plane.
            return Led::Elsewhere;
        };
        if beside == 0.0 {
            return Led::Through;
        }
        let (mut is_through, mut is_told) = (false, beside < least);
        for (other, wall) in self.all.iter().enumerate() {
            let Some(facets) = &wall.facets else { continue };
            let [from, to] = seen(wall);
            facets.crossed(&from, &to, |number, crossing| {
                let goes_on = || ((crossing - from).norm() - (place - begin).norm()).abs() < least;
                if other == owner || goes_on() {
                    is_through = true;
                    is_told |= other == owner && facets.nearest(number, &to).side != 0;
                }
            });
        }
        match (is_through, is_told) {
            (true, false) => Led::Through,
            (false, false) => Led::Round,
            (_, true) => Led::Elsewhere,
        }
    }
}
