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

use super::prepared::Ranked;
use super::sum::extremes;
use super::{Behaviour, Statistic};

/// Interquartile range along x.
pub const IQR_X: Statistic = Statistic {
    name: "iqr_x",
    unit: "m",
    doc: "interquartile range of the points along x; turns with the axes",
    behaviour: Behaviour::AXIS_LENGTH,
    value: |points| iqr(points.x()),
};

/// Interquartile range along y.
pub const IQR_Y: Statistic = Statistic {
    name: "iqr_y",
    unit: "m",
    doc: "interquartile range of the points along y; turns with the axes",
    behaviour: Behaviour::AXIS_LENGTH,
    value: |points| iqr(points.y()),
};

/// Interquartile range of the distance from the centroid.
pub const IQR_R: Statistic = Statistic {
    name: "iqr_r",
    unit: "m",
    doc: "interquartile range of the horizontal distance from the centroid",
    behaviour: Behaviour::LENGTH,
    value: |points| iqr_of_ranking(points.r_ranking()),
};

/// Interquartile range; 0 of nothing.
fn iqr(values: &[f64]) -> f64 {
    let mut scratch = values.to_vec();
    let upper = quantile(&mut scratch, 0.75);
    upper - quantile(&mut scratch, 0.25)
}

/// Interquartile range of values in ascending order.
fn iqr_of_ranking(ranking: &[Ranked]) -> f64 {
    let at = |q| interpolated(ranking.len(), q, |rank| ranking[rank].value);
    at(0.75) - at(0.25)
}

/// Linearly interpolated quantile; 0 of nothing. Reorders the values, which is cheaper than sorting.
pub(super) fn quantile(values: &mut [f64], q: f64) -> f64 {
    let rank = (q * values.len().saturating_sub(1) as f64) as usize;
    if rank >= values.len() {
        return 0.0;
    }
    let (_, &mut low, above) = values.select_nth_unstable_by(rank, f64::total_cmp);
    let next = extremes(above).0;
    interpolated(values.len(), q, |wanted| if wanted == rank { low } else { next })
}

/// The quantile at (n - 1) q of the n values in order.
fn interpolated(n: usize, q: f64, value: impl Fn(usize) -> f64) -> f64 {
    let Some(last) = n.checked_sub(1) else { return 0.0 };
    let position = q * last as f64;
    let (rank, fraction) = (position as usize, position.fract());
    let low = value(rank);
    if fraction > 0.0 { low + fraction * (value(rank + 1) - low) } else { low }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::prepared::ranking;

    #[test]
    fn quartiles_between_and_on_points() {
        // Sorted 1 2 3 4: Q1 = 1.75, Q3 = 3.25.
        assert_eq!(iqr(&[4.0, 1.0, 3.0, 2.0]), 1.5);
        // Sorted 0 1 2 3 10: Q1 = 1, Q3 = 3.
        assert_eq!(iqr(&[10.0, 1.0, 3.0, 2.0, 0.0]), 2.0);
        for values in [vec![4.0, 1.0, 3.0, 2.0], vec![10.0, 1.0, 3.0, 2.0, 0.0], vec![]] {
            assert_eq!(iqr_of_ranking(&ranking(&values)), iqr(&values));
        }
    }

    #[test]
    fn of_few_and_equal_values() {
        assert_eq!(iqr(&[]), 0.0);
        assert_eq!(iqr(&[5.0]), 0.0);
        assert_eq!(iqr(&[2.0, 2.0, 2.0]), 0.0);
    }
}
