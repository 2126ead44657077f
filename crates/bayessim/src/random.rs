//! Random numbers of a seed.

use granulcal_numbers::{box_muller, open};
use rand_core::Rng;
use rand_pcg::Pcg64;

/// Asked now and then whether to go on.
pub type KeepGoing<'a> = dyn Fn() -> bool + 'a;

/// Draws between two such questions.
pub const BLOCK: usize = 1 << 14;

/// Uniform and normal numbers.
#[derive(Debug)]
pub struct Random(Pcg64);

impl Random {
    pub fn new(seed: u64) -> Self {
        let mut pcg = Pcg64::new(u128::from(seed), 0xa02b_dbf7_bb3c_0a7a);
        // Seeds are small and near to each other: the first numbers would be, too.
        for _ in 0..4 {
            pcg.next_u64();
        }
        Self(pcg)
    }

    /// In the open interval (0, 1).
    pub fn uniform(&mut self) -> f64 {
        open(self.0.next_u64())
    }

    pub fn normal(&mut self) -> f64 {
        let (u, v) = (self.uniform(), self.uniform());
        box_muller(u, v)[0]
    }

    /// A whole number below `count`.
    pub fn below(&mut self, count: usize) -> usize {
        (self.uniform() * count as f64) as usize
    }

    /// An index with probabilities that rise to `cumulative`'s last entry.
    pub fn index(&mut self, cumulative: &[f64]) -> usize {
        let total = cumulative.last().copied().unwrap_or(0.0);
        let target = self.uniform() * total;
        cumulative.partition_point(|&sum| sum <= target).min(cumulative.len() - 1)
    }
}

/// Running sums.
pub fn cumulative(weights: impl IntoIterator<Item = f64>) -> Vec<f64> {
    weights
        .into_iter()
        .scan(0.0, |sum, weight| {
            *sum += weight;
            Some(*sum)
        })
        .collect()
}
