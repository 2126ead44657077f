//! How the velocities of a sheet change in a step: what they carry with them, the pressure, the edge to dry ground,
//! and, implicitly, the ground and the grains.
//!
//! Of the changes a of all circles at once,
//!
//! ```text
//! (m + dt m f + S + drag) a = m (carried - holds - g dh/dr) - m f u - what grains take
//! ```
//!
//! with m the volume that has a circle's velocity, f the ground's friction and S the mass of what sinks as it spreads.

use super::drag::{Dragged, Held, drag};
use super::flow::RadialFlow;
use super::ground::{DRY, Ground};
use super::rows::Rows;
use super::solids::Solids;

/// Share of a ring that anything may cross in a step `[-]`.
const COURANT: f64 = 0.4;
/// Steps in a call, at most: what is faster than that is no flow.
const MOST_STEPS: usize = 64;

/// What flows at a circle; nothing where the mass is 0.
#[derive(Clone, Copy, Debug, Default)]
struct Circle {
    /// Volume over 2 pi times a ring's width squared `[m]`.
    mass: f64,
    /// Share of it that is open below a tube.
    open: f64,
    /// Its acceleration but by pressure, ground and grains `[m/s^2]`.
    own: f64,
    /// What the slope of the head adds `[m/s^2]`.
    driven: f64,
    /// Rate at which the ground takes its velocity `[1/s]`.
    taken: f64,
}

/// Lets `flow` go on for `dt` `[s]` over the ground, between `solids` and past the grains that it drags.
pub(super) fn advance(
    flow: &mut RadialFlow,
    solids: &Solids,
    ground: &Ground,
    dragged: &mut [Dragged],
    dt: f64,
) {
    let mut left = dt;
    for step in (0..MOST_STEPS).rev() {
        flow.make_room();
        let heights = flow.heights(solids);
        let of = |(ring, &h): (usize, &f64)| ground.head(h, solids.top(ring));
        let heads: Vec<_> = heights.iter().enumerate().map(of).collect();
        let deepest = heights.iter().copied().fold(0.0, f64::max);
        let fastest = flow.speed.iter().map(|u| u.abs()).fold(0.0, f64::max);
        let fastest = fastest + ground.wave(deepest);
        let longest = COURANT * flow.ring / fastest.max(f64::MIN_POSITIVE);
        let dt = if step == 0 { left } else { left.min(longest) };
        accelerate(flow, (&heights, &heads), ground, dragged, dt);
        flow.move_on(&heights, ground, dt);
        left -= dt;
        if left <= 0.0 {
            return;
        }
    }
}

/// Changes the velocities of `flow` and of the grains that it drags within `dt`, and says what pressure did.
fn accelerate(
    flow: &mut RadialFlow,
    (heights, heads): (&[f64], &[f64]),
    ground: &Ground,
    dragged: &mut [Dragged],
    dt: f64,
) {
    let (fluxes, old) = (flow.fluxes(heights, ground), flow.speed.clone());
    let count = flow.thickness.len();
    let mut circles = vec![Circle::default(); count];
    for (at, circle) in circles.iter_mut().enumerate().skip(1) {
        *circle = circle_at(flow, at, &fluxes, (heights, heads), ground, dt).unwrap_or_default();
    }
    let mass: Vec<_> = circles.iter().map(|circle| circle.mass).collect();
    let open: Vec<_> = circles.iter().map(|circle| circle.open).collect();
    let mut rows = Rows::new(count);
    for (at, circle) in circles.iter().enumerate() {
        rows.add(at, at, circle.mass * (1.0 + dt * circle.taken));
        rows.acts[at] = circle.mass * (circle.own + circle.driven - circle.taken * old[at]);
    }
    sink(flow, &mut rows, heights, ground, (&mass, &old), dragged, dt);
    drag(&mut rows, (&mass, &open, &old), dragged, dt);
    let gained = rows.solve(&mass);
    flow.pressure = vec![0.0; count + 1];
    for (at, circle) in circles.iter().enumerate() {
        let flows = circle.mass > 0.0;
        flow.speed[at] = if flows { old[at] + dt * gained[at] } else { 0.0 };
        if flows {
            flow.pressure[at] = gained[at] - circle.own + circle.taken * flow.speed[at];
        }
    }
    for one in dragged {
        for (at, given) in one.follow(&mass, [&old, &flow.speed], dt) {
            flow.pressure[at] -= open[at] * given / mass[at];
        }
    }
}

/// What flows at a circle, if anything does.
fn circle_at(
    flow: &RadialFlow,
    at: usize,
    fluxes: &[f64],
    (heights, heads): (&[f64], &[f64]),
    ground: &Ground,
    dt: f64,
) -> Option<Circle> {
    let (q_in, q_out) = (flow.thickness[at - 1], flow.thickness[at]);
    let gap = ground.gap_at(at);
    if gap <= 0.0 || (q_in < DRY && q_out < DRY) {
        return None;
    }
    let share = RadialFlow::middle(at - 1) * q_in + RadialFlow::middle(at) * q_out;
    // Below a tube that is what passes it.
    let mean = share / (2.0 * at as f64);
    let open = (gap / mean).min(1.0);
    let mean = mean * open;
    // What comes in on either side brings the velocity that it has there.
    let u = &flow.speed;
    let middle = |ring: usize| 0.5 * (fluxes[ring] + fluxes[ring + 1]);
    let gained =
        middle(at - 1).max(0.0) * (u[at - 1] - u[at]) - middle(at).min(0.0) * (u[at + 1] - u[at]);
    let carried = gained / (at as f64 * mean * flow.ring);
    let driven = -ground.gravity * (heads[at] - heads[at - 1]) / flow.ring;
    // The edge to dry ground holds a sheet back, and never drives it.
    let is_edge = q_in < DRY || q_out < DRY;
    let outwards = if q_out < DRY { 1.0 } else { -1.0 };
    let holds = ground.gravity * ground.puddle.powi(2) / (2.0 * mean * flow.ring);
    let own = if is_edge { carried - outwards * holds } else { carried };
    if is_edge && outwards * (u[at] + dt * (own + driven)) <= 0.0 {
        return None;
    }
    let deep = 0.5 * (heights[at - 1] + heights[at]);
    let taken = friction(u[at], mean, deep, ground.viscosity);
    Some(Circle { mass: at as f64 * mean, open, own, driven, taken })
}

/// What spreads sinks: the energy of the motion down is q h^2 / 6 (div u)^2 over an area, and grains that it sinks past
/// hold it up.
fn sink(
    flow: &RadialFlow,
    rows: &mut Rows,
    heights: &[f64],
    ground: &Ground,
    (mass, old): (&[f64], &[f64]),
    dragged: &[Dragged],
    dt: f64,
) {
    let held = Held::of(dragged, mass, old, dt);
    for (ring, &height) in heights.iter().enumerate() {
        // D(u) in a ring is the sum of these parts of both its circles.
        let part = |at: usize| {
            let open = (ground.gap_at(at) / heights[ring.min(at)].max(DRY)).min(1.0);
            let flows = mass.get(at).is_some_and(|&mass| mass > 0.0);
            if flows { open * at as f64 / (RadialFlow::middle(ring) * flow.ring) } else { 0.0 }
        };
        let around = [(ring, -part(ring)), (ring + 1, part(ring + 1))];
        let around = || around.into_iter().filter(|(_, part)| *part != 0.0);
        let volume = RadialFlow::middle(ring) * flow.thickness[ring];
        let sinks = volume * height.powi(2) / 3.0;
        let rate = if volume > 0.0 { held.rate[ring] / volume } else { 0.0 };
        let past: f64 = around().map(|(at, part)| part * held.slip[at]).sum();
        for (at, part) in around() {
            rows.acts[at] -= sinks * rate * part * past;
            for (other, its) in around() {
                rows.add(at, other, sinks * part * its * (1.0 + dt * rate * held.stays[other]));
            }
        }
    }
}

/// Rate at which the ground takes velocity from a sheet of mean thickness `q` up to `deep` `[1/s]`.
fn friction(speed: f64, q: f64, deep: f64, viscosity: f64) -> f64 {
    let (speed, q, deep) = (speed.abs(), q.max(DRY), deep.max(DRY));
    // 24 / Re, without a division by a speed of zero.
    let laminar = 3.0 * viscosity / (deep * deep);
    if viscosity == 0.0 {
        return 0.0;
    }
    let reynolds = q * speed / viscosity;
    let blasius = 0.223 / 8.0 * reynolds.max(f64::MIN_POSITIVE).powf(-0.25) * speed / deep;
    laminar.max(blasius)
}

#[cfg(test)]
mod tests;
