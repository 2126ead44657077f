//! The part that depth images and height maps share.

use nalgebra::{Point3, Vector2, Vector3};

use super::component::remove_small;
use super::{Formation, Segmentation};
use crate::error::FeatureError;
use crate::plane::{PlaneFit, fit_plane, refine_plane};

/// Standard deviation of a Gaussian over its median absolute deviation.
const SD_PER_MAD: f64 = 1.482_602_218_505_602;

/// Residual below which the refit does not tighten further `[m]`: the rounding of an f32 depth.
const FINEST_INLIER: f64 = 1e-6;

/// Rounds in which the inlier distance is brought down to the noise of the ground.
const MAX_TIGHTENINGS: usize = 20;

/// Share of the inlier distance from which three standard deviations count as no less.
const SETTLED: f64 = 0.99;

/// The points of an image and the pixels that they belong to.
pub(super) struct Cloud {
    width: usize,
    height: usize,
    /// Index of the pixel of each point, rising.
    pixels: Vec<usize>,
    points: Vec<Vector3<f64>>,
}

impl Cloud {
    /// The points that `point_of` gives for the pixels (u, v).
    pub(super) fn new(
        width: usize,
        height: usize,
        point_of: impl Fn(usize, usize) -> Option<Vector3<f64>>,
    ) -> Self {
        let (mut pixels, mut points) = (Vec::new(), Vec::new());
        for v in 0..height {
            for u in 0..width {
                if let Some(point) = point_of(u, v) {
                    pixels.push(v * width + u);
                    points.push(point);
                }
            }
        }
        Self { width, height, pixels, points }
    }

    /// Ground, mask, centred points. `grains` marks the pixels of the grains if that is known;
    /// `up` chooses the side of the plane on which the grains are.
    pub(super) fn segment(
        self,
        settings: &Segmentation,
        grains: Option<&[bool]>,
        up: impl Fn(PlaneFit) -> PlaneFit,
    ) -> Result<Formation, FeatureError> {
        if self.points.len() < 3 {
            let pixels = self.width * self.height;
            return Err(FeatureError::NoValidDepth { pixels, got: self.points.len(), min: 3 });
        }
        let (plane, ground_sd) = self.ground(settings, grains, up)?;
        let threshold = settings.height_threshold.height(ground_sd);

        let ground_from_input = plane.plane.ground_from_world();
        let levelled: Vec<_> =
            self.points.iter().map(|p| (ground_from_input * Point3::from(*p)).coords).collect();
        let max_height = settings.max_height.unwrap_or(f64::INFINITY);
        let mut mask = vec![false; self.width * self.height];
        for (&pixel, point) in self.pixels.iter().zip(&levelled) {
            let is_grain = grains.map_or(point.z > threshold, |grains| grains[pixel]);
            mask[pixel] = is_grain && point.z <= max_height;
        }
        remove_small(&mut mask, self.width, settings.min_component_px);

        let mut points: Vec<_> = self
            .pixels
            .iter()
            .zip(&levelled)
            .filter_map(|(&pixel, point)| mask[pixel].then_some(*point))
            .collect();
        if points.is_empty() {
            let highest = levelled.iter().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max);
            return Err(FeatureError::EmptyMask { valid: levelled.len(), highest, threshold });
        }
        let centroid = centre(&mut points);
        Ok(Formation {
            masked_count: points.len(),
            points,
            mask,
            width: self.width,
            height: self.height,
            plane,
            valid_count: levelled.len(),
            threshold,
            centroid,
        })
    }

    /// The ground plane and the standard deviation of the ground about it `[m]`.
    fn ground(
        &self,
        settings: &Segmentation,
        grains: Option<&[bool]>,
        up: impl Fn(PlaneFit) -> PlaneFit,
    ) -> Result<(PlaneFit, f64), FeatureError> {
        let ground: Vec<_> = self
            .pixels
            .iter()
            .zip(&self.points)
            .filter(|(pixel, _)| grains.is_none_or(|grains| !grains[**pixel]))
            .map(|(_, point)| *point)
            .collect();
        let mut reach = settings.inlier_distance;
        let mut plane = up(fit_plane(&ground, reach, settings.plane_seed)?);
        let mut sd = sd_from_below(&ground, &plane, reach);
        // The foot of a pile is within the inlier distance and lifts the plane: fit again to what
        // the noise allows, until it allows no less.
        for _ in 0..MAX_TIGHTENINGS {
            let tight = (3.0 * sd).max(FINEST_INLIER);
            if tight >= SETTLED * reach {
                break;
            }
            reach = tight;
            plane = up(refine_plane(&ground, plane.plane, reach)?);
            sd = sd_from_below(&ground, &plane, reach);
        }
        Ok((plane, sd))
    }
}

/// Robust standard deviation of the ground about its plane `[m]`: the median distance of the points
/// within `reach` below the plane. Grains only ever add points above it, and dead pixels lie far
/// beyond the reach.
fn sd_from_below(ground: &[Vector3<f64>], fit: &PlaneFit, reach: f64) -> f64 {
    let mut below: Vec<f64> = ground
        .iter()
        .map(|point| -fit.plane.signed_distance(point))
        .filter(|depth| (0.0..=reach).contains(depth))
        .collect();
    if below.is_empty() {
        return 0.0;
    }
    let middle = below.len() / 2;
    let (_, median, _) = below.select_nth_unstable_by(middle, f64::total_cmp);
    SD_PER_MAD * *median
}

/// The fit seen from the other side.
pub(super) fn flipped(fit: PlaneFit) -> PlaneFit {
    let plane = fit.plane.flipped();
    PlaneFit { plane, tilt_rad: plane.tilt_rad(), ..fit }
}

/// Moves the points' centroid to x = y = 0 and returns where it was.
fn centre(points: &mut [Vector3<f64>]) -> Vector2<f64> {
    let centroid = points.iter().map(Vector3::xy).sum::<Vector2<f64>>() / points.len() as f64;
    for point in points {
        point.x -= centroid.x;
        point.y -= centroid.y;
    }
    centroid
}
