//! The height from which a pixel counts as grain.

use std::fmt;

use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

/// Robust standard deviations of the ground that a patch of grains must reach. Five would do for noise
/// that is the same all over the image; at its edge it is up to a quarter larger.
const PEAK_SDS: f64 = 6.0;

/// Height above the ground from which a pixel counts as grain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Threshold {
    /// This height `[m]`.
    Absolute(f64),
    /// Three robust standard deviations of the ground about its plane, but at least the floor:
    /// what the sensor can tell from the ground. A patch must reach six of them somewhere, for
    /// one pixel in 740 of Gaussian noise is above three, and correlated noise makes patches of them.
    Automatic {
        /// Least threshold `[m]`.
        floor: f64,
    },
}

impl Default for Threshold {
    /// Automatic with a floor of 1 mm, a quarter of the paper's 4 mm grains: one layer is kept.
    fn default() -> Self {
        Self::Automatic { floor: 0.001 }
    }
}

impl Threshold {
    /// Robust standard deviations of the ground that an automatic threshold is above it: one pixel in 740 of Gaussian
    /// noise is taken for a grain by itself.
    pub const ABOVE_NOISE: f64 = 3.0;

    /// The height `[m]` for a ground of the given roughness `[m]`.
    pub(super) fn height(self, ground_sd: f64) -> f64 {
        match self {
            Self::Absolute(height) => height,
            Self::Automatic { floor } => floor.max(Self::ABOVE_NOISE * ground_sd),
        }
    }

    /// The height `[m]` that a patch of grains must reach somewhere; a fixed threshold asks for none.
    pub(super) fn peak(self, ground_sd: f64) -> Option<f64> {
        match self {
            Self::Absolute(_) => None,
            Self::Automatic { floor } => Some(floor.max(PEAK_SDS * ground_sd)),
        }
    }
}

impl<'de> Deserialize<'de> for Threshold {
    /// From a table, `{ absolute = 0.002 }` or `{ automatic = { floor = 0.001 } }`, or from the height by itself.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Stated)
    }
}

/// A threshold as its table states it.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Table {
    Absolute(f64),
    Automatic { floor: f64 },
}

struct Stated;

impl<'de> Visitor<'de> for Stated {
    type Value = Threshold;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a height in m, { absolute = 0.002 } or { automatic = { floor = 0.001 } }")
    }

    fn visit_f64<E>(self, height: f64) -> Result<Threshold, E> {
        Ok(Threshold::Absolute(height))
    }

    fn visit_i64<E>(self, height: i64) -> Result<Threshold, E> {
        Ok(Threshold::Absolute(height as f64))
    }

    fn visit_u64<E>(self, height: u64) -> Result<Threshold, E> {
        Ok(Threshold::Absolute(height as f64))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Threshold, A::Error> {
        Ok(match Table::deserialize(MapAccessDeserializer::new(map))? {
            Table::Absolute(height) => Threshold::Absolute(height),
            Table::Automatic { floor } => Threshold::Automatic { floor },
        })
    }
}
