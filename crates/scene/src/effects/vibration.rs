//! A table that shakes up and down for a while: in its frame gravity swings by `Gamma g sin(2 pi f (t - begin))`,
//! g = 9.81 m/s^2 wherever the scene is.
//!
//! A pile slumps under it. Grains lift off above Gamma = 1.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use super::effect::Effect;
use crate::check::{non_negative, positive};
use crate::error::SceneError;
use crate::gravity::GRAVITY;

/// A shaking table.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Vibration {
    /// Gamma, the largest acceleration over 9.81 m/s^2 `[-]`.
    pub acceleration: f64,
    /// f `[Hz]`; steps of the solver resolve up to some 200 Hz.
    pub frequency: f64,
    /// When it begins `[s]`.
    pub begin: f64,
    /// For how long it lasts `[s]`.
    pub duration: f64,
}

impl Default for Vibration {
    fn default() -> Self {
        Self { acceleration: 0.0, frequency: 60.0, begin: 1.5, duration: 0.5 }
    }
}

impl Effect for Vibration {
    fn path(&self) -> &'static str {
        "effects.vibration"
    }

    fn check(&self) -> Result<(), SceneError> {
        non_negative("effects.vibration.acceleration", self.acceleration)?;
        positive("effects.vibration.frequency", self.frequency)?;
        non_negative("effects.vibration.begin", self.begin)?;
        non_negative("effects.vibration.duration", self.duration)
    }

    fn is_on(&self) -> bool {
        self.acceleration > 0.0 && self.duration > 0.0
    }
}

impl Vibration {
    /// When it ends `[s]`; 0 for one that is off.
    pub(super) fn end(&self) -> f64 {
        if self.is_on() { self.begin + self.duration } else { 0.0 }
    }

    /// What is added to the vertical component of gravity `[m/s^2]`.
    pub fn acceleration_at(&self, time: f64) -> f64 {
        let since = time - self.begin;
        if (0.0..self.duration).contains(&since) {
            self.acceleration * GRAVITY * (TAU * self.frequency * since).sin()
        } else {
            0.0
        }
    }
}
