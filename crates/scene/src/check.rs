//! Ranges that many numbers of a scene share. What is refused is named by its path.

use crate::error::DemError;

pub(crate) fn positive(name: &str, got: f64) -> Result<(), DemError> {
    if got > 0.0 && got.is_finite() {
        return Ok(());
    }
    Err(DemError::range(name, got, "positive and finite"))
}

pub(crate) fn non_negative(name: &str, got: f64) -> Result<(), DemError> {
    if got >= 0.0 && got.is_finite() {
        return Ok(());
    }
    Err(DemError::range(name, got, "zero or positive, and finite"))
}

pub(crate) fn finite(name: &str, got: f64) -> Result<(), DemError> {
    if got.is_finite() {
        return Ok(());
    }
    Err(DemError::range(name, got, "finite"))
}
