//! Impacts within a substep: one after the other, each at its own time (docs/theory/contact.md, box 1).
//!
//! Between impacts grains move straight on, as in event-driven simulation. A pair that approaches faster than an impact
//! must (`ContactContext::impact_speed`) and meets before the substep ends collides, together with every contact that
//! is closed then (`impact/cluster.rs`); what is slower is left to the contact solve.

mod cluster;
mod friction;
mod links;
mod members;
mod rolling_spring;
mod spring;

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::contact::Candidate;
use crate::contact_context::ContactContext;
use crate::contacts::Contacts;
use crate::particles::Particles;

use cluster::{Cluster, Outcome};

/// Impacts of one grain in a substep, at most; what is left then is for the contact solve.
const MAX_IMPACTS: u32 = 1024;

/// Gap below which a grain has reached a wall that bends, in radii `[-]`.
const TOUCHES: f64 = 1e-4;

/// Candidates that a thread takes at once.
const SHARE: usize = if cfg!(test) { 4 } else { 512 };

/// What the impacts of a simulation have cost and taken.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImpactWork {
    /// Impacts resolved.
    pub impacts: usize,
    /// Of pairs that touched nothing.
    pub alone: usize,
    /// Closed contacts of all impacts.
    pub links: usize,
    /// Grains hit, in all impacts.
    pub grains_hit: usize,
    /// Micro-steps of all impacts.
    pub micro_steps: usize,
    /// Largest energy after an impact over that before, moving walls' work added to it `[-]`.
    pub largest_energy_ratio: f64,
}

impl ImpactWork {
    fn note(&mut self, outcome: &Outcome, grains_hit: usize) {
        self.impacts += 1;
        self.alone += usize::from(outcome.micro_steps == 0);
        self.links += outcome.links;
        self.grains_hit += grains_hit;
        self.micro_steps += outcome.micro_steps;
        self.largest_energy_ratio = self.largest_energy_ratio.max(outcome.energy_ratio);
    }
}

/// An impact to come.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Event {
    /// `[s]` into the substep.
    time: f64,
    pair: Candidate,
    /// Impacts that both had had when this one was foreseen.
    counts: [u32; 2],
}

impl Event {
    /// The impact of a pair, if there is one in this substep after `now`.
    fn next(
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

/// The impacts of a substep.
#[derive(Clone, Debug, Default)]
pub(crate) struct Impacts {
    /// What may be an impact in this substep.
    pub candidates: Vec<Candidate>,
    queue: BinaryHeap<Event>,
    foreseen: Vec<Event>,
    /// Work that walls have done in impacts since it was last asked for, per typical mass `[m^2/s^2]`.
    pub work_of_walls: f64,
    /// Impacts of each grain in this substep.
    counts: Vec<u32>,
    /// The grains with impacts.
    hit: Vec<u32>,
    partners: Vec<u32>,
    cluster: Cluster,
    /// What impacts have cost and taken so far.
    pub work: ImpactWork,
}

impl Impacts {
    /// Resolves the impacts that the candidates lead to, in the order of their times; returns their number.
    /// Leaves each grain that was hit where it was at its last impact (`Particles::clocks`).
    pub fn resolve(
        &mut self,
        particles: &mut Particles,
        contacts: &mut Contacts,
        around: &ContactContext,
    ) -> usize {
        self.counts.resize(particles.count(), 0);
        let foreseen = |candidates: &mut [Candidate], found: &mut Vec<Event>| {
            let event = |&mut pair| Event::next(pair, 0.0, [0; 2], particles, around);
            found.extend(candidates.iter_mut().filter_map(event));
        };
        let candidates = &mut self.candidates;
        around.threads.gather(candidates, SHARE, &mut self.foreseen, foreseen, |(), ()| ());
        self.queue.extend(self.foreseen.drain(..));
        let mut resolved = 0;
        while let Some(Event { time, pair, counts }) = self.queue.pop() {
            if counts != self.counts_of(pair) {
                continue;
            }
            if self.is_early(pair, time, particles, around) {
                continue;
            }
            let Some(outcome) = self.cluster.resolve(pair, time, particles, contacts, around)
            else {
                continue;
            };
            self.work.note(&outcome, self.cluster.hit.len());
            self.work_of_walls += outcome.work_of_walls;
            resolved += 1;
            let hit = std::mem::take(&mut self.cluster.hit);
            for &grain in &hit {
                let (number, grain) = (grain, grain as usize);
                if self.counts[grain] == 0 {
                    self.hit.push(number);
                }
                // What walls crush is not let go by more of the same in this substep.
                self.counts[grain] += if outcome.is_cut { MAX_IMPACTS } else { 1 };
                contacts.follow_after_impact(grain, time, particles, around);
            }
            for &grain in &hit {
                self.foresee_all(grain as usize, time, particles, contacts, around);
            }
            self.cluster.hit = hit;
        }
        self.candidates.clear();
        for grain in self.hit.drain(..) {
            self.counts[grain as usize] = 0;
        }
        resolved
    }

    /// Whether a wall that bends is not reached yet at the time that its first normal gave; the impact is then foreseen
    /// anew.
    fn is_early(
        &mut self,
        pair: Candidate,
        time: f64,
        particles: &Particles,
        around: &ContactContext,
    ) -> bool {
        let Some(surface) = (pair.partner as usize).checked_sub(particles.count()) else {
            return false;
        };
        let sphere = particles.sphere_at(pair.i as usize, time);
        let near = around.walls.nearest(surface, &sphere.vector(), time);
        let (gap, radius) = (near.distance - sphere.0[3], sphere.0[3]);
        let is_early = near.bends && gap > TOUCHES * radius;
        if is_early {
            self.foresee(pair, time, particles, around);
        }
        is_early
    }

    fn counts_of(&self, pair: Candidate) -> [u32; 2] {
        [pair.i, pair.partner].map(|n| self.counts.get(n as usize).copied().unwrap_or(0))
    }

    /// Foresees every next impact of a grain that has just had one.
    fn foresee_all(
        &mut self,
        grain: usize,
        now: f64,
        particles: &Particles,
        contacts: &Contacts,
        around: &ContactContext,
    ) {
        if self.counts[grain] >= MAX_IMPACTS {
            return;
        }
        self.partners.clear();
        self.partners.extend(contacts.partners(grain));
        for number in 0..self.partners.len() {
            let partner = self.partners[number];
            let pair = if (partner as usize) < grain {
                Candidate { i: partner, partner: grain as u32 }
            } else {
                Candidate { i: grain as u32, partner }
            };
            self.foresee(pair, now, particles, around);
        }
    }

    /// Queues the impact of a pair, if there is one after `now`.
    fn foresee(
        &mut self,
        pair: Candidate,
        now: f64,
        particles: &Particles,
        around: &ContactContext,
    ) {
        self.queue.extend(Event::next(pair, now, self.counts_of(pair), particles, around));
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
