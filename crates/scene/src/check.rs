//! Ranges that many numbers of a scene share. What is refused is named by its path.

use crate::error::SceneError;

pub(crate) fn positive(name: &str, got: f64) -> Result<(), SceneError> {
    if got > 0.0 && got.is_finite() {
        return Ok(());
    }
    Err(SceneError::range(name, got, "positive and finite"))
}

pub(crate) fn non_negative(name: &str, got: f64) -> Result<(), SceneError> {
    if got >= 0.0 && got.is_finite() {
        return Ok(());
    }
    Err(SceneError::range(name, got, "zero or positive, and finite"))
}

pub(crate) fn finite(name: &str, got: f64) -> Result<(), SceneError> {
    if got.is_finite() {
        return Ok(());
    }
    Err(SceneError::range(name, got, "finite"))
}

/// Whether `got` lies between both bounds, which `allowed` has in words.
pub(crate) fn within(
    name: &str,
    got: f64,
    (min, max): (f64, f64),
    allowed: &'static str,
) -> Result<(), SceneError> {
    if (min..=max).contains(&got) { Ok(()) } else { Err(SceneError::range(name, got, allowed)) }
}

/// Fewest substeps in a period of what swings `[-]`: fewer are not seen as a swing.
const FEWEST_OF_PERIOD: f64 = 10.0;
/// A period of exactly so many is not refused for its rounding.
const ROUNDING: f64 = 1e-9;

/// Whether what swings at `frequency` `[Hz]` is seen to in substeps of `dt` `[s]`.
pub(crate) fn seen_to_swing(name: &str, frequency: f64, dt: f64) -> Result<(), SceneError> {
    if frequency * dt * FEWEST_OF_PERIOD <= 1.0 + ROUNDING {
        return Ok(());
    }
    let allowed = "at most one period in ten substeps, 200 Hz with preset default";
    Err(SceneError::range(name, frequency, allowed))
}
