//! Bonds that break: what glues grains to their neighbours at the begin, and not again once it has broken.
//!
//! A pair is held by a steady pull F until its surfaces have parted, or slid past each other, by `range` from where
//! they were nearest: the contact bond of a bonded-particle model (Potyondy and Cundall, Int. J. Rock Mechanics and
//! Mining Sciences 41 (2004) 1329, doi:10.1016/j.ijrmms.2004.09.011) for rigid grains, which have no stiffness to part
//! it by.

use serde::{Deserialize, Serialize};

use super::effect::Effect;
use crate::check::{non_negative, positive};
use crate::error::SceneError;

/// Breakable bonds between the grains of the start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Bonds {
    /// Pull F of a bond between two typical grains over the weight of one `[-]`; 0: no bonds.
    pub bond: f64,
    /// How far surfaces part, or slide, before their bond breaks, in radii of a typical grain `[-]`.
    pub range: f64,
    /// Gap below which grains are joined, in radii of a typical grain `[-]`.
    pub gap: f64,
    /// When they are joined `[s]`.
    pub begin: f64,
}

impl Default for Bonds {
    fn default() -> Self {
        Self { bond: 0.0, range: 0.2, gap: 0.25, begin: 0.0 }
    }
}

impl Effect for Bonds {
    fn path(&self) -> &'static str {
        "effects.bonds"
    }

    fn check(&self) -> Result<(), SceneError> {
        non_negative("effects.bonds.bond", self.bond)?;
        positive("effects.bonds.range", self.range)?;
        positive("effects.bonds.gap", self.gap)?;
        non_negative("effects.bonds.begin", self.begin)
    }

    fn is_on(&self) -> bool {
        self.bond > 0.0
    }
}
