//! The ground of an image: the plane that most of it lies on, and how it scatters about that.

use std::ops::RangeInclusive;

use nalgebra::{Vector2, Vector3};

use super::LEAST_POINTS;
use super::levelled::Cloud;
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

/// Length of the mean phase of distances that are in step, at least: 1 on level ground, 0.3 where a tilt spreads them
/// over three quarters of one.
const IN_STEP: f64 = 0.3;

/// Multiples of it, less their whole part, fill the numbers from 0 to 1 evenly.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

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
/// Points between three and six standard deviations of a level from it, over those on it, at most: two levels have a
/// gap.
const IN_GAP: f64 = 0.1;
/// Inlier distance by which one of two levels is looked for, over the standard deviation about the plane between them.
const LEVEL_REACH: f64 = 0.25;

/// The inlier distance grows to at most this share of the extent of the points.
const LARGEST_REACH: f64 = 0.05;

impl Cloud {
    /// The ground plane and the standard deviation of the ground about it `[m]`.
    pub(super) fn ground(
        &self,
        settings: &Segmentation,
        grains: Option<&[bool]>,
        up: impl Fn(PlaneFit) -> PlaneFit,
    ) -> Result<(PlaneFit, f64), FeatureError> {
        if self.points.len() < LEAST_POINTS {
            let (pixels, got) = (self.width * self.height, self.points.len());
            return Err(FeatureError::NoValidDepth { pixels, got, min: LEAST_POINTS });
        }
        let ground: Vec<_> = self
            .pixels
            .iter()
            .zip(&self.points)
            .filter(|(pixel, _)| grains.is_none_or(|grains| !grains[**pixel]))
            .map(|(_, point)| *point)
            .collect();
        let step = self.step();
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
        let tighten =
            |plane, reach, grown| tightened(&ground, plane, reach, grown, steepest, step, &up);
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
}

/// The plane fitted again to what the noise allows, until it allows no less, and the standard deviation about it `[m]`:
/// the foot of a pile is within the first inlier distance and lifts the plane. A distance that is in `grown` may grow
/// there. Depths are counted in `step`s `[m]`. `TooSteep` where it tips beyond the tilt `steepest` `[rad]`.
fn tightened(
    ground: &[Vector3<f64>],
    mut plane: PlaneFit,
    mut reach: f64,
    grown: RangeInclusive<f64>,
    steepest: f64,
    step: f64,
    up: &impl Fn(PlaneFit) -> PlaneFit,
) -> Result<(PlaneFit, f64), FeatureError> {
    let mut sd = sd_from_below(ground, &plane, reach, step);
    for _ in 0..MAX_TIGHTENINGS {
        let wanted = (3.0 * sd).max(FINEST_INLIER);
        let may_grow = reach > *grown.start() && wanted <= *grown.end();
        let grows = may_grow && wanted > reach / SETTLED;
        if wanted >= SETTLED * reach && !grows {
            break;
        }
        reach = wanted;
        plane = up(refine_plane(ground, plane.plane, reach, steepest)?);
        sd = sd_from_below(ground, &plane, reach, step);
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
///
/// Of depths that are counted in `step`s `[m]` a level ground has most points at one count, and their median distance
/// says nothing. Each point is then spread over its step, evenly.
fn sd_from_below(ground: &[Vector3<f64>], fit: &PlaneFit, reach: f64, step: f64) -> f64 {
    let of_spread = |step: f64| {
        let spread = |i: usize| step * ((i as f64 * GOLDEN).fract() - 0.5);
        let depths = ground.iter().enumerate();
        let mut below: Vec<f64> = depths
            .map(|(i, point)| spread(i) - fit.plane.signed_distance(point))
            .filter(|depth| (0.0..=reach).contains(depth))
            .collect();
        median(&mut below).map_or(0.0, |median| SD_PER_MAD * median.abs())
    };
    of_spread(if in_step(ground, fit, reach, step) { step } else { 0.0 })
}

/// Whether the distances of the points within `reach` of the plane are whole steps apart, and not spread over them by a
/// tilt: the length of their mean phase.
fn in_step(ground: &[Vector3<f64>], fit: &PlaneFit, reach: f64, step: f64) -> bool {
    if step <= 0.0 {
        return false;
    }
    let (mut count, mut sum) = (0.0, Vector2::zeros());
    for distance in ground.iter().map(|point| fit.plane.signed_distance(point)) {
        if distance.abs() <= reach {
            let (sin, cos) = (std::f64::consts::TAU * distance / step).sin_cos();
            sum += Vector2::new(cos, sin);
            count += 1.0;
        }
    }
    sum.norm() > IN_STEP * count
}
