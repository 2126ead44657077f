//! What the estimator makes of a component: its covariances after a trend was removed, exactly.
//!
//! Equation (9) of `docs/theory/sensor.md`, for a region without missing pixels.

use crate::sensor::field::{Along, Component};

/// One axis of a region: how a correlation along it meets the polynomials that are removed.
#[derive(Debug, Clone)]
pub(super) struct AxisResponse {
    /// Pixels along the axis.
    count: usize,
    /// Correlation at each lag.
    correlations: Vec<f64>,
    /// Σ_i q_a(i) (T q_a)(i + h) and Σ_i (T q_a)(i) q_a(i + h), for each degree a and lag h.
    from_trend: Vec<Vec<f64>>,
    to_trend: Vec<Vec<f64>>,
    /// q_a · T q_b.
    inner: Vec<Vec<f64>>,
    /// Σ_i q_a(i) q_b(i + h).
    overlaps: Vec<Vec<Vec<f64>>>,
}

impl AxisResponse {
    /// For a component that is correlated `along` an axis of `count` pixels, polynomials up to
    /// `degree` and lags up to `max_lag`.
    pub(super) fn new(along: Along, count: usize, degree: usize, max_lag: usize) -> Self {
        let correlations = along.correlations(count.max(max_lag + 1) - 1);
        // Beyond the reach of its taps a Gaussian is not correlated at all.
        let reach = correlations.iter().rposition(|&c| c != 0.0).map_or(0, |last| last + 1);
        let smooth = |q: &Vec<f64>| -> Vec<f64> {
            let near = |i: usize| i.saturating_sub(reach)..count.min(i + reach);
            let at = |i: usize| near(i).map(|j| correlations[i.abs_diff(j)] * q[j]).sum();
            (0..count).map(at).collect()
        };
        let trends = polynomials(count, degree);
        let smoothed: Vec<_> = trends.iter().map(smooth).collect();
        let lagged = |a: &[f64], b: &[f64]| -> Vec<f64> {
            let at = |h: usize| a.iter().zip(b.iter().skip(h)).map(|(a, b)| a * b).sum();
            (0..=max_lag).map(at).collect()
        };
        let pairs = || trends.iter().zip(&smoothed);
        Self {
            count,
            from_trend: pairs().map(|(q, s)| lagged(q, s)).collect(),
            to_trend: pairs().map(|(q, s)| lagged(s, q)).collect(),
            inner: trends
                .iter()
                .map(|a| smoothed.iter().map(|s| lagged(a, s)[0]).collect())
                .collect(),
            overlaps: trends
                .iter()
                .map(|a| trends.iter().map(|b| lagged(a, b)).collect())
                .collect(),
            correlations,
        }
    }
}

/// Polynomials of degree 0 to `degree`, orthonormal on the pixels.
fn polynomials(count: usize, degree: usize) -> Vec<Vec<f64>> {
    let mut found: Vec<Vec<f64>> = Vec::new();
    for power in 0..=degree.min(count.saturating_sub(1)) {
        let scaled = |i: usize| 2.0 * (i as f64 + 0.5) / count as f64 - 1.0;
        let mut next: Vec<f64> = (0..count).map(|i| scaled(i).powi(power as i32)).collect();
        for _ in 0..2 {
            // Twice is enough to be orthogonal to rounding.
            for q in &found {
                let share: f64 = q.iter().zip(&next).map(|(a, b)| a * b).sum();
                next.iter_mut().zip(q).for_each(|(value, q)| *value -= share * q);
            }
        }
        let norm = next.iter().map(|value| value * value).sum::<f64>().sqrt();
        found.push(next.into_iter().map(|value| value / norm).collect());
    }
    found
}

/// Number of pairs and expected sum of their products at each lag along the first axis, for a
/// component of variance 1 from which the polynomials of total degree up to `degree` were removed.
///
/// With P the projection onto them and C = T_x ⊗ T_y, the residual's covariance is
/// C - P C - C P + P C P; its sums over pairs at a lag factor into those of the axes.
pub(super) fn sums_along(
    first: &AxisResponse,
    second: &AxisResponse,
    degree: usize,
    max_lag: usize,
) -> Vec<(f64, f64)> {
    let (terms_a, terms_b) = (first.from_trend.len(), second.from_trend.len());
    let both = |a: usize, b: usize| a < terms_a && b < terms_b && a + b <= degree;
    (0..=max_lag.min(first.count - 1))
        .map(|h| {
            let pairs = ((first.count - h) * second.count) as f64;
            let mut sum = pairs * first.correlations[h] * second.correlations[0];
            for b in 0..=degree {
                for a in (0..=degree).filter(|&a| both(a, b)) {
                    sum -= first.from_trend[a][h] * second.from_trend[b][0];
                    sum -= first.to_trend[a][h] * second.to_trend[b][0];
                    for c in (0..=degree).filter(|&c| both(c, b)) {
                        sum += first.inner[a][c] * first.overlaps[a][c][h] * second.inner[b][b];
                    }
                }
            }
            (pairs, sum)
        })
        .collect()
}

/// The correlations of a component along its axes, in the order (x, y).
pub(super) fn axes(component: &Component) -> [Along; 2] {
    [component.x, component.y]
}

#[cfg(test)]
mod tests {
    use super::super::covariance::split;
    use super::super::flat::detrend;
    use super::*;
    use crate::sensor::NoiseField;
    use crate::sensor::field::SensorGrid;

    #[test]
    fn polynomials_are_orthonormal() {
        let found = polynomials(17, 3);
        for (i, a) in found.iter().enumerate() {
            for (j, b) in found.iter().enumerate() {
                let product: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                assert!((product - f64::from(u8::from(i == j))).abs() < 1e-12, "{i} {j} {product}");
            }
        }
    }

    /// Against the mean over many draws, for each kind of component.
    #[test]
    fn draws_have_the_expected_covariances() {
        let (width, height, degree, max_lag) = (40, 30, 2, 10);
        for field in [
            NoiseField { white: 1.0, ..NoiseField::default() },
            NoiseField {
                correlated: 1.0,
                correlation_x: 5.0,
                correlation_y: 2.0,
                ..NoiseField::default()
            },
            NoiseField { columns: 1.0, column_correlation: 3.0, ..NoiseField::default() },
            NoiseField { row_alternation: 1.0, ..NoiseField::default() },
        ] {
            let component =
                crate::sensor::field::components(&field).into_iter().find(|c| c.sd > 0.0).unwrap();
            let [x, y] = axes(&component);
            let x = AxisResponse::new(x, width, degree, max_lag);
            let y = AxisResponse::new(y, height, degree, max_lag);
            let grid = SensorGrid::under(width, height, 1.0).unwrap();
            let draws = 400;
            let mut mean = vec![0.0; 2 * (max_lag + 1)];
            for seed in 0..draws {
                let values = crate::sensor::field::sample(&field, &grid, seed);
                let patch = detrend(&values, width, degree, |v, t| v - t).unwrap();
                let found = split(&[vec![patch]], &[(0, 0)], max_lag).noise;
                for (sum, value) in mean.iter_mut().zip(found.x.iter().chain(&found.y)) {
                    *sum += value / draws as f64;
                }
            }
            let along_x = sums_along(&x, &y, degree, max_lag);
            let along_y = sums_along(&y, &x, degree, max_lag);
            for (got, (pairs, sum)) in mean.iter().zip(along_x.iter().chain(&along_y)) {
                // The longest-ranged of them has 40 independent values a draw: 4 sd are 0.03.
                assert!((got - sum / pairs).abs() < 0.03, "{field:?}: {got} {}", sum / pairs);
            }
        }
    }
}
