//! A polynomial trend and what remains of a frame: equation (6) of `docs/theory/sensor.md`.

use nalgebra::{DMatrix, DVector};

use crate::error::FeatureError;

/// Robust standard deviations from the trend beyond which a pixel is not of the surface.
const CLIP: f64 = 4.0;
/// The same for the first look, about the median of a frame that may be tilted.
const FIRST_CLIP: f64 = 6.0;
/// Standard deviation of a Gaussian over its median absolute deviation.
pub(super) const SD_PER_MAD: f64 = 1.482_602_218_505_602;
/// Rounds of "fit, leave out, fit again".
const MAX_ROUNDS: usize = 40;
/// Pixels for each coefficient below which there is nothing to learn.
const LEAST_PER_COEFFICIENT: usize = 10;

/// A region of a frame with its trend taken off.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Patch {
    pub(super) width: usize,
    pub(super) height: usize,
    /// The trend at every pixel.
    pub(super) trend: Vec<f64>,
    /// What remains; 0 where the mask is.
    pub(super) residual: Vec<f64>,
    /// 1 where there is a residual, else 0.
    pub(super) mask: Vec<f64>,
}

impl Patch {
    /// Pixels with a residual.
    pub(super) fn count(&self) -> usize {
        self.mask.iter().sum::<f64>() as usize
    }
}

/// Takes the polynomial of `degree` off; NaN is no data. `residual` gives the error from value and trend.
pub(super) fn detrend(
    values: &[f64],
    width: usize,
    degree: usize,
    residual: impl Fn(f64, f64) -> f64,
) -> Result<Patch, FeatureError> {
    let height = values.len() / width;
    let basis = Basis { width, height, degree };
    let min = LEAST_PER_COEFFICIENT * basis.len();
    let mut kept = first_look(values);
    let mut trend = Vec::new();
    for _ in 0..MAX_ROUNDS {
        let got = kept.iter().filter(|&&k| k).count();
        if got < min {
            return Err(FeatureError::TooFewPoints { what: "sensor fit", got, min });
        }
        trend = basis.fit(values, &kept);
        let off = |i: usize| (values[i] - trend[i]).abs();
        let mut distances: Vec<f64> = (0..values.len()).filter(|&i| kept[i]).map(off).collect();
        let reach = CLIP * SD_PER_MAD * median(&mut distances);
        // Values that are all alike have a reach of 0, and belong.
        let again: Vec<bool> =
            (0..values.len()).map(|i| values[i].is_finite() && off(i) <= reach + 1e-12).collect();
        if again == kept {
            break;
        }
        kept = again;
    }
    let mask = kept.iter().map(|&k| f64::from(u8::from(k))).collect();
    let residual = kept
        .iter()
        .zip(values.iter().zip(&trend))
        .map(|(&kept, (&value, &trend))| if kept { residual(value, trend) } else { 0.0 })
        .collect();
    Ok(Patch { width, height, trend, residual, mask })
}

/// The finite values that are not far from their median.
fn first_look(values: &[f64]) -> Vec<bool> {
    let mut finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    let middle = median(&mut finite);
    let mut distances: Vec<f64> = finite.iter().map(|v| (v - middle).abs()).collect();
    let mad = SD_PER_MAD * median(&mut distances);
    let reach = if mad > 0.0 { FIRST_CLIP * mad } else { f64::INFINITY };
    values.iter().map(|v| v.is_finite() && (v - middle).abs() <= reach).collect()
}

/// The median; 0 of nothing.
pub(super) fn median(values: &mut [f64]) -> f64 {
    crate::median::median(values).unwrap_or(0.0)
}

/// Monomials in the pixel coordinates scaled to [-1, 1].
pub(super) struct Basis {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) degree: usize,
}

impl Basis {
    pub(super) fn len(&self) -> usize {
        (self.degree + 1) * (self.degree + 2) / 2
    }

    /// The monomials at pixel (u, v), into `row`.
    pub(super) fn at(&self, u: usize, v: usize, row: &mut [f64]) {
        let scaled = |i: usize, side: usize| 2.0 * (i as f64 + 0.5) / side as f64 - 1.0;
        let (x, y) = (scaled(u, self.width), scaled(v, self.height));
        let mut next = row.iter_mut();
        for total in 0..=self.degree {
            for power in 0..=total {
                if let Some(value) = next.next() {
                    *value = x.powi((total - power) as i32) * y.powi(power as i32);
                }
            }
        }
    }

    /// The least-squares trend at every pixel, fitted to those that are kept.
    fn fit(&self, values: &[f64], kept: &[bool]) -> Vec<f64> {
        let count = self.len();
        let mut row = vec![0.0; count];
        let mut normal = DMatrix::<f64>::zeros(count, count);
        let mut right = DVector::<f64>::zeros(count);
        for (i, &value) in values.iter().enumerate().filter(|(i, _)| kept[*i]) {
            self.at(i % self.width, i / self.width, &mut row);
            for a in 0..count {
                right[a] += row[a] * value;
                for b in 0..=a {
                    normal[(a, b)] += row[a] * row[b];
                }
            }
        }
        normal.fill_upper_triangle_with_lower_triangle();
        // A field of one column has no slope along x: the smallest of all solutions is as good.
        let coefficients = normal.clone().cholesky().map_or_else(
            || {
                normal
                    .pseudo_inverse(1e-12)
                    .map_or_else(|_| right.clone(), |inverse| inverse * &right)
            },
            |factor| factor.solve(&right),
        );
        (0..values.len())
            .map(|i| {
                self.at(i % self.width, i / self.width, &mut row);
                row.iter().zip(coefficients.iter()).map(|(a, b)| a * b).sum()
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_leaves_nothing_and_faults_do_not_pull() {
        let value = |i: usize| {
            let (u, v) = ((i % 30) as f64, (i / 30) as f64);
            3.0 + 0.2 * u - 0.1 * v + 0.01 * u * v + 0.02 * v * v
        };
        let mut values: Vec<f64> = (0..900).map(value).collect();
        values[17] = f64::NAN;
        values[40] += 500.0;
        values[41] -= 3.0;
        let patch = detrend(&values, 30, 2, |value, trend| value - trend).unwrap();
        assert_eq!(patch.count(), 897);
        assert!(patch.residual.iter().all(|r| r.abs() < 1e-9));
        assert!((patch.trend[40] - value(40)).abs() < 1e-9);
    }

    #[test]
    fn too_little_is_an_error() {
        let got = detrend(&[1.0; 50], 10, 2, |v, t| v - t);
        assert!(matches!(got, Err(FeatureError::TooFewPoints { got: 50, min: 60, .. })));
    }
}
