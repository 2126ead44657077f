//! Interquartile ranges of both horizontal axes and of the radius.
//!
//! \\[ \mathrm{IQR}(v) = Q_{0.75}(v) - Q_{0.25}(v), \qquad v \in \{x, y, r\} \\]
//!
//! With the sorted values \\( v_{(0)} \le \dots \le v_{(n-1)} \\) and \\( h = (n-1) q \\), the quantile
//! is interpolated linearly, \\( Q_q = v_{(\lfloor h \rfloor)} + (h - \lfloor h \rfloor)
//! (v_{(\lfloor h \rfloor + 1)} - v_{(\lfloor h \rfloor)}) \\), as `numpy.percentile` and
//! `scipy.stats.iqr` do by default. 0 for equal values.
//!
//! Source: the paper, Summary Statistic Extraction; definition 7 of Hyndman & Fan 1996,
//! doi:10.1080/00031305.1996.10473566.

use super::{Behaviour, Statistic};

/// Interquartile range along x.
pub const IQR_X: Statistic = Statistic {
    name: "iqr_x",
    unit: "m",
    doc: "interquartile range of the points along x",
    behaviour: Behaviour::AXIS_LENGTH,
    value: |points| iqr(points.x()),
};

/// Interquartile range along y.
pub const IQR_Y: Statistic = Statistic {
    name: "iqr_y",
    unit: "m",
    doc: "interquartile range of the points along y",
    behaviour: Behaviour::AXIS_LENGTH,
    value: |points| iqr(points.y()),
};

/// Interquartile range of the distance from the centroid.
pub const IQR_R: Statistic = Statistic {
    name: "iqr_r",
    unit: "m",
    doc: "interquartile range of the horizontal distance from the centroid",
    behaviour: Behaviour::LENGTH,
    value: |points| iqr(points.r()),
};

/// Interquartile range; 0 of nothing.
fn iqr(values: &[f64]) -> f64 {
    let mut scratch = values.to_vec();
    quantile(&mut scratch, 0.75) - quantile(&mut scratch, 0.25)
}

/// Linearly interpolated quantile; reorders the values, which is cheaper than sorting them.
fn quantile(values: &mut [f64], q: f64) -> f64 {
    let Some(last) = values.len().checked_sub(1) else { return 0.0 };
    let position = q * last as f64;
    let (_, &mut low, above) = values.select_nth_unstable_by(position as usize, f64::total_cmp);
    let high = above.iter().copied().fold(f64::INFINITY, f64::min);
    let fraction = position.fract();
    if fraction > 0.0 { low + fraction * (high - low) } else { low }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quartiles_between_and_on_points() {
        // Sorted 1 2 3 4: Q1 = 1.75, Q3 = 3.25.
        assert_eq!(iqr(&[4.0, 1.0, 3.0, 2.0]), 1.5);
        // Sorted 0 1 2 3 10: Q1 = 1, Q3 = 3.
        assert_eq!(iqr(&[10.0, 1.0, 3.0, 2.0, 0.0]), 2.0);
    }

    #[test]
    fn of_few_and_equal_values() {
        assert_eq!(iqr(&[]), 0.0);
        assert_eq!(iqr(&[5.0]), 0.0);
        assert_eq!(iqr(&[2.0, 2.0, 2.0]), 0.0);
    }
}
