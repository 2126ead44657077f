//! Uniform numbers that depend on the seed and the row only.

use granulcal_numbers::{mix, open, scatter};
use rand_core::Rng;
use rand_pcg::Pcg64;

/// The use of the stream: draws from the prior. Streams of other uses (`granulcal-dataset`) have other numbers.
const PRIOR: u64 = 1;

/// Uniform numbers for the prior of one row.
pub(crate) struct Uniforms(Pcg64);

impl Uniforms {
    /// The stream of a row.
    pub(crate) fn of_row(seed: u64, row: u64) -> Self {
        let state = mix(seed, row, PRIOR);
        let wide = (u128::from(scatter(state)) << 64) | u128::from(state);
        Self(Pcg64::new(wide, u128::from(row)))
    }

    /// The next number, in the open interval (0, 1): the middles of 2^52 cells.
    pub(crate) fn next(&mut self) -> f64 {
        open(self.0.next_u64())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_and_seeds_have_streams_of_their_own() {
        let first = |seed, row| Uniforms::of_row(seed, row).next();
        assert_eq!(first(1, 2), first(1, 2));
        assert_ne!(first(1, 2), first(2, 1));
        assert_ne!(first(1, 2), first(1, 3));
    }

    #[test]
    fn first_numbers_of_rows_are_uniform_and_unrelated() {
        let n = 20_000;
        let draws: Vec<_> = (0..n).map(|row| Uniforms::of_row(3, row).next()).collect();
        let mean = draws.iter().sum::<f64>() / n as f64;
        let lag = draws.windows(2).map(|w| (w[0] - 0.5) * (w[1] - 0.5)).sum::<f64>() / n as f64;
        assert!((mean - 0.5).abs() < 0.01, "{mean}");
        assert!(lag.abs() < 0.003, "{lag}");
    }
}
