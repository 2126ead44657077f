//! Sums of many numbers, several at a time.
//!
//! One running sum waits for the addition before it; eight of them do not, fit the vector registers
//! and round less: the error grows with n/8.

use std::ops::{Add, AddAssign};

/// Relative range below which values count as equal. The rounding of coordinates and of r leaves a
/// few 1e-16 of the value; nothing that was measured is this exact.
const EQUAL: f64 = 1e-12;

/// Running sums side by side.
pub(super) const LANES: usize = 8;

/// Sum of `term` over `items`.
#[inline]
pub(super) fn sum<T, S: Copy + Default + Add<Output = S> + AddAssign>(
    items: &[T],
    term: impl Fn(&T) -> S,
) -> S {
    let (rows, rest) = items.as_chunks::<LANES>();
    let mut lanes = [S::default(); LANES];
    for row in rows {
        for (lane, item) in lanes.iter_mut().zip(row) {
            *lane += term(item);
        }
    }
    for (lane, item) in lanes.iter_mut().zip(rest) {
        *lane += term(item);
    }
    let [a, b, c, d, e, f, g, h] = lanes;
    ((a + b) + (c + d)) + ((e + f) + (g + h))
}

/// Arithmetic mean; 0 of nothing.
pub(super) fn mean(values: &[f64]) -> f64 {
    if values.is_empty() { 0.0 } else { sum(values, |v| *v) / values.len() as f64 }
}

/// Smallest and largest value; (∞, -∞) of nothing.
pub(super) fn extremes(values: &[f64]) -> (f64, f64) {
    let (rows, rest) = values.as_chunks::<LANES>();
    let (mut low, mut high) = ([f64::INFINITY; LANES], [f64::NEG_INFINITY; LANES]);
    for row in rows.iter().map(<[f64; LANES]>::as_slice).chain([rest]) {
        for ((low, high), &v) in low.iter_mut().zip(&mut high).zip(row) {
            *low = if v < *low { v } else { *low };
            *high = if v > *high { v } else { *high };
        }
    }
    let least = low.into_iter().fold(f64::INFINITY, f64::min);
    (least, high.into_iter().fold(f64::NEG_INFINITY, f64::max))
}

/// Whether all values are equal up to rounding.
pub(super) fn is_constant(values: &[f64]) -> bool {
    let (low, high) = extremes(values);
    // Also true of no values, where high < low.
    high - low <= EQUAL * low.abs().max(high.abs()) || high <= low
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_any_length() {
        for n in [0, 1, 7, 8, 9, 40, 41] {
            let values: Vec<f64> = (0..n).map(f64::from).collect();
            assert_eq!(sum(&values, |v| 2.0 * v), f64::from(n * (n - 1)));
            let (low, high) = extremes(&values);
            if n == 0 {
                assert!(low > high && mean(&values) == 0.0);
            } else {
                assert_eq!((low, high), (0.0, f64::from(n - 1)));
                assert_eq!(mean(&values), 0.5 * f64::from(n - 1));
            }
        }
    }
}
