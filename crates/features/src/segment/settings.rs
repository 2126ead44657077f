//! What the segmentation can be told.

use serde::{Deserialize, Serialize};

use crate::camera::sample_offset;
use crate::colour::HsvRange;
use crate::error::{FeatureError, require_in};
use crate::region::Region;
use granulcal_scene::{CameraSpec, Mask};

use super::threshold::Threshold;

/// Largest length `[m]` that a setting may have.
const MAX_LENGTH: f64 = 1e3;

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
    /// Part of the full image that is looked at `[px]`: the floor of a tray, without its rim and the table around it.
    /// Default none, which is all of it.
    pub region: Option<Region>,
    /// Keep the middle pixel of every n × n block (the paper: 10 for its D435); default the n with
    /// which a pixel is as wide on the ground as `ground_resolution`, or 1 without one.
    pub downsample: Option<usize>,
    /// Width of a pixel on the ground that the down-sampled image should have `[m/px]`: that of the
    /// simulated images. Default none.
    pub ground_resolution: Option<f64>,
    /// Side of the square of ground that is kept of an image that shows more `[m]`: that of the simulated images.
    /// Default none.
    pub field_width: Option<f64>,
    /// Distance from the plane within which a pixel can be ground `[m]`. Default automatic: from 3 mm
    /// on it is doubled until the ground does not go on below it, then brought to the noise found.
    pub inlier_distance: Option<f64>,
    /// Tilt beyond which a plane is a wall and not the ground `[deg]`; default 45.
    pub max_tilt_deg: f64,
    /// Incidence beyond which two steps in a row from pixel to pixel are no surface but a pixel that
    /// flies between two `[deg]`; default 80, 90 keeps all.
    pub flying_deg: f64,
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
            region: None,
            downsample: None,
            ground_resolution: None,
            field_width: None,
            inlier_distance: None,
            max_tilt_deg: 45.0,
            flying_deg: 80.0,
            max_height: None,
            min_component_px: 1,
            plane_seed: 0,
        }
    }
}

impl Segmentation {
    /// These settings for a recording that is held against the images of a scene's camera: pixels as wide on the
    /// ground, no more of the ground in view and, unless they state one, its threshold.
    #[must_use]
    pub fn as_seen_by(&self, camera: &CameraSpec) -> Self {
        Self {
            downsample: None,
            ground_resolution: Some(camera.ground_resolution()),
            field_width: Some(camera.field_width),
            ..self.at_threshold_of(camera)
        }
    }

    /// These settings with the height from which the camera's images show grain as the floor of the automatic
    /// threshold, which stays above the ground's noise; unless they state a threshold, or its images are told apart by
    /// colour.
    #[must_use]
    pub fn at_threshold_of(&self, camera: &CameraSpec) -> Self {
        match camera.mask {
            Mask::Height => self.with_scene_threshold(camera.height_threshold),
            Mask::Colour => self.clone(),
        }
    }

    /// These settings with an automatic threshold of at least `floor` `[m]`, unless they state another than the
    /// default.
    #[must_use]
    pub fn with_scene_threshold(&self, floor: f64) -> Self {
        let height_threshold = match self.height_threshold {
            own if own == Threshold::default() => Threshold::Automatic { floor },
            own => own,
        };
        Self { height_threshold, ..self.clone() }
    }

    /// Refuses lengths that mean nothing.
    pub(super) fn require_valid(&self) -> Result<(), FeatureError> {
        let threshold = match self.height_threshold {
            Threshold::Absolute(height) => height,
            Threshold::Automatic { floor } => floor,
        };
        require_in("height_threshold [m]", threshold, 0.0, MAX_LENGTH)?;
        let optional = |what, value: Option<f64>, min| {
            require_in(what, value.unwrap_or(MAX_LENGTH), min, MAX_LENGTH)
        };
        optional("inlier_distance [m]", self.inlier_distance, 1e-9)?;
        optional("ground_resolution [m/px]", self.ground_resolution, 1e-9)?;
        optional("field_width [m]", self.field_width, 1e-9)?;
        optional("max_height [m]", self.max_height, 0.0)?;
        require_in("max_tilt_deg [deg]", self.max_tilt_deg, 0.0, 90.0)?;
        require_in("flying_deg [deg]", self.flying_deg, 0.0, 90.0)
    }

    /// The factor of down-sampling for an image whose pixels are `resolution` `[m/px]` wide on the
    /// ground and which has `side` of them along its shorter side.
    pub(super) fn factor(&self, resolution: f64, side: usize) -> usize {
        match (self.downsample, self.ground_resolution) {
            (Some(n), _) => n,
            (None, Some(wanted)) => ((wanted / resolution).round() as usize).clamp(1, side.max(1)),
            (None, None) => 1,
        }
    }

    /// Refuses a region that is not in an image of this size.
    pub(super) fn require_region(&self, width: usize, height: usize) -> Result<(), FeatureError> {
        self.region.map_or(Ok(()), |region| region.require_inside(width, height))
    }

    /// Whether a pixel of the down-sampled image lies inside the border of the full one, and in its region.
    pub(super) fn inside(
        &self,
        width: usize,
        height: usize,
        n: usize,
    ) -> impl Fn(usize, usize) -> bool + use<> {
        let border = self.border_px;
        let region = self.region.unwrap_or(Region::whole(width, height));
        let full = move |pixel: usize| pixel * n + sample_offset(n);
        let kept = move |at: usize, side: usize| at >= border && at < side.saturating_sub(border);
        move |u, v| {
            let (u, v) = (full(u), full(v));
            kept(u, width) && kept(v, height) && region.holds(u, v)
        }
    }
}

/// Side of the square that is as large as a pixel of these widths along x and y.
pub(super) fn side_of((x, y): (f64, f64)) -> f64 {
    (x * y).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_says_the_threshold_where_the_settings_say_none() {
        let camera = CameraSpec { height_threshold: 1.5e-3, ..CameraSpec::default() };
        let none = Segmentation::default();
        let of_scene = Threshold::Automatic { floor: 1.5e-3 };
        assert_eq!(none.as_seen_by(&camera).height_threshold, of_scene);
        // As in the scene's images where there is no noise, and above the noise where there is.
        assert_eq!([0.0, 4e-4, 1e-3].map(|sd| of_scene.height(sd)), [1.5e-3, 1.5e-3, 3e-3]);
        for stated in [Threshold::Absolute(1e-3), Threshold::Automatic { floor: 2e-3 }] {
            let own = Segmentation { height_threshold: stated, ..none.clone() };
            assert_eq!(own.as_seen_by(&camera).height_threshold, stated);
        }
        let by_colour = CameraSpec { mask: Mask::Colour, ..camera };
        assert_eq!(none.as_seen_by(&by_colour).height_threshold, Threshold::default());
    }
}
