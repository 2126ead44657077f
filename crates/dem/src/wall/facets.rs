//! A mesh as the solver sees it: a contact for each place where its distance to a grain is least nearby.
//!
//! A grain in a corner touches two faces, one on a flat wall touches one triangle of it. So each triangle reports its
//! nearest point if that is a local minimum of the distance over the whole mesh: inside the triangle it always is, on
//! an edge only if the distance does not fall into the triangle across, at a corner only if it falls along no edge that
//! leaves it. Of the triangles that share such an edge or corner the first reports it.
//!
//! The library's vectors are converted here and nowhere else.

use std::collections::HashMap;
use std::ops::Range;

use nalgebra::Vector3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::Vector as ParryVector;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};
use parry3d_f64::query::{PointQuery, PointQueryWithLocation};
use parry3d_f64::shape::{Triangle, TrianglePointLocation};

use super::edge::{Across, Edge};
use super::surface::crossing_of_plane;
use super::{Nearest, Passage};

/// Shares of a triangle and sines of angles that are zero but for rounding `[-]`.
const ROUNDING: f64 = 1e-9;
/// Triangles that bend by less than this at an edge lie flat there, as a sine `[-]`.
const FLAT: f64 = 1e-3;

/// Directions that are less than 60 degrees apart are one way, as a cosine `[-]`.
const SAME_WAY: f64 = 0.5;

/// The triangles of a mesh, in metres.
#[derive(Clone, Debug)]
pub(crate) struct Facets {
    all: Vec<Facet>,
    /// What lies across the edges, edge after edge.
    across: Vec<Across>,
    corners: Vec<Corner>,
    /// Directions in which edges leave the corners, corner after corner.
    leaving: Vec<Vector3<f64>>,
    tree: Bvh,
}

#[derive(Clone, Debug)]
struct Facet {
    triangle: Triangle,
    normal: Vector3<f64>,
    corners: [u32; 3],
    /// Edges AB, BC and CA into `Facets::across`.
    edges: [Range<u32>; 3],
    /// At which of them the mesh ends or bends.
    is_sharp: [bool; 3],
}

#[derive(Clone, Debug, Default)]
struct Corner {
    /// The first triangle that has it.
    owner: u32,
    /// Into `Facets::leaving`.
    leaving: Range<u32>,
    /// Whether the mesh ends or bends there.
    is_sharp: bool,
}

fn parry(v: &Vector3<f64>) -> ParryVector {
    ParryVector::new(v.x, v.y, v.z)
}

fn plain(v: ParryVector) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

impl Facets {
    /// The facets of `triangles`, each three of `vertices` `[m]`; every one has an area.
    pub fn new(vertices: &[Vector3<f64>], triangles: &[[u32; 3]]) -> Self {
        let mut at_edge: HashMap<[u32; 2], Vec<u32>> = HashMap::new();
        let mut at_corner = vec![Vec::new(); vertices.len()];
        for (number, &[a, b, c]) in triangles.iter().enumerate() {
            for edge in [[a, b], [b, c], [c, a]] {
                at_edge.entry(sorted(edge)).or_default().push(number as u32);
            }
            for corner in [a, b, c] {
                at_corner[corner as usize].push(number as u32);
            }
        }
        let mut across = Vec::new();
        let all: Vec<Facet> = triangles
            .iter()
            .enumerate()
            .map(|(number, &corners)| {
                let [a, b, c] = corners.map(|corner| vertices[corner as usize]);
                let [i, j, k] = corners;
                let edges = [[i, j], [j, k], [k, i]].map(|edge| {
                    let first = across.len() as u32;
                    for &other in &at_edge[&sorted(edge)] {
                        if other as usize != number {
                            let inwards = inwards(vertices, edge, triangles[other as usize]);
                            across.push(Across { facet: other, inwards });
                        }
                    }
                    first..across.len() as u32
                });
                let triangle = Triangle::new(parry(&a), parry(&b), parry(&c));
                let normal = (b - a).cross(&(c - a)).normalize();
                let is_sharp = [0, 1, 2].map(|edge: usize| {
                    let ends = [corners[edge], corners[(edge + 1) % 3]];
                    let Range { start, end } = edges[edge];
                    is_sharp(
                        &inwards(vertices, ends, corners),
                        &across[start as usize..end as usize],
                    )
                });
                Facet { triangle, normal, corners, edges, is_sharp }
            })
            .collect();
        let mut sharp_corners = vec![false; vertices.len()];
        for facet in &all {
            for edge in (0..3).filter(|&edge| facet.is_sharp[edge]) {
                for end in [edge, (edge + 1) % 3] {
                    sharp_corners[facet.corners[end] as usize] = true;
                }
            }
        }
        let mut leaving = Vec::new();
        let corners = at_corner
            .iter()
            .enumerate()
            .map(|(corner, users)| {
                let first = leaving.len() as u32;
                for &user in users {
                    for other in triangles[user as usize] {
                        if other as usize != corner {
                            leaving.push(vertices[other as usize] - vertices[corner]);
                        }
                    }
                }
                let owner = users.first().copied().unwrap_or_default();
                let is_sharp = sharp_corners[corner];
                Corner { owner, leaving: first..leaving.len() as u32, is_sharp }
            })
            .collect();
        let boxes = all.iter().map(|facet| facet.triangle.local_aabb()).enumerate();
        let tree = Bvh::from_iter(BvhBuildStrategy::Binned, boxes);
        Self { all, across, corners, leaving, tree }
    }

    /// Number of triangles.
    pub fn count(&self) -> usize {
        self.all.len()
    }

    /// The nearest point of one triangle, infinitely far if it is not one to touch, or another triangle's.
    pub fn nearest(&self, number: usize, centre: &Vector3<f64>) -> Nearest {
        let facet = &self.all[number];
        let (point, location) =
            facet.triangle.project_local_point_and_get_location(parry(centre), false);
        let offset = centre - plain(point.point);
        let (is_own, is_inside) = match location {
            TrianglePointLocation::OnEdge(edge, _) => {
                (self.owns_edge(number, edge, &offset), false)
            }
            TrianglePointLocation::OnVertex(corner) => {
                (self.owns_corner(number, corner, &offset), false)
            }
            TrianglePointLocation::OnFace(_, shares) => {
                (!self.is_on_edge_of_earlier(number, shares, &offset), true)
            }
            TrianglePointLocation::OnSolid => (true, true),
        };
        if !is_own {
            let normal = facet.normal;
            return Nearest { distance: f64::INFINITY, normal, side: 0, bends: false };
        }
        let distance = offset.norm();
        let normal = if distance > 0.0 { offset / distance } else { facet.normal };
        let height = offset.dot(&facet.normal);
        let side = if is_inside && height != 0.0 { height.signum() as i8 } else { 0 };
        Nearest { distance, normal, side, bends: !is_inside }
    }

    /// Whether what a triangle was to a place is gone on with by another, which lies towards `normal` of it: the place
    /// has left the one, and the nearest point of either lies the same way.
    pub fn is_left_to(&self, number: usize, normal: &Vector3<f64>, centre: &Vector3<f64>) -> bool {
        if self.nearest(number, centre).distance.is_finite() {
            return false;
        }
        let point = self.all[number].triangle.project_local_point(parry(centre), false).point;
        let offset = centre - plain(point);
        offset.dot(normal) > SAME_WAY * offset.norm()
    }

    /// The way from one place to another, if it goes through one triangle and ends behind an edge or a corner that the
    /// triangle shares with others, beyond them all.
    pub fn passed_at_edge(
        &self,
        number: usize,
        from: &Vector3<f64>,
        to: &Vector3<f64>,
    ) -> Option<Passage> {
        let facet = &self.all[number];
        let passage = self.passed(number, from, to)?;
        let (point, location) =
            facet.triangle.project_local_point_and_get_location(parry(to), false);
        let offset = to - plain(point.point);
        let is_behind = match location {
            TrianglePointLocation::OnEdge(edge, _) => {
                let across = self.across(number, edge);
                !across.is_empty() && across.iter().all(|other| !falls(&offset, &other.inwards))
            }
            TrianglePointLocation::OnVertex(corner) => {
                // The edges AB, BC and CA that end there.
                let mut ends = [corner, (corner + 2) % 3].into_iter();
                ends.all(|edge| !self.across(number, edge).is_empty())
                    && self.leaving(number, corner).iter().all(|edge| !falls(&offset, edge))
            }
            TrianglePointLocation::OnFace(..) | TrianglePointLocation::OnSolid => false,
        };
        is_behind.then_some(passage)
    }

    /// The way from one place to another, if it goes through one triangle.
    pub fn passed(&self, number: usize, from: &Vector3<f64>, to: &Vector3<f64>) -> Option<Passage> {
        let Facet { triangle, normal, .. } = &self.all[number];
        let crossing = parry(&crossing_of_plane(&plain(triangle.a), normal, from, to)?);
        let [begin, end] = [from, to].map(|x| (x - plain(triangle.a)).dot(normal));
        let size = (triangle.b - triangle.a).length() + (triangle.c - triangle.a).length();
        let is_through = triangle.distance_to_local_point(crossing, false) <= ROUNDING * size;
        let passage = Passage { depth: end.abs(), normal: begin.signum() * normal, beyond: None };
        is_through.then_some(passage)
    }

    /// Whether the point of a triangle that is nearest to a place is on an edge or a corner where the mesh ends or
    /// bends.
    pub fn is_sharp_at(&self, number: usize, place: &Vector3<f64>) -> bool {
        let facet = &self.all[number];
        match facet.triangle.project_local_point_and_get_location(parry(place), false).1 {
            TrianglePointLocation::OnEdge(edge, _) => facet.is_sharp[edge as usize],
            TrianglePointLocation::OnVertex(corner) => {
                self.corners[facet.corners[corner as usize] as usize].is_sharp
            }
            TrianglePointLocation::OnFace(..) | TrianglePointLocation::OnSolid => false,
        }
    }

    /// The edges of a triangle where the mesh ends or bends, but for those that an earlier triangle has.
    pub fn sharp_edges(&self, number: usize) -> impl Iterator<Item = Edge<'_>> {
        let facet = &self.all[number];
        let Triangle { a, b, c } = facet.triangle;
        let vertices = [a, b, c].map(plain);
        (0..3).filter_map(move |edge| {
            let across = self.across(number, edge as u32);
            let is_own = across.iter().all(|other| other.facet as usize > number);
            let next = (edge + 1) % 3;
            let leaving = [edge, next].map(|corner| self.leaving(number, corner as u32));
            let [from, to, third] = [edge, next, (edge + 2) % 3].map(|corner| vertices[corner]);
            (is_own && facet.is_sharp[edge]).then(|| Edge::new([from, to], third, across, leaving))
        })
    }

    /// How far from a triangle a way from one place to another crosses its plane, 0 in it `[m]`, and where; nothing if
    /// it does not but for rounding.
    pub fn crossed_beside(
        &self,
        number: usize,
        from: &Vector3<f64>,
        to: &Vector3<f64>,
    ) -> Option<(f64, Vector3<f64>)> {
        let Facet { triangle, normal, .. } = &self.all[number];
        let crossing = crossing_of_plane(&plain(triangle.a), normal, from, to)?;
        let distance = triangle.distance_to_local_point(parry(&crossing), false);
        let size = (triangle.b - triangle.a).length() + (triangle.c - triangle.a).length();
        Some((if distance > ROUNDING * size { distance } else { 0.0 }, crossing))
    }

    /// Calls `found` for every triangle through which a way from one place to another goes, with where.
    pub fn crossed(
        &self,
        from: &Vector3<f64>,
        to: &Vector3<f64>,
        mut found: impl FnMut(usize, Vector3<f64>),
    ) {
        let way = Aabb::new(parry(&from.inf(to)), parry(&from.sup(to)));
        for number in self.tree.intersect_aabb(&way) {
            let Facet { triangle, normal, .. } = &self.all[number as usize];
            let crossing = crossing_of_plane(&plain(triangle.a), normal, from, to);
            if let Some(crossing) = crossing
                && self.passed(number as usize, from, to).is_some()
            {
                found(number as usize, crossing);
            }
        }
    }

    /// Whether the distance at this edge falls into no triangle across, and none of them comes first.
    fn owns_edge(&self, number: usize, edge: u32, offset: &Vector3<f64>) -> bool {
        self.across(number, edge)
            .iter()
            .all(|across| across.facet as usize > number && !falls(offset, &across.inwards))
    }

    /// Whether a point inside the triangle, where it has these shares of A, B and C, is as well on an edge that an
    /// earlier triangle reports.
    fn is_on_edge_of_earlier(
        &self,
        number: usize,
        shares: [f64; 3],
        offset: &Vector3<f64>,
    ) -> bool {
        let [a, b, c] = shares.map(|share| share < ROUNDING);
        [c, a, b].into_iter().zip(&self.all[number].edges).any(|(is_on_edge, edge)| {
            let across = &self.across[edge.start as usize..edge.end as usize];
            let earlier =
                |other: &Across| (other.facet as usize) < number && !falls(offset, &other.inwards);
            is_on_edge && across.iter().any(earlier)
        })
    }

    /// Whether the distance at this corner falls along no edge, and no other triangle with it comes first.
    fn owns_corner(&self, number: usize, corner: u32, offset: &Vector3<f64>) -> bool {
        let owner = self.corners[self.all[number].corners[corner as usize] as usize].owner;
        owner as usize == number
            && self.leaving(number, corner).iter().all(|edge| !falls(offset, edge))
    }

    /// What lies across an edge of a triangle.
    fn across(&self, number: usize, edge: u32) -> &[Across] {
        let Range { start, end } = self.all[number].edges[edge as usize];
        &self.across[start as usize..end as usize]
    }

    /// Directions in which edges leave a corner of a triangle.
    fn leaving(&self, number: usize, corner: u32) -> &[Vector3<f64>] {
        let corner = &self.corners[self.all[number].corners[corner as usize] as usize];
        &self.leaving[corner.leaving.start as usize..corner.leaving.end as usize]
    }

    /// Whether a triangle is nearer than `range` `[m]`.
    pub fn may_reach(&self, number: usize, centre: &Vector3<f64>, range: f64) -> bool {
        self.all[number].triangle.distance_to_local_point(parry(centre), false) < range
    }

    /// Calls `found` for every triangle that is nearer than `range` `[m]`, in the order of their numbers.
    pub fn reached(&self, centre: &Vector3<f64>, range: f64, mut found: impl FnMut(usize)) {
        let (centre_there, half) = (parry(centre), ParryVector::splat(range));
        let around = Aabb::new(centre_there - half, centre_there + half);
        let mut numbers: Vec<u32> = self.tree.intersect_aabb(&around).collect();
        numbers.sort_unstable();
        for number in numbers {
            if self.may_reach(number as usize, centre, range) {
                found(number as usize);
            }
        }
    }
}

/// Whether the distance falls in this direction, by more than rounding.
fn falls(offset: &Vector3<f64>, direction: &Vector3<f64>) -> bool {
    offset.dot(direction) > ROUNDING * offset.norm() * direction.norm()
}

/// Whether a mesh ends or bends at an edge, from the ways into its triangles there.
fn is_sharp(inwards: &Vector3<f64>, across: &[Across]) -> bool {
    let [other] = across else { return true };
    let bend = (inwards.normalize() + other.inwards.normalize()).norm();
    bend > FLAT
}

fn sorted([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// From an edge into a triangle that has it, at right angles to the edge.
fn inwards(vertices: &[Vector3<f64>], [from, to]: [u32; 2], triangle: [u32; 3]) -> Vector3<f64> {
    let third = triangle.into_iter().find(|&corner| corner != from && corner != to);
    let [from, to] = [from, to].map(|corner| vertices[corner as usize]);
    let third = vertices[third.expect("three corners") as usize];
    let along = (to - from).normalize();
    let into = third - from;
    into - into.dot(&along) * along
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A cube from -1 to 1, seen from inside and outside.
    fn cube() -> Facets {
        let corner = |n: u32| {
            let bit = |at: u32| if n >> at & 1 == 1 { 1.0 } else { -1.0 };
            Vector3::new(bit(0), bit(1), bit(2))
        };
        let vertices: Vec<_> = (0..8).map(corner).collect();
        let faces =
            [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
        let triangles: Vec<[u32; 3]> =
            faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        Facets::new(&vertices, &triangles)
    }

    /// Distances of all contacts within `range` of a point, in ascending order.
    fn touched(facets: &Facets, centre: [f64; 3], range: f64) -> Vec<f64> {
        let centre = Vector3::from(centre);
        let mut distances = Vec::new();
        facets.reached(&centre, range, |number| {
            let near = facets.nearest(number, &centre);
            if near.distance < range {
                assert!((near.normal.norm() - 1.0).abs() < 1e-12);
                distances.push(near.distance);
            }
        });
        distances.sort_by(f64::total_cmp);
        distances
    }

    #[test]
    fn each_place_is_touched_once() {
        let cube = cube();
        let near = |expected: &[f64], centre| {
            let got = touched(&cube, centre, 0.5);
            assert_eq!(got.len(), expected.len(), "{centre:?} {got:?}");
            assert!(got.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{got:?}");
        };
        near(&[], [0.0, 0.1, 0.2]);
        near(&[0.1], [0.3, 0.2, -0.9]); // a face from inside
        near(&[0.1], [0.3, 0.3, -0.9]); // on the diagonal of the face, which two triangles share
        near(&[0.1], [0.3, 0.2, -1.1]); // and from outside
        near(&[0.1, 0.2], [0.9, 0.3, 0.8]); // in an edge from inside: two faces
        near(&[0.1, 0.2, 0.3], [0.9, 0.7, 0.8]); // in a corner: three
        near(&[0.1], [1.06, 0.2, 1.08]); // beyond an edge: the edge, once
        near(&[(3.0f64 * 0.01).sqrt()], [1.1, 1.1, -1.1]); // beyond a corner: the corner, once
    }

    proptest! {
        #[test]
        fn the_least_distance_is_that_of_all_triangles(centre in prop::array::uniform3(-1.6f64..1.6)) {
            let cube = cube();
            let point = Vector3::from(centre);
            let all = (0..cube.count()).map(|n| {
                cube.all[n].triangle.distance_to_local_point(parry(&point), false)
            });
            let least = all.fold(f64::INFINITY, f64::min);
            let got = touched(&cube, centre, 3.0);
            prop_assert!((got[0] - least).abs() < 1e-12, "{got:?} {least}");
            // Outside a convex body there is one nearest point.
            if point.amax() > 1.0 {
                let here = got.iter().filter(|d| **d < least + 1e-9).count();
                prop_assert_eq!(here, 1, "{:?}", got);
            }
        }
    }
}
