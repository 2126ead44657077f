//! From an image to the points of the formation.
//!
//! Measured and simulated images take one path: valid pixels to points, ground plane, the frame in
//! which the ground is z = 0, mask ([`Levelled`]), points centred at their centroid ([`Formation`]).
//! For a noise-free simulated image the plane is known and [`grain_points`] skips the fit.

mod bow;
mod component;
mod directions;
mod edge;
mod field;
mod flat;
mod flying;
mod formation;
mod ground;
mod levelled;
mod outlook;
mod part;
mod settings;
mod shape;
mod step;
mod threshold;

use nalgebra::Vector3;

pub use edge::EdgePixels;
pub use formation::Formation;
pub use levelled::Levelled;
pub use part::Part;
pub use settings::Segmentation;
pub use shape::{Kind, Shape};
pub use threshold::Threshold;

use crate::camera::Camera;
use crate::colour::ColourImage;
use crate::depth::{DepthImage, is_valid};
use crate::error::{FeatureError, require_finite};
use crate::height_map::HeightMap;
use crate::plane::PlaneFit;
use levelled::{Cloud, Footprint, flipped};
use settings::side_of;

/// Sides of the grid `[px]` on which the ground is looked for to choose the down-sampling.
const COARSE_SIDE_PX: usize = 160;

/// Points that a plane needs.
const LEAST_POINTS: usize = 3;

/// The formation in a depth image.
///
/// With a colour image and `segmentation.colour` the colour decides what is a grain and the ground
/// is fitted to the other pixels; without, the height above the ground decides and the fit has to
/// find the ground by itself.
///
/// # Errors
/// `IncompleteColour` when only one of image and range is given, `SizeMismatch` when camera, depth
/// and colour differ in size, `NoValidDepth`, `TooSmall` on the ground for `ground_resolution`,
/// `DegeneratePlane`, `TooSteep` for a ground beyond `max_tilt_deg`, `EmptyMask`, `OutOfRange` for a
/// setting.
pub fn segment_depth(
    camera: &Camera,
    image: &DepthImage,
    colour: Option<&ColourImage>,
    segmentation: &Segmentation,
) -> Result<Formation, FeatureError> {
    level_depth(camera, image, colour, segmentation)?.into_formation()
}

/// The formation in a height map; heights are positive up, NaN and non-finite pixels carry no data.
///
/// # Errors
/// As [`segment_depth`]; `IncompleteColour` when `segmentation.colour` is set, as there is no image.
pub fn segment_height_map(
    map: &HeightMap,
    segmentation: &Segmentation,
) -> Result<Formation, FeatureError> {
    level_height_map(map, segmentation)?.into_formation()
}

/// The ground, the heights above it and the mask of a depth image, whether or not there is a grain.
///
/// # Errors
/// As [`segment_depth`] but for `EmptyMask`.
pub fn level_depth(
    camera: &Camera,
    image: &DepthImage,
    colour: Option<&ColourImage>,
    segmentation: &Segmentation,
) -> Result<Levelled, FeatureError> {
    segmentation.require_valid()?;
    camera.require_valid()?;
    image.require_valid()?;
    camera.require_size(image.width, image.height)?;
    segmentation.require_region(image.width, image.height)?;
    let colour = match (colour, &segmentation.colour) {
        (Some(colour), Some(range)) => {
            let (got, expected) = ((colour.width, colour.height), (image.width, image.height));
            if got != expected {
                return Err(FeatureError::SizeMismatch { what: "colour image", got, expected });
            }
            Some((colour, range))
        }
        (None, None) => None,
        (image, range) => return Err(incomplete_colour(image.is_some(), range.is_some())),
    };
    // The ground lies in front of the camera, whatever pose the caller believes it has.
    let up = |fit: PlaneFit| {
        let below = fit.plane.signed_distance(&camera.centre_in_world()) < 0.0;
        if below { flipped(fit) } else { fit }
    };
    let image = flying::removed(image, camera, segmentation.flying_deg);
    let side = image.width.min(image.height);
    let cloud = |n: usize| depth_cloud(camera, &image, segmentation, n);
    let grains = |n: usize| colour.map(|(colour, range)| colour.mask(range, n)).transpose();
    let (n, small) =
        if segmentation.downsample.is_none() && segmentation.ground_resolution.is_some() {
            // A pixel's width on the ground needs the ground, for which some pixels are enough.
            let coarse = (side / COARSE_SIDE_PX).max(1);
            let glance = cloud(coarse)?;
            let (plane, _) = glance.ground(segmentation, grains(coarse)?.as_deref(), up)?;
            let pixel = glance.resolution(&plane);
            let n = segmentation.factor(side_of(pixel) / coarse as f64, side);
            let whole = |width: f64, pixels: usize| width * pixels as f64 / coarse as f64;
            let extent = (whole(pixel.0, image.width), whole(pixel.1, image.height));
            (n, require_some(cloud(n)?, segmentation, extent)?)
        } else {
            let n = segmentation.factor(1.0, side);
            (n, cloud(n)?)
        };
    let levelled = small.level(segmentation, grains(n)?.as_deref(), up)?;
    let along = camera.camera_from_world.inverse_transform_vector(&Vector3::x());
    Ok(in_field(levelled, segmentation, &along))
}

/// Refuses an image that is so small on the ground, `extent` `[m]`, that pixels of the width that is asked for leave
/// none.
fn require_some(
    cloud: Cloud,
    segmentation: &Segmentation,
    extent: (f64, f64),
) -> Result<Cloud, FeatureError> {
    match segmentation.ground_resolution {
        Some(wanted) if cloud.downsample > 1 && cloud.points.len() < LEAST_POINTS => {
            Err(FeatureError::TooSmall { extent, wanted, got: cloud.points.len() })
        }
        _ => Ok(cloud),
    }
}

/// What of it lies in the region and in the field of view that are asked for; columns of the image go `along`.
fn in_field(levelled: Levelled, segmentation: &Segmentation, along: &Vector3<f64>) -> Levelled {
    // As if the camera had seen no more.
    let levelled = if segmentation.region.is_some() { levelled.trimmed() } else { levelled };
    match segmentation.field_width {
        Some(width) => levelled.within(width, along),
        None => levelled,
    }
}

/// The points of a depth image down-sampled by `n`.
fn depth_cloud(
    camera: &Camera,
    image: &DepthImage,
    segmentation: &Segmentation,
    n: usize,
) -> Result<Cloud, FeatureError> {
    let (small_camera, small) = (camera.downsampled(n)?, image.downsample(n)?);
    let inside = segmentation.inside(image.width, image.height, n);
    let [across, axis] = [Vector3::x(), Vector3::z()]
        .map(|axis| camera.camera_from_world.inverse_transform_vector(&axis));
    let footprint = Footprint::Pyramid {
        fx: small_camera.intrinsics.fx,
        fy: small_camera.intrinsics.fy,
        centre: camera.centre_in_world(),
        axis,
        across,
    };
    let point = |u: usize, v: usize| unproject_pixel(&small_camera, &small, u, v);
    Ok(Cloud::new((small.width, small.height), n, footprint, |u, v| {
        if inside(u, v) { point(u, v) } else { None }
    }))
}

/// The ground, the heights above it and the mask of a height map, whether or not there is a grain.
///
/// # Errors
/// As [`segment_height_map`] but for `EmptyMask`.
pub fn level_height_map(
    map: &HeightMap,
    segmentation: &Segmentation,
) -> Result<Levelled, FeatureError> {
    segmentation.require_valid()?;
    map.require_valid()?;
    segmentation.require_region(map.width, map.height)?;
    if segmentation.colour.is_some() {
        return Err(incomplete_colour(false, true));
    }
    let resolution = side_of((map.resolution_x, map.resolution_y));
    let n = segmentation.factor(resolution, map.width.min(map.height));
    let inside = segmentation.inside(map.width, map.height, n);
    let small = flying::removed_heights(map, segmentation.flying_deg).downsample(n)?;
    let footprint = Footprint::Column { x: small.resolution_x, y: small.resolution_y };
    let cloud = Cloud::new((small.width, small.height), n, footprint, |u, v| {
        let point = small.point(u, v);
        (inside(u, v) && point.z.is_finite()).then_some(point)
    });
    let extent = (map.resolution_x * map.width as f64, map.resolution_y * map.height as f64);
    let cloud = if map.z.iter().any(|z| z.is_finite()) {
        require_some(cloud, segmentation, extent)?
    } else {
        cloud
    };
    let levelled = cloud.level(segmentation, None, |fit| fit)?;
    Ok(in_field(levelled, segmentation, &Vector3::x()))
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
        return Err(FeatureError::no_grain_in_image(valid, highest, threshold));
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
