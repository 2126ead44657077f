//! Where the mass of grains is, by percentiles of their distance from an axis.

use nalgebra::{Vector2, Vector3};

use super::require_frame;
use crate::error::{FeatureError, require_in};

/// The radii about `axis` `[m]` within which the stated shares `[%]` of the mass are, one each; NaN without grains, or
/// if one is nowhere (NaN).
///
/// The share within the k-th nearest grain counts half of that grain: percentile p of n equal grains is the
/// (p n / 100 + 1/2)-th, linear between two.
///
/// # Errors
/// `LengthMismatch` when there is not one radius per position, `OutOfRange` for a radius that is not positive or a
/// percentile outside 0 to 100, `NonFinite` for the axis.
pub fn mass_percentiles(
    positions: &[Vector3<f64>],
    radii: &[f64],
    axis: Vector2<f64>,
    percentiles: &[f64],
) -> Result<Vec<f64>, FeatureError> {
    require_frame(positions, radii, axis)?;
    for &percent in percentiles {
        require_in("percentile [%]", percent, 0.0, 100.0)?;
    }
    if positions.iter().any(|x| !(x.x.is_finite() && x.y.is_finite())) {
        return Ok(vec![f64::NAN; percentiles.len()]);
    }
    let mut grains: Vec<(f64, f64)> =
        positions.iter().zip(radii).map(|(x, a)| ((x.xy() - axis).norm(), a.powi(3))).collect();
    grains.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = grains.iter().map(|(_, mass)| mass).sum();
    let mut within = 0.0;
    let curve: Vec<(f64, f64)> = grains
        .iter()
        .map(|&(radius, mass)| {
            within += mass;
            (100.0 * (within - 0.5 * mass) / total, radius)
        })
        .collect();
    Ok(percentiles.iter().map(|&percent| value_at(&curve, percent)).collect())
}

/// Linear between the points of a curve that rises, its ends beyond them; NaN of an empty one.
pub fn value_at(curve: &[(f64, f64)], at: f64) -> f64 {
    let after = curve.partition_point(|&(x, _)| x < at);
    match (after.checked_sub(1).and_then(|before| curve.get(before)), curve.get(after)) {
        (Some(&(x0, y0)), Some(&(x1, y1))) => y0 + (y1 - y0) * (at - x0) / (x1 - x0),
        (Some(&(_, y)), None) | (None, Some(&(_, y))) => y,
        (None, None) => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_of_an_even_row_are_its_quantiles() {
        let grains: Vec<_> = (0..100).map(|i| Vector3::new(f64::from(i) + 0.5, 0.0, 0.0)).collect();
        let of = |percentiles: &[f64]| {
            mass_percentiles(&grains, &[1e-3; 100], Vector2::zeros(), percentiles).unwrap()
        };
        let found = of(&[10.0, 50.0, 90.0]);
        assert!(
            found.iter().zip([10.0, 50.0, 90.0]).all(|(a, b)| (a - b).abs() < 1e-9),
            "{found:?}"
        );
        assert_eq!(of(&[100.0]), [99.5]);
    }

    #[test]
    fn a_heavy_grain_has_its_share() {
        // Masses 1 and 8: the inner grain is the first ninth.
        let grains = [Vector3::new(1.0, 0.0, 0.0), Vector3::new(0.0, 2.0, 0.0)];
        let of = |grains: &[Vector3<f64>], radii: &[f64], percentiles: &[f64]| {
            mass_percentiles(grains, radii, Vector2::zeros(), percentiles)
        };
        let found = of(&grains, &[1.0, 2.0], &[100.0 / 18.0, 99.0]).unwrap();
        assert!((found[0] - 1.0).abs() < 1e-12 && found[1] == 2.0, "{found:?}");
        assert!(of(&[], &[], &[5.0]).unwrap()[0].is_nan());
        let nowhere = [grains[0], Vector3::repeat(f64::NAN)];
        assert!(of(&nowhere, &[1.0, 2.0], &[5.0]).unwrap()[0].is_nan());
        let got = of(&grains, &[1.0], &[5.0]);
        assert_eq!(got, Err(FeatureError::LengthMismatch { what: "radii", got: 1, expected: 2 }));
        for (radius, percent) in [(0.0, 5.0), (f64::NAN, 5.0), (1.0, f64::NAN), (1.0, 101.0)] {
            let got = of(&grains, &[1.0, radius], &[percent]);
            assert!(matches!(got, Err(FeatureError::OutOfRange { .. })), "{got:?}");
        }
    }
}
