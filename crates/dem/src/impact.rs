//! Impacts within a substep: one pair after the other, each at its own time (docs/theory/contact.md, box 1).
//!
//! Between impacts grains move straight on, as in event-driven simulation. What approaches faster than
//! [`IMPACT_SPEED`] and meets before the substep ends is an impact with Newton's restitution; what is slower or
//! stays closed is left to the contact solve. Every impact takes energy, whatever its coefficients are.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use nalgebra::Vector3;

use crate::bed::Bed;
use crate::contact::{Candidate, ContactLaw};
use crate::contacts::Contacts;
use crate::law::{IMPACT_SPEED, INVERSE_INERTIA, TANGENTIAL_INERTIA};
use crate::material::Material;
use crate::surroundings::Surroundings;

/// Impacts of one grain in a substep, at most; what is left then is for the contact solve.
const MAX_IMPACTS: u32 = 1024;

/// Candidates that a thread takes at once.
const SHARE: usize = if cfg!(test) { 4 } else { 512 };

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
        bed: &Bed,
        around: &Surroundings,
    ) -> Option<Self> {
        let time = match other_grain(pair, bed) {
            Some(j) => time_of_pair(pair.i as usize, j, now, bed),
            None => time_at_wall(pair, now, bed, around),
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
}

impl Impacts {
    /// Resolves the impacts that the candidates lead to, in the order of their times; returns their number.
    /// Leaves each grain that was hit where it was at its last impact (`Bed::clocks`).
    pub fn resolve(
        &mut self,
        bed: &mut Bed,
        contacts: &mut Contacts,
        around: &Surroundings,
    ) -> usize {
        self.counts.resize(bed.count(), 0);
        let foreseen = |candidates: &mut [Candidate], found: &mut Vec<Event>| {
            let event = |&mut pair| Event::next(pair, 0.0, [0; 2], bed, around);
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
            let Some(work) = collide(pair, time, bed, around) else { continue };
            self.work_of_walls += work;
            resolved += 1;
            for grain in [pair.i, pair.partner] {
                let grain = grain as usize;
                if grain >= bed.count() {
                    continue;
                }
                if self.counts[grain] == 0 {
                    self.hit.push(grain as u32);
                }
                self.counts[grain] += 1;
                contacts.follow_after_impact(grain, time, bed, around);
                self.foresee_all(grain, time, bed, contacts, around);
            }
        }
        self.candidates.clear();
        for grain in self.hit.drain(..) {
            self.counts[grain as usize] = 0;
        }
        resolved
    }

    fn counts_of(&self, pair: Candidate) -> [u32; 2] {
        [pair.i, pair.partner].map(|n| self.counts.get(n as usize).copied().unwrap_or(0))
    }

    /// Foresees every next impact of a grain that has just had one.
    fn foresee_all(
        &mut self,
        grain: usize,
        now: f64,
        bed: &Bed,
        contacts: &Contacts,
        around: &Surroundings,
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
            self.foresee(pair, now, bed, around);
        }
    }

    /// Queues the impact of a pair, if there is one after `now`.
    fn foresee(&mut self, pair: Candidate, now: f64, bed: &Bed, around: &Surroundings) {
        self.queue.extend(Event::next(pair, now, self.counts_of(pair), bed, around));
    }
}

fn other_grain(pair: Candidate, bed: &Bed) -> Option<usize> {
    let j = pair.partner as usize;
    (j < bed.count()).then_some(j)
}

/// When two grains on their straight ways touch fast enough: the root of `|d + w tau| = r_i + r_j`.
fn time_of_pair(i: usize, j: usize, now: f64, bed: &Bed) -> Option<f64> {
    let (a, b) = (bed.place_at(i, now), bed.place_at(j, now));
    let apart = bed.nearest(a.vector() - b.vector());
    let relative = bed.velocity(i) - bed.velocity(j);
    let touching = a.0[3] + b.0[3];
    let closing = -apart.dot(&relative);
    if closing <= IMPACT_SPEED * touching {
        return None;
    }
    let excess = apart.norm_squared() - touching * touching;
    if excess <= 0.0 {
        return Some(now);
    }
    let discriminant = closing * closing - relative.norm_squared() * excess;
    // At the touch the approach is the root of the discriminant over the distance of the centres.
    if discriminant <= (IMPACT_SPEED * touching).powi(2) {
        return None;
    }
    Some(now + excess / (closing + discriminant.sqrt()))
}

/// When a grain touches a wall, on the parabola of which the substep is the chord.
fn time_at_wall(pair: Candidate, now: f64, bed: &Bed, around: &Surroundings) -> Option<f64> {
    let (grain, dt) = (pair.i as usize, around.settings.dt);
    let surface = pair.partner as usize - bed.count();
    let place = bed.place_at(grain, now);
    let near = around.walls.nearest(surface, &place.vector(), now);
    if near.distance.is_infinite() {
        return None;
    }
    let gap = near.distance - place.0[3];
    let touching = place.vector() - near.distance * near.normal;
    let w_n =
        near.normal.dot(&(bed.velocity(grain) - around.walls.wall(surface).motion_at(&touching).0));
    let fall = near.normal.dot(&around.gravity);
    if gap <= 0.0 {
        return (w_n + fall * (now - 0.5 * dt) < -IMPACT_SPEED).then_some(now);
    }
    // gap + w_n tau - fall / 2 (time (dt - time) - now (dt - now)) = 0 for time = now + tau.
    let speed = -(w_n + fall * (now - 0.5 * dt));
    let discriminant = speed * speed - 2.0 * fall * gap;
    if discriminant <= IMPACT_SPEED * IMPACT_SPEED {
        return None;
    }
    let root = discriminant.sqrt();
    // Downhill the larger denominator is the earlier root; without one the wall is never reached.
    (speed + root > 0.0).then(|| now + 2.0 * gap / (speed + root))
}

/// What a grain meets at the time of an impact.
struct Meeting {
    law: ContactLaw,
    material: Material,
    /// From the other to the grain.
    normal: Vector3<f64>,
    velocity: Vector3<f64>,
    spin: Vector3<f64>,
    /// What gravity adds to the approach between the middle of the substep, whose velocities we have, and now.
    falling: f64,
}

impl Meeting {
    fn with_grain(i: usize, j: usize, time: f64, bed: &Bed, around: &Surroundings) -> Self {
        let (a, b) = (bed.place_at(i, time), bed.place_at(j, time));
        let apart = bed.nearest(a.vector() - b.vector());
        let distance = apart.norm();
        Self {
            law: around.pair_law(bed, i, j),
            material: around.material,
            normal: if distance > 0.0 { apart / distance } else { Vector3::z() },
            velocity: bed.velocity(j),
            spin: bed.bodies[j].spin.vector(),
            falling: 0.0,
        }
    }

    /// `None` where the wall is not at hand: the grain's place at the foreseen time may be, by a rounding, past its edge.
    fn with_wall(
        i: usize,
        surface: usize,
        time: f64,
        bed: &Bed,
        around: &Surroundings,
    ) -> Option<Self> {
        let place = bed.place_at(i, time).vector();
        let law = around.wall_law(bed, i, surface);
        let (wall, near) =
            (around.walls.wall(surface), around.walls.nearest(surface, &place, time));
        if near.distance.is_infinite() {
            return None;
        }
        let normal = near.normal;
        let (velocity, omega) = wall.motion_at(&(place - near.distance * normal));
        let spin = bed.radius(i) * omega;
        Some(Self {
            law,
            material: wall.material,
            normal,
            // The contact sees the surface of its second body at v - n x w.
            velocity: velocity + normal.cross(&spin),
            spin,
            falling: normal.dot(&around.gravity) * (time - 0.5 * around.settings.dt),
        })
    }
}

/// Lets two collide at `time` if they still approach fast enough: Newton's restitution, Coulomb's friction
/// and rolling friction, each solved exactly in this order. If they do not, both stay as they are.
/// Returns the work of a moving wall per typical mass `[m^2/s^2]`.
fn collide(pair: Candidate, time: f64, bed: &mut Bed, around: &Surroundings) -> Option<f64> {
    let (i, other) = (pair.i as usize, other_grain(pair, bed));
    let meeting = if let Some(j) = other {
        Meeting::with_grain(i, j, time, bed, around)
    } else {
        Meeting::with_wall(i, pair.partner as usize - bed.count(), time, bed, around)?
    };
    let Meeting { law, material, normal, velocity, spin: spin_j, falling } = meeting;
    let ([c_i, c_j], [l_i, l_j]) = (law.inverse_mass, law.lever);
    let dv = bed.velocity(i) - velocity;
    let w_n = normal.dot(&dv);
    if w_n + falling >= -IMPACT_SPEED {
        return None;
    }
    bed.advance(i, time);
    if let Some(j) = other {
        bed.advance(j, time);
    }
    let a_n = c_i + c_j;
    let restitution = around.effects.restitution_at(material.restitution, -(w_n + falling));
    let lambda_n = -(1.0 + restitution) * (w_n + falling) / a_n;

    let spin_i = bed.bodies[i].spin.vector();
    let u_t = dv + normal.cross(&(spin_i + spin_j)) - w_n * normal;
    let a_t = TANGENTIAL_INERTIA * a_n;
    let lambda_t = -(1.0 + material.tangential_restitution) / a_t * u_t;
    let lambda_t = shorten(lambda_t, law.sliding_friction * lambda_n);
    let force = lambda_n * normal + lambda_t;
    let twist = INVERSE_INERTIA * normal.cross(&lambda_t);

    let rho = l_i * (spin_i - c_i * twist) - l_j * (spin_j - c_j * twist);
    let a_r = INVERSE_INERTIA * (l_i * l_i * c_i + l_j * l_j * c_j);
    let (about, limit) = (normal.dot(&rho), law.torsional_friction * lambda_n);
    let most = law.rolling_friction * lambda_n;
    let mut stopping = (about * normal - rho) / a_r;
    if law.rolling_speed > 0.0 {
        stopping *= most / (most + law.rolling_speed / a_r);
    }
    let rolling = shorten(stopping, most);
    // Not `clamp`, which panics at a NaN: what is not finite is for the health to see.
    let lambda_r = rolling + (-about / a_r).max(-limit).min(limit) * normal;
    let roll = INVERSE_INERTIA * lambda_r;

    let body = &mut bed.bodies[i];
    body.velocity.add(&(c_i * force));
    body.spin.add(&(c_i * (l_i * roll - twist)));
    if let Some(j) = other {
        let body = &mut bed.bodies[j];
        body.velocity.add(&(-c_j * force));
        body.spin.add(&(-c_j * (l_j * roll + twist)));
        return Some(0.0);
    }
    Some(force.dot(&(velocity - normal.cross(&spin_j))) + lambda_r.dot(&spin_j))
}

/// The vector, or the part of it that is as long as `limit`.
fn shorten(vector: Vector3<f64>, limit: f64) -> Vector3<f64> {
    let norm = vector.norm();
    if norm > limit { vector * (limit / norm) } else { vector }
}
