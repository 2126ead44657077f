//! Pixels that fly: a mean of the near and the far side of an edge, at which there is nothing.
//!
//! At a depth edge a camera delivers pixels between the two surfaces. Going across the edge their
//! depth rises twice, to them and away from them, by more than any surface's that the camera can see:
//! a surface of incidence i rises by tan(i) times the width of a pixel.

use crate::camera::Camera;
use crate::depth::{DepthImage, is_valid};
use crate::height_map::HeightMap;

/// The image without its flying pixels.
pub(super) fn removed(image: &DepthImage, camera: &Camera, limit_deg: f64) -> DepthImage {
    let slope = limit_deg.to_radians().tan();
    let (fx, fy) = (camera.intrinsics.fx, camera.intrinsics.fy);
    let value = |u: usize, v: usize| {
        let depth = image.at(u, v);
        is_valid(depth).then(|| f64::from(depth))
    };
    let mut depth = image.depth.clone();
    for_each_flying(
        image.width,
        image.height,
        limit_deg,
        value,
        |z| (slope * z / fx, slope * z / fy),
        |pixel| depth[pixel] = 0.0,
    );
    DepthImage { depth, ..*image }
}

/// The map without its flying pixels.
pub(super) fn removed_heights(map: &HeightMap, limit_deg: f64) -> HeightMap {
    let slope = limit_deg.to_radians().tan();
    let step = (slope * map.resolution_x, slope * map.resolution_y);
    let value = |u: usize, v: usize| Some(map.at(u, v)).filter(|z| z.is_finite());
    let mut z = map.z.clone();
    for_each_flying(map.width, map.height, limit_deg, value, |_| step, |p| z[p] = f64::NAN);
    HeightMap { z, ..*map }
}

fn for_each_flying(
    width: usize,
    height: usize,
    limit_deg: f64,
    value: impl Fn(usize, usize) -> Option<f64>,
    step: impl Fn(f64) -> (f64, f64),
    mut clear: impl FnMut(usize),
) {
    if limit_deg >= 90.0 {
        return;
    }
    let climbs = |before: Option<f64>, here: f64, after: Option<f64>, step: f64| {
        let (Some(before), Some(after)) = (before, after) else { return false };
        let (to, from) = (here - before, after - here);
        to.min(from) > step || to.max(from) < -step
    };
    for v in 0..height {
        for u in 0..width {
            let Some(here) = value(u, v) else { continue };
            let (step_x, step_y) = step(here);
            let left = u.checked_sub(1).and_then(|u| value(u, v));
            let above = v.checked_sub(1).and_then(|v| value(u, v));
            let right = if u + 1 < width { value(u + 1, v) } else { None };
            let below = if v + 1 < height { value(u, v + 1) } else { None };
            if climbs(left, here, right, step_x) || climbs(above, here, below, step_y) {
                clear(v * width + u);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_lies_between_two_surfaces_is_removed() {
        // 10 mm pixels: 80 degrees is a step of 57 mm. An edge of 200 mm with one pixel between, a
        // slope of 50 mm a pixel, a spike, a hole.
        let row = [0.0, 0.0, 0.1, 0.2, 0.2, 0.15, 0.1, 0.05, 0.0, 0.3, 0.0, 0.0, -0.3, 0.0];
        let map = HeightMap::new(14, 3, 0.01, 0.01, row.repeat(3)).unwrap();
        let got = removed_heights(&map, 80.0);
        for (i, (&before, after)) in map.z.iter().zip(&got.z).enumerate() {
            assert_eq!(after.is_nan(), i % 14 == 2, "{i}");
            assert!(after.is_nan() || *after == before);
        }
        assert_eq!(removed_heights(&map, 90.0), map);
    }
}
