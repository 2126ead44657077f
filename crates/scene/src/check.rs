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
