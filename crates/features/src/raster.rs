//! Grains over the ground plane to a depth image, exact to the ray.
//!
//! Each grain is visited once: the tangents of its silhouette bound the pixels it can cover, and
//! for those the ray through the pixel's centre is intersected with the sphere; the nearest depth
//! wins. All arithmetic is f64 with only + - · / and √, which IEEE 754 rounds in one way, so an
//! image has the same bits on every machine and in every order of the grains. See
//! `docs/theory/features.md` for the equations.

mod convex;
mod orthographic;
mod sphere;

use nalgebra::Vector3;

pub use convex::{ConvexShape, render_convex};
pub use orthographic::height_map;

use crate::camera::{Camera, downsampled_size, sample_offset};
use crate::depth::DepthImage;
use crate::error::{FeatureError, require_in, require_length};
use sphere::SphereInView;

/// Largest coordinate and radius `[m]` that is rendered; squares of it stay far from overflow.
const MAX_COORDINATE: f64 = 1e6;

/// The depth image of spheres on the ground z = 0.
///
/// A pixel where the ray meets neither a grain nor the ground in front of the camera is 0.0. A
/// grain behind the camera is not seen, nor is one that contains the camera's centre: it has no
/// front for the camera to look at.
///
/// # Errors
/// `LengthMismatch` when there is not one radius per position, `OutOfRange` for a radius that is
/// not positive, a coordinate beyond 1000 km or not finite, or a camera with nonsense in its fields.
pub fn render(
    camera: &Camera,
    positions: &[Vector3<f64>],
    radii: &[f64],
) -> Result<DepthImage, FeatureError> {
    render_grid(camera, positions, radii, 1)
}

/// What `render(..)?.downsample(step)` returns, bit for bit, at the cost of the pixels kept.
///
/// # Errors
/// As [`render`], and `DownsampleFactor` when no pixel would be left.
pub fn render_grid(
    camera: &Camera,
    positions: &[Vector3<f64>],
    radii: &[f64],
    step: usize,
) -> Result<DepthImage, FeatureError> {
    camera.require_valid()?;
    require_spheres(positions, radii)?;
    let k = &camera.intrinsics;
    let (width, height) = downsampled_size(k.width, k.height, step)?;
    let columns = SampledAxis::new(width, step, k.fx, k.cx);
    let rows = SampledAxis::new(height, step, k.fy, k.cy);

    let (mut depth, sees_horizon) = ground_depth(camera, &columns, &rows);
    let grains = positions.iter().zip(radii).filter_map(|(position, &radius)| {
        let centre = camera.camera_from_world * nalgebra::Point3::from(*position);
        SphereInView::new(centre.coords, radius)
    });
    // The widest registers of the machine: no step is fused, so the bits are the same on all.
    pulp::Arch::new().dispatch(|| {
        for grain in grains {
            let (first_row, end_row) = rows.covered(grain.slopes_y);
            let (first, end) = columns.covered(grain.slopes_x);
            if first >= end {
                continue;
            }
            for row in first_row..end_row {
                let pixels = &mut depth[row * width + first..row * width + end];
                grain.draw_row(rows.slopes[row], &columns.slopes[first..end], pixels);
            }
        }
    });
    if sees_horizon {
        for value in &mut depth {
            *value = if value.is_finite() { *value } else { 0.0 };
        }
    }
    DepthImage::new(width, height, depth)
}

/// Depth of the ground at every pixel, infinite where the ray never meets it, and whether there is
/// such a pixel.
fn ground_depth(camera: &Camera, columns: &SampledAxis, rows: &SampledAxis) -> (Vec<f32>, bool) {
    let height = camera.centre_in_world().z;
    // World z of the ray (x, y, 1) is `up` times it.
    let rotation = camera.camera_from_world.rotation.to_rotation_matrix();
    let up = rotation.matrix().column(2).into_owned();
    let width = columns.slopes.len();
    let mut depth = vec![0.0; width * rows.slopes.len()];
    let mut sees_horizon = false;
    let draw = || {
        for (pixels, &y) in depth.chunks_exact_mut(width).zip(&rows.slopes) {
            let up_at_row = up.y * y + up.z;
            let ground_at = |x: f64| {
                let ground = (-height / (up.x * x + up_at_row)) as f32;
                if ground > 0.0 { ground } else { f32::INFINITY }
            };
            if up.x == 0.0 {
                // Not tilted sideways: the ground has one depth along a row.
                pixels.fill(ground_at(0.0));
            } else {
                for (pixel, &x) in pixels.iter_mut().zip(&columns.slopes) {
                    *pixel = ground_at(x);
                }
            }
            // 1/depth is linear along a row, so only its ends can be the first to miss the ground.
            sees_horizon |= pixels[0].is_infinite() || pixels[width - 1].is_infinite();
        }
    };
    pulp::Arch::new().dispatch(draw);
    (depth, sees_horizon)
}

/// The ray slopes of the pixels that are rendered, along one axis of the image.
struct SampledAxis {
    /// x/z (or y/z) of the ray through each pixel's centre.
    slopes: Vec<f64>,
    focal: f64,
    /// Image coordinate of the centre of the first pixel, less the principal point `[px]`.
    first: f64,
    step: f64,
}

impl SampledAxis {
    /// Slack `[px]` on the bounds of a silhouette: the ray test decides, the bounds only save time.
    const SLACK: f64 = 1e-6;

    fn new(count: usize, step: usize, focal: f64, principal: f64) -> Self {
        let offset = sample_offset(step);
        let slopes =
            (0..count).map(|i| ((i * step + offset) as f64 + 0.5 - principal) / focal).collect();
        Self { slopes, focal, first: offset as f64 + 0.5 - principal, step: step as f64 }
    }

    /// Half-open range of pixels whose slope lies between the two given.
    fn covered(&self, (low, high): (f64, f64)) -> (usize, usize) {
        let index = |slope: f64, slack: f64| (slope * self.focal - self.first + slack) / self.step;
        let count = self.slopes.len() as f64;
        // The cast of a clamped, non-negative number is exact.
        let first = index(low, -Self::SLACK).ceil().clamp(0.0, count);
        let end = (index(high, Self::SLACK).floor() + 1.0).clamp(0.0, count);
        (first as usize, end as usize)
    }
}

/// Refuses spheres that are not spheres.
fn require_spheres(positions: &[Vector3<f64>], radii: &[f64]) -> Result<(), FeatureError> {
    require_length("radii", radii.len(), positions.len())?;
    for position in positions {
        for &coordinate in position {
            require_in("position [m]", coordinate, -MAX_COORDINATE, MAX_COORDINATE)?;
        }
    }
    for &radius in radii {
        require_in("radius [m]", radius, f64::MIN_POSITIVE, MAX_COORDINATE)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
