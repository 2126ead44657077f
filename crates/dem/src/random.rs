//! Random words as numbers.

/// The top 53 bits of a random word as a number in [0, 1).
pub(crate) fn unit_interval(word: u64) -> f64 {
    (word >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}
