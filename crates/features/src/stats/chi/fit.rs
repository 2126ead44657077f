//! Maximum likelihood of the shifted, scaled chi distribution by its profile over the shift.

use super::gamma::{gamma_shape, ln_gamma};
use super::log_sum::{ln_and_inverse_sums, ln_sum};
use crate::stats::sum::{extremes, is_constant, mean, sum};

/// Fewest degrees of freedom: below, the likelihood is unbounded.
pub const MIN_DF: f64 = 1.0;
/// Most degrees of freedom: beyond, thousands of points cannot tell chi from normal.
pub const MAX_DF: f64 = 100.0;

/// Largest distance of the shift below the smallest radius, in ranges of the data: for k ≤ 100 the
/// likelihood rises towards smaller distances from (k - 1) = 99 ranges on.
const MAX_GAP: f64 = 99.0;
/// Smallest distance of the shift below the smallest radius, in ranges of the data. Rounding of r must
/// not put a radius below the shift, where the density is 0; the likelihood cannot tell it from none.
const MIN_GAP: f64 = 1e-12;
/// The same in roundings of the largest radius, which decide where the range is much smaller.
const MIN_GAP_ROUNDINGS: f64 = 8.0;
/// Points of the search grid in ln(gap), at most 0.6 apart.
const GRID: usize = 55;
/// Steps of the root search at most; it converges faster than linearly.
const ROOT_STEPS: usize = 100;
/// Relative width of the bracket at which the root search ends.
const ROOT_TOLERANCE: f64 = 1e-14;

/// A chi distribution fitted to radii.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChiFit {
    /// Degrees of freedom k `[-]`, within [[`MIN_DF`], [`MAX_DF`]].
    pub df: f64,
    /// Shift b `[m]`, below the smallest radius, if by 1e-12 of the range (equal radii: that radius).
    pub shift: f64,
    /// Scale A `[m]`.
    pub scale: f64,
}

impl ChiFit {
    /// The fit of greatest likelihood within the bounds.
    ///
    /// Equal values, up to rounding, give k = 1, b = their minimum and A their root mean square
    /// distance from it, 0: the limit of ever narrower data of any shape with k = 1.
    pub fn new(radii: &[f64]) -> Self {
        if radii.is_empty() {
            return Self { df: MIN_DF, shift: 0.0, scale: 0.0 };
        }
        let (min, max) = extremes(radii);
        let range = max - min;
        if is_constant(radii) {
            let square = sum(radii, |r| (r - min) * (r - min));
            let scale = (square / radii.len() as f64).sqrt();
            return Self { df: MIN_DF, shift: min, scale };
        }
        let data = UnitData::new(radii.iter().map(|r| (r - min) / range).collect());
        let rounding = f64::EPSILON * max.abs().max(min.abs()) / range;
        let best = data.best(MIN_GAP.max(MIN_GAP_ROUNDINGS * rounding));
        Self { df: best.df, shift: min - best.gap * range, scale: best.scale * range }
    }
}

/// The best k and A for one shift.
#[derive(Debug, Clone, Copy)]
struct Profile {
    /// Distance of the shift below the smallest value.
    gap: f64,
    df: f64,
    scale: f64,
    /// Log likelihood per value.
    likelihood: f64,
}

/// Data moved and scaled to [0, 1].
struct UnitData {
    values: Vec<f64>,
    mean: f64,
    variance: f64,
}

impl UnitData {
    fn new(values: Vec<f64>) -> Self {
        let middle = mean(&values);
        let squares = sum(&values, |v| (v - middle) * (v - middle));
        let variance = squares / values.len() as f64;
        Self { values, mean: middle, variance }
    }

    /// The global maximum: the half-normal end of the range against every local maximum inside.
    fn best(&self, min_gap: f64) -> Profile {
        let step = (MAX_GAP / min_gap).ln() / (GRID - 1) as f64;
        let gap_of = |i: usize| min_gap * (step * i as f64).exp();
        let grid: Vec<Profile> = (0..GRID).map(|i| self.profile(gap_of(i))).collect();
        let mut best = self.half_normal(min_gap);
        for (i, point) in grid.iter().enumerate() {
            let left = grid[i.saturating_sub(1)];
            let right = grid[(i + 1).min(GRID - 1)];
            if point.likelihood < left.likelihood || point.likelihood < right.likelihood {
                continue;
            }
            for candidate in [*point, self.climb(left.gap, *point), self.climb(point.gap, right)] {
                if candidate.likelihood > best.likelihood {
                    best = candidate;
                }
            }
        }
        best
    }

    /// k = 1 with the shift at the smallest value, where that k is best placed.
    fn half_normal(&self, gap: f64) -> Profile {
        let mean_square = self.mean_square(gap);
        let likelihood = log_likelihood(MIN_DF, mean_square, 0.0);
        Profile { gap, df: MIN_DF, scale: mean_square.sqrt(), likelihood }
    }

    /// For a fixed shift, (v - b)² follows a gamma distribution of shape k/2: one equation for k,
    /// then A² = mean (v - b)² / k.
    fn profile(&self, gap: f64) -> Profile {
        self.profile_with(gap, ln_sum(&self.values, gap) / self.count())
    }

    /// The same where the mean of ln(v + gap) is known.
    fn profile_with(&self, gap: f64, mean_ln: f64) -> Profile {
        let mean_square = self.mean_square(gap);
        let log_ratio = mean_square.ln() - 2.0 * mean_ln;
        let df = 2.0 * gamma_shape(log_ratio, 0.5 * MIN_DF, 0.5 * MAX_DF);
        let likelihood = log_likelihood(df, mean_square, mean_ln);
        Profile { gap, df, scale: (mean_square / df).sqrt(), likelihood }
    }

    /// The stationary point between two gaps, or `other` if the slope does not change sign there.
    ///
    /// Regula falsi on the slope of the profile, with the weights of the Illinois algorithm
    /// (Dowell & Jarratt 1971, doi:10.1007/BF01934364), in the logarithm of the gap.
    fn climb(&self, gap: f64, other: Profile) -> Profile {
        let (mut a, mut b) = (gap.min(other.gap).ln(), gap.max(other.gap).ln());
        let (mut slope_a, mut slope_b) = (self.slope(a.exp()), self.slope(b.exp()));
        if !(slope_a > 0.0 && slope_b < 0.0) {
            return other;
        }
        let mut moved_a = None;
        for _ in 0..ROOT_STEPS {
            if b - a <= ROOT_TOLERANCE * a.abs().max(1.0) {
                break;
            }
            let guess = (a * slope_b - b * slope_a) / (slope_b - slope_a);
            let middle = if guess > a && guess < b { guess } else { 0.5 * (a + b) };
            let slope = self.slope(middle.exp());
            // An end that stays twice gets half its weight, or it would stay for ever.
            if slope > 0.0 {
                slope_b *= if moved_a == Some(true) { 0.5 } else { 1.0 };
                (a, slope_a, moved_a) = (middle, slope, Some(true));
            } else if slope < 0.0 {
                slope_a *= if moved_a == Some(false) { 0.5 } else { 1.0 };
                (b, slope_b, moved_a) = (middle, slope, Some(false));
            } else {
                (a, b) = (middle, middle);
            }
        }
        self.profile((0.5 * (a + b)).exp())
    }

    /// Derivative of the profile likelihood with respect to the gap. k and A are best for the gap,
    /// so only the explicit dependence counts (or k is at a bound and does not move).
    fn slope(&self, gap: f64) -> f64 {
        let (ln, inverse) = ln_and_inverse_sums(&self.values, gap);
        let df = self.profile_with(gap, ln / self.count()).df;
        let square = self.mean_square(gap);
        (df - 1.0) * inverse / self.count() - df * (self.mean + gap) / square
    }

    fn count(&self) -> f64 {
        self.values.len() as f64
    }

    /// Mean of (v + gap)².
    fn mean_square(&self, gap: f64) -> f64 {
        self.variance + (self.mean + gap) * (self.mean + gap)
    }
}

/// Log likelihood per value at A² = mean square / k.
fn log_likelihood(df: f64, mean_square: f64, mean_ln: f64) -> f64 {
    let half = 0.5 * df;
    let scale_free = (1.0 - half) * std::f64::consts::LN_2 - ln_gamma(half) - half;
    scale_free - half * (mean_square / df).ln() + (df - 1.0) * mean_ln
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
