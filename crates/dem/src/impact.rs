//! Impacts within a substep: one after the other, each at its own time (docs/theory/contact.md, box 1).
//!
//! Between impacts grains move straight on, as in event-driven simulation. A pair that approaches faster than an impact
//! must (`ContactContext::impact_speed`) and meets before the substep ends collides, together with every contact that
//! is closed then (`impact/cluster.rs`); what is slower is left to the contact solve.

mod ahead;
mod cluster;
mod event;
mod friction;
mod links;
mod members;
mod rolling_spring;
mod spring;

use std::collections::BinaryHeap;

use crate::contact::Candidate;
use crate::contact_context::ContactContext;
use crate::contacts::Contacts;
use crate::particles::Particles;
use crate::partners::Partners;

use ahead::{Ahead, Room};
use cluster::{Cluster, Collision};
use event::Event;

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
    fn note(&mut self, collision: &Collision) {
        let outcome = &collision.outcome;
        self.impacts += 1;
        self.alone += usize::from(outcome.micro_steps == 0);
        self.links += outcome.links;
        self.grains_hit += collision.hit().len();
        self.micro_steps += outcome.micro_steps;
        self.largest_energy_ratio = self.largest_energy_ratio.max(outcome.energy_ratio);
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
    ahead: Ahead,
    room: Room,
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
        let before = self.work.impacts;
        if around.threads.are_several() && self.queue.len() >= ahead::MANY {
            let room = std::mem::take(&mut self.room);
            around.threads.rounds(
                (particles, contacts),
                |(particles, contacts), foretold| {
                    self.ahead.extend(foretold, &self.counts);
                    self.go_on(true, particles, contacts, around)
                },
                |(particles, contacts), event| room.foretell(event, particles, contacts, around),
            );
            self.room = room;
            self.ahead.clear();
        } else {
            self.go_on(false, particles, contacts, around);
        }
        self.candidates.clear();
        for grain in self.hit.drain(..) {
            self.counts[grain as usize] = 0;
        }
        self.work.impacts - before
    }

    /// Lets impacts happen until none is left, or the next one has to be foretold for it is one of many: returns those
    /// to foretell then.
    fn go_on(
        &mut self,
        foretells: bool,
        particles: &mut Particles,
        contacts: &mut Contacts,
        around: &ContactContext,
    ) -> Vec<Event> {
        while let Some(event) = self.queue.pop() {
            if self.is_past(&event) || self.is_early(&event, particles, around) {
                continue;
            }
            let collision = if self.ahead.holds(&event, &self.counts, contacts.listing()) {
                self.ahead.take(&event)
            } else {
                if foretells && self.queue.len() >= ahead::FEW {
                    let window = self.ahead.window();
                    if window > 1 {
                        return self.next_ones(event, window, contacts.listing());
                    }
                }
                self.cluster.collide(event.pair, event.time, particles, contacts, around)
            };
            self.ahead.note_turn();
            if let Some(collision) = collision {
                self.let_happen(&collision, event.time, particles, contacts, around);
            }
        }
        Vec::new()
    }

    /// Whether a grain of the pair has had an impact since this one was foreseen.
    fn is_past(&self, event: &Event) -> bool {
        event.counts != self.counts_of(event.pair)
    }

    /// This impact, and so many with those that come after it, as far as they are not foretold.
    fn next_ones(&mut self, first: Event, window: usize, listing: &Partners) -> Vec<Event> {
        let mut next = vec![first];
        next.extend((1..window).map_while(|_| self.queue.pop()));
        self.queue.extend(&next);
        next.retain(|event| {
            !self.is_past(event) && !self.ahead.holds(event, &self.counts, listing)
        });
        next
    }

    /// Lets an impact happen, and foresees what comes of it.
    fn let_happen(
        &mut self,
        collision: &Collision,
        time: f64,
        particles: &mut Particles,
        contacts: &mut Contacts,
        around: &ContactContext,
    ) {
        collision.happen(particles);
        self.work.note(collision);
        self.work_of_walls += collision.outcome.work_of_walls;
        for grain in collision.hit() {
            if self.counts[grain] == 0 {
                self.hit.push(grain as u32);
            }
            // What walls crush is not let go by more of the same in this substep.
            self.counts[grain] += if collision.outcome.is_cut { MAX_IMPACTS } else { 1 };
            contacts.follow_after_impact(grain, time, particles, around);
        }
        for grain in collision.hit() {
            self.foresee_all(grain, time, particles, contacts, around);
        }
    }

    /// Whether a wall that bends is not reached yet at the time that its first normal gave; the impact is then foreseen
    /// anew.
    fn is_early(
        &mut self,
        &Event { pair, time, .. }: &Event,
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
