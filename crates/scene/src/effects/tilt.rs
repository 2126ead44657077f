//! A table that is not level: gravity, seen from the table, is turned about its axes.
//!
//! The funnel stands on the table and is turned with it. A pour of a tilted table lands downhill of the funnel's axis
//! and spreads downhill; nothing in the material does that.

use nalgebra::{Rotation3, Vector3};
use serde::{Deserialize, Serialize};

use super::effect::Effect;
use crate::error::SceneError;

/// Steepest tilt `[rad]`: beyond it the words "table" and "ground" lose their sense.
const STEEPEST: f64 = 0.8;

/// Turn of the table about its x and y axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Tilt {
    /// About x `[rad]`: a positive angle lifts the side of positive y.
    pub x: f64,
    /// About y `[rad]`: a positive angle lowers the side of positive x.
    pub y: f64,
}

impl Effect for Tilt {
    fn path(&self) -> &'static str {
        "effects.tilt"
    }

    fn check(&self) -> Result<(), SceneError> {
        for (name, got) in [("effects.tilt.x", self.x), ("effects.tilt.y", self.y)] {
            if !(-STEEPEST..=STEEPEST).contains(&got) {
                return Err(SceneError::range(name, got, "in [-0.8, 0.8]"));
            }
        }
        Ok(())
    }

    fn is_on(&self) -> bool {
        *self != Self::default()
    }
}

impl Tilt {
    /// Gravity as it is seen from the table.
    pub fn turn(&self, gravity: &Vector3<f64>) -> Vector3<f64> {
        let axis = Vector3::new(self.x, self.y, 0.0);
        Rotation3::new(axis).inverse() * gravity
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gravity_keeps_its_length_and_points_downhill() {
        let turned = Tilt { x: 0.0, y: 0.1 }.turn(&Vector3::new(0.0, 0.0, -9.81));
        assert!((turned.norm() - 9.81).abs() < 1e-12);
        assert!((turned.x - 9.81 * 0.1f64.sin()).abs() < 1e-12);
        let turned = Tilt { x: 0.1, y: 0.0 }.turn(&Vector3::new(0.0, 0.0, -9.81));
        assert!((turned.y + 9.81 * 0.1f64.sin()).abs() < 1e-12);
    }
}
