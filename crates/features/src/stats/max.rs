//! Largest height and largest radius.
//!
//! \\[ \max(z) = \max_i z_i, \qquad \max(r) = \max_i r_i \\]
//!
//! Defined for any number of points. One stray grain decides max(r): that is the paper's choice.
//!
//! Source: the paper, Summary Statistic Extraction.

use super::sum::extremes;
use super::{Behaviour, Prepared, Statistic};

/// Height of the highest point above the ground.
pub const MAX_Z: Statistic = Statistic {
    name: "max_z",
    unit: "m",
    doc: "height of the highest point above the ground",
    behaviour: Behaviour::HEIGHT,
    value: |points| extremes(points.z()).1,
};

/// Distance of the farthest point from the centroid.
pub const MAX_R: Statistic = Statistic {
    name: "max_r",
    unit: "m",
    doc: "horizontal distance of the farthest point from the centroid",
    behaviour: Behaviour::LENGTH,
    value: |points: &Prepared| extremes(points.r()).1,
};

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn of_three_points() {
        // Centroid (1, 0): distances 1, 1, 0... with the third point on it.
        let points = [
            Vector3::new(0.0, 0.0, 1.0),
            Vector3::new(2.0, 0.0, -3.0),
            Vector3::new(1.0, 0.0, 0.5),
        ];
        let prepared = Prepared::new(&points).unwrap();
        assert_eq!((MAX_Z.value)(&prepared), 1.0);
        assert_eq!((MAX_R.value)(&prepared), 1.0);
    }
}
