//! Where bodies touch each other and the walls: manifolds between bodies, the nearest points of the body's own corners
//! at walls.

use nalgebra::Vector3;

use super::around::Around;
use super::body::Moving;
use super::boxes;
use super::contact::Point;
use super::edges::at_edges;
use super::manifold::manifold;
use super::manifolds::Manifolds;
use super::meeting::{Asked, Meeting};
use super::motion::{Motion, Way};
use super::pairs::{Neighbours, Pair};
use super::pose::Pose;
use super::rims::at_rims;
use crate::wall::Led;
use granulcal_scene::Solid;

/// What may meet in a substep, and where.
pub(super) struct Contacts {
    /// Pairs whose balls may meet.
    pub pairs: Vec<Pair>,
    /// How each body was taken to move when they were found.
    pub motions: Vec<Motion>,
    /// How far each body is from all walls at least, as of pairs `[m]`.
    pub clear_of_walls: Vec<f64>,
    /// The ways of the bodies of which the ends have been looked at; none at first.
    pub examined: Vec<Way>,
    /// The numbers of points whose gaps were corrected by what was foreseen last.
    pub corrected: Vec<usize>,
    /// In the order of their names, which depends on the places alone; what is foreseen comes behind.
    pub points: Vec<Point>,
    /// Of the points in that order.
    pub manifolds: Manifolds,
    /// Deepest overlap at the begin of the substep `[m]`.
    pub deepest: f64,
}

/// Every point of contact that the next substep may close, as far as it can be seen where the bodies are.
/// `points` is a list of before, whose memory is used again.
pub(super) fn contacts(
    around: &Around<'_>,
    bodies: &[Moving],
    neighbours: &mut Neighbours,
    mut points: Vec<Point>,
) -> Contacts {
    points.clear();
    let motions: Vec<_> = bodies.iter().map(|body| Motion::of(body, around.solid.reach)).collect();
    let mut clear_of_walls = Vec::with_capacity(bodies.len());
    let (mut manifolds, mut deepest) = (Manifolds::default(), 0.0);
    for (i, Moving { pose, .. }) in bodies.iter().enumerate() {
        let first = points.len();
        let range = around.range(&motions[i], None) + around.way_of_walls(&pose.centre);
        let is_near = at_all_of_walls(around, pose, i, (0.0, range), &mut points);
        clear_of_walls.push(if is_near { f64::NEG_INFINITY } else { range });
        points[first..].sort_by_key(Point::name);
        manifolds.add(&points[first..]);
        deepest = depth_of(&points[first..], deepest);
    }
    let mut pairs = neighbours.near(around, bodies, &motions);
    let mut near = Vec::new();
    for (number, pair) in pairs.iter_mut().enumerate() {
        let Pair { i, j, range, .. } = *pair;
        // Most are given for what an impact may do to them, and are too far from each other as balls.
        if pair.clear <= range {
            pair.clear = clearance(around.solid, &bodies[i].pose, &bodies[j].pose);
        }
        if pair.clear <= range {
            pair.clear = range;
            near.push((Asked { i, j, range }, number));
        }
    }
    let (asked, numbers): (Vec<_>, Vec<_>) = near.into_iter().unzip();
    meet(
        around,
        |body| &bodies[body].pose,
        &asked,
        |number, meeting| {
            pairs[numbers[number]].clear = f64::NEG_INFINITY;
            let first = points.len();
            meeting.points(around, &asked[number], |point| points.push(point));
            manifolds.add(&points[first..]);
            deepest = depth_of(&points[first..], deepest);
        },
    );
    let (examined, corrected) = (Vec::new(), Vec::new());
    Contacts { pairs, motions, clear_of_walls, examined, corrected, points, manifolds, deepest }
}

/// The deepest overlap of the points, `least` at least `[m]`.
fn depth_of(points: &[Point], least: f64) -> f64 {
    points.iter().map(|point| -point.gap).fold(least, f64::max)
}

/// Gives, for each pair that may be as near as asked, its number and where it meets.
pub(super) fn meet<'p>(
    around: &Around<'_>,
    pose: impl Fn(usize) -> &'p Pose,
    asked: &[Asked],
    mut found: impl FnMut(usize, &Meeting),
) {
    if around.solid.is_box() {
        return boxes::meet(&around.solid.half_extents, pose, asked, found);
    }
    let mut meeting = Meeting::default();
    for (number, &Asked { i, j, range }) in asked.iter().enumerate() {
        if manifold(around, [pose(i), pose(j)], range, &mut meeting) {
            found(number, &meeting);
        }
    }
}

/// How far the boxes or cylinders around two bodies, along their own axes, are apart along the line between their
/// centres: no more than the bodies are `[m]`.
pub(super) fn clearance(solid: &Solid, a: &Pose, b: &Pose) -> f64 {
    let offset = b.centre - a.centre;
    let extent = |body: &Pose| {
        let local = body.seen(&offset);
        match solid.round {
            Some((radius, half)) => {
                radius * (local.x * local.x + local.z * local.z).sqrt() + half * local.y.abs()
            }
            None => local.abs().dot(&solid.half_extents),
        }
    };
    let square = offset.norm_squared();
    (square - extent(a) - extent(b)) / square.sqrt().max(f64::MIN_POSITIVE)
}

/// Adds the points of body `i` at the surfaces of walls, at their rims and at the edges of their triangles that are
/// nearer than `range` `[m]` at `now` `[s]` into the substep; returns whether any may be so near.
pub(super) fn at_all_of_walls(
    around: &Around<'_>,
    body: &Pose,
    i: usize,
    when: (f64, f64),
    found: &mut Vec<Point>,
) -> bool {
    at_walls(around, body, i, when, found)
        | at_rims(around, body, i, when, found)
        | at_edges(around, body, i, when, found)
}

/// Adds the points of body `i` at all surfaces that are nearer than `range` at `now` `[s]` into the substep; returns
/// whether any may be so near.
fn at_walls(
    around: &Around<'_>,
    body: &Pose,
    i: usize,
    (now, range): (f64, f64),
    found: &mut Vec<Point>,
) -> bool {
    let (solid, walls) = (around.solid, around.walls);
    let mut is_near = false;
    walls.reached(&body.centre, solid.reach + range, |surface| {
        is_near = true;
        let wall = walls.wall(surface);
        let mut touch = |mark: Vector3<f64>| {
            let arm = body.axes * mark;
            let near = walls.nearest(surface, &(body.centre + arm), now);
            let is_beyond = near.side == 0 && near.distance > 0.0;
            // Behind two surfaces that meet there it has come through one of them.
            if is_beyond {
                let corner = body.centre + arm;
                if let Some(passed) = walls.passed_at_end(surface, &body.centre, &corner, now) {
                    let (normal, gap) = (passed.normal, -passed.depth);
                    found.push(Point::at_wall(i, surface, wall, body, mark, normal, gap));
                    return;
                }
            }
            if near.distance.is_infinite() {
                return;
            }
            let corner = body.centre + arm;
            // Beyond the end of a shell or a disc it is its rim that touches, of triangles their edge.
            if is_beyond && (!wall.has_facets() || walls.is_sharp_at(surface, &corner, now)) {
                return;
            }
            // A corner that has come through a shell, and not round its end, is on the other side of it than the
            // centre.
            let from_wall = near.distance * near.normal - arm;
            let mut is_through = near.side != 0
                && near.distance > 0.0
                && from_wall.dot(&near.normal) < 0.0
                && !walls.leads_round(surface, &body.centre, &corner, now);
            if is_through && wall.has_facets() {
                match walls.way(surface, [&body.centre, &corner], now, around.least()) {
                    Led::Through => {}
                    Led::Round => is_through = false,
                    Led::Elsewhere => return,
                }
            }
            let (gap, normal) = if is_through {
                (-near.distance, -near.normal)
            } else {
                (near.distance, near.normal)
            };
            if gap <= range {
                found.push(Point::at_wall(i, surface, wall, body, mark, normal, gap));
            }
        };
        let seen = walls.nearest(surface, &body.centre, now);
        let towards = body.seen(&-seen.normal);
        solid.extremes(&towards, &mut touch);
        // A triangle that is not the nearest of its mesh to the centre does not tell on which side that is.
        if solid.round.is_some() && seen.distance.is_infinite() {
            solid.extremes(&-towards, &mut touch);
        }
    });
    is_near
}
