//! Excess kurtosis of the radius.
//!
//! \\[ \mathrm{KURT}(r) = \frac{m_4}{m_2^2} - 3, \qquad m_k = \frac{1}{n} \sum_{i=1}^{n} (r_i - \mu(r))^k \\]
//!
//! Fisher's definition, 0 for a normal distribution, with the biased moments: the default of
//! `scipy.stats.kurtosis`. At least 1 - 3 = -2. Equal radii have no kurtosis: where scipy answers
//! NaN this is 0.
//!
//! Source: the paper, Summary Statistic Extraction.

use nalgebra::Vector2;

use super::sum::{extremes, is_constant, mean, sum};
use super::{Behaviour, Statistic};

/// Excess kurtosis of the distance from the centroid.
pub const KURTOSIS_R: Statistic = Statistic {
    name: "kurtosis_r",
    unit: "-",
    doc: "excess kurtosis of the horizontal distance from the centroid",
    behaviour: Behaviour::NUMBER,
    value: |points| kurtosis(points.r()),
};

/// Biased excess kurtosis; 0 for equal values.
fn kurtosis(values: &[f64]) -> f64 {
    if is_constant(values) {
        return 0.0;
    }
    let middle = mean(values);
    let (low, high) = extremes(values);
    // In units of the largest deviation no power underflows, however small the formation.
    let reach = f64::max(high - middle, middle - low);
    let powers = sum(values, |v| {
        let square = ((v - middle) / reach).powi(2);
        Vector2::new(square, square * square)
    });
    values.len() as f64 * powers.y / (powers.x * powers.x) - 3.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_small_sets() {
        // Two equal halves are the flattest set there is.
        assert_eq!(kurtosis(&[-1.0, 1.0, -1.0, 1.0]), -2.0);
        // -2 -1 0 1 2: m2 = 2, m4 = 6.8, 6.8/4 - 3.
        assert!((kurtosis(&[0.0, 1.0, 2.0, 3.0, 4.0]) + 1.3).abs() < 1e-15);
    }

    #[test]
    fn of_equal_and_of_tiny_values() {
        assert_eq!(kurtosis(&[0.1; 7]), 0.0);
        assert_eq!(kurtosis(&[]), 0.0);
        assert!((kurtosis(&[0.0, 1e-120, 2e-120, 3e-120, 4e-120]) + 1.3).abs() < 1e-12);
    }
}
