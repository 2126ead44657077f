//! A soft layer on the ground: a bed of springs and dampers above the hard ground. The equations are in
//! `effect/elastic_layer.rs`.
//!
//! The hard ground lies below it and keeps its own coefficients: no thickness is no layer.

use serde::{Deserialize, Serialize};

use super::effect::Effect;
use crate::check::{non_negative, positive};
use crate::error::SceneError;

/// The layer's surface is the plane z = 0, the hard ground lies `thickness` below.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Layer {
    /// `[m]`
    pub thickness: f64,
    /// Weights of a typical grain that press it in by its radius `[-]`.
    pub stiffness: f64,
    /// Damping over the critical damping of a typical grain `[-]`.
    pub damping: f64,
}

impl Default for Layer {
    fn default() -> Self {
        Self { thickness: 0.0, stiffness: 20.0, damping: 1.0 }
    }
}

impl Effect for Layer {
    fn path(&self) -> &'static str {
        "effects.layer"
    }

    fn check(&self) -> Result<(), SceneError> {
        non_negative("effects.layer.thickness", self.thickness)?;
        positive("effects.layer.stiffness", self.stiffness)?;
        non_negative("effects.layer.damping", self.damping)
    }

    fn is_on(&self) -> bool {
        self.thickness > 0.0
    }

    fn changes_contacts(&self) -> bool {
        true
    }
}
