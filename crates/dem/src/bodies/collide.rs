//! Where bodies touch each other and the walls: parry's manifolds between bodies, the nearest points of the body's own
//! corners at walls. The only file of this room that asks parry.

use nalgebra::{UnitQuaternion, Vector3};
use parry3d_f64::math::{Pose, Rotation};
use parry3d_f64::query::{ContactManifold, DefaultQueryDispatcher, PersistentQueryDispatcher as _};

use super::body::Moving;
use super::contact::{Point, WALL};
use crate::wall::Walls;
use granulcal_scene::Material;
use granulcal_scene::{Solid, parry};

/// Bodies look for each other at least so far, in their reach `[-]`.
const LEAST_MARGIN: f64 = 0.02;

/// Every point of contact that the next substep may close, in an order that depends on the places alone.
pub(super) fn points(
    solid: &Solid,
    bodies: &[Moving],
    walls: &Walls,
    material: &Material,
    dt: f64,
) -> Vec<Point> {
    let mut found = Vec::new();
    for i in 0..bodies.len() {
        at_walls(solid, bodies, i, walls, dt, &mut found);
    }
    let mut manifold = ContactManifold::<(), ()>::new();
    for (i, j) in near_pairs(solid, bodies, dt) {
        between(solid, bodies, (i, j), material, dt, &mut manifold, &mut found);
    }
    found
}

/// How far a body's points go in a substep relative to those of another, and a little more `[m]`.
fn margin(solid: &Solid, a: &Moving, b: Option<&Moving>, dt: f64) -> f64 {
    let apart = b.map_or(a.velocity, |b| a.velocity - b.velocity).norm();
    let turning = a.omega.norm() + b.map_or(0.0, |b| b.omega.norm());
    LEAST_MARGIN * solid.reach + dt * (apart + turning * solid.reach)
}

/// Pairs whose balls may meet, each once, in rising order: sweep along x.
fn near_pairs(solid: &Solid, bodies: &[Moving], dt: f64) -> Vec<(usize, usize)> {
    let mut order: Vec<usize> = (0..bodies.len()).collect();
    order.sort_by(|&a, &b| bodies[a].centre.x.total_cmp(&bodies[b].centre.x).then(a.cmp(&b)));
    let fastest = bodies.iter().map(|b| b.velocity.norm() + b.omega.norm() * solid.reach);
    let most = 2.0 * solid.reach * (1.0 + LEAST_MARGIN) + 2.0 * dt * fastest.fold(0.0, f64::max);
    let mut pairs = Vec::new();
    for (at, &i) in order.iter().enumerate() {
        for &j in &order[at + 1..] {
            let offset = bodies[j].centre - bodies[i].centre;
            if offset.x > most {
                break;
            }
            let range = 2.0 * solid.reach + margin(solid, &bodies[i], Some(&bodies[j]), dt);
            if offset.norm_squared() < range * range {
                pairs.push((i.min(j), i.max(j)));
            }
        }
    }
    pairs.sort_unstable();
    pairs
}

fn between(
    solid: &Solid,
    bodies: &[Moving],
    (i, j): (usize, usize),
    material: &Material,
    dt: f64,
    manifold: &mut ContactManifold<(), ()>,
    found: &mut Vec<Point>,
) {
    let (a, b) = (&bodies[i], &bodies[j]);
    let range = margin(solid, a, Some(b), dt);
    let back = a.turned.inverse();
    // In units of the reach.
    let offset = parry(&(back * (b.centre - a.centre) / solid.reach));
    let pose = Pose::from_parts(offset, rotation(&(back * b.turned)));
    // What a manifold remembers of the substep before would make the next depend on more than the state.
    *manifold = ContactManifold::new();
    let asked = DefaultQueryDispatcher.contact_manifold_convex_convex(
        &pose,
        solid.unit.as_ref(),
        solid.unit.as_ref(),
        None,
        None,
        range / solid.reach,
        manifold,
    );
    if asked.is_err() {
        return;
    }
    let of = |v: parry3d_f64::math::Vector| Vector3::new(v.x, v.y, v.z);
    let normal = -(a.turned * of(manifold.local_n1));
    for contact in &manifold.points {
        let gap = contact.dist * solid.reach;
        if gap > range {
            continue;
        }
        let mark = of(contact.local_p1) * solid.reach;
        let on_i = a.turned * mark;
        let on_j = b.turned * (of(contact.local_p2) * solid.reach);
        let middle = 0.5 * (a.centre + on_i + b.centre + on_j);
        let mut point = Point::new(i, j, 0, normal, gap);
        (point.arm_i, point.arm_j, point.mark) = (middle - a.centre, middle - b.centre, mark);
        (point.friction, point.restitution) = (material.sliding_friction, material.restitution);
        found.push(point);
    }
}

fn at_walls(
    solid: &Solid,
    bodies: &[Moving],
    i: usize,
    walls: &Walls,
    dt: f64,
    found: &mut Vec<Point>,
) {
    let body = &bodies[i];
    let range = margin(solid, body, None, dt);
    let back = body.turned.inverse();
    walls.reached(&body.centre, solid.reach + range, |surface| {
        let wall = walls.wall(surface);
        let mut touch = |mark: Vector3<f64>| {
            let arm = body.turned * mark;
            let near = walls.nearest(surface, &(body.centre + arm), 0.0);
            if near.distance > range {
                return;
            }
            // A corner that has come through a shell is on the other side of it than the centre.
            let from_wall = near.distance * near.normal - arm;
            let is_through = near.distance > 0.0 && from_wall.dot(&near.normal) < 0.0;
            let (gap, normal) = if is_through {
                (-near.distance, -near.normal)
            } else {
                (near.distance, near.normal)
            };
            let mut point = Point::new(i, WALL, surface, normal, gap);
            (point.arm_i, point.mark) = (arm, mark);
            point.wall_velocity = wall.motion_at(&(body.centre + arm)).0;
            (point.friction, point.restitution) =
                (wall.material.sliding_friction, wall.material.restitution);
            found.push(point);
        };
        let seen = walls.nearest(surface, &body.centre, 0.0);
        let towards = back * -seen.normal;
        solid.extremes(&towards, &mut touch);
        // A triangle that is not the nearest of its mesh to the centre does not tell on which side that is.
        if solid.round.is_some() && seen.distance.is_infinite() {
            solid.extremes(&-towards, &mut touch);
        }
    });
}

fn rotation(turned: &UnitQuaternion<f64>) -> Rotation {
    Rotation::from_xyzw(turned.i, turned.j, turned.k, turned.w)
}
