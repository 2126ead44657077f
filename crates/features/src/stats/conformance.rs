//! Every statistic of the registry keeps what it declares.

use nalgebra::{Rotation3, Vector3};

use super::*;
use crate::rng::Stream;

/// What a table says of one statistic.
struct Entry {
    name: &'static str,
    unit: &'static str,
    doc: &'static str,
    behaviour: Behaviour,
}

impl<P> From<&Statistic<P>> for Entry {
    fn from(s: &Statistic<P>) -> Self {
        Self { name: s.name, unit: s.unit, doc: s.doc, behaviour: s.behaviour }
    }
}

/// Values of a family for points whose lengths are the second argument times a metre.
type Values = fn(&[Vector3<f64>], f64) -> Result<Vec<f64>, FeatureError>;

/// A family of statistics: its entries and its values.
struct Family {
    entries: Vec<Entry>,
    values: Values,
}

fn families() -> [Family; 2] {
    [
        Family {
            entries: PAPER16.iter().map(Entry::from).collect(),
            values: |points, _| paper16(points).map(Vec::from),
        },
        Family {
            entries: DIAGNOSTICS.iter().map(Entry::from).collect(),
            values: |points, unit| {
                let lengths = (4e-3 * unit, 1.5e-3 * unit);
                let (grain_diameter, spacing) = lengths;
                let settings = DiagnosticSettings { pour_axis: None, grain_diameter, spacing };
                diagnostics(points, &settings).map(Vec::from)
            },
        },
    ]
}

/// A lopsided pile: nothing about it is symmetric by accident.
fn pile(seed: u64, count: usize) -> Vec<Vector3<f64>> {
    let mut stream = Stream::new(seed);
    (0..count)
        .map(|_| {
            let (x, y) = (0.02 * stream.normal(), 0.03 * stream.uniform());
            let height = 0.03 - 0.5 * x.hypot(y - 0.01);
            Vector3::new(x, y, height.max(0.002) + 5e-4 * stream.normal())
        })
        .collect()
}

fn piles() -> Vec<Vec<Vector3<f64>>> {
    (0..40).map(|seed| pile(seed, 20 + 17 * seed as usize)).collect()
}

fn assert_close(name: &str, got: f64, expected: f64) {
    // The likelihood's maximum is flat: b, A and k know half the digits of the data.
    let digits = if name.starts_with("chi") { 1e-6 } else { 1e-10 };
    let allowed = digits * expected.abs() + 1e-12;
    assert!((got - expected).abs() <= allowed, "{name}: {got} instead of {expected}");
}

/// Compares the values of changed piles with what `expected` makes of entry, index and values before.
fn assert_change(
    change: impl Fn(&Vector3<f64>) -> Vector3<f64>,
    unit: f64,
    expected: impl Fn(&Entry, usize, &[f64]) -> Option<f64>,
) {
    for family in families() {
        for points in piles() {
            let before = (family.values)(&points, 1.0).unwrap();
            let changed: Vec<_> = points.iter().map(&change).collect();
            let after = (family.values)(&changed, unit).unwrap();
            for (i, entry) in family.entries.iter().enumerate() {
                if let Some(expected) = expected(entry, i, &before) {
                    assert_close(entry.name, after[i], expected);
                }
            }
        }
    }
}

#[test]
fn the_sixteen_are_in_the_papers_order() {
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
}

#[test]
fn names_are_unique_and_units_and_docs_say_what_is_declared() {
    let entries: Vec<_> = families().into_iter().flat_map(|family| family.entries).collect();
    for (i, entry) in entries.iter().enumerate() {
        assert!(entries[..i].iter().all(|other| other.name != entry.name), "{}", entry.name);
        let unit = ["-", "m"][entry.behaviour.length_power as usize];
        assert_eq!(entry.unit, unit, "{}", entry.name);
        let turns = entry.behaviour.rotation == Rotation::Axis;
        assert_eq!(entry.doc.contains("turns with the axes"), turns, "{}", entry.name);
        if let Rotation::Mode { order } = entry.behaviour.rotation {
            assert!(entry.doc.contains(&format!("mode {order}")), "{}", entry.name);
        }
    }
}

#[test]
fn a_shift_in_the_plane_changes_nothing() {
    let shift = Vector3::new(0.25, -0.75, 0.0);
    assert_change(|p| p + shift, 1.0, |_, i, before| Some(before[i]));
}

#[test]
fn a_lift_raises_what_is_declared_to_rise() {
    assert_change(
        |p| p + Vector3::z() * 0.125,
        1.0,
        |entry, i, before| match entry.behaviour.lift {
            Lift::Invariant => Some(before[i]),
            Lift::Rises => Some(before[i] + 0.125),
            Lift::Changes => None,
        },
    );
}

#[test]
fn a_rotation_turns_what_is_declared_to_turn() {
    // Multiples of the rim's sectors, which only turn as a whole.
    for sectors in [3, -5] {
        let angle = f64::from(sectors) * std::f64::consts::TAU / 24.0;
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), angle);
        assert_change(
            |p| turn * p,
            1.0,
            |entry, i, before| match entry.behaviour.rotation {
                Rotation::Invariant => Some(before[i]),
                Rotation::Axis => None,
                Rotation::Mode { order } => {
                    let (sin, cos) = (f64::from(order) * angle).sin_cos();
                    Some(if entry.name.contains("cos") {
                        before[i] * cos - before[i + 1] * sin
                    } else {
                        before[i] * cos + before[i - 1] * sin
                    })
                }
            },
        );
    }
}

#[test]
fn what_belongs_to_an_axis_changes_with_it() {
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), 0.6);
    let turned: Vec<_> = pile(21, 400).iter().map(|p| turn * p).collect();
    let (before, after) = (paper16(&pile(21, 400)).unwrap(), paper16(&turned).unwrap());
    for ((statistic, before), after) in PAPER16.iter().zip(before).zip(after) {
        let differs = (after / before - 1.0).abs() > 1e-3;
        let turns = statistic.behaviour.rotation == Rotation::Axis;
        assert_eq!(differs, turns, "{}: {before} {after}", statistic.name);
    }
}

#[test]
fn a_change_of_scale_acts_by_the_declared_power() {
    for scale in [1e-3, 7.0] {
        assert_change(
            |p| p * scale,
            scale,
            |entry, i, before| Some(before[i] * f64::powi(scale, entry.behaviour.length_power)),
        );
    }
}

#[test]
fn the_order_of_the_points_is_irrelevant() {
    for family in families() {
        for points in piles() {
            let reversed: Vec<_> = points.iter().rev().copied().collect();
            let middle = points.len() / 3;
            let rotated = [&points[middle..], &points[..middle]].concat();
            let before = (family.values)(&points, 1.0).unwrap();
            for shuffled in [reversed, rotated] {
                let after = (family.values)(&shuffled, 1.0).unwrap();
                for ((entry, got), expected) in family.entries.iter().zip(after).zip(&before) {
                    assert_close(entry.name, got, *expected);
                }
            }
        }
    }
}

/// Inputs that no camera delivers, and some that a bad one does.
fn awkward() -> Vec<Vec<Vector3<f64>>> {
    let ring = |count: i32, r: f64| -> Vec<Vector3<f64>> {
        (0..count)
            .map(|i| {
                let angle = std::f64::consts::TAU * f64::from(i) / f64::from(count);
                Vector3::new(r * angle.cos(), r * angle.sin(), 0.01)
            })
            .collect()
    };
    let line = |step: Vector3<f64>| (0..5).map(|i| step * f64::from(i)).collect::<Vec<_>>();
    let times = |factor: f64| pile(2, 50).into_iter().map(|p| p * factor).collect::<Vec<_>>();
    let beside = |d: f64| pile(3, 50).into_iter().map(|p| p + Vector3::repeat(d)).collect();
    let mut inputs = vec![
        line(Vector3::x()),
        line(Vector3::new(1e-3, 2e-3, 3e-3)),
        line(Vector3::z()),
        times(1e-310),
        times(1e-150),
        times(1e7),
        times(-1.0),
        beside(9e5),
        beside(-1e12),
        vec![Vector3::repeat(0.2); 9],
        vec![Vector3::repeat(0.0); 3],
        vec![Vector3::repeat(9e5); 20],
        [vec![Vector3::zeros(); 999], vec![Vector3::new(1e6, 0.0, 1e6)]].concat(),
        [pile(4, 200), vec![Vector3::new(1e6, -1e6, 0.0)]].concat(),
        [ring(12, 0.03), ring(12, 0.05)].concat(),
        [ring(3, 0.03), ring(3, 0.03 + 1e-13)].concat(),
    ];
    inputs.extend([3, 4, 7, 100].map(|count| ring(count, 0.05)));
    inputs.extend([3, 4, 5].map(|count| pile(5, count)));
    inputs
}

#[test]
fn every_value_is_finite_on_awkward_input() {
    let mut inputs = awkward();
    inputs.push(pile(2, 50).into_iter().map(|p| p * 1e99).collect());
    for (input, points) in inputs.iter().enumerate() {
        for (statistic, value) in PAPER16.iter().zip(paper16(points).unwrap()) {
            assert!(value.is_finite(), "input {input}: {} = {value}", statistic.name);
        }
    }
    for (input, points) in awkward().iter().enumerate() {
        for spacing in [1e-5, 1.5e-3, 10.0] {
            let settings = DiagnosticSettings { pour_axis: None, grain_diameter: 4e-3, spacing };
            for (statistic, value) in
                DIAGNOSTICS.iter().zip(diagnostics(points, &settings).unwrap())
            {
                assert!(value.is_finite(), "input {input}: {} = {value}", statistic.name);
            }
        }
    }
}

#[test]
fn bad_input_is_refused_by_name() {
    for family in families() {
        let refusal = |points: &[Vector3<f64>]| (family.values)(points, 1.0).unwrap_err();
        for count in 0..MIN_POINTS {
            let got = refusal(&pile(1, count));
            assert!(matches!(got, FeatureError::TooFewPoints { got, min: 3, .. } if got == count));
        }
        for bad in [f64::NAN, f64::INFINITY] {
            let mut points = pile(1, 5);
            points[2].y = bad;
            assert!(matches!(refusal(&points), FeatureError::NonFinite { index: 7, .. }));
        }
        let mut points = pile(1, 5);
        points[0].x = -2e100;
        assert!(matches!(refusal(&points), FeatureError::OutOfRange { .. }));
    }
}
