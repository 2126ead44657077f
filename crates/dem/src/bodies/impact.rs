//! Impacts of bodies: one manifold after the other, each at its time.
//!
//! The plastic impact of a manifold, all its points that meet within the substep together, gives impulses lambda with
//! lambda . u_0 <= 0 and u_0 = u + W lambda. Restitution gives e lambda more, friction and all. With E the kinetic
//! energy,
//!
//! ```text
//! E_plastic = E + lambda . u_0 - lambda . W lambda / 2
//! E_after   = E_plastic + e lambda . u_0 + e^2 lambda . W lambda / 2  <=  E_plastic + lambda . W lambda / 2  <=  E:
//! ```
//!
//! no impact creates energy, whatever the shapes, and a single point without friction obeys Newton's law.

use nalgebra::Vector3;

use super::body::{Moving, product};
use super::contact::Point;
use super::manifolds::Manifold;
use super::motion::Motion;
use crate::law::Small;
use granulcal_scene::Solid;

/// Sweeps over the points of a manifold at most, and the change over the impulse at which they stand.
const SWEEPS: usize = 300;
const STANDS: f64 = 1e-9;
/// Impacts of a substep at most, over its manifolds: a cube between two others may be hit often.
const ROUNDS: usize = 8;
/// Points are no farther from a body's centre than this in its reach: half a gap aside of it `[-]`.
const FARTHEST: f64 = 2.0;

/// Resolves what meets within the substep faster than an impact must; returns the number of impacts, and what moving
/// walls have put in over the mass `[m^2/s^2]`.
pub(super) fn resolve(
    (manifolds, points): (&mut [Manifold], &[Point]),
    bodies: &mut [Moving],
    solid: &Solid,
    dt: f64,
    small: &Small,
) -> (usize, f64) {
    let (mut count, mut work) = (0, 0.0);
    // The round in which each body was hit last: what is not due stays so until a body of it is.
    let mut hit_in = vec![0; bodies.len()];
    let motions: Vec<_> =
        bodies.iter().map(|body| Motion::of(body, FARTHEST * solid.reach)).collect();
    for round in 1..=ROUNDS {
        let may_be_due = |manifold: &Manifold| {
            let (i, j) = (manifold.i(), manifold.j());
            if round == 1 {
                // Two that go side by side do not close fast, wherever they touch.
                manifold.is_news
                    && j.is_none_or(|j| motions[i].beside(&motions[j]) > small.impact_speed)
            } else {
                hit_in[i] + 1 == round || j.is_some_and(|j| hit_in[j] + 1 == round)
            }
        };
        let mut due: Vec<(f64, usize)> = manifolds
            .iter()
            .enumerate()
            .filter(|(_, manifold)| may_be_due(manifold))
            .filter_map(|(number, manifold)| {
                first_touch(&points[manifold.range()], bodies, dt, small).map(|time| (time, number))
            })
            .collect();
        if due.is_empty() {
            // None of them comes to be due before a body of it is hit again.
            for manifold in manifolds.iter_mut() {
                manifold.is_news = false;
            }
            break;
        }
        due.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (_, number) in due {
            let group = &points[manifolds[number].range()];
            // What has been hit meanwhile may be on its way out.
            if let Some(time) = first_touch(group, bodies, dt, small) {
                work += bounce(group, bodies, solid, [time, dt]);
                count += 1;
                hit_in[group[0].i()] = round;
                if let Some(j) = group[0].j() {
                    hit_in[j] = round;
                }
            }
        }
    }
    (count, work)
}

/// When the first of the points that are fast enough touches, if one does within the substep `[s]`; not before its
/// bodies were hit the last time.
fn first_touch(group: &[Point], bodies: &[Moving], dt: f64, small: &Small) -> Option<f64> {
    let since = group[0].last_hit(bodies);
    let of = |point: &Point| {
        let closing = -point.normal.dot(&point.velocity(bodies));
        if point.restitution <= 0.0 || closing <= small.impact_speed {
            return None;
        }
        let time = (point.gap_of_last_motion(bodies) / closing).max(since);
        (time < dt).then_some(time)
    };
    group.iter().filter_map(of).min_by(f64::total_cmp)
}

/// Lets a manifold's bodies bounce, whose points carry nothing yet, as they lie at that time: only there both take the
/// impulse at one place, and keep their angular momentum. Returns what a moving wall has put in.
fn bounce(group: &[Point], bodies: &mut [Moving], solid: &Solid, [time, dt]: [f64; 2]) -> f64 {
    let meets = |point: &Point| {
        point.gap_of_last_motion(bodies) <= -dt * point.normal.dot(&point.velocity(bodies))
    };
    let mut touching: Vec<_> = group.iter().copied().filter(meets).collect();
    let touched = [Some(group[0].i()), group[0].j()];
    let begun: Vec<_> = touched.into_iter().flatten().map(|body| (body, bodies[body])).collect();
    for (body, begun) in &begun {
        bodies[*body] = begun.at(time, solid);
    }
    for point in &mut touching {
        point.carry(|body| begun[usize::from(body != begun[0].0)].1.pose, |body| bodies[body].pose);
    }
    solve(&mut touching, bodies);
    let mut work = 0.0;
    for mut point in touching {
        point.impulse *= 1.0 + point.restitution;
        point.give(bodies, &point.impulse);
        work += point.work_of_wall();
    }
    for (body, mut begun) in begun {
        begun.was_hit(time, &bodies[body], solid);
        bodies[body] = begun;
    }
    work
}

/// Finds the impulses of a plastic impact of points between the same two: with the velocities of all at hand,
/// `u_l += W_lk lambda_k`.
fn solve(points: &mut [Point], bodies: &[Moving]) {
    let mut velocities: Vec<_> = points.iter().map(|point| point.velocity(bodies)).collect();
    let between = |(l, k): (&Point, &Point)| l.response(k, bodies);
    let all = |k| points.iter().map(move |l| (l, k));
    let responses: Vec<_> = points.iter().flat_map(all).map(between).collect();
    let count = points.len();
    let blocks: Vec<_> = (0..count).map(|k| points[k].block(&responses[k * count + k])).collect();
    for _ in 0..SWEEPS {
        let (mut changed, mut largest) = (0.0_f64, 0.0_f64);
        for ((k, point), block) in points.iter_mut().enumerate().zip(&blocks) {
            let change = point.solve(block, velocities[k]);
            if change != Vector3::zeros() {
                let of_k = &responses[k * count..(k + 1) * count];
                for (velocity, response) in velocities.iter_mut().zip(of_k) {
                    *velocity += product(response, &change);
                }
            }
            changed = changed.max(change.norm_squared());
            largest = largest.max(point.impulse.norm_squared());
        }
        if changed <= STANDS * STANDS * largest {
            break;
        }
    }
}
