//! Standard deviations of height, of both horizontal axes and of the radius.
//!
//! \\[ \sigma(v) = \sqrt{\frac{1}{n} \sum_{i=1}^{n} (v_i - \mu(v))^2}, \qquad v \in \{z, x, y, r\} \\]
//!
//! The population form, divided by n, as `numpy.std`. 0 for equal values. σ(x) and σ(y) depend on
//! how the table is turned under the camera.
//!
//! Source: the paper, Summary Statistic Extraction.

use super::sum::{mean, sum};
use super::{Behaviour, Statistic};

/// Standard deviation of the height.
pub const SD_Z: Statistic = Statistic {
    name: "sd_z",
    unit: "m",
    doc: "standard deviation of the height",
    behaviour: Behaviour::LENGTH,
    value: |points| sd(points.z()),
};

/// Standard deviation along x.
pub const SD_X: Statistic = Statistic {
    name: "sd_x",
    unit: "m",
    doc: "standard deviation of the points along x; turns with the axes",
    behaviour: Behaviour::AXIS_LENGTH,
    value: |points| sd(points.x()),
};

/// Standard deviation along y.
pub const SD_Y: Statistic = Statistic {
    name: "sd_y",
    unit: "m",
    doc: "standard deviation of the points along y; turns with the axes",
    behaviour: Behaviour::AXIS_LENGTH,
    value: |points| sd(points.y()),
};

/// Standard deviation of the distance from the centroid.
pub const SD_R: Statistic = Statistic {
    name: "sd_r",
    unit: "m",
    doc: "standard deviation of the horizontal distance from the centroid",
    behaviour: Behaviour::LENGTH,
    value: |points| sd(points.r()),
};

/// Population standard deviation, in two passes so that a large mean costs no digits.
fn sd(values: &[f64]) -> f64 {
    let middle = mean(values);
    let squares = sum(values, |v| (v - middle) * (v - middle));
    (squares / values.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_small_sets() {
        assert_eq!(sd(&[2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0]), 2.0);
        assert_eq!(sd(&[3.0, 3.0, 3.0]), 0.0);
        assert_eq!(sd(&[]), 0.0);
    }

    #[test]
    fn a_large_mean_costs_no_digits() {
        assert_eq!(sd(&[1e6 - 1.0, 1e6 + 1.0]), 1.0);
    }
}
