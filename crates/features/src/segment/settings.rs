//! What the segmentation can be told.

use serde::{Deserialize, Serialize};

use crate::camera::sample_offset;
use crate::colour::HsvRange;
use crate::error::{FeatureError, require_in};

/// Largest length `[m]` that a setting may have.
const MAX_LENGTH: f64 = 1e3;

/// Height above the ground from which a pixel counts as grain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Threshold {
    /// This height `[m]`.
    Absolute(f64),
    /// Three robust standard deviations of the ground about its plane, but at least the floor:
    /// what the sensor can tell from the ground.
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
    /// The height `[m]` for a ground of the given roughness `[m]`.
    pub(super) fn height(self, ground_sd: f64) -> f64 {
        match self {
            Self::Absolute(height) => height,
            Self::Automatic { floor } => floor.max(3.0 * ground_sd),
        }
    }
}

/// How an image is segmented. The default suits an overhead depth camera at 0.3 m to 0.5 m.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Segmentation {
    /// Height from which a pixel counts as grain; default automatic, at least 1 mm.
    pub height_threshold: Threshold,
    /// Colours that count as grain, instead of the height; default none.
    pub colour: Option<HsvRange>,
    /// Frame of pixels at the edge of the full image that is ignored `[px]`; default 0.
    pub border_px: usize,
    /// Keep the middle pixel of every n × n block; default 1, all (the paper: 10 for its D435).
    pub downsample: usize,
    /// Distance from the plane within which a pixel can be ground `[m]`; default 3 mm, above the
    /// noise of a stereo camera at that height. It is brought down to the noise that is found.
    pub inlier_distance: f64,
    /// Height above which a pixel is a fault (a funnel, a hand, a spike) and not data `[m]`; default
    /// none.
    pub max_height: Option<f64>,
    /// Grains must form patches of at least so many pixels, counted over edges and corners; default
    /// 1, which keeps all. Raise it against single noisy pixels, at the price of single grains.
    pub min_component_px: usize,
    /// Seed of the random search for the plane; default 0.
    pub plane_seed: u64,
}

impl Default for Segmentation {
    fn default() -> Self {
        Self {
            height_threshold: Threshold::default(),
            colour: None,
            border_px: 0,
            downsample: 1,
            inlier_distance: 0.003,
            max_height: None,
            min_component_px: 1,
            plane_seed: 0,
        }
    }
}

impl Segmentation {
    /// Refuses lengths that mean nothing.
    pub(super) fn require_valid(&self) -> Result<(), FeatureError> {
        let threshold = match self.height_threshold {
            Threshold::Absolute(height) => height,
            Threshold::Automatic { floor } => floor,
        };
        require_in("height_threshold [m]", threshold, 0.0, MAX_LENGTH)?;
        require_in("inlier_distance [m]", self.inlier_distance, 1e-9, MAX_LENGTH)?;
        require_in("max_height [m]", self.max_height.unwrap_or(MAX_LENGTH), 0.0, MAX_LENGTH)
    }

    /// Whether a pixel of the down-sampled image lies inside the border of the full one.
    pub(super) fn inside(
        &self,
        width: usize,
        height: usize,
    ) -> impl Fn(usize, usize) -> bool + use<> {
        let (border, n) = (self.border_px, self.downsample);
        let kept = move |pixel: usize, side: usize| {
            let full = pixel * n + sample_offset(n);
            full >= border && full < side.saturating_sub(border)
        };
        move |u, v| kept(u, width) && kept(v, height)
    }
}
