//! A patch of what was taken for grains.

/// Grains whose room is more than a few lone ones make.
const MANY: f64 = 30.0;

/// A patch of what was taken for grains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// Volume between the ground and its surface `[m³]`.
    pub volume: f64,
    /// Height of its highest pixel above the ground `[m]`.
    pub height: f64,
}

impl Part {
    /// Whether it takes more room than a few grains of `diameter` `[m]`.
    pub(super) fn is_many(&self, diameter: f64) -> bool {
        self.volume > MANY * std::f64::consts::PI / 6.0 * diameter.powi(3)
    }
}
