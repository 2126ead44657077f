//! Where grains leave the scene, and when enough have.

use serde::{Deserialize, Serialize};

use crate::check::finite;
use crate::error::SceneError;

/// Grains whose centre comes below a height leave the scene: nothing touches them and no camera sees them any more.
///
/// They are looked for at every search for pairs, a few milliseconds apart at most.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outflow {
    /// The height `[m]`.
    pub below: f64,
    /// The pour ends when this share of the grains' mass has left `[%]`; without it, as other pours do.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until: Option<f64>,
}

impl Outflow {
    pub(crate) fn check(&self) -> Result<(), SceneError> {
        finite("outflow.below", self.below)?;
        match self.until {
            Some(got) if !(got > 0.0 && got <= 100.0) => {
                Err(SceneError::range("outflow.until", got, "more than 0 and at most 100"))
            }
            _ => Ok(()),
        }
    }
}
