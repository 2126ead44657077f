//! Contacts in batches of [`LANES`], coloured so that the contacts of a colour share no grain.
//!
//! Between two searches the list of contacts is fixed; every substep refreshes gap, normal and bias of
//! each. Impulses live in the batches and are carried from list to list by the pair's indices.

mod check;

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::lanes::{LANES, Lanes, Lanes3};

/// Colours that a grain's mask can tell apart; contacts beyond them get a batch of their own.
const COLOURS: usize = 63;
/// Appended batches that are looked through for a free lane.
const APPEND_LOOK_BACK: usize = 8;

/// [`LANES`] contacts: geometry, law and impulses. Empty lanes refer to the resting body and have no compliance.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Batch {
    /// First grain of each contact.
    pub i: [u32; LANES],
    /// Second grain, or the resting body at a wall.
    pub j: [u32; LANES],
    /// Unit normal from `j` to `i`.
    pub normal: Lanes3,
    /// Bias b of `0 <= w_n + b _|_ lambda_n >= 0` `[m/s]`.
    pub bias: Lanes,
    /// Normal impulse.
    pub lambda_n: Lanes,
    /// Tangential impulse, at right angles to the normal.
    pub lambda_t: Lanes3,
    /// Rolling and torsional impulse over the effective radius.
    pub lambda_r: Lanes3,
    /// Coefficients, as an index into [`ContactSet::laws`].
    pub law: u32,
    /// How many lanes are in use.
    pub used: u32,
}

/// Masses, levers, compliances and friction of the contacts of a batch; shared by all batches that agree.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct LawLanes {
    /// Inverse masses.
    pub inverse_mass_i: Lanes,
    pub inverse_mass_j: Lanes,
    /// R_eff / r of either grain.
    pub lever_i: Lanes,
    pub lever_j: Lanes,
    /// 1 / A_n and 1 / A_r of the contact's own Delassus block; 1 / A_t is 2/7 of 1 / A_n.
    pub compliance_n: Lanes,
    pub compliance_r: Lanes,
    pub sliding_friction: Lanes,
    pub rolling_friction: Lanes,
    pub torsional_friction: Lanes,
}

/// What only grains at walls need.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(crate) struct WallLanes {
    /// Wall of each contact.
    pub wall: [u16; LANES],
    /// Side of the wall's shell at the last look (see `wall::Nearest::side`).
    pub side: [i8; LANES],
    /// Whether the grain's centre has changed sides.
    pub went_through: [bool; LANES],
}

/// A contact before it is put into a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Listed {
    pub i: u32,
    /// Second grain, or the wall's number.
    pub partner: u32,
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

/// Coefficients of one contact, put into a lane when the list is made.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ContactLaw {
    pub inverse_mass: [f64; 2],
    pub lever: [f64; 2],
    pub sliding_friction: f64,
    pub rolling_friction: f64,
    pub torsional_friction: f64,
}

/// The batches of one colour.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Colour {
    pub batches: Range<usize>,
    /// Whether no two contacts of the colour share a grain; false only for what was left without a colour.
    pub is_disjoint: bool,
}

/// All contacts of a kind (pairs of grains, or grains at walls), colour after colour.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct ContactSet {
    pub batches: Vec<Batch>,
    pub laws: Vec<LawLanes>,
    /// The colours, in the order in which they are solved.
    pub colours: Vec<Colour>,
    /// One for each batch at walls, none for pairs.
    pub at_walls: Vec<WallLanes>,
    /// Grains; every index in a batch is at most this, the resting body's.
    grains: usize,
    /// Batches that were coloured; those after them hold contacts that were appended.
    coloured: usize,
    /// The contact law behind each entry of `laws`, if all its lanes share one.
    uniform: Vec<Option<ContactLaw>>,
    #[serde(skip)]
    carried: Vec<Carried>,
    #[serde(skip)]
    carried_starts: Vec<u32>,
    #[serde(skip)]
    masks: Vec<u64>,
    #[serde(skip)]
    colour_of: Vec<u8>,
}

impl Batch {
    pub fn empty(resting: u32) -> Self {
        Self {
            i: [resting; LANES],
            j: [resting; LANES],
            normal: Lanes3 { x: Lanes::ZERO, y: Lanes::ZERO, z: Lanes::splat(1.0) },
            bias: Lanes::ZERO,
            lambda_n: Lanes::ZERO,
            lambda_t: Lanes3::ZERO,
            lambda_r: Lanes3::ZERO,
            law: 0,
            used: 0,
        }
    }

    /// Lanes in use.
    pub fn lanes(&self) -> Range<usize> {
        0..self.used as usize
    }
}

impl LawLanes {
    /// All lanes alike.
    fn uniform(law: &ContactLaw) -> Self {
        let mut lanes = Self {
            inverse_mass_i: Lanes::ZERO,
            inverse_mass_j: Lanes::ZERO,
            lever_i: Lanes::ZERO,
            lever_j: Lanes::ZERO,
            compliance_n: Lanes::ZERO,
            compliance_r: Lanes::ZERO,
            sliding_friction: Lanes::ZERO,
            rolling_friction: Lanes::ZERO,
            torsional_friction: Lanes::ZERO,
        };
        (0..LANES).for_each(|lane| lanes.set(lane, law));
        lanes
    }

    fn set(&mut self, lane: usize, law: &ContactLaw) {
        let [mass_i, mass_j] = law.inverse_mass;
        let [lever_i, lever_j] = law.lever;
        self.inverse_mass_i.0[lane] = mass_i;
        self.inverse_mass_j.0[lane] = mass_j;
        self.lever_i.0[lane] = lever_i;
        self.lever_j.0[lane] = lever_j;
        self.compliance_n.0[lane] = 1.0 / (mass_i + mass_j);
        let roll = lever_i * lever_i * mass_i + lever_j * lever_j * mass_j;
        self.compliance_r.0[lane] = 1.0 / (crate::bed::INVERSE_INERTIA * roll);
        self.sliding_friction.0[lane] = law.sliding_friction;
        self.rolling_friction.0[lane] = law.rolling_friction;
        self.torsional_friction.0[lane] = law.torsional_friction;
    }
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

    /// Grains that the contacts are between.
    pub fn grains(&self) -> usize {
        self.grains
    }

    /// Replaces the list: colours the contacts, fills the batches and hands the impulses on.
    ///
    /// `at_walls` says what `partner` means; `law` gives a contact's coefficients.
    pub fn rebuild(
        &mut self,
        listed: &[Listed],
        grains: usize,
        at_walls: bool,
        law: impl Fn(&Listed) -> ContactLaw,
    ) {
        self.collect_carried(grains);
        self.colour(listed, grains, at_walls);
        let mut next = self.lay_out(grains as u32, at_walls);
        for (index, contact) in listed.iter().enumerate() {
            let colour = self.colour_of[index] as usize;
            let slot = next[colour];
            next[colour] += if colour == COLOURS { LANES } else { 1 };
            let (number, lane) = (slot / LANES, slot % LANES);
            self.set_law(number, lane, law(contact));
            let batch = &mut self.batches[number];
            batch.used += 1;
            batch.i[lane] = contact.i;
            if at_walls {
                self.at_walls[number].wall[lane] = contact.partner as u16;
            } else {
                batch.j[lane] = contact.partner;
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
    pub fn append(&mut self, contact: Listed, at_wall: bool, law: ContactLaw) {
        let (i, j) = (contact.i, if at_wall { self.grains as u32 } else { contact.partner });
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
            match self.colours.last_mut() {
                Some(last) if last.batches.start == self.coloured => last.batches.end += 1,
                _ => {
                    let batches = self.coloured..self.coloured + 1;
                    self.colours.push(Colour { batches, is_disjoint: false });
                }
            }
            self.batches.len() - 1
        });
        let lane = self.batches[number].used as usize;
        self.set_law(number, lane, law);
        let batch = &mut self.batches[number];
        batch.used += 1;
        batch.i[lane] = i;
        if at_wall {
            self.at_walls[number].wall[lane] = contact.partner as u16;
        } else {
            batch.j[lane] = j;
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
                    partner: at_wall.map_or(batch.j[lane], |at| u32::from(at.wall[lane])),
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
    fn colour(&mut self, listed: &[Listed], grains: usize, at_walls: bool) {
        self.masks.clear();
        self.masks.resize(grains, 0);
        self.colour_of.clear();
        for contact in listed {
            let i = contact.i as usize;
            let j = if at_walls { i } else { contact.partner as usize };
            let colour = ((self.masks[i] | self.masks[j]).trailing_ones() as usize).min(COLOURS);
            if colour < COLOURS {
                self.masks[i] |= 1 << colour;
                self.masks[j] |= 1 << colour;
            }
            self.colour_of.push(colour as u8);
        }
    }

    /// Sizes the batches and returns the first slot of each colour.
    fn lay_out(&mut self, resting: u32, at_walls: bool) -> [usize; COLOURS + 1] {
        let mut counts = [0; COLOURS + 1];
        for &colour in &self.colour_of {
            counts[colour as usize] += 1;
        }
        let mut next = [0; COLOURS + 1];
        let mut batches = 0;
        self.colours.clear();
        for (colour, &count) in counts.iter().enumerate() {
            next[colour] = batches * LANES;
            batches += if colour == COLOURS { count } else { usize::div_ceil(count, LANES) };
            let range = next[colour] / LANES..batches;
            if !range.is_empty() {
                self.colours.push(Colour { batches: range, is_disjoint: colour < COLOURS });
            }
        }
        self.batches.clear();
        self.batches.resize(batches, Batch::empty(resting));
        self.at_walls.clear();
        self.at_walls.resize(if at_walls { batches } else { 0 }, WallLanes::default());
        self.grains = resting as usize;
        self.coloured = batches;
        self.laws.clear();
        self.uniform.clear();
        next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law(number: f64) -> ContactLaw {
        ContactLaw {
            inverse_mass: [1.0, 1.0],
            lever: [0.5, 0.5],
            sliding_friction: number,
            rolling_friction: 0.1,
            torsional_friction: 0.05,
        }
    }

    /// Every pair of `grains`: the densest list there is.
    fn all_pairs(grains: u32) -> Vec<Listed> {
        (0..grains)
            .flat_map(|i| (i + 1..grains).map(move |partner| Listed { i, partner }))
            .collect()
    }

    #[test]
    fn lanes_of_a_batch_share_no_grain_and_no_contact_is_lost() {
        // 80 grains that all touch need more colours than a mask holds.
        let listed = all_pairs(80);
        let mut set = ContactSet::default();
        set.rebuild(&listed, 80, false, |_| law(0.5));
        assert_eq!(set.len(), listed.len());
        let mut found = Vec::new();
        for batch in &set.batches {
            let mut grains: Vec<u32> =
                batch.lanes().flat_map(|lane| [batch.i[lane], batch.j[lane]]).collect();
            found.extend(batch.lanes().map(|lane| (batch.i[lane], batch.j[lane])));
            grains.sort_unstable();
            assert!(grains.windows(2).all(|pair| pair[0] != pair[1]));
        }
        found.sort_unstable();
        assert_eq!(found, listed.iter().map(|c| (c.i, c.partner)).collect::<Vec<_>>());
        assert_eq!(set.laws.len(), 1);
    }

    #[test]
    fn impulses_and_laws_follow_their_contact() {
        let mut set = ContactSet::default();
        let friction = |contact: &Listed| f64::from(contact.i) + 0.01 * f64::from(contact.partner);
        set.rebuild(&all_pairs(9), 9, false, |contact| law(friction(contact)));
        for batch in &mut set.batches {
            for lane in batch.lanes() {
                batch.lambda_n.0[lane] = f64::from(batch.i[lane] * 100 + batch.j[lane]);
            }
        }
        // The next list has fewer contacts in another order.
        let mut fewer: Vec<Listed> = all_pairs(9).into_iter().filter(|c| c.partner != 4).collect();
        fewer.reverse();
        set.rebuild(&fewer, 9, false, |contact| law(friction(contact)));
        assert_eq!(set.len(), fewer.len());
        for batch in &set.batches {
            for lane in batch.lanes() {
                let (i, partner) = (batch.i[lane], batch.j[lane]);
                assert_eq!(batch.lambda_n.0[lane], f64::from(i * 100 + partner));
                let expected = friction(&Listed { i, partner });
                assert_eq!(set.laws[batch.law as usize].sliding_friction.0[lane], expected);
            }
        }
    }
}
