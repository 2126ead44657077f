//! Uniform and normal numbers from a seed: the generator's 64-bit words do not change between versions.

use granulcal_numbers::{box_muller, half_open};
use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng, SeedableRng};

/// A seeded stream of numbers.
pub(crate) struct Stream {
    words: Pcg64,
    spare: Option<f64>,
}

impl Stream {
    /// The stream that belongs to `seed`.
    pub(crate) fn new(seed: u64) -> Self {
        Self { words: Pcg64::seed_from_u64(seed), spare: None }
    }

    /// Uniform in [0, 1), on the grid of 2^-53.
    pub(crate) fn uniform(&mut self) -> f64 {
        half_open(self.words.next_u64())
    }

    /// Uniform index below `len`, which must not be 0 (it gives 0 then).
    pub(crate) fn index(&mut self, len: usize) -> usize {
        // The high half of a 128-bit product is unbiased to 2^-64 len.
        ((u128::from(self.words.next_u64()) * len as u128) >> 64) as usize
    }

    /// Standard normal.
    pub(crate) fn normal(&mut self) -> f64 {
        if let Some(value) = self.spare.take() {
            return value;
        }
        let (u, v) = (self.uniform(), self.uniform());
        // 1 - u is in (0, 1].
        let [first, second] = box_muller(1.0 - u, v);
        self.spare = Some(second);
        first
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uniform_and_normal_have_their_moments() {
        let mut stream = Stream::new(1);
        let n = 200_000;
        let mean = (0..n).map(|_| stream.uniform()).sum::<f64>() / f64::from(n);
        assert!((mean - 0.5).abs() < 0.003, "{mean}");
        let normals: Vec<f64> = (0..n).map(|_| stream.normal()).collect();
        let mean = normals.iter().sum::<f64>() / f64::from(n);
        let variance = normals.iter().map(|x| x * x).sum::<f64>() / f64::from(n);
        assert!(mean.abs() < 0.01 && (variance - 1.0).abs() < 0.015, "{mean} {variance}");
    }

    #[test]
    fn index_stays_below_its_bound() {
        let mut stream = Stream::new(2);
        assert!((0..1000).all(|_| stream.index(3) < 3));
        assert_eq!(stream.index(0), 0);
    }

    #[test]
    fn a_seed_is_a_stream() {
        let (mut a, mut b, mut c) = (Stream::new(7), Stream::new(7), Stream::new(8));
        let first = a.uniform();
        assert_eq!(first, b.uniform());
        assert_ne!(first, c.uniform());
    }
}
