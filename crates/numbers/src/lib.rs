//! Random words as numbers, the normal distribution and numbers in messages, once for all crates.
//!
//! A seed stands for a pour, a data set and an image. A distribution crate may change its algorithm between versions,
//! and with it what every seed stands for; what is written here does not change by a bit.

mod general;

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

pub use general::{General, short};

/// Increment of SplitMix64.
const GOLDEN_GAMMA: u64 = 0x9e37_79b9_7f4a_7c15;

/// The top 53 bits of a random word as a number in [0, 1), on the grid of 2^-53.
///
/// ```
/// assert_eq!(granulcal_numbers::half_open(0), 0.0);
/// assert_eq!(granulcal_numbers::half_open(u64::MAX), 1.0 - 2f64.powi(-53));
/// ```
pub fn half_open(word: u64) -> f64 {
    (word >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// The top 52 bits of a random word as a number in the open interval (0, 1): the middles of 2^52 cells.
///
/// ```
/// assert_eq!(granulcal_numbers::open(0), 2f64.powi(-53));
/// assert_eq!(granulcal_numbers::open(u64::MAX), 1.0 - 2f64.powi(-53));
/// ```
pub fn open(word: u64) -> f64 {
    ((word >> 12) as f64 + 0.5) * (1.0 / (1u64 << 52) as f64)
}

/// Two independent standard normal numbers of two uniform ones, `u` in (0, 1] and `v` in [0, 1]: the transform of Box
/// and Muller (1958), doi:10.1214/aoms/1177706645.
///
/// ```
/// let [a, b] = granulcal_numbers::box_muller((-0.5f64).exp(), 0.125);
/// assert!((a - 0.5f64.sqrt()).abs() < 1e-15 && (b - 0.5f64.sqrt()).abs() < 1e-15);
/// ```
pub fn box_muller(u: f64, v: f64) -> [f64; 2] {
    let radius = (-2.0 * u.ln()).sqrt();
    let (sin, cos) = (TAU * v).sin_cos();
    [radius * cos, radius * sin]
}

/// The output function of SplitMix64, a bijection that makes words unrelated which differ by one: Steele, Lea and Flood
/// (2014), doi:10.1145/2660193.2660195.
///
/// ```
/// // The first number of the generator that is seeded with 0.
/// assert_eq!(granulcal_numbers::scatter(0), 0xe220_a839_7b1d_cdaf);
/// ```
pub fn scatter(word: u64) -> u64 {
    let mut z = word.wrapping_add(GOLDEN_GAMMA);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// One word of a seed, a row and what it is for: streams that differ in any of the three are unrelated.
///
/// ```
/// use granulcal_numbers::{mix, scatter};
/// assert_eq!(mix(1, 2, 3), scatter(scatter(scatter(1) ^ 2) ^ 3));
/// ```
pub fn mix(seed: u64, row: u64, purpose: u64) -> u64 {
    scatter(scatter(scatter(seed) ^ row) ^ purpose)
}

/// Standard normal distribution function.
///
/// ```
/// assert_eq!(granulcal_numbers::normal_cdf(0.0), 0.5);
/// assert!((granulcal_numbers::normal_cdf(1.959_963_984_540_054) - 0.975).abs() < 1e-15);
/// ```
pub fn normal_cdf(z: f64) -> f64 {
    0.5 * libm::erfc(-z * FRAC_1_SQRT_2)
}
