//! Where bodies touch each other and the walls: manifolds between bodies, the nearest points of the body's own corners at
//! walls.

use nalgebra::Vector3;

use super::around::Around;
use super::body::Moving;
use super::contact::{Point, WALL};
use super::manifold::manifold;
use super::rims::at_rims;
use granulcal_scene::Solid;

/// What goes farther than this within a substep is examined where it will be, too, in the least margin `[-]`.
const FORESEEN: f64 = 0.5;
/// Gaps of points that bodies turn past are corrected by no less than this, in their reach `[-]`.
const CORRECTED: f64 = 2e-3;

/// Pairs are sought so much farther than a body goes, for the impacts that make it faster, in its reach `[-]`.
const SLACK: f64 = 0.1;

/// Cells along an axis at most.
const MOST_CELLS: u64 = 1 << 21;

/// Velocity of a body, and how fast it turns its farthest points `[m/s]`.
type Motion = (Vector3<f64>, f64);

/// What may meet in a substep, and where.
pub(super) struct Contacts {
    /// Pairs whose balls may meet, in rising order.
    pairs: Vec<(usize, usize)>,
    /// How each body was taken to move when they were found.
    motions: Vec<Motion>,
    /// In the order of their rank, which depends on the places alone.
    pub points: Vec<Point>,
}

/// Every point of contact that the next substep may close, as far as it can be seen where the bodies are.
/// `points` is a list of before, whose memory is used again.
pub(super) fn contacts(around: &Around<'_>, bodies: &[Moving], mut points: Vec<Point>) -> Contacts {
    points.clear();
    for (i, body) in bodies.iter().enumerate() {
        let first = points.len();
        let range = around.range(body, None);
        at_walls(around, body, i, range, &mut points);
        at_rims(around, body, i, range, &mut points);
        points[first..].sort_by_key(Point::rank);
    }
    let pairs = near_pairs(around, bodies);
    for &(i, j) in &pairs {
        let range = around.range(&bodies[i], Some(&bodies[j]));
        if are_apart(around.solid, &bodies[i], &bodies[j], range) {
            continue;
        }
        touches(around, bodies, (i, j), range, |point| points.push(point));
    }
    Contacts { pairs, motions: motions(around, bodies), points }
}

impl Contacts {
    /// Adds the points at which bodies would lie in something at the end of the substep: a corner that swings in from
    /// elsewhere is none of those that are nearest at its begin. Returns whether there are any.
    pub fn foresee(&mut self, around: &Around<'_>, bodies: &[Moving]) -> bool {
        let known = self.points.len();
        let mut new = Vec::new();
        self.seek_farther(around, bodies);
        let later: Vec<_> = bodies.iter().map(|body| body.foreseen(around.dt)).collect();
        let is_far = |range: f64| range > (1.0 + FORESEEN) * around.least();
        for (i, body) in later.iter().enumerate() {
            if is_far(around.range(&bodies[i], None)) {
                at_walls(around, body, i, 0.0, &mut new);
                at_rims(around, body, i, 0.0, &mut new);
            }
        }
        for &(i, j) in &self.pairs {
            if is_far(around.range(&bodies[i], Some(&bodies[j])))
                && !are_apart(around.solid, &later[i], &later[j], 0.0)
            {
                touches(around, &later, (i, j), 0.0, |point| new.push(point));
            }
        }
        let (least, mut is_news) = (CORRECTED * around.solid.reach, false);
        for point in new {
            let point = point.foreseen(bodies, around.dt);
            let of_before = &self.points[..known];
            let first = of_before.partition_point(|known| known.rank() < point.rank());
            let same = (first..known)
                .take_while(|&number| of_before[number].rank() == point.rank())
                .find(|&number| of_before[number].is_like(&point, around.solid.reach));
            match same {
                // Its bodies turn so far that it gets there sooner than its velocity says.
                Some(number) if point.gap < self.points[number].gap - least => {
                    self.points[number].gap = point.gap;
                }
                Some(_) => continue,
                None => self.points.push(point),
            }
            is_news = true;
        }
        // Those of a manifold stay together.
        if self.points.len() > known {
            self.points.sort_by_key(Point::rank);
        }
        is_news
    }

    /// Finds the pairs anew if impacts have changed a body's motion so much that it may meet others.
    fn seek_farther(&mut self, around: &Around<'_>, bodies: &[Moving]) {
        let now = motions(around, bodies);
        let slack = SLACK * around.solid.reach / around.dt;
        let is_other = |(now, then): (&Motion, &Motion)| {
            (now.0 - then.0).norm() + (now.1 - then.1).max(0.0) > slack
        };
        if now.iter().zip(&self.motions).any(is_other) {
            self.pairs = near_pairs(around, bodies);
            self.motions = now;
        }
    }
}

fn motions(around: &Around<'_>, bodies: &[Moving]) -> Vec<Motion> {
    bodies.iter().map(|body| (body.velocity, body.omega.norm() * around.solid.reach)).collect()
}

/// Pairs whose balls may meet, each once, in rising order. Cells are as wide as no two balls that may meet are apart, and
/// are sorted: a row of them along z is one range.
fn near_pairs(around: &Around<'_>, bodies: &[Moving]) -> Vec<(usize, usize)> {
    let reach = around.solid.reach;
    let farthest = bodies.iter().map(|body| body.way(reach, around.dt)).fold(0.0, f64::max);
    let slack = 2.0 * SLACK * reach;
    let width = 2.0 * reach + around.least() + 2.0 * farthest + slack;
    let low = bodies.iter().fold(Vector3::repeat(f64::MAX), |low, body| low.inf(&body.centre));
    // Far beyond any scene all are of one cell, whose neighbours still have numbers.
    let cell_of = |body: &Moving| {
        let [x, y, z] = <[f64; 3]>::from((body.centre - low) / width)
            .map(|c| (c as u64).min(MOST_CELLS - 3) + 1);
        cell(x, y, z)
    };
    let mut cells: Vec<_> = bodies.iter().map(cell_of).zip(0_u32..).collect();
    cells.sort_unstable();
    let mut pairs = Vec::new();
    for (at, &(of_i, i)) in cells.iter().enumerate() {
        let body = &bodies[i as usize];
        let mut look = |slots: &[(u64, u32)], last: u64| {
            for &(_, j) in slots.iter().take_while(|slot| slot.0 <= last) {
                let other = &bodies[j as usize];
                let square = (other.centre - body.centre).norm_squared();
                if square > width * width {
                    continue;
                }
                let range = 2.0 * reach + around.range(body, Some(other)) + slack;
                if square < range * range {
                    pairs.push(u64::from(i.min(j)) << 32 | u64::from(i.max(j)));
                }
            }
        };
        // What comes after it in the order: its own row, and those ahead.
        look(&cells[at + 1..], of_i + 1);
        let (along_y, along_x) = (cell(0, 1, 0), cell(1, 0, 0));
        for row in
            [of_i + along_y, of_i + along_x - along_y, of_i + along_x, of_i + along_x + along_y]
        {
            let first = cells.partition_point(|slot| slot.0 < row - 1);
            look(&cells[first..], row + 1);
        }
    }
    pairs.sort_unstable();
    pairs.into_iter().map(|pair| ((pair >> 32) as usize, (pair & 0xffff_ffff) as usize)).collect()
}

/// The number of a cell: in the order of x, then y, then z.
fn cell(x: u64, y: u64, z: u64) -> u64 {
    (x * MOST_CELLS + y) * MOST_CELLS + z
}

/// Whether the boxes or cylinders around two bodies, along their own axes, are more than `range` apart along the line
/// between their centres.
fn are_apart(solid: &Solid, a: &Moving, b: &Moving, range: f64) -> bool {
    let offset = b.centre - a.centre;
    let extent = |body: &Moving| {
        let local = body.turned.inverse_transform_vector(&offset);
        match solid.round {
            Some((radius, half)) => radius * local.x.hypot(local.z) + half * local.y.abs(),
            None => local.abs().dot(&solid.half_extents),
        }
    };
    offset.norm_squared() - extent(a) - extent(b) > range * offset.norm()
}

/// Gives the points at which two bodies are nearer than `range`.
fn touches(
    around: &Around<'_>,
    bodies: &[Moving],
    (i, j): (usize, usize),
    range: f64,
    mut found: impl FnMut(Point),
) {
    let (solid, a, b) = (around.solid, &bodies[i], &bodies[j]);
    let Some(manifold) = manifold(solid, a, b, range) else { return };
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
        (point.friction, point.restitution) =
            (around.material.sliding_friction, around.material.restitution);
        found(point);
    }
}

fn at_walls(around: &Around<'_>, body: &Moving, i: usize, range: f64, found: &mut Vec<Point>) {
    let (solid, walls) = (around.solid, around.walls);
    let back = body.turned.inverse();
    walls.reached(&body.centre, solid.reach + range, |surface| {
        let wall = walls.wall(surface);
        let mut touch = |mark: Vector3<f64>| {
            let arm = body.turned * mark;
            let near = walls.nearest(surface, &(body.centre + arm), 0.0);
            // Beyond the end of a shell or a disc it is its rim that touches.
            let is_at_rim = near.side == 0 && near.distance > 0.0 && !wall.has_facets();
            if near.distance > range || is_at_rim {
                return;
            }
            // A corner that has come through a shell is on the other side of it than the centre.
            let from_wall = near.distance * near.normal - arm;
            let is_through =
                near.side != 0 && near.distance > 0.0 && from_wall.dot(&near.normal) < 0.0;
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
