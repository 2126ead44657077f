//! A ground unlike the grains: its coefficients as multiples of those between grain and ground that the scene states.
//!
//! The paper assumes a ground of the grains' own material. As ratios the effect is the same question whatever the
//! material is: 1 is off. A soft ground is a small `restitution`. A grain never leaves with more than
//! it came. Its coefficients by themselves, not as ratios, are the scene's `ground.material`.

use serde::{Deserialize, Serialize};

use super::effect::Effect;
use crate::check::non_negative;
use crate::error::SceneError;
use crate::material::Material;

/// Ratios of the ground's coefficients to those it would have `[-]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GroundUnlike {
    /// Of sliding friction.
    pub sliding_friction: f64,
    /// Of rolling friction.
    pub rolling_friction: f64,
    /// Of restitution; the product is at most 1.
    pub restitution: f64,
}

impl Default for GroundUnlike {
    fn default() -> Self {
        Self { sliding_friction: 1.0, rolling_friction: 1.0, restitution: 1.0 }
    }
}

impl Effect for GroundUnlike {
    fn path(&self) -> &'static str {
        "effects.ground"
    }

    fn check(&self) -> Result<(), SceneError> {
        non_negative("effects.ground.sliding_friction", self.sliding_friction)?;
        non_negative("effects.ground.rolling_friction", self.rolling_friction)?;
        non_negative("effects.ground.restitution", self.restitution)
    }

    fn is_on(&self) -> bool {
        *self != Self::default()
    }
}

impl GroundUnlike {
    /// The ground's material of what it would be without the effect.
    pub fn of(&self, plain: Material) -> Material {
        Material {
            sliding_friction: self.sliding_friction * plain.sliding_friction,
            rolling_friction: self.rolling_friction * plain.rolling_friction,
            restitution: (self.restitution * plain.restitution).min(1.0),
            ..plain
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_is_off_to_the_last_bit_and_restitution_stays_possible() {
        let plain = Material::new(0.37, 0.11, 0.83).unwrap();
        assert_eq!(GroundUnlike::default().of(plain), plain);
        let hard = GroundUnlike { restitution: 2.0, ..GroundUnlike::default() };
        assert_eq!(hard.of(plain).restitution, 1.0);
    }
}
