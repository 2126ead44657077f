//! The contacts of a list: in which batch each is, what it carries over from the list before.
//!
//! The contacts of a block are coloured so that those of a batch share no grain. Impulses are carried from list to
//! list by the pair's indices.

mod check;

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::blocks::Blocks;
use crate::body::Body;
use crate::contact::{Batch, ContactKey, ContactLaw, LawLanes, WallLanes};
use crate::lanes::LANES;

/// Colours that a grain's mask can distinguish; contacts beyond them get a batch of their own.
const COLOURS: usize = 63;
/// Appended batches that are searched for a free lane.
const APPEND_LOOK_BACK: usize = 8;

/// What the second body of every contact of a set is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum BodyKind {
    /// A grain.
    #[default]
    Grain,
    /// A wall, and the resting body.
    RestingWall,
    /// A wall that may move, and a body of the contact's own that stands for it.
    MovingWall,
    /// A soft layer on a wall that rests, and the resting body.
    SoftLayer,
}

/// Where the coefficients of the contacts of a list come from.
pub(crate) enum Laws<F> {
    /// All are alike.
    One(ContactLaw),
    /// Each has its own.
    Each(F),
}

/// All contacts of a kind (pairs of grains, or grains at walls), block after block and in it colour after colour.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct ContactSet {
    pub batches: Vec<Batch>,
    pub laws: Vec<LawLanes>,
    /// The batches of each block.
    pub parts: Vec<Range<usize>>,
    /// Parts that share no grain, phase after phase.
    pub phases: Vec<Range<usize>>,
    /// One for each batch at walls, none for pairs.
    pub at_walls: Vec<WallLanes>,
    /// Grains; every index in a batch is at most this, the resting body's, but for those of moving walls.
    grains: usize,
    second: BodyKind,
    /// Batches that were coloured; those after them hold contacts that were appended.
    coloured: usize,
    /// The contact law behind each entry of `laws`, if all its lanes share one.
    uniform: Vec<Option<ContactLaw>>,
    #[serde(skip)]
    carried: Vec<Carried>,
    #[serde(skip)]
    carried_starts: Vec<u32>,
    #[serde(skip)]
    ordered: Vec<ContactKey>,
    #[serde(skip)]
    masks: Vec<u64>,
    #[serde(skip)]
    colour_of: Vec<u8>,
}

/// What a contact hands on to the next list.
#[derive(Clone, Copy, Debug)]
struct Carried {
    partner: u32,
    lambda_n: f64,
    lambda_t: [f64; 3],
    lambda_r: [f64; 3],
    side: i8,
}

impl ContactSet {
    /// Number of contacts.
    pub fn len(&self) -> usize {
        self.batches.iter().map(|batch| batch.used as usize).sum()
    }

    /// Whether the second body of every contact is a wall.
    pub fn is_at_walls(&self) -> bool {
        !self.at_walls.is_empty()
    }

    /// Whether each contact has a body of its own that stands for a moving wall.
    pub fn has_wall_bodies(&self) -> bool {
        self.second == BodyKind::MovingWall
    }

    /// Whether its contacts give way.
    pub fn is_soft(&self) -> bool {
        self.second == BodyKind::SoftLayer
    }

    /// Bodies that stand for moving walls.
    pub fn wall_bodies(&self) -> usize {
        if self.has_wall_bodies() { LANES * self.batches.len() } else { 0 }
    }

    /// The body that stands for the wall of a contact.
    fn wall_body(&self, number: usize, lane: usize) -> u32 {
        let own = if self.has_wall_bodies() { 1 + number * LANES + lane } else { 0 };
        (self.grains + own) as u32
    }

    /// Every lane in use, as batch and lane.
    pub fn lanes(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let batches = self.batches.iter().enumerate();
        batches.flat_map(|(number, batch)| batch.lanes().map(move |lane| (number, lane)))
    }

    /// Whether the kernels, which index without looking, may be let loose on these bodies.
    pub fn fits(&self, bodies: &[Body]) -> bool {
        bodies.len() > self.grains + self.wall_bodies()
    }

    /// Replaces the list: puts the contacts of each block into batches, colour after colour, and hands the impulses
    /// on.
    ///
    /// `second` says what `partner` means.
    pub fn rebuild(
        &mut self,
        listed: &[ContactKey],
        blocks: &Blocks,
        grains: usize,
        second: BodyKind,
        laws: &Laws<impl Fn(&ContactKey) -> ContactLaw>,
    ) {
        self.collect_carried(grains);
        let at_walls = second != BodyKind::Grain;
        self.second = second;
        self.grains = grains;
        self.masks.resize(grains, 0);
        self.batches.clear();
        self.at_walls.clear();
        self.parts.clear();
        self.phases.clear();
        self.laws.clear();
        self.uniform.clear();
        if let Laws::One(law) = laws {
            // The entry that an empty batch names.
            self.laws.push(LawLanes::uniform(law));
            self.uniform.push(Some(*law));
        }
        let mut ordered = std::mem::take(&mut self.ordered);
        let starts = blocks.sort(listed, !at_walls, &mut ordered);
        for phase in blocks.phases() {
            let first = self.parts.len();
            for block in phase {
                let contacts = &ordered[starts[block]..starts[block + 1]];
                if !contacts.is_empty() {
                    self.add_part(contacts, at_walls, laws);
                }
            }
            if self.parts.len() > first {
                self.phases.push(first..self.parts.len());
            }
        }
        self.ordered = ordered;
        self.coloured = self.batches.len();
    }

    /// Appends the batches of one block.
    fn add_part(
        &mut self,
        contacts: &[ContactKey],
        at_walls: bool,
        laws: &Laws<impl Fn(&ContactKey) -> ContactLaw>,
    ) {
        let begin = self.batches.len();
        self.colour(contacts, at_walls);
        let mut next = self.lay_out(at_walls);
        self.parts.push(begin..self.batches.len());
        for (index, contact) in contacts.iter().enumerate() {
            let colour = self.colour_of[index] as usize;
            let slot = next[colour];
            next[colour] += if colour == COLOURS { LANES } else { 1 };
            let (number, lane) = (slot / LANES, slot % LANES);
            if let Laws::Each(law) = laws {
                self.set_law(number, lane, law(contact));
            }
            let j = if at_walls { self.wall_body(number, lane) } else { contact.partner };
            let batch = &mut self.batches[number];
            batch.used += 1;
            (batch.i[lane], batch.j[lane]) = (contact.i, j);
            if at_walls {
                self.at_walls[number].wall[lane] = contact.partner;
            }
            let range = self.carried_starts[contact.i as usize] as usize
                ..self.carried_starts[contact.i as usize + 1] as usize;
            if let Some(old) = self.carried[range].iter().find(|c| c.partner == contact.partner) {
                batch.lambda_n.0[lane] = old.lambda_n;
                batch.lambda_t.set(lane, old.lambda_t);
                batch.lambda_r.set(lane, old.lambda_r);
                if at_walls {
                    self.at_walls[number].side[lane] = old.side;
                }
            }
        }
    }

    /// Adds one contact, without impulses, between two lists: into one of the last batches if it shares no
    /// grain with that, else into a new one. Appended contacts are solved after all others.
    pub fn append(&mut self, contact: ContactKey, at_wall: bool, law: ContactLaw) {
        let (i, j) = (contact.i, contact.partner);
        let fits = |batch: &Batch| {
            let mut lanes = batch.lanes();
            let shared = |lane: usize| {
                let grains = [batch.i[lane], batch.j[lane]];
                grains.contains(&i) || (!at_wall && grains.contains(&j))
            };
            (batch.used as usize) < LANES && !lanes.any(shared)
        };
        let first = self.coloured.max(self.batches.len().saturating_sub(APPEND_LOOK_BACK));
        let number = (first..self.batches.len()).find(|&n| fits(&self.batches[n]));
        let number = number.unwrap_or_else(|| {
            self.batches.push(Batch::empty(self.grains as u32));
            if at_wall {
                self.at_walls.push(WallLanes::default());
            }
            match self.parts.last_mut() {
                Some(last) if last.start == self.coloured => last.end += 1,
                _ => {
                    self.phases.push(self.parts.len()..self.parts.len() + 1);
                    self.parts.push(self.coloured..self.coloured + 1);
                }
            }
            self.batches.len() - 1
        });
        let lane = self.batches[number].used as usize;
        self.set_law(number, lane, law);
        let j = if at_wall { self.wall_body(number, lane) } else { j };
        let batch = &mut self.batches[number];
        batch.used += 1;
        (batch.i[lane], batch.j[lane]) = (i, j);
        // Until it is assembled it is open.
        batch.bias.0[lane] = f64::INFINITY;
        if at_wall {
            self.at_walls[number].wall[lane] = contact.partner;
        }
    }

    /// Gives a lane its coefficients. Batches of equal contacts share one entry of `laws`.
    fn set_law(&mut self, number: usize, lane: usize, law: ContactLaw) {
        let batch = &mut self.batches[number];
        if lane == 0 {
            // The latest entries only: with many laws a search would cost more than a copy saves.
            const LOOK_BACK: usize = 4;
            let recent = self.uniform.iter().rposition(|known| *known == Some(law));
            let shared = recent.filter(|&entry| entry + LOOK_BACK >= self.uniform.len());
            batch.law = shared.unwrap_or_else(|| {
                self.laws.push(LawLanes::uniform(&law));
                self.uniform.push(Some(law));
                self.laws.len() - 1
            }) as u32;
            return;
        }
        match self.uniform[batch.law as usize] {
            Some(known) if known == law => return,
            None => {}
            Some(_) => {
                let mut own = self.laws[batch.law as usize].clone();
                own.set(lane, &law);
                self.laws.push(own);
                self.uniform.push(None);
                batch.law = self.laws.len() as u32 - 1;
                return;
            }
        }
        self.laws[batch.law as usize].set(lane, &law);
    }

    /// Counting sort of what the old contacts hand on, by first grain.
    fn collect_carried(&mut self, grains: usize) {
        let at_walls = !self.at_walls.is_empty();
        self.carried_starts.clear();
        self.carried_starts.resize(grains + 2, 0);
        let worth = |b: &Batch, lane: usize| at_walls || b.lambda_n.0[lane] > 0.0;
        for batch in &self.batches {
            for lane in batch.lanes().filter(|&lane| worth(batch, lane)) {
                self.carried_starts[batch.i[lane] as usize + 2] += 1;
            }
        }
        for grain in 1..grains + 2 {
            self.carried_starts[grain] += self.carried_starts[grain - 1];
        }
        let total = self.carried_starts[grains + 1] as usize;
        let nothing = Carried {
            partner: u32::MAX,
            lambda_n: 0.0,
            lambda_t: [0.0; 3],
            lambda_r: [0.0; 3],
            side: 0,
        };
        self.carried.resize(total, nothing);
        for (number, batch) in self.batches.iter().enumerate() {
            let at_wall = self.at_walls.get(number);
            for lane in batch.lanes().filter(|&lane| worth(batch, lane)) {
                let slot = &mut self.carried_starts[batch.i[lane] as usize + 1];
                self.carried[*slot as usize] = Carried {
                    partner: at_wall.map_or(batch.j[lane], |at| at.wall[lane]),
                    lambda_n: batch.lambda_n.0[lane],
                    lambda_t: batch.lambda_t.get(lane),
                    lambda_r: batch.lambda_r.get(lane),
                    side: at_wall.map_or(0, |at| at.side[lane]),
                };
                *slot += 1;
            }
        }
    }

    /// Greedy colouring: the lowest colour that neither grain has yet.
    fn colour(&mut self, contacts: &[ContactKey], at_walls: bool) {
        let grains = |contact: &ContactKey| {
            let i = contact.i as usize;
            (i, if at_walls { i } else { contact.partner as usize })
        };
        for contact in contacts {
            let (i, j) = grains(contact);
            (self.masks[i], self.masks[j]) = (0, 0);
        }
        self.colour_of.clear();
        for contact in contacts {
            let (i, j) = grains(contact);
            let colour = ((self.masks[i] | self.masks[j]).trailing_ones() as usize).min(COLOURS);
            if colour < COLOURS {
                self.masks[i] |= 1 << colour;
                self.masks[j] |= 1 << colour;
            }
            self.colour_of.push(colour as u8);
        }
    }

    /// Makes room for the coloured contacts and returns the first slot of each colour.
    fn lay_out(&mut self, at_walls: bool) -> [usize; COLOURS + 1] {
        let mut counts = [0; COLOURS + 1];
        for &colour in &self.colour_of {
            counts[colour as usize] += 1;
        }
        let mut next = [0; COLOURS + 1];
        let mut batches = self.batches.len();
        for (colour, &count) in counts.iter().enumerate() {
            next[colour] = batches * LANES;
            batches += if colour == COLOURS { count } else { usize::div_ceil(count, LANES) };
        }
        self.batches.resize(batches, Batch::empty(self.grains as u32));
        self.at_walls.resize(if at_walls { batches } else { 0 }, WallLanes::default());
        next
    }
}

#[cfg(test)]
mod tests;
