//! The outline of the largest body of grains, seen from above.
//!
//! Grains i and j belong to one body where their shadows are near,
//!
//! ```text
//! |xᵢ - xⱼ| ≤ λ (aᵢ + aⱼ),
//! ```
//!
//! or where a chain of such pairs joins them. Of the body with the most grains the outline at azimuth φ is where a ray
//! from the axis leaves it for good,
//!
//! ```text
//! R(φ) = max { dᵢ cos δ + √(aᵢ² - dᵢ² sin² δ) : |dᵢ sin δ| ≤ aᵢ },   δ = φ - φᵢ,
//! ```
//!
//! and the radius of the front is the mean of R over the azimuths that meet it. A grain that has rolled away belongs to
//! no body and moves no front, which is how people follow a front in a picture.

use std::collections::HashMap;
use std::f64::consts::TAU;

use nalgebra::{Vector2, Vector3};

use super::require_frame;
use crate::error::{FeatureError, require_in};

/// Rays from the axis.
const AZIMUTHS: usize = 36;

/// The mean radius about `axis` `[m]` of the outline of the largest body, grains being linked where they are within
/// `link` sums of their radii of each other; `None` without grains, or if one is nowhere (NaN).
///
/// # Errors
/// `LengthMismatch` when there is not one radius per position, `OutOfRange` for a radius or a link that is not
/// positive, `NonFinite` for the axis.
pub fn outline_radius(
    positions: &[Vector3<f64>],
    radii: &[f64],
    axis: Vector2<f64>,
    link: f64,
) -> Result<Option<f64>, FeatureError> {
    require_frame(positions, radii, axis)?;
    require_in("link [-]", link, f64::MIN_POSITIVE, 1e6)?;
    if positions.is_empty() || positions.iter().any(|x| !(x.x.is_finite() && x.y.is_finite())) {
        return Ok(None);
    }
    let places: Vec<Vector2<f64>> = positions.iter().map(|x| x.xy() - axis).collect();
    let body = largest_body(&places, radii, link);
    let mut total = 0.0;
    let mut met = 0;
    for ray in 0..AZIMUTHS {
        let azimuth = TAU * (ray as f64 + 0.5) / AZIMUTHS as f64;
        let along = Vector2::new(azimuth.cos(), azimuth.sin());
        let reach = body.iter().filter_map(|&i| leaves(places[i], radii[i], along));
        if let Some(reach) = reach.max_by(f64::total_cmp) {
            total += reach;
            met += 1;
        }
    }
    Ok((met > 0).then(|| total / f64::from(met)))
}

/// Where a ray along the unit vector `along` leaves a disc; `None` if it misses it.
fn leaves(place: Vector2<f64>, radius: f64, along: Vector2<f64>) -> Option<f64> {
    let (ahead, aside) = (place.dot(&along), place.perp(&along));
    let half = radius * radius - aside * aside;
    if half < 0.0 {
        return None;
    }
    Some(ahead + half.sqrt()).filter(|&reach| reach > 0.0)
}

/// Indices of the grains of the largest body, the first of equals.
fn largest_body(places: &[Vector2<f64>], radii: &[f64], link: f64) -> Vec<usize> {
    let widest = radii.iter().copied().fold(0.0, f64::max);
    let cell = 2.0 * link * widest;
    let at = |p: &Vector2<f64>| ((p.x / cell).floor() as i64, (p.y / cell).floor() as i64);
    let mut cells: HashMap<(i64, i64), Vec<usize>> = HashMap::new();
    for (i, place) in places.iter().enumerate() {
        cells.entry(at(place)).or_default().push(i);
    }
    let mut is_free = vec![true; places.len()];
    let mut largest = Vec::new();
    for seed in 0..places.len() {
        if !is_free[seed] {
            continue;
        }
        is_free[seed] = false;
        let mut body = vec![seed];
        let mut next = 0;
        while let Some(&i) = body.get(next) {
            next += 1;
            let (column, row) = at(&places[i]);
            for (dx, dy) in (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (dx, dy))) {
                let cell = (column.saturating_add(dx), row.saturating_add(dy));
                for &j in cells.get(&cell).into_iter().flatten() {
                    let far = link * (radii[i] + radii[j]);
                    if is_free[j] && (places[i] - places[j]).norm_squared() <= far * far {
                        is_free[j] = false;
                        body.push(j);
                    }
                }
            }
        }
        if body.len() > largest.len() {
            largest = body;
        }
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::*;

    const RADIUS: f64 = 2e-3;

    /// A disc of grains on a square lattice of 1 mm about `axis`.
    fn disc(axis: Vector2<f64>, edge: f64) -> Vec<Vector3<f64>> {
        let mut grains = Vec::new();
        for i in -90..=90 {
            for j in -90..=90 {
                let (x, y) = (1e-3 * f64::from(i), 1e-3 * f64::from(j));
                if x.hypot(y) <= edge - RADIUS {
                    grains.push(Vector3::new(axis.x + x, axis.y + y, RADIUS));
                }
            }
        }
        grains
    }

    fn outline(grains: &[Vector3<f64>], axis: Vector2<f64>, link: f64) -> f64 {
        outline_radius(grains, &vec![RADIUS; grains.len()], axis, link).unwrap().unwrap()
    }

    #[test]
    fn a_disc_ends_at_its_edge() {
        let axis = Vector2::new(0.03, -0.02);
        let found = outline(&disc(axis, 0.06), axis, 1.5);
        assert!((found - 0.06).abs() < 5e-4, "{found}");
    }

    #[test]
    fn grains_that_have_rolled_away_do_not_count() {
        let axis = Vector2::zeros();
        let mut grains = disc(axis, 0.06);
        let before = outline(&grains, axis, 1.5);
        for k in 0..40 {
            let (sin, cos) = (0.15 * f64::from(k)).sin_cos();
            grains.push(Vector3::new(0.1 * cos, 0.1 * sin, RADIUS));
        }
        // 15 mm of arc between them: more than 1.5 diameters of 4 mm, less than 4.
        assert_eq!(outline(&grains, axis, 1.5), before);
        // A lone grain between body and ring joins them where links are long.
        grains.push(Vector3::new(0.08, 0.0, RADIUS));
        assert_eq!(outline(&grains, axis, 1.5), before);
        assert!(outline(&grains, axis, 6.0) > before + 0.005);
    }

    #[test]
    fn a_link_is_as_long_as_it_says() {
        // Three grains in a row, 1.4 and 1.6 diameters apart, about an axis in the first.
        let at = |x: f64| Vector3::new(2.0 * RADIUS * x, 0.0, 0.0);
        let grains = [at(0.0), at(1.4), at(3.0)];
        let body = |link| {
            let places: Vec<_> = grains.iter().map(|x: &Vector3<f64>| x.xy()).collect();
            largest_body(&places, &[RADIUS; 3], link).len()
        };
        assert_eq!((body(1.3), body(1.5), body(1.7)), (1, 2, 3));
    }

    #[test]
    fn one_grain_aside_is_met_by_the_rays_that_meet_it() {
        // Seen from the axis at 5 radii a grain fills asin(1 / 5) = 11.5 degrees to each side: the rays at 5 and -5
        // degrees meet it, at d cos + sqrt(a² - d² sin²).
        let grain = [Vector3::new(5.0 * RADIUS, 0.0, RADIUS)];
        let (sin, cos) = 5f64.to_radians().sin_cos();
        let expected = RADIUS * (5.0 * cos + (1.0 - 25.0 * sin * sin).sqrt());
        assert!((outline(&grain, Vector2::zeros(), 1.5) - expected).abs() < 1e-15);
    }

    #[test]
    fn nothing_has_no_outline() {
        assert_eq!(outline_radius(&[], &[], Vector2::zeros(), 1.5), Ok(None));
        let nowhere = [Vector3::repeat(f64::NAN)];
        assert_eq!(outline_radius(&nowhere, &[RADIUS], Vector2::zeros(), 1.5), Ok(None));
    }

    #[test]
    fn what_is_no_frame_is_refused() {
        let (grain, axis) = ([Vector3::zeros()], Vector2::zeros());
        let got = outline_radius(&grain, &[RADIUS; 2], axis, 1.5);
        assert_eq!(got, Err(FeatureError::LengthMismatch { what: "radii", got: 2, expected: 1 }));
        for (radius, link) in [(0.0, 1.5), (f64::NAN, 1.5), (RADIUS, 0.0), (RADIUS, f64::NAN)] {
            let got = outline_radius(&grain, &[radius], axis, link);
            assert!(matches!(got, Err(FeatureError::OutOfRange { .. })), "{got:?}");
        }
        // Far beyond the last cell that has a number.
        let far = [Vector3::x() * 1e20];
        assert_eq!(outline_radius(&far, &[RADIUS], axis, 1.5), Ok(None));
    }
}
