//! Components of a known field are found again.

use super::*;

const MAX_LAG: usize = 24;

fn estimator() -> Estimator {
    Estimator::new(vec![(120, 100), (60, 150)], 2, MAX_LAG)
}

/// What the estimator gives for a field, on average.
fn expected(field: &NoiseField) -> Covariances {
    let estimator = estimator();
    let mut sum = Covariances::zeros(MAX_LAG);
    for component in crate::sensor::field::components(field) {
        let (x, y) = estimator.expected(axes(&component));
        let variance = component.sd * component.sd;
        sum.combine(&Covariances { x, y }, |sum, value| sum + variance * value);
    }
    sum
}

#[test]
fn finds_the_components_of_a_covariance() {
    let truth = NoiseField {
        white: 0.5,
        correlated: 1.0,
        correlation_x: 6.0,
        correlation_y: 4.0,
        row_alternation: 0.8,
        ..NoiseField::default()
    };
    let got = decompose(&expected(&truth), &estimator(), true, 1e-3);
    for (got, truth) in [
        (got.white, 0.5),
        (got.correlated, 1.0),
        (got.correlation_x, 6.0),
        (got.correlation_y, 4.0),
        (got.row_alternation, 0.8),
    ] {
        assert!((got / truth - 1.0).abs() < 0.05, "{got} {truth}");
    }
    assert!(got.broad == 0.0 && got.columns == 0.0 && got.rows == 0.0, "{got:?}");
}

#[test]
fn whatever_it_finds_has_the_covariances() {
    let truth = NoiseField {
        white: 0.2,
        correlated: 0.7,
        correlation_x: 1.5,
        correlation_y: 1.2,
        broad: 0.5,
        broad_x: 12.0,
        broad_y: 9.0,
        columns: 0.3,
        column_correlation: 3.0,
        rows: 0.4,
        row_correlation: 2.0,
        row_alternation: 0.8,
    };
    let target = expected(&truth);
    let got = expected(&decompose(&target, &estimator(), true, 0.0));
    for (a, b) in target.x.iter().zip(&got.x).chain(target.y.iter().zip(&got.y)) {
        assert!((a - b).abs() < 0.03 * target.variance(), "{a} {b}");
    }
}

#[test]
fn blots_of_equal_area_keep_their_own_variances() {
    for (first, second) in [(0.22, 0.29), (0.29, 0.22)] {
        let truth = NoiseField {
            correlated: first,
            correlation_x: 24.0,
            correlation_y: 1.3,
            broad: second,
            broad_x: 1.95,
            broad_y: 16.0,
            row_alternation: 0.39,
            ..NoiseField::default()
        };
        let target = expected(&truth);
        let found = decompose(&target, &estimator(), true, 0.0);
        let got = expected(&found);
        for (a, b) in target.x.iter().zip(&got.x).chain(target.y.iter().zip(&got.y)) {
            assert!((a - b).abs() < 0.02 * target.variance(), "{a} {b}: {found:?}");
        }
    }
}

#[test]
fn noise_has_no_stripes_and_nothing_is_nothing() {
    let stripes = NoiseField { rows: 1.0, row_correlation: 2.0, ..NoiseField::default() };
    let got = decompose(&expected(&stripes), &estimator(), false, 0.0);
    assert!(got.rows == 0.0 && got.columns == 0.0 && got.row_alternation == 0.0);
    let mut none = Covariances::zeros(MAX_LAG);
    assert!(decompose(&none, &estimator(), true, 0.0).is_none());
    none.x[0] = -1.0;
    assert!(decompose(&none, &estimator(), true, 0.0).is_none());
}
