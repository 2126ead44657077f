//! What is remembered of liquid bridges from substep to substep.

use serde::{Deserialize, Serialize};

/// The pairs that a bridge joins, sorted: first grain, then second grain or the number of grains plus the wall's
/// surface.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Bridges {
    pub(super) joined: Vec<(u32, u32)>,
    #[serde(skip)]
    pub(super) next: Vec<(u32, u32)>,
}
