//! A pull in newtons per metre in place of a multiple of the weight.

use crate::check::non_negative;
use crate::error::SceneError;

/// Refuses a tension that is negative, or stated beside a bond.
///
/// # Errors
/// [`SceneError::OutOfRange`].
pub(super) fn either(name: &str, tension: f64, bond: f64) -> Result<(), SceneError> {
    non_negative(name, tension)?;
    if tension > 0.0 && bond > 0.0 {
        return Err(SceneError::range(name, tension, "0 where bond is stated"));
    }
    Ok(())
}
