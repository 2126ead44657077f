//! Impacts that threads work out ahead of their turn.
//!
//! What an impact does is decided by the grains that it looks at. As long as none of these has been hit since, and none
//! has got a new partner, it does what was foretold; else it is worked out again. So impacts happen one after the other
//! in the order of their times, with the same bits on any number of threads.

use std::collections::HashMap;
use std::sync::Mutex;

use super::cluster::{Cluster, Collision};
use super::event::Event;
use crate::contact::Candidate;
use crate::contact_context::ContactContext;
use crate::contacts::Contacts;
use crate::particles::Particles;
use crate::partners::Partners;

/// Impacts that are foretold at once, at most. The more, the more of them are overtaken by what others do before.
const MOST: usize = if cfg!(test) { 6 } else { 64 };
/// Impacts of a substep from which on threads are worth being called.
pub(super) const MANY: usize = if cfg!(test) { 4 } else { 128 };
/// Impacts to come below which threads are not worth their waiting for each other.
pub(super) const FEW: usize = if cfg!(test) { 2 } else { 16 };
/// Impacts after which two are foretold again where that had been for nothing.
const PAUSE: usize = if cfg!(test) { 3 } else { 32 };

/// An impact as the state was when it was foretold.
#[derive(Clone, Debug)]
pub(super) struct Foretold {
    pair: Candidate,
    /// `[s]` into the substep.
    time: f64,
    /// What it does, if the pair still closes fast enough.
    collision: Option<Collision>,
    /// The grains that it has looked at.
    seen: Vec<u32>,
    /// Partners that had been added to the list.
    added: usize,
}

/// Clusters for impacts that are worked out at the same time.
#[derive(Debug, Default)]
pub(super) struct Room(Mutex<Vec<Cluster>>);

impl Room {
    /// Works out an impact as if it were the next.
    pub fn foretell(
        &self,
        &Event { pair, time, .. }: &Event,
        particles: &Particles,
        contacts: &Contacts,
        around: &ContactContext,
    ) -> Foretold {
        let clusters = || self.0.lock().expect("no thread has panicked");
        let spare = clusters().pop();
        let mut cluster = spare.unwrap_or_default();
        let collision = cluster.collide(pair, time, particles, contacts, around);
        let is_grain = |&seen: &u32| (seen as usize) < particles.count();
        let seen = cluster.seen(contacts).filter(is_grain).collect();
        clusters().push(cluster);
        Foretold { pair, time, collision, seen, added: contacts.listing().added() }
    }
}

impl Clone for Room {
    /// Room is made when it is needed.
    fn clone(&self) -> Self {
        Self::default()
    }
}

/// The foretold impacts of a substep.
#[derive(Clone, Debug)]
pub(super) struct Ahead {
    /// Each with the impacts that the grains which it has looked at had had.
    of_pair: HashMap<Candidate, (Foretold, Vec<u32>)>,
    /// Impacts that are foretold at once now.
    window: usize,
    /// Those foretold in the last round, and what has had its turn since.
    told: usize,
    done: usize,
}

impl Default for Ahead {
    fn default() -> Self {
        Self { of_pair: HashMap::new(), window: MOST, told: 0, done: 0 }
    }
}

impl Ahead {
    pub fn clear(&mut self) {
        self.of_pair.clear();
        self.told = 0;
    }

    /// Notes that an impact has had its turn.
    pub fn note_turn(&mut self) {
        self.done += 1;
    }

    /// How many impacts to foretell now; 1 is none but the next. Where grains are close, as in a stem, most of them are
    /// overtaken: fewer then.
    pub fn window(&mut self) -> usize {
        if self.window > 1 {
            let is_for_nothing = 4 * self.done < 3 * self.told;
            let next = if is_for_nothing { self.window / 2 } else { 2 * self.window };
            self.window = next.min(MOST);
            self.done = 0;
        } else if self.done >= PAUSE {
            (self.window, self.told, self.done) = (2, 0, 0);
        }
        self.window
    }

    /// Notes what was foretold when grains had had so many impacts.
    pub fn extend(&mut self, foretold: Vec<Foretold>, counts: &[u32]) {
        let with_counts = |foretold: Foretold| {
            let had = foretold.seen.iter().map(|&grain| counts[grain as usize]).collect();
            (foretold.pair, (foretold, had))
        };
        self.told = foretold.len();
        self.of_pair.extend(foretold.into_iter().map(with_counts));
    }

    /// Whether what was foretold of an impact still holds.
    pub fn holds(&self, event: &Event, counts: &[u32], listing: &Partners) -> bool {
        self.of_pair.get(&event.pair).is_some_and(|(foretold, had)| {
            let as_then = |(&grain, &count): (&u32, &u32)| {
                let grain = grain as usize;
                counts[grain] == count && listing.has_all_since(grain, foretold.added)
            };
            foretold.time == event.time && foretold.seen.iter().zip(had).all(as_then)
        })
    }

    /// What was foretold of an impact.
    pub fn take(&mut self, event: &Event) -> Option<Collision> {
        self.of_pair.remove(&event.pair)?.0.collision
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fewer_are_foretold_where_they_are_overtaken() {
        let mut ahead = Ahead::default();
        let round = |ahead: &mut Ahead, turns: usize| {
            ahead.told = ahead.window;
            (0..turns).for_each(|_| ahead.note_turn());
            ahead.window()
        };
        assert_eq!(round(&mut ahead, MOST), MOST);
        assert_eq!(round(&mut ahead, 1), MOST / 2);
        while round(&mut ahead, 1) > 1 {}
        for _ in 1..PAUSE {
            assert_eq!(ahead.window(), 1);
            ahead.note_turn();
        }
        ahead.note_turn();
        assert_eq!(ahead.window(), 2);
        assert_eq!(round(&mut ahead, 2), 4);
    }

    #[test]
    fn what_is_foretold_holds_until_a_grain_that_it_saw_is_hit_or_gets_a_partner() {
        let pair = Candidate { i: 0, partner: 1 };
        let event = |time| Event { time, pair, counts: [0; 2] };
        let mut listing = Partners::default();
        listing.rebuild(4, |add| add(0, 1));
        listing.add(0, 3);
        let mut counts = vec![0, 0, 2, 0];
        let mut ahead = Ahead::default();
        let foretold = Foretold { pair, time: 0.5, collision: None, seen: vec![0, 1, 2], added: 1 };
        ahead.extend(vec![foretold], &counts);

        assert!(ahead.holds(&event(0.5), &counts, &listing));
        assert!(!ahead.holds(&event(0.4), &counts, &listing));
        counts[3] += 1;
        listing.add(3, 2);
        assert!(ahead.holds(&event(0.5), &counts, &listing), "of a grain that it has not seen");
        counts[2] += 1;
        assert!(!ahead.holds(&event(0.5), &counts, &listing), "hit");
        counts[2] -= 1;
        listing.add(2, 3);
        assert!(!ahead.holds(&event(0.5), &counts, &listing), "a new partner");
    }
}
