//! Space that repeats, as a scene states it: a drum without end walls, a slice of a wide box.

use serde::{Deserialize, Serialize};

use crate::check::finite;
use crate::error::SceneError;

/// Diameters that the period must have at least: a grain must not meet itself, nor one grain from two sides.
const FEWEST_DIAMETERS: f64 = 4.0;

/// A horizontal axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PeriodicAxis {
    /// x
    X,
    /// y
    Y,
}

impl PeriodicAxis {
    /// Its number among the coordinates.
    pub fn index(self) -> usize {
        match self {
            Self::X => 0,
            Self::Y => 1,
        }
    }
}

/// Space repeats along an axis: a grain that leaves at `to` comes in at `from`.
///
/// Walls do not repeat: give them the same shape all along the period, and at least its length.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Periodic {
    /// Along which axis.
    pub axis: PeriodicAxis,
    /// Where the period begins `[m]`.
    pub from: f64,
    /// Where it ends `[m]`.
    pub to: f64,
}

impl Periodic {
    pub(crate) fn check(&self, widest: f64) -> Result<(), SceneError> {
        finite("periodic.from", self.from)?;
        finite("periodic.to", self.to)?;
        if self.to - self.from >= FEWEST_DIAMETERS * widest {
            return Ok(());
        }
        let allowed = "at least 4 diameters of the widest grain above periodic.from";
        Err(SceneError::range("periodic.to", self.to, allowed))
    }
}
