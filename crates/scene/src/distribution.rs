//! The distributions a prior is made of, each by its quantile function.
//!
//! A quantile turns one uniform number into one draw, so a row needs a known count of random words
//! whatever the distribution. Exponentials and logarithms come from `libm`, which gives the same bits
//! on every machine.

use std::fmt;

use granulcal_numbers::normal_cdf;

use crate::normal::truncated_normal_quantile;

/// How a parameter is distributed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distribution {
    /// Uniform between two bounds.
    Uniform {
        /// Lower bound.
        low: f64,
        /// Upper bound.
        high: f64,
    },
    /// Uniform in the logarithm.
    LogUniform {
        /// Lower bound, positive.
        low: f64,
        /// Upper bound.
        high: f64,
    },
    /// Normal, cut off at the bounds where they are given.
    Normal {
        /// Mean before the cut.
        mean: f64,
        /// Standard deviation before the cut.
        sd: f64,
        /// Lower bound.
        low: Option<f64>,
        /// Upper bound.
        high: Option<f64>,
    },
    /// Always the same value; not a parameter to infer.
    Fixed {
        /// The value.
        value: f64,
    },
}

impl Distribution {
    /// The word used in TOML.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Uniform { .. } => "uniform",
            Self::LogUniform { .. } => "log_uniform",
            Self::Normal { .. } => "normal",
            Self::Fixed { .. } => "fixed",
        }
    }

    /// The share of the normal that the bounds leave; 1 of what is no normal.
    pub fn mass(&self) -> f64 {
        let Self::Normal { mean, sd, low, high } = *self else { return 1.0 };
        let [a, b] = [low, high].map(|bound| bound.map(|bound| (bound - mean) / sd));
        let (a, b) = (a.unwrap_or(f64::NEG_INFINITY), b.unwrap_or(f64::INFINITY));
        // In the upper tail the probabilities of the lower one keep their digits.
        if a > 0.0 { normal_cdf(-a) - normal_cdf(-b) } else { normal_cdf(b) - normal_cdf(a) }
    }

    /// The value below which a draw falls with probability `u`, in (0, 1).
    pub fn quantile(&self, u: f64) -> f64 {
        match *self {
            Self::Uniform { low, high } => (low + u * (high - low)).clamp(low, high),
            Self::LogUniform { low, high } => {
                let (a, b) = (libm::log(low), libm::log(high));
                libm::exp(a + u * (b - a)).clamp(low, high)
            }
            Self::Normal { mean, sd, low, high } => {
                let low = low.unwrap_or(f64::NEG_INFINITY);
                let high = high.unwrap_or(f64::INFINITY);
                let z = truncated_normal_quantile(u, (low - mean) / sd, (high - mean) / sd);
                (mean + sd * z).clamp(low, high)
            }
            Self::Fixed { value } => value,
        }
    }

    /// Whether [`Self::extremes`] leaves values out that may be drawn: those of a normal that is not cut off.
    pub(crate) fn is_unbounded(&self) -> bool {
        matches!(self, Self::Normal { low, high, .. } if low.is_none() || high.is_none())
    }

    /// Values that stand for the range: the bounds, the mean where a normal has none, the fixed value.
    pub(crate) fn extremes(&self) -> Vec<f64> {
        match *self {
            Self::Uniform { low, high } | Self::LogUniform { low, high } => vec![low, high],
            Self::Normal { mean, low, high, .. } => {
                let ends: Vec<_> = [low, high].into_iter().flatten().collect();
                if ends.is_empty() { vec![mean] } else { ends }
            }
            Self::Fixed { value } => vec![value],
        }
    }
}

impl fmt::Display for Distribution {
    /// For people: the word used in TOML and its numbers.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())?;
        match *self {
            Self::Uniform { low, high } | Self::LogUniform { low, high } => {
                write!(f, " from {low} to {high}")
            }
            Self::Normal { mean, sd, low, high } => {
                write!(f, " {mean} ± {sd}")?;
                low.map_or(Ok(()), |low| write!(f, " from {low}"))?;
                high.map_or(Ok(()), |high| write!(f, " to {high}"))
            }
            Self::Fixed { value } => write!(f, " at {value}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_distribution_says_its_word_and_its_numbers() {
        for (distribution, words) in [
            (Distribution::LogUniform { low: 0.001, high: 1.0 }, "log_uniform from 0.001 to 1"),
            (
                Distribution::Normal { mean: 0.5, sd: 0.1, low: Some(0.0), high: None },
                "normal 0.5 ± 0.1 from 0",
            ),
            (Distribution::Fixed { value: 0.3 }, "fixed at 0.3"),
        ] {
            assert_eq!(distribution.to_string(), words);
        }
    }

    /// Mean of a standard normal cut to its upper half, sqrt(2 / pi).
    const HALF_NORMAL_MEAN: f64 = 0.797_884_560_802_865_4;

    #[test]
    fn draws_stay_within_bounds_and_have_their_mean() {
        let n = 20_000;
        let mean = |d: Distribution| {
            (0..n).map(|i| d.quantile((f64::from(i) + 0.5) / f64::from(n))).sum::<f64>()
                / f64::from(n)
        };
        let close = |got: f64, expected: f64| assert!((got - expected).abs() < 1e-3, "{got}");
        close(mean(Distribution::Uniform { low: 1.0, high: 3.0 }), 2.0);
        close(mean(Distribution::LogUniform { low: 0.1, high: 1.0 }), 0.9 / 10f64.ln());
        let normal = |low, high| Distribution::Normal { mean: 0.0, sd: 1.0, low, high };
        close(mean(normal(None, None)), 0.0);
        close(mean(normal(Some(0.0), None)), HALF_NORMAL_MEAN);
        close(mean(normal(None, Some(0.0))), -HALF_NORMAL_MEAN);
        // Far in the tail the draws still fall between the bounds: mean a + 1/a - 2/a^3 + ...
        let far = normal(Some(10.0), Some(11.0));
        assert!((mean(far) - 10.098).abs() < 1e-3, "{}", mean(far));
        assert!((10.0..=11.0).contains(&far.quantile(1e-12)));
    }
}
