//! A pull in newtons per metre in place of a multiple of the weight.

use crate::check::non_negative;
use crate::error::DemError;

/// Refuses a tension that is negative, or stated beside a bond.
///
/// # Errors
/// [`DemError::OutOfRange`].
pub(super) fn either(name: &str, tension: f64, bond: f64) -> Result<(), DemError> {
    non_negative(name, tension)?;
    if tension > 0.0 && bond > 0.0 {
        return Err(DemError::range(name, tension, "0 where bond is stated"));
    }
    Ok(())
}
