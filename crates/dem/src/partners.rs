//! With whom each grain is listed.

use serde::{Deserialize, Serialize};

/// Ends a chain.
const NONE: u32 = u32::MAX;

/// For each grain those that it is listed with, in one array; those that are added later hang on chains.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Partners {
    starts: Vec<u32>,
    listed: Vec<u32>,
    /// Latest link of each grain's chain.
    latest: Vec<u32>,
    added: Vec<Link>,
}

/// A partner that was added, and the link before it.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Link {
    partner: u32,
    before: u32,
}

impl Partners {
    /// Replaces all: `each` calls its argument with every grain and its partner, in the same order whenever it is
    /// asked.
    pub fn rebuild(&mut self, grains: usize, each: impl Fn(&mut dyn FnMut(u32, u32))) {
        self.latest.clear();
        self.latest.resize(grains, NONE);
        self.added.clear();
        self.starts.clear();
        self.starts.resize(grains + 2, 0);
        each(&mut |grain, _| self.starts[grain as usize + 2] += 1);
        for grain in 2..self.starts.len() {
            self.starts[grain] += self.starts[grain - 1];
        }
        self.listed.resize(self.starts[grains + 1] as usize, 0);
        each(&mut |grain, partner| {
            let slot = &mut self.starts[grain as usize + 1];
            self.listed[*slot as usize] = partner;
            *slot += 1;
        });
    }

    /// Whether partners that were read from bytes are those of so many grains, each less than `bodies`.
    ///
    /// # Errors
    /// What is wrong.
    pub fn check(&self, grains: usize, bodies: usize) -> Result<(), &'static str> {
        let known = |&partner: &u32| (partner as usize) < bodies;
        let links = self.added.len();
        let fits = self.latest.len() == grains
            && self.starts.len() == if grains == 0 { self.starts.len() } else { grains + 2 }
            && self.starts.is_sorted()
            && self.starts.last().is_none_or(|&end| end as usize == self.listed.len())
            && self.listed.iter().all(known)
            && self.added.iter().all(|link| known(&link.partner))
            // Chains lead back, so that none is a ring.
            && self.latest.iter().all(|&link| link == NONE || (link as usize) < links)
            && self.added.iter().enumerate().all(|(number, link)| link.before == NONE || (link.before as usize) < number);
        if fits { Ok(()) } else { Err("partners that the scene has not") }
    }

    /// Adds a partner to a grain.
    pub fn add(&mut self, grain: usize, partner: u32) {
        self.added.push(Link { partner, before: self.latest[grain] });
        self.latest[grain] = self.added.len() as u32 - 1;
    }

    /// The partners of a grain.
    pub fn of(&self, grain: usize) -> impl Iterator<Item = u32> + '_ {
        let listed = self.starts[grain] as usize..self.starts[grain + 1] as usize;
        let mut link = self.latest[grain];
        let added = std::iter::from_fn(move || {
            let Link { partner, before } = *self.added.get(link as usize)?;
            link = before;
            Some(partner)
        });
        self.listed[listed].iter().copied().chain(added)
    }

    /// Whether a grain is listed with that partner.
    pub fn has(&self, grain: usize, partner: u32) -> bool {
        self.of(grain).any(|known| known == partner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_grain_has_its_partners() {
        let pairs = [(0, 3), (2, 1), (0, 1), (3, 4)];
        let mut partners = Partners::default();
        for _ in 0..2 {
            partners.rebuild(4, |add| {
                for (grain, partner) in pairs {
                    add(grain, partner);
                }
            });
            partners.add(1, 7);
            partners.add(0, 2);
            partners.add(0, 5);
            let of = |grain| partners.of(grain).collect::<Vec<_>>();
            assert_eq!([of(0), of(1), of(2), of(3)], [vec![3, 1, 5, 2], vec![7], vec![1], vec![4]]);
            assert!(partners.has(0, 5) && !partners.has(2, 3));
        }
    }
}
