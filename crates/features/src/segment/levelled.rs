//! An image turned so that its ground is z = 0: what depth images and height maps share.

use std::ops::RangeInclusive;

use nalgebra::{Point3, Vector3};

use super::component::{remove_low, remove_small};
use super::settings::Segmentation;
use crate::error::FeatureError;
use crate::median::median;
use crate::plane::{PlaneFit, fit_plane_within, refine_plane};

/// Standard deviation of a Gaussian over its median absolute deviation.
const SD_PER_MAD: f64 = 1.482_602_218_505_602;

/// Residual below which the refit does not tighten further `[m]`: the rounding of an f32 depth.
const FINEST_INLIER: f64 = 1e-6;

/// Rounds in which the inlier distance is brought to the noise of the ground.
const MAX_TIGHTENINGS: usize = 20;

/// Share of the inlier distance from which three standard deviations count as no less.
const SETTLED: f64 = 0.99;

/// Inlier distance at which the search for the ground begins unless told otherwise `[m]`: above the
/// noise of a stereo camera at 0.3 m to 0.5 m.
const FIRST_REACH: f64 = 0.003;

/// Points between one and two inlier distances below the plane, for each within one, from which the
/// ground is rougher than the inlier distance. Gaussian noise whose sd is the distance has 0.4, whose
/// sd is a third of it 0.003.
const SHOULDER: f64 = 0.3;

/// A ground of two levels, such as a mat on a table, draws the plane between them. A plane is on one of them if so many
/// of the points lie on it, and scatter about it less than this share of what they did.
const LEVEL_SHARE: f64 = 0.35;
const LEVEL_SCATTER: f64 = 1.0 / 3.0;
/// Standard deviation about the plane between two levels, at least `[m]`: below it nothing is to be gained.
const BETWEEN_LEVELS: f64 = 1e-3;
/// What scatters less about a plane is of one count of a camera and no level `[m]`.
const LEAST_SCATTER: f64 = 1e-5;
/// Points between three and six standard deviations of a level from it, over those on it, at most: two levels have a gap.
const IN_GAP: f64 = 0.1;
/// Inlier distance by which one of two levels is looked for, over the standard deviation about the plane between them.
const LEVEL_REACH: f64 = 0.25;

/// The inlier distance grows to at most this share of the extent of the points.
const LARGEST_REACH: f64 = 0.05;

/// What a pixel's column of grains measures on the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Footprint {
    /// The same rectangle under every pixel, its sides along x and y `[m]`, seen along z.
    Column { x: f64, y: f64 },
    /// A pyramid with its tip at the camera's `centre`, looking along `axis`; focal lengths `[px]`.
    Pyramid { fx: f64, fy: f64, centre: Vector3<f64>, axis: Vector3<f64> },
}

/// The points of an image and the pixels that they belong to.
pub(super) struct Cloud {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Index of the pixel of each point, rising.
    pixels: Vec<usize>,
    points: Vec<Vector3<f64>>,
    pub(super) footprint: Footprint,
    /// The factor by which the image was down-sampled.
    pub(super) downsample: usize,
}

/// An image whose ground was found: its heights above the ground, and which pixels are grain.
#[derive(Debug, Clone, PartialEq)]
pub struct Levelled {
    /// Columns `[px]`, after down-sampling.
    pub width: usize,
    /// Rows `[px]`, after down-sampling.
    pub height: usize,
    /// Height above the fitted ground `[m]`, row by row, shape [height · width]; `None` = no data.
    pub heights: Vec<Option<f64>>,
    /// Which pixels are grain, row by row, shape [height · width]; none on a flat bed.
    pub mask: Vec<bool>,
    /// The ground in the frame of the input, normal towards the camera.
    pub plane: PlaneFit,
    /// Robust standard deviation of the ground about its plane `[m]`.
    pub ground_sd: f64,
    /// Height above the ground from which a pixel counts as grain `[m]`; not applied when a colour
    /// decides.
    pub threshold: f64,
    /// Whether a colour decides which pixels are grain.
    pub is_by_colour: bool,
    /// Pixels that carry data, within the border.
    pub valid_count: usize,
    /// Pixels above the greatest height, which carry none.
    pub above_count: usize,
    /// Share of the square of ground that was asked for which the image shows `[-]`; none without one.
    pub shown: Option<f64>,
    /// Whether the image shows more, which was cut off.
    pub is_cropped: bool,
    /// The factor by which the image was down-sampled.
    pub downsample: usize,
    /// Width of a pixel on the ground, along x and y `[m/px]`.
    pub resolution: (f64, f64),
    /// Volume between the ground and the surface of each pixel with data `[m³]`.
    pub(super) volumes: Vec<f64>,
    /// Points of the pixels with data, in the frame in which the ground is z = 0 `[m]`.
    pub(super) points: Vec<Vector3<f64>>,
    /// The pixels with data.
    pub(super) pixels: Vec<usize>,
}

impl Cloud {
    /// The points that `point_of` gives for the pixels (u, v).
    pub(super) fn new(
        (width, height): (usize, usize),
        downsample: usize,
        footprint: Footprint,
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
        Self { width, height, pixels, points, footprint, downsample }
    }

    /// Ground, heights, mask. `grains` marks the pixels of the grains if that is known; `up` chooses
    /// the side of the plane on which the grains are.
    pub(super) fn level(
        self,
        settings: &Segmentation,
        grains: Option<&[bool]>,
        up: impl Fn(PlaneFit) -> PlaneFit,
    ) -> Result<Levelled, FeatureError> {
        let (plane, ground_sd) = self.ground(settings, grains, up)?;
        let threshold = settings.height_threshold.height(ground_sd);
        let ground_from_input = plane.plane.ground_from_world();
        let max_height = settings.max_height.unwrap_or(f64::INFINITY);
        let mut heights = vec![None; self.width * self.height];
        let mut mask = vec![false; self.width * self.height];
        let (mut pixels, mut points, mut volumes) = (Vec::new(), Vec::new(), Vec::new());
        for (&pixel, seen) in self.pixels.iter().zip(&self.points) {
            let point = (ground_from_input * Point3::from(*seen)).coords;
            if point.z > max_height {
                continue;
            }
            heights[pixel] = Some(point.z);
            mask[pixel] = grains.map_or(point.z > threshold, |grains| grains[pixel]);
            pixels.push(pixel);
            volumes.push(self.volume(&plane, seen, point.z));
            points.push(point);
        }
        if let (Some(peak), None) = (settings.height_threshold.peak(ground_sd), grains) {
            remove_low(&mut mask, self.width, |pixel| heights[pixel].is_some_and(|z| z > peak));
        }
        remove_small(&mut mask, self.width, settings.min_component_px);
        Ok(Levelled {
            width: self.width,
            height: self.height,
            heights,
            mask,
            ground_sd,
            threshold,
            is_by_colour: grains.is_some(),
            valid_count: points.len(),
            above_count: self.points.len() - points.len(),
            shown: None,
            is_cropped: false,
            downsample: self.downsample,
            resolution: self.resolution(&plane),
            plane,
            volumes,
            points,
            pixels,
        })
    }

    /// The ground plane and the standard deviation of the ground about it `[m]`.
    pub(super) fn ground(
        &self,
        settings: &Segmentation,
        grains: Option<&[bool]>,
        up: impl Fn(PlaneFit) -> PlaneFit,
    ) -> Result<(PlaneFit, f64), FeatureError> {
        if self.points.len() < 3 {
            let pixels = self.width * self.height;
            return Err(FeatureError::NoValidDepth { pixels, got: self.points.len(), min: 3 });
        }
        let ground: Vec<_> = self
            .pixels
            .iter()
            .zip(&self.points)
            .filter(|(pixel, _)| grains.is_none_or(|grains| !grains[**pixel]))
            .map(|(_, point)| *point)
            .collect();
        let first = settings.inlier_distance.unwrap_or(FIRST_REACH);
        let largest = match settings.inlier_distance {
            Some(fixed) => fixed,
            None => LARGEST_REACH * extent(&ground),
        };
        let mut reach = first;
        let steepest = settings.max_tilt_deg.to_radians();
        let search = |reach| fit_plane_within(&ground, reach, steepest, settings.plane_seed);
        let mut plane = up(search(reach)?);
        // A ground rougher than the inlier distance goes on below it: search again with twice that.
        while 2.0 * reach <= largest && shoulder(&ground, &plane, reach) > SHOULDER {
            reach *= 2.0;
            plane = up(search(reach)?);
        }
        // Only a distance that has grown may still grow.
        let tighten = |plane, reach, grown| tightened(&ground, plane, reach, grown, steepest, &up);
        let (plane, sd) = tighten(plane, reach, first..=largest)?;
        if settings.inlier_distance.is_none() && sd > BETWEEN_LEVELS {
            let near = LEVEL_REACH * sd;
            let found = search(near).and_then(|level| tighten(up(level), near, 0.0..=3.0 * sd));
            let (level, scatter) = match found {
                // What is too steep is none of two levels.
                Err(FeatureError::TooSteep { .. }) => return Ok((plane, sd)),
                found => found?,
            };
            let within = |sds: f64| {
                let on_it = |point: &&Vector3<f64>| {
                    level.plane.signed_distance(point).abs() <= sds * scatter
                };
                ground.iter().filter(on_it).count() as f64
            };
            let (on_it, and_near) = (within(3.0), within(6.0));
            let is_level = on_it >= LEVEL_SHARE * ground.len() as f64
                && and_near - on_it <= IN_GAP * on_it
                && scatter > LEAST_SCATTER;
            if is_level && scatter < LEVEL_SCATTER * sd {
                return Ok((level, scatter));
            }
        }
        Ok((plane, sd))
    }

    /// Volume under a pixel `[m³]` whose point was seen at `seen` and lies `height` above the ground.
    fn volume(&self, plane: &PlaneFit, seen: &Vector3<f64>, height: f64) -> f64 {
        match self.footprint {
            // Along z the column is longer than the distance from a tilted plane.
            Footprint::Column { x, y } => x * y * height / plane.plane.normal.z,
            Footprint::Pyramid { fx, fy, centre, axis } => {
                // The pyramid of a pixel cut at depth z holds z³/(3 fx fy); the ray meets the ground
                // at the depth z above/(above - height).
                let above = plane.plane.signed_distance(&centre);
                let depth = (seen - centre).dot(&axis);
                let ground = depth * above / (above - height);
                (ground.powi(3) - depth.powi(3)) / (3.0 * fx * fy)
            }
        }
    }

    /// Width of a pixel on the ground `[m/px]`.
    pub(super) fn resolution(&self, plane: &PlaneFit) -> (f64, f64) {
        match self.footprint {
            Footprint::Column { x, y } => (x, y),
            Footprint::Pyramid { fx, fy, centre, .. } => {
                let above = plane.plane.signed_distance(&centre);
                (above / fx, above / fy)
            }
        }
    }
}

impl Levelled {
    /// (point, whether it is grain, volume `[m³]`) of the pixels with data.
    pub(super) fn samples(&self) -> impl Iterator<Item = (&Vector3<f64>, bool, f64)> {
        self.points
            .iter()
            .zip(&self.pixels)
            .zip(&self.volumes)
            .map(|((point, &pixel), &volume)| (point, self.mask[pixel], volume))
    }
}

/// The plane fitted again to what the noise allows, until it allows no less, and the standard deviation about it `[m]`: the
/// foot of a pile is within the first inlier distance and lifts the plane. A distance that is in `grown` may grow there.
/// `TooSteep` where it tips beyond the tilt `steepest` `[rad]`.
fn tightened(
    ground: &[Vector3<f64>],
    mut plane: PlaneFit,
    mut reach: f64,
    grown: RangeInclusive<f64>,
    steepest: f64,
    up: &impl Fn(PlaneFit) -> PlaneFit,
) -> Result<(PlaneFit, f64), FeatureError> {
    let mut sd = sd_from_below(ground, &plane, reach);
    for _ in 0..MAX_TIGHTENINGS {
        let wanted = (3.0 * sd).max(FINEST_INLIER);
        let may_grow = reach > *grown.start() && wanted <= *grown.end();
        let grows = may_grow && wanted > reach / SETTLED;
        if wanted >= SETTLED * reach && !grows {
            break;
        }
        reach = wanted;
        plane = up(refine_plane(ground, plane.plane, reach, steepest)?);
        sd = sd_from_below(ground, &plane, reach);
    }
    Ok((plane, sd))
}

/// Diagonal of the box around the points `[m]`.
fn extent(points: &[Vector3<f64>]) -> f64 {
    let far = Vector3::repeat(f64::INFINITY);
    let (low, high) =
        points.iter().fold((far, -far), |(low, high), point| (low.inf(point), high.sup(point)));
    (high - low).norm()
}

/// Points between one and two reaches below the plane, for each within one.
fn shoulder(ground: &[Vector3<f64>], fit: &PlaneFit, reach: f64) -> f64 {
    let (mut near, mut far) = (0_u32, 0_u32);
    for point in ground {
        let below = -fit.plane.signed_distance(point) / reach;
        near += u32::from((0.0..=1.0).contains(&below));
        far += u32::from(below > 1.0 && below <= 2.0);
    }
    f64::from(far) / f64::from(near.max(1))
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
    median(&mut below).map_or(0.0, |median| SD_PER_MAD * median)
}

/// The fit seen from the other side.
pub(super) fn flipped(fit: PlaneFit) -> PlaneFit {
    let plane = fit.plane.flipped();
    PlaneFit { plane, tilt_rad: plane.tilt_rad(), ..fit }
}
