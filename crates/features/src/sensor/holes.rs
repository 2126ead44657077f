//! Where a depth camera sees nothing: equation (4) of `docs/theory/sensor.md`.

use granulcal_scene::StereoSensor;
use nalgebra::Vector3;

use crate::camera::Camera;
use crate::depth::{DepthImage, is_valid};
use crate::height_map::HeightMap;

/// Jump of the disparity per pixel of the sensor beyond which the two images no longer show a
/// surface's points in the same order.
const ORDER: f64 = 1.0;

/// Clears what the right imager does not see: left of its view, and behind a nearer surface.
///
/// `scale` is the number of the sensor's pixels along a pixel of the image.
pub(super) fn clear_occluded(
    seen: &mut [bool],
    image: &DepthImage,
    sensor: &StereoSensor,
    scale: f64,
) {
    let rows = seen.chunks_exact_mut(image.width).zip(image.depth.chunks_exact(image.width));
    let mut disparity = vec![0.0; image.width];
    for (seen, depth) in rows {
        for (disparity, &depth) in disparity.iter_mut().zip(depth) {
            // NaN fails every comparison: next to no data there is no jump.
            *disparity =
                if is_valid(depth) { sensor.disparity(f64::from(depth)) } else { f64::NAN };
        }
        for (u, seen) in seen.iter_mut().enumerate() {
            let column = (u as f64 + 0.5) * scale;
            *seen &= column - disparity[u] >= sensor.left_margin;
        }
        for u in 1..image.width {
            let jump = disparity[u] - disparity[u - 1];
            if jump > ORDER * scale {
                // The edge lies in the middle between the two pixels; whose middles are hidden?
                let hidden = ((jump + sensor.edge_margin) / scale).round() as usize;
                seen[u.saturating_sub(hidden)..u].fill(false);
            }
        }
    }
}

/// Clears surfaces whose normal is turned from the ray by `limit_deg` or more.
pub(super) fn clear_grazing(
    seen: &mut [bool],
    image: &DepthImage,
    camera: &Camera,
    limit_deg: f64,
) {
    let point = |u: usize, v: usize| {
        let depth = image.at(u, v);
        is_valid(depth).then(|| camera.unproject(u as f64 + 0.5, v as f64 + 0.5, f64::from(depth)))
    };
    let eye = camera.centre_in_world();
    clear(seen, image.width, limit_deg, point, |p| (p - eye).normalize());
}

/// As [`clear_grazing`], for rays that all go straight down.
pub(super) fn clear_grazing_heights(seen: &mut [bool], map: &HeightMap, limit_deg: f64) {
    let point = |u: usize, v: usize| {
        let point = map.point(u, v);
        (u < map.width && v < map.height && point.z.is_finite()).then_some(point)
    };
    clear(seen, map.width, limit_deg, point, |_| -Vector3::z());
}

fn clear(
    seen: &mut [bool],
    width: usize,
    limit_deg: f64,
    point: impl Fn(usize, usize) -> Option<Vector3<f64>>,
    ray_to: impl Fn(Vector3<f64>) -> Vector3<f64>,
) {
    if limit_deg >= 90.0 {
        return;
    }
    let least_cosine = limit_deg.to_radians().cos();
    for (index, seen) in seen.iter_mut().enumerate() {
        let (u, v) = (index % width, index / width);
        let Some(here) = point(u, v) else { continue };
        let ray = ray_to(here);
        // The flatter of the two sides: an edge is steep on one of them, a grazing surface on both.
        let along = |before: Option<Vector3<f64>>, after: Option<Vector3<f64>>| {
            let steps = [before.map(|p| here - p), after.map(|p| p - here)];
            let depth = |step: &Vector3<f64>| (ray.dot(step) / step.norm()).abs();
            steps.into_iter().flatten().min_by(|a, b| depth(a).total_cmp(&depth(b)))
        };
        let x = along(u.checked_sub(1).and_then(|u| point(u, v)), point(u + 1, v));
        let y = along(v.checked_sub(1).and_then(|v| point(u, v)), point(u, v + 1));
        let (Some(x), Some(y)) = (x, y) else { continue };
        let normal = x.cross(&y);
        if normal.dot(&ray).abs() < least_cosine * normal.norm() {
            *seen = false;
        }
    }
}
