//! What every message of a pour's MCAP says of its time and place.

use foxglove::messages::Timestamp;

/// The frame that the ground is still in.
pub(super) const WORLD: &str = "world";

/// Simulated time `[s]` in nanoseconds.
pub(super) fn nanoseconds(time: f64) -> u64 {
    (time * 1e9).round() as u64
}

/// Simulated time `[s]` as a message has it.
pub(super) fn timestamp(time: f64) -> Option<Timestamp> {
    let total = nanoseconds(time);
    Timestamp::new_checked((total / 1_000_000_000) as u32, (total % 1_000_000_000) as u32)
}
