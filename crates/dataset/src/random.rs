//! Seeds that depend on the seed and the row only.

use granulcal_numbers::mix;

/// Seeds of rows are below 2^53, so that every tool that reads numbers as f64 keeps them whole.
const SEED_BITS: u32 = 53;

/// What a stream of a row is for; streams of different use are independent. 1 is the prior's (`granulcal-scene`).
#[derive(Clone, Copy, Debug)]
enum Use {
    /// The seed of the pour.
    Pour = 2,
    /// The seed of the camera's noise.
    Camera = 3,
    /// The seed of the sensor's noise.
    Sensor = 4,
}

/// The seed of the pour of a row.
pub(crate) fn pour_seed(seed: u64, row: u64) -> u64 {
    mix(seed, row, Use::Pour as u64) >> (u64::BITS - SEED_BITS)
}

/// The seed of the camera's noise of a pour.
pub(crate) fn camera_seed(pour_seed: u64) -> u64 {
    mix(pour_seed, 0, Use::Camera as u64)
}

/// The seed of the sensor's noise of a pour.
pub(crate) fn sensor_seed(pour_seed: u64) -> u64 {
    mix(pour_seed, 0, Use::Sensor as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_have_seeds_of_their_own() {
        let mut seeds: Vec<_> = (0..10_000).map(|row| pour_seed(7, row)).collect();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), 10_000);
        assert!(seeds.iter().all(|&seed| seed < 1 << SEED_BITS));
    }
}
