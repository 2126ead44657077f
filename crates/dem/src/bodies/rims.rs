//! Where bodies touch the rims of walls: the tip of a funnel, the edge between its cone and its stem, the edge of a
//! bowl.
//!
//! With f(p) the height of a point over the body's faces, negative inside, a rim touches at the point of its circle
//! where f is least. It counts if f grows into each of the rim's surfaces: else a corner of the body meets one of them
//! first.

use std::f64::consts::FRAC_PI_2;

use nalgebra::Vector3;

use super::around::Around;
use super::contact::Point;
use super::pose::Pose;
use crate::wall::{Rim, Wall, any_normal};
use granulcal_scene::Solid;

/// Angles that are tried within a part of the circle.
const SAMPLES: usize = 8;
/// Halvings of the interval about the least of them by golden section: each leaves 0.618 of it.
const NARROWINGS: usize = 24;
const GOLDEN: f64 = 0.618_033_988_749_895;

/// Adds the points of body `i` at all rims that are nearer than `range` `[m]` at `now` `[s]` into the substep: one in
/// each part of the circle, so that a face that lies on a rim has two or more. Returns whether any may be so near.
pub(super) fn at_rims(
    around: &Around<'_>,
    body: &Pose,
    i: usize,
    (now, range): (f64, f64),
    found: &mut Vec<Point>,
) -> bool {
    let mut is_near = false;
    for (count, (wall, rim)) in around.walls.rims().enumerate() {
        let first = found.len();
        let touch = |gap: f64, mark: Vector3<f64>, face: Vector3<f64>| {
            // After the surfaces, so that its points have a name of their own.
            let surface = around.walls.surfaces() + count;
            let normal = -(body.axes * face);
            let point = Point::at_wall(i, surface, wall, body, mark, normal, gap);
            // The least of two parts may be where they meet.
            if !found[first..].iter().any(|other| other.is_like(&point, around.solid.reach)) {
                found.push(point);
            }
        };
        is_near |= nearest(around.solid, body, (wall, rim), (now, range), touch);
    }
    is_near
}

/// Gives where a body is nearer to a rim than `range`: how far it is `[m]`, where on the body that is `[m]`, and the
/// outward normal of its face there; both in its own axes. Returns whether the ball around it is so near.
fn nearest(
    solid: &Solid,
    body: &Pose,
    (wall, rim): (&Wall, &Rim),
    (now, range): (f64, f64),
    mut found: impl FnMut(f64, Vector3<f64>, Vector3<f64>),
) -> bool {
    let reach = solid.reach + range;
    let centre = wall.stated_place(&body.centre, now);
    let offset = centre - rim.centre;
    let along = offset.dot(&rim.axis);
    let across = offset - along * rim.axis;
    let from_axis = across.norm();
    let aside = from_axis - rim.radius;
    if along * along + aside * aside > reach * reach {
        return false;
    }
    // The first direction is towards the body; on the axis any is.
    let is_aside = from_axis > 1e-9 * rim.radius;
    let first = if is_aside { across / from_axis } else { any_normal(&rim.axis) };
    let frame = [first, rim.axis.cross(&first)];
    let into_body = body.turned.inverse() * wall.stated().inverse();
    let height = |angle: f64| solid.height(&(into_body * (rim.at(&frame, angle)[0] - centre)));
    let mut part = |from: f64, to: f64| {
        let angle = least(from, to, |angle| height(angle).0);
        let (gap, face) = height(angle);
        let [place, outward] = rim.at(&frame, angle);
        if gap <= range && rim.holds(&outward, &-(into_body.inverse() * face)) {
            found(gap, into_body * (place - centre) - gap * face, face);
        }
    };
    // What of the circle is nearer to the line through the body and the axis than the reach, from outside.
    let share = reach / rim.radius;
    if share < 1.0 {
        part(share.asin(), 0.0);
        part(-share.asin(), 0.0);
    } else {
        let corner = |quarter: i32| f64::from(quarter) * FRAC_PI_2;
        (0..4).for_each(|quarter| part(corner(quarter), corner(quarter + 1)));
    }
    true
}

/// Where a function is least between two places: the first least of some samples, then golden section about it.
fn least(from: f64, to: f64, of: impl Fn(f64) -> f64) -> f64 {
    let step = (to - from) / SAMPLES as f64;
    let mut best = (from, of(from));
    for sample in 1..=SAMPLES {
        let place = from + sample as f64 * step;
        let value = of(place);
        if value < best.1 {
            best = (place, value);
        }
    }
    let (mut low, mut high) = (best.0 - step.abs(), best.0 + step.abs());
    for _ in 0..NARROWINGS {
        let inner = GOLDEN * (high - low);
        if of(high - inner) <= of(low + inner) {
            high = low + inner;
        } else {
            low = high - inner;
        }
    }
    let place = 0.5 * (low + high);
    // Where it is level the first sample stands.
    if of(place) < best.1 { place } else { best.0 }
}
