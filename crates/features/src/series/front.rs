//! The front of a body of grains that spreads about an axis, seen from above.
//!
//! The share of a circle of radius ρ about the axis that the grains' shadows cover is
//!
//! ```text
//! c(ρ) = |∪ᵢ Aᵢ(ρ)| / 2π,   Aᵢ(ρ) = { φ : |ρ e(φ) - xᵢ| ≤ aᵢ },
//! ```
//!
//! an arc about the azimuth of grain i of half width arccos((ρ² + dᵢ² - aᵢ²) / (2 ρ dᵢ)), all of the circle where ρ +
//! dᵢ ≤ aᵢ. Of a solid body whose outline is R(φ), c(ρ) is the share of azimuths with R(φ) > ρ, so that the radius
//! where c = 1/2 is the median of the front over the azimuth; single grains that have run ahead hardly change it. c is
//! taken as its mean over a ring one mean diameter wide, in which the gaps between single grains even out.

use std::f64::consts::{PI, TAU};

use nalgebra::{Vector2, Vector3};

use super::require_frame;
use crate::error::{FeatureError, require_in};

/// Circles in a mean grain's radius.
const CIRCLES: f64 = 4.0;
/// Circles at most: each has its room.
const MAX_CIRCLES: f64 = 1e7;
/// Circles to each side of a ring's middle: a mean grain's radius.
const HALF_RING: usize = 4;

/// The largest radius about `axis` `[m]` at which grains cover `level` of the circle, seen from above; `None` if they
/// do nowhere, or if a grain is nowhere (NaN).
///
/// Circles are a quarter of a mean grain's radius apart; the share is their mean over a ring one mean diameter wide,
/// linear between two.
///
/// # Errors
/// `LengthMismatch` when there is not one radius per position, `OutOfRange` for a radius or a level that is not
/// positive, a level above 1, or a grain 2.5 million mean radii away, `NonFinite` for the axis.
pub fn front_radius(
    positions: &[Vector3<f64>],
    radii: &[f64],
    axis: Vector2<f64>,
    level: f64,
) -> Result<Option<f64>, FeatureError> {
    require_frame(positions, radii, axis)?;
    require_in("level of a front [-]", level, f64::MIN_POSITIVE, 1.0)?;
    if positions.is_empty() || positions.iter().any(|x| !(x.x.is_finite() && x.y.is_finite())) {
        return Ok(None);
    }
    let step = radii.iter().sum::<f64>() / radii.len() as f64 / CIRCLES;
    let mut discs: Vec<Disc> = positions
        .iter()
        .zip(radii)
        .map(|(x, &radius)| {
            let offset = x.xy() - axis;
            Disc { distance: offset.norm(), azimuth: offset.y.atan2(offset.x), radius }
        })
        .collect();
    discs.sort_by(|a, b| b.reach().total_cmp(&a.reach()));
    let widest = discs.iter().map(|disc| disc.radius).fold(0.0, f64::max);

    // From the outermost circle inwards: a disc is met once the circle is within its reach, and left for good once the
    // circle is nearer to the axis than any of it.
    let mut first = 0;
    let circles = (discs[0].reach() / step).floor();
    require_in("reach of the grains, in quarters of their mean radius", circles, 0.0, MAX_CIRCLES)?;
    let circles = circles as usize + 1;
    let mut covered = vec![0.0; circles];
    for (number, share) in covered.iter_mut().enumerate().rev() {
        let rho = number as f64 * step;
        while first < discs.len() && discs[first].distance - 2.0 * widest > rho {
            first += 1;
        }
        *share = share_covered(discs[first..].iter().take_while(|d| d.reach() > rho), rho);
    }
    let mut outer = 0.0;
    for number in (0..circles + HALF_RING).rev() {
        let ring = number.saturating_sub(HALF_RING)..=number + HALF_RING;
        let count = ring.clone().count() as f64;
        let mean = ring.map(|circle| covered.get(circle).unwrap_or(&0.0)).sum::<f64>() / count;
        if mean >= level {
            return Ok(Some(step * (number as f64 + (mean - level) / (mean - outer))));
        }
        outer = mean;
    }
    Ok(None)
}

/// A grain's shadow.
struct Disc {
    distance: f64,
    azimuth: f64,
    radius: f64,
}

impl Disc {
    fn reach(&self) -> f64 {
        self.distance + self.radius
    }

    /// Half width of its arc on a circle of radius `rho` `[rad]`.
    fn half_width(&self, rho: f64) -> Option<f64> {
        let Self { distance, radius, .. } = *self;
        if (rho - distance).abs() >= radius {
            return (rho + distance <= radius).then_some(PI);
        }
        let cosine = (rho * rho + distance * distance - radius * radius) / (2.0 * rho * distance);
        // Where the axis is inside the disc and the circle reaches out of it only just, or rho is 0.
        Some(if cosine.is_nan() { PI } else { cosine.clamp(-1.0, 1.0).acos() })
    }
}

/// Share of a circle that the arcs cover.
fn share_covered<'a>(discs: impl Iterator<Item = &'a Disc>, rho: f64) -> f64 {
    let mut arcs = Vec::new();
    for disc in discs {
        let Some(half) = disc.half_width(rho) else { continue };
        let (from, to) = (disc.azimuth - half, disc.azimuth + half);
        // Arcs that go round the cut at ±pi are two.
        if from < -PI {
            arcs.push((from + TAU, PI));
        }
        if to > PI {
            arcs.push((-PI, to - TAU));
        }
        arcs.push((from.max(-PI), to.min(PI)));
    }
    arcs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut covered, mut end) = (0.0, -PI);
    for (from, to) in arcs {
        covered += (to - from.max(end)).max(0.0);
        end = to.max(end);
    }
    covered / TAU
}

#[cfg(test)]
mod tests {
    use super::*;

    const RADIUS: f64 = 2e-3;

    /// A disc of grains on a close lattice about `axis`, and its outline.
    fn body(axis: Vector2<f64>, outline: impl Fn(f64) -> f64) -> Vec<Vector3<f64>> {
        let mut grains = Vec::new();
        for i in -120..=120 {
            for j in -120..=120 {
                let (x, y) = (1e-3 * f64::from(i), 1e-3 * f64::from(j));
                // A grain's edge, not its centre, is at the outline.
                if x.hypot(y) <= outline(y.atan2(x)) - RADIUS {
                    grains.push(Vector3::new(axis.x + x, axis.y + y, RADIUS));
                }
            }
        }
        grains
    }

    fn front(grains: &[Vector3<f64>], axis: Vector2<f64>) -> f64 {
        front_radius(grains, &vec![RADIUS; grains.len()], axis, 0.5).unwrap().unwrap()
    }

    #[test]
    fn a_disc_ends_at_its_edge() {
        let axis = Vector2::new(0.03, -0.02);
        let found = front(&body(axis, |_| 0.06), axis);
        assert!((found - 0.06).abs() < 5e-4, "{found}");
    }

    #[test]
    fn the_front_is_the_median_of_the_outline() {
        // R = 60 mm + 20 mm cos(3 phi): half of the azimuths reach beyond 60 mm.
        let axis = Vector2::zeros();
        let found = front(&body(axis, |phi| 0.06 + 0.02 * (3.0 * phi).cos()), axis);
        assert!((found - 0.06).abs() < 1e-3, "{found}");
    }

    #[test]
    fn one_grain_covers_a_circle_as_its_arc_says() {
        // At distance d = a / 2 from the axis: all of a circle of radius up to a / 2, none from 3 a / 2 on, and a third
        // (half width pi / 3) where rho^2 + d^2 - rho d = a^2, which is rho = a (1 + sqrt(13)) / 4.
        let disc = Disc { distance: 0.5 * RADIUS, azimuth: 3.0, radius: RADIUS };
        let share = |rho: f64| share_covered([&disc].into_iter(), rho * RADIUS);
        assert_eq!((share(0.0), share(0.499), share(1.501)), (1.0, 1.0, 0.0));
        let third = share((1.0 + 13f64.sqrt()) / 4.0);
        assert!((third - 1.0 / 3.0).abs() < 1e-12, "{third}");
    }

    #[test]
    fn two_grains_that_overlap_on_a_circle_count_once() {
        let at = |azimuth: f64| Disc { distance: 10.0 * RADIUS, azimuth, radius: RADIUS };
        let half = at(0.0).half_width(10.0 * RADIUS).unwrap();
        let discs = [at(PI - 0.5 * half), at(-PI + 0.5 * half), at(1.0)];
        let share = share_covered(discs.iter(), 10.0 * RADIUS);
        assert!((share - 5.0 * half / TAU).abs() < 1e-12, "{share}");
    }

    #[test]
    fn grains_far_from_the_axis_or_none_have_no_front() {
        assert_eq!(front_radius(&[Vector3::x()], &[RADIUS], Vector2::zeros(), 0.5), Ok(None));
        assert_eq!(front_radius(&[], &[], Vector2::zeros(), 0.5), Ok(None));
        let nowhere = [Vector3::repeat(f64::NAN)];
        assert_eq!(front_radius(&nowhere, &[RADIUS], Vector2::zeros(), 0.5), Ok(None));
    }

    #[test]
    fn what_is_no_frame_is_refused() {
        let (grain, axis) = ([Vector3::zeros()], Vector2::zeros());
        let got = front_radius(&grain, &[], axis, 0.5);
        assert_eq!(got, Err(FeatureError::LengthMismatch { what: "radii", got: 0, expected: 1 }));
        let far = [Vector3::x() * 1e9];
        for (grains, radius, level) in [
            (grain, 0.0, 0.5),
            (grain, f64::NAN, 0.5),
            (grain, RADIUS, 0.0),
            (grain, RADIUS, f64::NAN),
            (far, RADIUS, 0.5),
        ] {
            let got = front_radius(&grains, &[radius], axis, level);
            assert!(matches!(got, Err(FeatureError::OutOfRange { .. })), "{got:?}");
        }
        let got = front_radius(&grain, &[RADIUS], Vector2::repeat(f64::NAN), 0.5);
        assert!(matches!(got, Err(FeatureError::NonFinite { .. })), "{got:?}");
    }

    #[test]
    fn grains_that_have_run_ahead_do_not_count() {
        let axis = Vector2::zeros();
        let mut grains = body(axis, |_| 0.06);
        let before = front(&grains, axis);
        for k in 0..30 {
            let (sin, cos) = (0.2 * f64::from(k)).sin_cos();
            grains.push(Vector3::new(0.1 * cos, 0.1 * sin, RADIUS));
        }
        // They share the mean radius, and with it the circles, but for rounding.
        let after = front(&grains, axis);
        assert!((after - before).abs() < 1e-12, "{after} {before}");
    }
}
