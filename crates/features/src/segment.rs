//! From an image to the points of the formation.
//!
//! Measured and simulated images take one path: valid pixels to points, ground plane, the frame in
//! which the ground is z = 0, mask, points centred at their centroid. For a noise-free simulated
//! image the plane is known and [`grain_points`] skips the fit.

mod cloud;
mod component;
mod settings;
mod spacing;

use nalgebra::{Vector2, Vector3};

pub use settings::{Segmentation, Threshold};

use crate::camera::Camera;
use crate::colour::ColourImage;
use crate::depth::{DepthImage, is_valid};
use crate::error::{FeatureError, require_finite};
use crate::height_map::HeightMap;
use crate::plane::PlaneFit;
use cloud::Cloud;

/// The points of a formation and how they were found.
#[derive(Debug, Clone, PartialEq)]
pub struct Formation {
    /// Points of the grains `[m]`: ground at z = 0, z up, centroid at x = y = 0.
    pub points: Vec<Vector3<f64>>,
    /// Which pixels the points are, row by row, shape [height · width].
    pub mask: Vec<bool>,
    /// Columns of the mask `[px]`, after down-sampling.
    pub width: usize,
    /// Rows of the mask `[px]`, after down-sampling.
    pub height: usize,
    /// The ground in the frame of the input, normal towards the camera.
    pub plane: PlaneFit,
    /// Pixels that carry data, within the border.
    pub valid_count: usize,
    /// Pixels taken for grains.
    pub masked_count: usize,
    /// Height above the ground from which a pixel counts as grain `[m]`; not applied when a colour
    /// decides.
    pub threshold: f64,
    /// Where the centroid was in the levelled frame, before it was moved to 0 `[m]`.
    pub centroid: Vector2<f64>,
}

/// The formation in a depth image.
///
/// With a colour image and `segmentation.colour` the colour decides what is a grain and the ground
/// is fitted to the other pixels; without, the height above the ground decides and the fit has to
/// find the ground by itself.
///
/// # Errors
/// `IncompleteColour` when only one of image and range is given, `SizeMismatch` when camera, depth
/// and colour differ in size, `NoValidDepth`, `DegeneratePlane`, `EmptyMask`, `OutOfRange` for a
/// setting.
pub fn segment_depth(
    camera: &Camera,
    image: &DepthImage,
    colour: Option<&ColourImage>,
    segmentation: &Segmentation,
) -> Result<Formation, FeatureError> {
    segmentation.require_valid()?;
    camera.require_valid()?;
    image.require_valid()?;
    camera.require_size(image.width, image.height)?;
    let n = segmentation.downsample;
    let grains = match (colour, &segmentation.colour) {
        (Some(colour), Some(range)) => {
            let (got, expected) = ((colour.width, colour.height), (image.width, image.height));
            if got != expected {
                return Err(FeatureError::SizeMismatch { what: "colour image", got, expected });
            }
            Some(colour.mask(range, n)?)
        }
        (None, None) => None,
        (image, range) => return Err(incomplete_colour(image.is_some(), range.is_some())),
    };
    let (small_camera, small) = (camera.downsampled(n)?, image.downsample(n)?);
    let point = |u: usize, v: usize| unproject_pixel(&small_camera, &small, u, v);
    let inside = segmentation.inside(image.width, image.height);
    let cloud =
        Cloud::new(small.width, small.height, |u, v| if inside(u, v) { point(u, v) } else { None });
    // The ground lies in front of the camera, whatever pose the caller believes it has.
    let up = |fit: PlaneFit| {
        let below = fit.plane.signed_distance(&camera.centre_in_world()) < 0.0;
        if below { cloud::flipped(fit) } else { fit }
    };
    cloud.segment(segmentation, grains.as_deref(), up)
}

/// The formation in a height map; heights are positive up, NaN and non-finite pixels carry no data.
///
/// # Errors
/// As [`segment_depth`]; `IncompleteColour` when `segmentation.colour` is set, as there is no image.
pub fn segment_height_map(
    map: &HeightMap,
    segmentation: &Segmentation,
) -> Result<Formation, FeatureError> {
    segmentation.require_valid()?;
    if segmentation.colour.is_some() {
        return Err(incomplete_colour(false, true));
    }
    let inside = segmentation.inside(map.width, map.height);
    let small = map.downsample(segmentation.downsample)?;
    let cloud = Cloud::new(small.width, small.height, |u, v| {
        let point = small.point(u, v);
        (inside(u, v) && point.z.is_finite()).then_some(point)
    });
    cloud.segment(segmentation, None, |fit| fit)
}

/// The points of a noise-free image that lie above `threshold` `[m]`, in the world, not centred.
///
/// The plane is the known ground z = 0. Half a grain's radius is a good threshold: it is far above
/// the rounding of an f32 depth and below the top of a grain that lies on the ground.
///
/// # Errors
/// `SizeMismatch` when `camera` is not the camera of this image (for a down-sampled image, pass
/// [`Camera::downsampled`]), `NoValidDepth`, `EmptyMask`, `NonFinite` for the threshold.
pub fn grain_points(
    camera: &Camera,
    image: &DepthImage,
    threshold: f64,
) -> Result<Vec<Vector3<f64>>, FeatureError> {
    require_finite("threshold", [threshold].into_iter())?;
    camera.require_valid()?;
    image.require_valid()?;
    camera.require_size(image.width, image.height)?;
    let (mut valid, mut highest) = (0, f64::NEG_INFINITY);
    let mut points = Vec::new();
    for v in 0..image.height {
        for point in (0..image.width).filter_map(|u| unproject_pixel(camera, image, u, v)) {
            valid += 1;
            highest = highest.max(point.z);
            if point.z > threshold {
                points.push(point);
            }
        }
    }
    if valid == 0 {
        return Err(FeatureError::NoValidDepth { pixels: image.depth.len(), got: 0, min: 1 });
    }
    if points.is_empty() {
        return Err(FeatureError::EmptyMask { valid, highest, threshold });
    }
    Ok(points)
}

/// The point that a pixel saw, if it saw one.
fn unproject_pixel(
    camera: &Camera,
    image: &DepthImage,
    u: usize,
    v: usize,
) -> Option<Vector3<f64>> {
    let depth = image.at(u, v);
    is_valid(depth).then(|| camera.unproject(u as f64 + 0.5, v as f64 + 0.5, f64::from(depth)))
}

/// Colour needs both an image and a range.
fn incomplete_colour(image: bool, range: bool) -> FeatureError {
    FeatureError::IncompleteColour { image, range }
}

#[cfg(test)]
mod tests;
