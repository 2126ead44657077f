//! Flat frames pass, mounds are found where they are.

use super::super::flat::detrend;
use super::*;
use crate::sensor::NoiseField;
use crate::sensor::field::{SensorGrid, sample};

const HEIGHTS: Optics =
    Optics::TimeOfFlight { resolution: 2.8e-3, depth_unit: 0.0, inverse: false };

fn correlated(correlated: f64, correlation_x: f64, correlation_y: f64) -> NoiseField {
    NoiseField { correlated, correlation_x, correlation_y, ..NoiseField::default() }
}

/// Sizes and noise of regions of a D435 (wall and boards, as if in metres), of a Kinect v2, of white noise and of
/// broad.
fn flat_frames() -> Vec<(usize, usize, NoiseField)> {
    let wall =
        NoiseField { broad: 0.081, broad_x: 24.0, broad_y: 6.7, ..correlated(0.141, 7.8, 5.3) };
    let boards =
        NoiseField { broad: 0.1, broad_x: 7.4, broad_y: 22.0, ..correlated(0.096, 5.0, 5.0) };
    let kinect = NoiseField {
        white: 0.15e-3,
        broad: 0.224e-3,
        broad_x: 16.3,
        broad_y: 17.9,
        columns: 0.2e-3,
        column_correlation: 1.3,
        row_alternation: 0.389e-3,
        ..correlated(0.239e-3, 1.4, 1.2)
    };
    let white = NoiseField { white: 1e-3, ..NoiseField::default() };
    vec![
        (100, 145, wall),
        (76, 57, boards),
        (133, 133, kinect),
        (160, 120, white),
        (160, 120, correlated(1.4e-3, 4.0, 3.0)),
        (120, 90, correlated(1.4e-3, 12.0, 12.0)),
        (65, 50, correlated(1.4e-3, 24.0, 24.0)),
        (20, 20, correlated(1.4e-3, 2.0, 2.0)),
    ]
}

fn noise(width: usize, height: usize, field: &NoiseField, seed: u64) -> Vec<f64> {
    sample(field, &SensorGrid::under(width, height, 1.0).unwrap(), seed)
}

fn found(optics: &Optics, values: &[f64], width: usize, degree: usize) -> Option<Bump> {
    let patch = detrend(values, width, degree, |v, t| optics.error(v, t)).unwrap();
    largest(optics, values, &patch.trend, width, degree)
}

/// What so many frames of each kind give: the largest ratio, how many are beyond 1 and how many could not be judged.
fn of_flat(frames: u64) -> (f64, usize, usize) {
    let (mut most, mut alarms, mut unknown) = (0.0_f64, 0, 0);
    for (width, height, field) in flat_frames() {
        let mut own = 0.0_f64;
        for seed in 0..frames {
            let values = noise(width, height, &field, seed);
            match found(&HEIGHTS, &values, width, 1 + seed as usize % 2) {
                Some(bump) => {
                    own = own.max(bump.ratio);
                    alarms += usize::from(bump.ratio > 1.0);
                }
                None => unknown += 1,
            }
        }
        println!("{width}x{height} {field:?}: {own:.2}");
        most = most.max(own);
    }
    println!("{alarms} beyond chance, {unknown} not judged of {frames} frames of each kind");
    (most, alarms, unknown)
}

#[test]
fn chance_makes_no_bump() {
    let (most, _, unknown) = of_flat(6);
    assert!(most > 0.05 && most < 1.0, "{most}");
    // Those of which the noise is as broad as the region are not judged.
    assert!((4..=24).contains(&unknown), "{unknown}");
}

#[test]
#[ignore = "a minute; `make test-long` runs it"]
fn chance_makes_hardly_a_bump_in_thousands_of_frames() {
    let (_, alarms, _) = of_flat(500);
    assert!(alarms <= 4, "{alarms} of 4000");
}

#[derive(Clone, Copy, Debug)]
enum Shape {
    Cone,
    Cap,
    Slab,
}

/// A mound that covers a share of a frame, and the pixel of its middle.
fn mound(
    (width, height): (usize, usize),
    shape: Shape,
    share: f64,
    top: f64,
    seed: u64,
) -> (Vec<f64>, (usize, usize)) {
    let radius = (share * (width * height) as f64 / std::f64::consts::PI).sqrt();
    let mut stream = Stream::new(seed);
    let mut middle = |length: usize| (0.2 + 0.6 * stream.uniform()) * length as f64;
    let (x, y) = (middle(width), middle(height));
    let at = |i: usize| {
        let (u, v) = ((i % width) as f64 + 0.5 - x, (i / width) as f64 + 0.5 - y);
        let inwards = 1.0 - u.hypot(v) / radius;
        match shape {
            _ if inwards <= 0.0 => 0.0,
            Shape::Cone => top * inwards,
            Shape::Cap => top * inwards * (2.0 - inwards),
            Shape::Slab => top,
        }
    };
    ((0..width * height).map(at).collect(), (x as usize, y as usize))
}

/// Tries mounds of a height that cover 2 to 20 % of a view, of which the noise is that of a D435 at 0.4 m and of a
/// Kinect v2: tries, how many are missed and how many could not be judged. What is found is where the mound is, and as
/// high.
fn try_mounds(top: f64, seeds: u64) -> (usize, usize, usize) {
    let (mut tries, mut missed, mut unknown) = (0, 0, 0);
    for (width, height, field) in [(160, 120, correlated(1.4e-3, 3.0, 2.5)), flat_frames()[2]] {
        for shape in [Shape::Cone, Shape::Cap, Shape::Slab] {
            for share in [0.02, 0.05, 0.1, 0.2] {
                let before = missed;
                for seed in 0..seeds {
                    let mut values = noise(width, height, &field, seed);
                    let (mound, (x, y)) = mound((width, height), shape, share, top, seed + 77);
                    values.iter_mut().zip(mound).for_each(|(value, z)| *value += z);
                    tries += 1;
                    let Some(bump) = found(&HEIGHTS, &values, width, 2) else {
                        unknown += 1;
                        continue;
                    };
                    if bump.ratio <= 1.0 {
                        missed += 1;
                        continue;
                    }
                    let what = format!("{shape:?} {share} {top} {seed} {width}: {bump:?}");
                    let Region { x: left, y: up, width: w, height: h } = bump.region;
                    // A tile of a slab's edge may stand off as far as one of its middle.
                    assert!((left..left + w + 20).contains(&(x + 10)), "{what} {x}");
                    assert!((up..up + h + 20).contains(&(y + 10)), "{what} {y}");
                    assert!(bump.height > 0.25 * top && bump.height < 1.4 * top, "{what}");
                }
                println!("{width}x{height} {shape:?} {share} {top}: {} missed", missed - before);
            }
        }
    }
    (tries, missed, unknown)
}

#[test]
fn mounds_are_found() {
    assert_eq!(try_mounds(0.03, 1), (24, 0, 0));
}

#[test]
#[ignore = "minutes; `make test-long` runs it"]
fn mounds_are_found_wherever_they_are() {
    let tries = [0.01, 0.015, 0.02, 0.03].map(|top| (top, try_mounds(top, 40)));
    println!("{tries:?}");
    for (top, (tries, missed, unknown)) in tries {
        // 1.5 cm are ten standard deviations of a pixel.
        assert!(top < 0.015 || missed == 0, "{top}: {missed} of {tries}");
        assert!(unknown * 10 < tries, "{top}: {unknown} of {tries}");
    }
}

#[test]
fn a_crater_is_below_and_in_its_place() {
    let (width, height) = (160, 120);
    let mut values = noise(width, height, &correlated(1e-3, 3.0, 3.0), 3);
    let (hole, (x, y)) = mound((width, height), Shape::Cap, 0.05, 0.02, 9);
    values.iter_mut().zip(hole).for_each(|(value, z)| *value -= z);
    let bump = found(&HEIGHTS, &values, width, 2).unwrap();
    assert!(bump.ratio > 1.0 && bump.height < -0.01, "{bump:?}");
    let region = Region { x: 7, y: 5, width, height };
    let error = bump.require_chance(2, &region).unwrap_err();
    let FeatureError::Bump { frame: 3, place, size, .. } = error else { panic!("{error}") };
    assert!((place.0..place.0 + size.0).contains(&(x + 7)), "{error} {x}");
    assert!((place.1..place.1 + size.1).contains(&(y + 5)), "{error} {y}");
    assert!(error.to_string().contains("m below the smooth surface"), "{error}");
}

#[test]
fn rounding_makes_no_bump() {
    // Level and tilted by less than a step over the frame, with hardly any noise and with some.
    for (tilt, sd) in [(0.0, 1e-9), (0.0, 1e-4), (0.3e-3, 1e-9), (0.7e-3, 2e-4), (20e-3, 1e-9)] {
        let (width, height) = (120, 90);
        let step = 1e-3;
        let white = NoiseField { white: sd, ..NoiseField::default() };
        let depths = noise(width, height, &white, 1).into_iter().enumerate().map(|(i, error)| {
            let exact = 0.6 + tilt * (i % width) as f64 / width as f64 + error;
            (exact / step).round() * step
        });
        let optics = Optics::TimeOfFlight { resolution: 1e-3, depth_unit: step, inverse: true };
        let values: Vec<f64> = depths.map(|z| 1.0 / z).collect();
        if let Some(bump) = found(&optics, &values, width, 1) {
            assert!(bump.ratio <= 1.0, "{tilt} {sd}: {bump:?}");
        }
    }
}

#[test]
fn a_grazing_wall_passes_and_a_box_on_it_does_not() {
    // From 0.4 to 1.2 m: disparities and inverse depths of a plane are affine, its noise in metres is not.
    let (width, height) = (160, 120);
    let plane = |i: usize| 2.5 - 1.67 * (i % width) as f64 / width as f64;
    let white = NoiseField { white: 1.0, ..NoiseField::default() };
    let errors = noise(width, height, &white, 5);
    let box_at = |i: usize| (100..120).contains(&(i % width)) && (30..60).contains(&(i / width));
    let stereo = Optics::Stereo { focal_length: 390.0, baseline: 0.05, depth_unit: 1e-4 };
    let flight = Optics::TimeOfFlight { resolution: 2e-3, depth_unit: 1e-4, inverse: true };
    for (optics, value) in [
        (
            &stereo,
            &(|z: f64, error: f64| 390.0 * 0.05 / z + 0.1 * error) as &dyn Fn(f64, f64) -> f64,
        ),
        (&flight, &|z, error| 1.0 / (z + 2e-3 * error)),
    ] {
        let of = |thick: f64| -> Vec<f64> {
            let z = |i: usize| 1.0 / plane(i) - if box_at(i) { thick } else { 0.0 };
            (0..width * height).map(|i| value(z(i), errors[i])).collect()
        };
        let bump = found(optics, &of(0.0), width, 2).unwrap();
        assert!(bump.ratio < 1.0, "{bump:?}");
        let bump = found(optics, &of(0.03), width, 2).unwrap();
        assert!(bump.ratio > 1.0 && (bump.height - 0.03).abs() < 0.006, "{bump:?}");
        let Region { x, y, width: w, height: h } = bump.region;
        assert!((90..=100).contains(&x) && (120..=130).contains(&(x + w)), "{bump:?}");
        assert!((20..=30).contains(&y) && (60..=70).contains(&(y + h)), "{bump:?}");
    }
}
