//! Gravity where a scene states none.

/// Standard gravity as the peers' scenes use it `[m/s^2]`.
pub const GRAVITY: f64 = 9.81;

/// Gravity that points down `[m/s^2]`.
pub(crate) fn standard_gravity() -> [f64; 3] {
    [0.0, 0.0, -GRAVITY]
}
