//! Seeds and numbers that depend on the seed and the row only.

use granulcal_numbers::{open, scatter};
use rand_core::Rng;
use rand_pcg::Pcg64;

/// Seeds of rows are below 2^53, so that every tool that reads numbers as f64 keeps them whole.
const SEED_BITS: u32 = 53;

/// What a stream of a row is for; streams of different use are independent.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Use {
    /// Draws from the prior.
    Prior = 1,
    /// The seed of the pour.
    Pour = 2,
    /// The seed of the camera's noise.
    Camera = 3,
    /// The seed of the sensor's noise.
    Sensor = 4,
}

/// One word for (seed, row, use).
fn mix(seed: u64, row: u64, purpose: Use) -> u64 {
    scatter(scatter(scatter(seed) ^ row) ^ purpose as u64)
}

/// The seed of the pour of a row.
pub(crate) fn pour_seed(seed: u64, row: u64) -> u64 {
    mix(seed, row, Use::Pour) >> (u64::BITS - SEED_BITS)
}

/// The seed of the camera's noise of a pour.
pub(crate) fn camera_seed(pour_seed: u64) -> u64 {
    mix(pour_seed, 0, Use::Camera)
}

/// The seed of the sensor's noise of a pour.
pub(crate) fn sensor_seed(pour_seed: u64) -> u64 {
    mix(pour_seed, 0, Use::Sensor)
}

/// Uniform numbers for the prior of one row.
pub(crate) struct Uniforms(Pcg64);

impl Uniforms {
    /// The stream of a row.
    pub(crate) fn of_row(seed: u64, row: u64) -> Self {
        let state = mix(seed, row, Use::Prior);
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
        let mut seeds: Vec<_> = (0..10_000).map(|row| pour_seed(7, row)).collect();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), 10_000);
        assert!(seeds.iter().all(|&seed| seed < 1 << SEED_BITS));
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
