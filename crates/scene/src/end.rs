//! When a pour ends, and what is no longer followed before that.

use serde::{Deserialize, Serialize};

use crate::check::positive;
use crate::error::SceneError;

/// When a pour ends: at rest, with every moving grain out of view, or at the horizon. [`crate::Outflow::until`] may end
/// it before.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EndRule {
    /// Longest simulated time `[s]`.
    pub horizon: f64,
    /// Mean kinetic energy of a grain per mass below which the pour is at rest `[m^2/s^2]`.
    pub kinetic_energy: f64,
    /// What becomes of grains that have rolled away for good.
    #[serde(skip_serializing_if = "RolledAway::is_default")]
    pub rolled_away: RolledAway,
}

/// What becomes of grains that roll outward on the level ground, out of the camera's view, from where nothing turns
/// them back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RolledAway {
    /// They are followed to the end of the pour and stand in its arrays.
    #[default]
    Stay,
    /// They leave the scene: nothing touches them and they stand in no array of the pour any more.
    Leave,
}

impl RolledAway {
    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
    fn is_default(&self) -> bool {
        *self == Self::Stay
    }
}

impl Default for EndRule {
    fn default() -> Self {
        Self { horizon: 4.0, kinetic_energy: 1e-8, rolled_away: RolledAway::Stay }
    }
}

impl EndRule {
    pub(crate) fn check(&self) -> Result<(), SceneError> {
        positive("end.horizon", self.horizon)?;
        positive("end.kinetic_energy", self.kinetic_energy)
    }
}
