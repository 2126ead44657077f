//! Where bodies touch the edges of triangles: the side of a tray, the outlet of a hopper, the ridge of a wedge.
//!
//! With f(t) the height of an edge's point over the body's faces, negative inside, a convex function, the edge touches
//! where f is least: at its end, or where a face that falls along it meets one that rises. Between these two the normal
//! is at right angles to the edge. A face that lies along the edge touches it at both ends of what they share. An edge
//! in the body came in through a face into which its triangles do not lead: others are not asked.

use nalgebra::{UnitQuaternion, Vector3};

use super::around::Around;
use super::contact::Point;
use super::pose::Pose;
use crate::wall::Edge;
use granulcal_scene::Solid;

/// A face along which an edge rises less than this lies along it `[-]`.
const SHALLOW: f64 = 0.2;
/// What of an edge is in a face is told to this, in the body's reach `[-]`.
const WITHIN: f64 = 1e-4;
/// The least of f is told to this, in the body's reach `[-]`.
const EXACT: f64 = 1e-9;
/// Faces that all but face each other have no normal between them `[-]`.
const OPPOSITE: f64 = 0.3;
/// A face that shares less of an edge than this, in the body's reach, has one point there `[-]`.
const SHORT: f64 = 0.1;
/// An edge that is deeper than this in a body, in its reach, under each face through which it can have come in, has not
/// come in through them `[-]`.
const DEEPEST: f64 = 0.1;
/// Of a polyhedron each step finds another face, of a cylinder they are Newton's.
const STEPS: usize = 40;

/// Adds the points of body `i` at all edges that are nearer than `range` `[m]` at `now` `[s]` into the substep. Returns
/// whether any may be so near.
pub(super) fn at_edges(
    around: &Around<'_>,
    body: &Pose,
    i: usize,
    (now, range): (f64, f64),
    found: &mut Vec<Point>,
) -> bool {
    let (solid, first, mut is_near) = (around.solid, found.len(), false);
    around.walls.edges(&body.centre, solid.reach + range, now, |name, wall, edge| {
        let centre = wall.stated_place(&body.centre, now);
        let into_body = body.turned.inverse() * wall.stated().inverse();
        let Some(seen) = Seen::new(solid, edge, (&centre, into_body), range) else { return };
        is_near = true;
        seen.touched(range, |gap, mark, face| {
            let point = Point::at_wall(i, name, wall, body, mark, -(body.axes * face), gap);
            // Edges that meet share their corner.
            if !found[first..].iter().any(|other| other.is_like(&point, solid.reach)) {
                found.push(point);
            }
        });
    });
    is_near
}

/// A part of an edge, in a body's axes.
struct Seen<'a> {
    solid: &'a Solid,
    edge: &'a Edge<'a>,
    /// From where the wall is stated.
    into_body: UnitQuaternion<f64>,
    begin: Vector3<f64>,
    along: Vector3<f64>,
    /// Which part of it the ball around the body can reach `[m]`.
    ends: [f64; 2],
}

/// The face that a point of an edge is highest over: a line below f.
#[derive(Clone, Copy)]
struct Line {
    at: f64,
    height: f64,
    slope: f64,
    face: Vector3<f64>,
}

impl Line {
    fn height_at(&self, at: f64) -> f64 {
        self.height + self.slope * (at - self.at)
    }
}

/// Where f is least.
struct Least {
    at: f64,
    gap: f64,
    /// Of the body, outward.
    normal: Vector3<f64>,
    /// Of the faces that meet there the one that lies more along the edge.
    along: Line,
    /// f over the gap: how the heights over a face fall along the normal.
    scale: f64,
}

impl Least {
    /// Over one face.
    fn of(line: Line) -> Self {
        Self { at: line.at, gap: line.height, normal: line.face, along: line, scale: 1.0 }
    }
}

impl<'a> Seen<'a> {
    /// None if the ball around the body and the edge are farther apart than `range`.
    fn new(
        solid: &'a Solid,
        edge: &'a Edge<'a>,
        (centre, into_body): (&Vector3<f64>, UnitQuaternion<f64>),
        range: f64,
    ) -> Option<Self> {
        let reach = solid.reach + range;
        let begin = into_body * (edge.from - centre);
        let along = into_body * edge.along;
        let middle = -begin.dot(&along);
        let half = (reach * reach - (begin + middle * along).norm_squared()).sqrt();
        let ends = [(middle - half).max(0.0), (middle + half).min(edge.length)];
        // Not a number if it is too far.
        let is_near = half > 0.0 && ends[0] < ends[1];
        is_near.then_some(Self { solid, edge, into_body, begin, along, ends })
    }

    fn line(&self, at: f64, admits: &impl Fn(&Vector3<f64>) -> bool) -> Line {
        let (height, face) = self.solid.height_over(&(self.begin + at * self.along), admits);
        Line { at, height, slope: face.dot(&self.along), face }
    }

    /// Whether a face of this outward normal may lie on the edge.
    fn holds(&self, normal: &Vector3<f64>) -> bool {
        self.edge.holds(&-(self.into_body.inverse() * normal))
    }

    /// Gives where the body is nearer to the edge than `range`: how far it is `[m]`, where on the body that is `[m]`,
    /// and its outward normal there; both in its own axes.
    fn touched(&self, range: f64, found: impl FnMut(f64, Vector3<f64>, Vector3<f64>)) {
        let any = |_: &Vector3<f64>| true;
        let least = self.least(&any);
        if least.gap > range.max(0.0) {
            return;
        }
        if self.holds(&least.normal) {
            self.touched_at(&least, range, &any, found);
        } else if least.gap < 0.0 {
            // What of it is in the body is nearer to another face than to that through which it came in.
            let admits = |normal: &Vector3<f64>| self.holds(normal);
            let least = self.least(&admits);
            if least.gap > -DEEPEST * self.solid.reach && self.holds(&least.normal) {
                self.touched_at(&least, range, &admits, found);
            }
        }
    }

    fn touched_at(
        &self,
        least: &Least,
        range: f64,
        admits: &impl Fn(&Vector3<f64>) -> bool,
        mut found: impl FnMut(f64, Vector3<f64>, Vector3<f64>),
    ) {
        let mut touch = |at: f64, gap: f64| {
            if gap <= range {
                found(gap, self.begin + at * self.along - gap * least.normal, least.normal);
            }
        };
        if least.along.slope.abs() > SHALLOW {
            let towards = -(self.into_body.inverse() * least.normal);
            let end = [0.0, self.edge.length].iter().position(|end| *end == least.at);
            if end.is_none_or(|end| self.edge.holds_at(end, &towards)) {
                touch(least.at, least.gap);
            }
            return;
        }
        let shared = self.ends.map(|end| self.end_of(&least.along, end, admits));
        if shared[1] - shared[0] < SHORT * self.solid.reach {
            touch(least.at, least.gap);
        } else {
            for at in shared {
                touch(at, least.along.height_at(at) / least.scale);
            }
        }
    }

    /// Where f is least: by the lines below it at both sides, which close in on it.
    fn least(&self, admits: &impl Fn(&Vector3<f64>) -> bool) -> Least {
        let [mut left, mut right] = self.ends.map(|end| self.line(end, admits));
        if left.slope >= 0.0 {
            return Least::of(left);
        }
        if right.slope <= 0.0 {
            return Least::of(right);
        }
        let mut at = left.at;
        for _ in 0..STEPS {
            let rise = right.height_at(0.0) - left.height_at(0.0);
            at = (rise / (left.slope - right.slope)).clamp(left.at, right.at);
            let middle = self.line(at, admits);
            if middle.slope == 0.0 {
                return Least::of(middle);
            }
            if middle.height - left.height_at(at) <= EXACT * self.solid.reach {
                break;
            }
            *(if middle.slope < 0.0 { &mut left } else { &mut right }) = middle;
        }
        let along = if left.slope.abs() < right.slope { left } else { right };
        let height = along.height_at(at);
        let share = right.slope / (right.slope - left.slope);
        let between = share * left.face + (1.0 - share) * right.face;
        let scale = between.norm();
        if scale < OPPOSITE {
            return Least::of(Line { at, height, ..along });
        }
        Least { at, gap: height / scale, normal: between / scale, along, scale }
    }

    /// How far towards an end of the edge a face is the highest: from there by Newton's steps, since f is convex.
    fn end_of(&self, face: &Line, end: f64, admits: &impl Fn(&Vector3<f64>) -> bool) -> f64 {
        let mut at = end;
        for _ in 0..STEPS {
            let line = self.line(at, admits);
            let above = line.height - face.height_at(at);
            if above <= WITHIN * self.solid.reach {
                break;
            }
            at -= above / (line.slope - face.slope);
        }
        at
    }
}
