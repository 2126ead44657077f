//! Every statistic of the registry keeps what it declares.

use nalgebra::{Rotation3, Vector3};

use super::*;
use crate::rng::Stream;

/// A lopsided pile: nothing about it is symmetric by accident.
fn pile(count: usize) -> Vec<Vector3<f64>> {
    let mut stream = Stream::new(21);
    (0..count)
        .map(|_| {
            let (x, y) = (0.02 * stream.normal(), 0.03 * stream.uniform());
            let height = 0.03 - 0.5 * x.hypot(y - 0.01);
            Vector3::new(x, y, height.max(0.002) + 5e-4 * stream.normal())
        })
        .collect()
}

fn values(points: impl Iterator<Item = Vector3<f64>>) -> [f64; 16] {
    paper16(&points.collect::<Vec<_>>()).unwrap()
}

fn assert_close(statistic: &Statistic, got: f64, expected: f64) {
    let allowed = 1e-7 * expected.abs() + 1e-12;
    assert!((got - expected).abs() <= allowed, "{}: {got} instead of {expected}", statistic.name);
}

#[test]
fn names_units_and_docs_are_there_and_in_the_papers_order() {
    let expected = [
        "max_z",
        "mean_z",
        "sd_z",
        "max_r",
        "mean_r",
        "sd_x",
        "sd_y",
        "sd_r",
        "iqr_x",
        "iqr_y",
        "iqr_r",
        "kurtosis_r",
        "dcor_r_z",
        "chi_df",
        "chi_shift",
        "chi_scale",
    ];
    assert_eq!(PAPER16.map(|statistic| statistic.name), expected);
    for statistic in &PAPER16 {
        let unit = ["-", "m"][statistic.behaviour.length_power as usize];
        assert_eq!(statistic.unit, unit, "{}", statistic.name);
        assert!(!statistic.doc.is_empty(), "{}", statistic.name);
    }
}

#[test]
fn a_shift_in_the_plane_changes_nothing() {
    let (before, shift) = (values(pile(400).into_iter()), Vector3::new(0.3, -0.7, 0.0));
    let after = values(pile(400).into_iter().map(|p| p + shift));
    for (statistic, (got, expected)) in PAPER16.iter().zip(after.into_iter().zip(before)) {
        assert_close(statistic, got, expected);
    }
}

#[test]
fn a_lift_raises_what_is_declared_to_rise() {
    let (before, lift) = (values(pile(400).into_iter()), 0.125);
    let after = values(pile(400).into_iter().map(|p| p + Vector3::z() * lift));
    for (statistic, (got, before)) in PAPER16.iter().zip(after.into_iter().zip(before)) {
        let rise = if statistic.behaviour.rises_with_z { lift } else { 0.0 };
        assert_close(statistic, got, before + rise);
    }
}

#[test]
fn a_rotation_changes_only_what_is_declared_to_turn() {
    let before = values(pile(400).into_iter());
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), 0.6);
    let after = values(pile(400).into_iter().map(|p| turn * p));
    for (statistic, (got, before)) in PAPER16.iter().zip(after.into_iter().zip(before)) {
        if statistic.behaviour.rotation_invariant {
            assert_close(statistic, got, before);
        } else {
            assert!((got / before - 1.0).abs() > 1e-3, "{} does not turn", statistic.name);
        }
    }
}

#[test]
fn a_change_of_scale_acts_by_the_declared_power() {
    let before = values(pile(400).into_iter());
    for scale in [1e-3, 7.0] {
        let after = values(pile(400).into_iter().map(|p| p * scale));
        for (statistic, (got, before)) in PAPER16.iter().zip(after.into_iter().zip(before)) {
            assert_close(
                statistic,
                got,
                before * f64::powi(scale, statistic.behaviour.length_power),
            );
        }
    }
}

#[test]
fn the_order_of_the_points_is_irrelevant() {
    let before = values(pile(400).into_iter());
    let after = values(pile(400).into_iter().rev());
    for (statistic, (got, expected)) in PAPER16.iter().zip(after.into_iter().zip(before)) {
        assert_close(statistic, got, expected);
    }
}

#[test]
fn every_value_is_finite_on_awkward_input() {
    let ring = |count: i32, r: f64| -> Vec<Vector3<f64>> {
        (0..count)
            .map(|i| {
                let angle = std::f64::consts::TAU * f64::from(i) / f64::from(count);
                Vector3::new(r * angle.cos(), r * angle.sin(), 0.01)
            })
            .collect()
    };
    let line: Vec<_> = (0..5).map(|i| Vector3::new(f64::from(i), 0.0, 0.0)).collect();
    let tiny: Vec<_> = pile(50).into_iter().map(|p| p * 1e-150).collect();
    let huge: Vec<_> = pile(50).into_iter().map(|p| p * 1e7).collect();
    let far: Vec<_> = pile(50).into_iter().map(|p| p + Vector3::repeat(9e5)).collect();
    let subnormal: Vec<_> = pile(50).into_iter().map(|p| p * 1e-310).collect();
    let outlier = [vec![Vector3::zeros(); 999], vec![Vector3::new(1e6, 0.0, 1e6)]].concat();
    let mut inputs = vec![line, tiny, huge, far, subnormal, outlier, vec![Vector3::repeat(0.2); 9]];
    inputs.extend([3, 4, 7, 100].map(|count| ring(count, 0.05)));
    inputs.extend([3, 4, 5].map(pile));
    for (input, points) in inputs.iter().enumerate() {
        for (statistic, value) in PAPER16.iter().zip(paper16(points).unwrap()) {
            assert!(value.is_finite(), "input {input}: {} = {value}", statistic.name);
        }
    }
}

#[test]
fn bad_input_is_refused_by_name() {
    for count in 0..MIN_POINTS {
        let got = paper16(&pile(count));
        assert!(matches!(got, Err(FeatureError::TooFewPoints { got, min: 3, .. }) if got == count));
    }
    for bad in [f64::NAN, f64::INFINITY] {
        let mut points = pile(5);
        points[2].y = bad;
        assert!(matches!(paper16(&points), Err(FeatureError::NonFinite { index: 7, .. })));
    }
    let mut points = pile(5);
    points[0].x = -2e6;
    assert!(matches!(paper16(&points), Err(FeatureError::OutOfRange { .. })));
}
