//! Blocks of space, one after the other in the solver: the grains of a block stay in the cache while its
//! contacts are solved.
//!
//! A contact belongs to the block of its first grain. Blocks are more than twice as wide as a pair is long, so that
//! no grain has contacts in two blocks whose coordinates agree modulo 2: those form a phase, and its blocks may be
//! solved at the same time. The order of the solve depends on the blocks, never on the threads.
//!
//! A grain much wider than the others has contacts all over: the pairs that it is in are a block and a phase of their
//! own, the last.

use std::ops::Range;

use nalgebra::Vector3;

use crate::contact::ContactKey;

/// Grains below which one block holds all: they fit the cache.
const ONE_BLOCK: usize = if cfg!(test) { 200 } else { 4096 };
/// Width of a block in radii of a typical grain, if pairs are not too long for it.
const WIDTH: f64 = 20.0;
/// Upper bound of the number of blocks.
const MAX_BLOCKS: f64 = 32_768.0;

/// The block of each grain. The default is one block for all.
#[derive(Clone, Debug, Default)]
pub(crate) struct Blocks {
    /// Rank of each grain's block, phase after phase; empty if there is but one block.
    of: Vec<u32>,
    /// Ranks of the blocks of each phase.
    phases: Vec<Range<usize>>,
    /// Rank of each block, x fastest.
    ranks: Vec<u32>,
    /// Whether any grain is wide: their pairs have the rank after the last.
    has_wide: bool,
}

impl Blocks {
    /// Puts grains at `points` `[m]` into blocks; no pair is longer than `longest` `[m]`, but for those of `wide`
    /// grains.
    pub fn place(&mut self, points: &[Vector3<f64>], longest: f64, radius: f64, wide: &[u32]) {
        self.of.clear();
        self.has_wide = !wide.is_empty();
        if points.len() < ONE_BLOCK {
            return;
        }
        let (mut low, mut high) = (points[0], points[0]);
        for point in points {
            low = low.inf(point);
            high = high.sup(point);
        }
        let mut width = (WIDTH * radius).max(2.01 * longest);
        let extent = high - low;
        let count = |width: f64| extent.iter().map(|e| (e / width).floor() + 1.0).product::<f64>();
        while count(width) > MAX_BLOCKS {
            width *= 1.25;
        }
        let cells = [0, 1, 2].map(|axis| (extent[axis] / width) as usize + 1);
        self.rank(cells);
        self.of.extend(points.iter().map(|point| {
            let [x, y, z] = [0, 1, 2].map(|axis| ((point[axis] - low[axis]) / width) as usize);
            self.ranks[(z * cells[1] + y) * cells[0] + x]
        }));
        for &grain in wide {
            self.of[grain as usize] = self.ranks.len() as u32;
        }
        if self.has_wide {
            self.phases.push(self.ranks.len()..self.ranks.len() + 1);
        }
    }

    /// Ranks blocks by phase.
    fn rank(&mut self, cells: [usize; 3]) {
        self.ranks.clear();
        self.ranks.resize(cells.iter().product(), 0);
        self.phases.clear();
        let mut rank = 0;
        for phase in 0..8 {
            let first = rank;
            let [x0, y0, z0] = [phase & 1, phase >> 1 & 1, phase >> 2];
            for z in (z0..cells[2]).step_by(2) {
                for y in (y0..cells[1]).step_by(2) {
                    for x in (x0..cells[0]).step_by(2) {
                        self.ranks[(z * cells[1] + y) * cells[0] + x] = rank as u32;
                        rank += 1;
                    }
                }
            }
            self.phases.push(first..rank);
        }
    }

    /// The ranks of the blocks, phase after phase.
    pub fn phases(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let one = self.of.is_empty().then_some(0..1);
        let several = if self.of.is_empty() { &[] } else { &self.phases[..] };
        one.into_iter().chain(several.iter().cloned())
    }

    /// Orders the contacts by their blocks and leaves their order within a block; returns where each begins. Whether
    /// they are pairs says what their partners are.
    pub fn sort(
        &self,
        listed: &[ContactKey],
        are_pairs: bool,
        ordered: &mut Vec<ContactKey>,
    ) -> Vec<usize> {
        ordered.clear();
        if self.of.is_empty() {
            ordered.extend_from_slice(listed);
            return vec![0, listed.len()];
        }
        // A wide grain's rank is the highest, and goes before that of its partner.
        let block_of = |contact: &ContactKey| {
            let of_i = self.of[contact.i as usize];
            let is_asked = are_pairs && self.has_wide;
            let of_wide = self.ranks.len() as u32;
            if is_asked && self.of[contact.partner as usize] == of_wide { of_wide } else { of_i }
        };
        let mut starts = vec![0; self.ranks.len() + usize::from(self.has_wide) + 2];
        for contact in listed {
            starts[block_of(contact) as usize + 2] += 1;
        }
        for block in 2..starts.len() {
            starts[block] += starts[block - 1];
        }
        ordered.resize(listed.len(), ContactKey { i: 0, partner: 0 });
        for contact in listed {
            let slot = &mut starts[block_of(contact) as usize + 1];
            ordered[*slot] = *contact;
            *slot += 1;
        }
        starts.pop();
        starts
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;

    /// A bar of grains, 10 by 10 by 80.
    fn points() -> Vec<Vector3<f64>> {
        let at = |n: usize| [n % 10, n / 10 % 10, n / 100].map(|c| 4e-3 * c as f64);
        (0..8000).map(|n| Vector3::from(at(n))).collect()
    }

    #[test]
    fn blocks_of_a_phase_share_no_grain() {
        let (points, longest) = (points(), 9e-3);
        let mut blocks = Blocks::default();
        blocks.place(&points, longest, 2e-3, &[]);
        let near = |&(i, j): &(usize, usize)| (points[i] - points[j]).norm() < longest;
        let pairs =
            (0..points.len()).flat_map(|i| (i + 1..points.len().min(i + 230)).map(move |j| (i, j)));
        let listed: Vec<ContactKey> = pairs
            .filter(near)
            .map(|(i, j)| ContactKey { i: i as u32, partner: j as u32 })
            .collect();
        let mut ordered = Vec::new();
        let starts = blocks.sort(&listed, true, &mut ordered);
        assert!(blocks.phases().any(|phase| phase.len() > 2));
        for phase in blocks.phases() {
            let mut owner = HashMap::new();
            for block in phase {
                for contact in &ordered[starts[block]..starts[block + 1]] {
                    for grain in [contact.i, contact.partner] {
                        assert_eq!(*owner.entry(grain).or_insert(block), block);
                    }
                }
            }
        }
        ordered.sort_unstable();
        let mut sorted = listed;
        sorted.sort_unstable();
        assert_eq!(ordered, sorted);
    }

    #[test]
    fn few_grains_are_one_block_in_their_order() {
        let mut blocks = Blocks::default();
        blocks.place(&points()[..100], 9e-3, 2e-3, &[]);
        let listed: Vec<ContactKey> =
            (0..50).rev().map(|i| ContactKey { i, partner: i + 1 }).collect();
        let mut ordered = Vec::new();
        assert_eq!(blocks.sort(&listed, true, &mut ordered), [0, 50]);
        assert_eq!(ordered, listed);
        assert!(blocks.phases().eq(std::iter::once(0..1)));
    }
}
