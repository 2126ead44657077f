//! Mean height and mean radius.
//!
//! \\[ \mu(v) = \frac{1}{n} \sum_{i=1}^{n} v_i, \qquad v \in \{z, r\} \\]
//!
//! Defined for any number of points.
//!
//! Source: the paper, Summary Statistic Extraction.

use super::sum::mean;
use super::{Behaviour, Statistic};

/// Mean height of the points above the ground.
pub const MEAN_Z: Statistic = Statistic {
    name: "mean_z",
    unit: "m",
    doc: "mean height of the points above the ground",
    behaviour: Behaviour::HEIGHT,
    value: |points| mean(points.z()),
};

/// Mean distance of the points from the centroid.
pub const MEAN_R: Statistic = Statistic {
    name: "mean_r",
    unit: "m",
    doc: "mean horizontal distance of the points from the centroid",
    behaviour: Behaviour::LENGTH,
    value: |points| mean(points.r()),
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::Prepared;
    use nalgebra::Vector3;

    #[test]
    fn of_three_points() {
        let points =
            [Vector3::new(0.0, 0.0, 1.0), Vector3::new(3.0, 0.0, 2.0), Vector3::new(6.0, 0.0, 6.0)];
        let prepared = Prepared::new(&points).unwrap();
        assert_eq!((MEAN_Z.value)(&prepared), 3.0);
        assert_eq!((MEAN_R.value)(&prepared), 2.0);
    }
}
