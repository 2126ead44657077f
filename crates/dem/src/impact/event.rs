//! An impact to come: which pair meets, and when.

use std::cmp::Ordering;

use crate::contact::Candidate;
use crate::contact_context::ContactContext;
use crate::particles::Particles;

/// An impact to come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Event {
    /// `[s]` into the substep.
    pub time: f64,
    pub pair: Candidate,
    /// Impacts that both had had when this one was foreseen.
    pub counts: [u32; 2],
}

impl Event {
    /// The impact of a pair, if there is one in this substep after `now`.
    pub fn next(
        pair: Candidate,
        now: f64,
        counts: [u32; 2],
        particles: &Particles,
        around: &ContactContext,
    ) -> Option<Self> {
        let time = match other_grain(pair, particles) {
            Some(j) => time_of_pair(pair.i as usize, j, now, particles, around.impact_speed),
            None => time_at_wall(pair, now, particles, around),
        };
        let time = time.filter(|&time| time < around.settings.dt)?;
        Some(Self { time, pair, counts })
    }
}

impl Eq for Event {}

impl Ord for Event {
    /// Greatest is first: the earliest, then the lowest grains.
    fn cmp(&self, other: &Self) -> Ordering {
        let key = |event: &Self| (event.pair.i, event.pair.partner);
        other.time.total_cmp(&self.time).then_with(|| key(other).cmp(&key(self)))
    }
}

impl PartialOrd for Event {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

fn other_grain(pair: Candidate, particles: &Particles) -> Option<usize> {
    let j = pair.partner as usize;
    (j < particles.count()).then_some(j)
}

/// When two grains on their straight ways touch, at `least` so fast `[m/s]`: the root of `|d + w tau| = r_i + r_j`.
fn time_of_pair(i: usize, j: usize, now: f64, particles: &Particles, least: f64) -> Option<f64> {
    let (a, b) = (particles.sphere_at(i, now), particles.sphere_at(j, now));
    let apart = particles.nearest(a.vector() - b.vector());
    let relative = particles.velocity(i) - particles.velocity(j);
    let touching = a.0[3] + b.0[3];
    let closing = -apart.dot(&relative);
    if closing <= least * touching {
        return None;
    }
    let excess = apart.norm_squared() - touching * touching;
    if excess <= 0.0 {
        return Some(now);
    }
    let discriminant = closing * closing - relative.norm_squared() * excess;
    // At the touch the approach is the root of the discriminant over the distance of the centres.
    if discriminant <= (least * touching).powi(2) {
        return None;
    }
    Some(now + excess / (closing + discriminant.sqrt()))
}

/// When a grain touches a wall, on the parabola of which the substep is the chord.
fn time_at_wall(
    pair: Candidate,
    now: f64,
    particles: &Particles,
    around: &ContactContext,
) -> Option<f64> {
    let (grain, dt) = (pair.i as usize, around.settings.dt);
    let surface = pair.partner as usize - particles.count();
    let sphere = particles.sphere_at(grain, now);
    let near = around.walls.nearest(surface, &sphere.vector(), now);
    if near.distance.is_infinite() {
        return None;
    }
    let gap = near.distance - sphere.0[3];
    let touching = sphere.vector() - near.distance * near.normal;
    let w_n = near
        .normal
        .dot(&(particles.velocity(grain) - around.walls.wall(surface).motion_at(&touching).0));
    let fall = near.normal.dot(&around.gravity);
    if gap <= 0.0 {
        return (w_n + fall * (now - 0.5 * dt) < -around.impact_speed).then_some(now);
    }
    // gap + w_n tau - fall / 2 (time (dt - time) - now (dt - now)) = 0 for time = now + tau.
    let speed = -(w_n + fall * (now - 0.5 * dt));
    let discriminant = speed * speed - 2.0 * fall * gap;
    if discriminant <= around.impact_speed * around.impact_speed {
        return None;
    }
    let root = discriminant.sqrt();
    // Downhill the larger denominator is the earlier root; without one the wall is never reached.
    (speed + root > 0.0).then(|| now + 2.0 * gap / (speed + root))
}
