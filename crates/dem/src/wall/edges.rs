//! Which edges of triangles are near, and which ways lead round them.

use nalgebra::Vector3;

use super::edge::Edge;
use super::{Part, Wall, Walls};

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
    /// Calls `found` for every edge of a wall's triangles that may be nearer to a place than `range` `[m]` at `now`
    /// `[s]` into the substep, with the number after all surfaces and rims that the edges of its wall have in common.
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

    /// How the way from one place to another, at `now` `[s]` into a substep, that ends on the other side of a triangle
    /// leads there. What crosses its plane nearer to it than `least` `[m]` has not surely gone round.
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
