//! The fast distance correlation against its definition.

use proptest::prelude::*;

use super::*;
use crate::rng::Stream;
use crate::stats::sum::mean;

/// As the statistic: rankings first, 0 for a constant.
fn of(x: &[f64], y: &[f64]) -> f64 {
    if is_constant(x) || is_constant(y) {
        return 0.0;
    }
    distance_correlation(&ranking(x), &ranking(y))
}

/// The definition: distance matrices, centred twice, multiplied and averaged.
fn by_definition(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len();
    let centred = |v: &[f64]| {
        let distance = |i: usize, j: usize| (v[i] - v[j]).abs();
        let rows: Vec<f64> =
            (0..n).map(|i| (0..n).map(|j| distance(i, j)).sum::<f64>() / n as f64).collect();
        let all = mean(&rows);
        let mut matrix = Vec::with_capacity(n * n);
        for i in 0..n {
            matrix.extend((0..n).map(|j| distance(i, j) - rows[i] - rows[j] + all));
        }
        matrix
    };
    let (a, b) = (centred(x), centred(y));
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let scale = (product(&a, &a) * product(&b, &b)).sqrt();
    if scale > 0.0 { (product(&a, &b).max(0.0) / scale).sqrt() } else { 0.0 }
}

#[test]
fn of_three_points_by_hand() {
    // x = 0 1 2, y = 0 1 0. Row sums: a = 3 2 3, b = 1 2 1; products: a_ij b_ij sums to 4.
    // dCov² = 4/9 - 2·(3 + 4 + 3)/27 + 8·4/81 = 8/81.
    // dVar²(x) = 12/9 - 2·22/27 + 64/81 = 40/81, dVar²(y) = 4/9 - 2·6/27 + 16/81 = 16/81.
    let expected = (8.0_f64 / (40.0_f64 * 16.0).sqrt()).sqrt();
    assert!((of(&[0.0, 1.0, 2.0], &[0.0, 1.0, 0.0]) - expected).abs() < 1e-15);
}

#[test]
fn a_line_is_one_and_a_constant_is_zero() {
    let x: Vec<f64> = (0..50).map(f64::from).collect();
    let y: Vec<f64> = x.iter().map(|x| 3.0 - 2.0 * x).collect();
    assert!((of(&x, &y) - 1.0).abs() < 1e-14);
    assert_eq!(of(&x, &[0.2; 50]), 0.0);
    assert_eq!(of(&[], &[]), 0.0);
}

#[test]
fn equals_the_definition_on_many_points() {
    let mut stream = Stream::new(1);
    for count in [3, 10, 31, 32, 33, 64, 65, 257, 1000] {
        let x: Vec<f64> = (0..count).map(|_| stream.uniform()).collect();
        let y: Vec<f64> = x.iter().map(|x| x.sin() + stream.normal()).collect();
        let (got, expected) = (of(&x, &y), by_definition(&x, &y));
        assert!((got - expected).abs() < 1e-12, "{count}: {got} {expected}");
    }
}

proptest! {
    #[test]
    fn equals_the_definition_with_ties(values in prop::collection::vec((0_i32..6, -4_i32..4), 3..60)) {
        let x: Vec<f64> = values.iter().map(|v| f64::from(v.0)).collect();
        let y: Vec<f64> = values.iter().map(|v| 0.1 * f64::from(v.1)).collect();
        let (got, expected) = (of(&x, &y), by_definition(&x, &y));
        // The square is what is computed: near 0 the root magnifies its rounding.
        prop_assert!((got * got - expected * expected).abs() < 1e-13, "{} {}", got, expected);
    }

    #[test]
    fn is_symmetric_and_bounded(values in prop::collection::vec((-1e3..1e3_f64, -1e-3..1e-3_f64), 3..40)) {
        let (x, y): (Vec<f64>, Vec<f64>) = values.into_iter().unzip();
        let (xy, yx) = (of(&x, &y), of(&y, &x));
        prop_assert!((xy - yx).abs() < 1e-9 && (0.0..=1.0).contains(&xy));
    }
}
