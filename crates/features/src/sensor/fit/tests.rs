//! Sensors that are known are found again.

use super::*;
use crate::camera::{Camera, Intrinsics};
use crate::depth::DepthImage;
use crate::height_map::HeightMap;
use crate::region::Region;
use crate::sensor::{Moments, Observe};

const FOCAL: f64 = 390.0;
const BASELINE: f64 = 0.05;

/// A camera at the origin and a tilted wall some 0.6 m away.
fn board(width: usize, height: usize) -> (Camera, DepthImage) {
    let (w, h) = (width as f64, height as f64);
    let intrinsics = Intrinsics::new(width, height, FOCAL, FOCAL, 0.5 * w, 0.5 * h).unwrap();
    let camera = Camera { intrinsics, camera_from_world: nalgebra::Isometry3::identity() };
    let depth = (0..width * height).map(|i| {
        let (u, v) = ((i % width) as f64 - 0.5 * w, (i / width) as f64 - 0.5 * h);
        (1.0 / (1.6 + 1e-3 * u - 5e-4 * v)) as f32
    });
    let image = DepthImage::new(width, height, depth.collect()).unwrap();
    (camera, image)
}

fn truth() -> StereoSensor {
    StereoSensor {
        quantisation: 1.0 / 32.0,
        depth_unit: 1e-4,
        dropout: 0.01,
        noise: NoiseField {
            correlated: 0.15,
            correlation_x: 6.0,
            correlation_y: 4.0,
            ..NoiseField::default()
        },
        fixed_pattern: NoiseField {
            columns: 0.1,
            column_correlation: 2.0,
            ..NoiseField::default()
        },
        ..StereoSensor::new(FOCAL, BASELINE)
    }
}

#[test]
fn a_stereo_sensor_is_found_again() {
    let (camera, image) = board(240, 160);
    let sensor = DepthSensor::Stereo(truth());
    let shots: Vec<_> = (0..4).map(|seed| sensor.observe(&camera, &image, seed).unwrap()).collect();
    let frames = FlatFrames::from_stereo(&shots, &camera, BASELINE, 1e-4).unwrap();
    // The right imager does not see the first 31 columns.
    let region = Region { x: 40, y: 0, width: 200, height: 160 };
    let settings =
        FitSettings { regions: vec![region], trend_degree: 1, sessions: 8, ..Default::default() };
    let found = fit(&frames, &settings).unwrap();
    let DepthSensor::Stereo(got) = found.sensor else { panic!("{:?}", found.sensor) };
    assert_eq!(got.quantisation, 1.0 / 32.0);
    assert!((got.dropout - 0.01).abs() < 0.003, "{}", got.dropout);
    assert!(got.left_margin < 1.5, "{}", got.left_margin);
    let truth = truth();
    for (what, got, truth, tolerance) in [
        ("noise", got.noise.sd(), truth.noise.sd(), 0.06),
        ("pattern", got.fixed_pattern.sd(), truth.fixed_pattern.sd(), 0.15),
        ("length x", half_width(&got.noise, true), 6.0 * 1.1774, 0.12),
        ("length y", half_width(&got.noise, false), 4.0 * 1.1774, 0.12),
    ] {
        assert!((got / truth - 1.0).abs() < tolerance, "{what}: {got} {truth}\n{found:?}");
    }
    // Its own frames are like the measured ones, and other frames of the camera too.
    let others: Vec<_> =
        (9..12).map(|seed| sensor.observe(&camera, &image, seed).unwrap()).collect();
    let others = FlatFrames::from_stereo(&others, &camera, BASELINE, 1e-4).unwrap();
    for comparison in [found.comparison, compare(&found.sensor, &others, &settings).unwrap()] {
        let (measured, model) = comparison.sd();
        assert!((model / measured - 1.0).abs() < 0.08, "{comparison:?}");
        assert!(comparison.worst_correlation(24) < 0.15, "{comparison:?}");
    }
}

/// Lag at which the correlation falls to a half `[px]`.
fn half_width(field: &NoiseField, along_x: bool) -> f64 {
    let at = |lag: usize| {
        let (x, y) = if along_x { (lag, 0) } else { (0, lag) };
        field.covariance(x, y) / field.covariance(0, 0)
    };
    let after = (1..100).find(|&lag| at(lag) < 0.5).unwrap();
    let (a, b) = (at(after - 1), at(after));
    (after - 1) as f64 + (a - 0.5) / (a - b)
}

#[test]
fn trend_removal_is_corrected_for() {
    // One small frame, where six coefficients take a fifth of the variance.
    let noise = NoiseField {
        correlated: 1e-3,
        correlation_x: 4.0,
        correlation_y: 4.0,
        ..NoiseField::default()
    };
    let sensor =
        DepthSensor::TimeOfFlight(TimeOfFlightSensor { noise, ..TimeOfFlightSensor::new(0.003) });
    let bed = HeightMap::new(56, 56, 0.003, 0.003, vec![0.0; 3136]).unwrap();
    let settings = FitSettings { max_lag: 16, sessions: 12, ..Default::default() };
    let (mut naive, mut corrected) = (0.0, 0.0);
    let repeats = 12;
    for seed in 0..repeats {
        let map = sensor.observe_height_map(&bed, seed).unwrap();
        let frames = FlatFrames::from_height_maps(&[map]).unwrap();
        let found = fit(&frames, &settings).unwrap();
        naive += found.comparison.measured.noise.variance() / f64::from(repeats as u32) / 1e-6;
        corrected += found.sensor.noise().sd().powi(2) / f64::from(repeats as u32) / 1e-6;
    }
    // The sd of one estimate is a fifth, of the mean of 12 a twentieth.
    assert!(naive < 0.88 && (corrected - 1.0).abs() < 0.15, "{naive} {corrected}");
}

#[test]
fn crops_of_one_pattern_are_laid_onto_each_other() {
    let fixed_pattern = NoiseField {
        correlated: 1e-3,
        correlation_x: 1.5,
        correlation_y: 1.5,
        row_alternation: 5e-4,
        ..NoiseField::default()
    };
    let sensor = DepthSensor::TimeOfFlight(TimeOfFlightSensor {
        fixed_pattern,
        noise: NoiseField { white: 3e-4, ..NoiseField::default() },
        ..TimeOfFlightSensor::new(0.003)
    });
    let bed = HeightMap::new(70, 70, 0.003, 0.003, vec![0.0; 4900]).unwrap();
    let crop = |seed: u64, x: usize, y: usize| {
        let whole = sensor.observe_height_map(&bed, seed).unwrap();
        let z = (0..3600).map(|i| whole.at(i % 60 + x, i / 60 + y)).collect();
        HeightMap::new(60, 60, 0.003, 0.003, z).unwrap()
    };
    let maps = [crop(1, 4, 4), crop(2, 7, 4), crop(3, 4, 1), crop(4, 4, 4)];
    let frames = FlatFrames::from_height_maps(&maps).unwrap();
    let settings = FitSettings { max_lag: 12, max_shift: 5, sessions: 6, ..Default::default() };
    let found = fit(&frames, &settings).unwrap();
    assert_eq!(found.comparison.shifts, [(0, 0), (-3, 0), (0, 3), (0, 0)]);
    let pattern = found.sensor.fixed_pattern();
    assert!((pattern.sd() / fixed_pattern.sd() - 1.0).abs() < 0.1, "{pattern:?}");
    assert!((pattern.row_alternation / 5e-4 - 1.0).abs() < 0.15, "{pattern:?}");
    assert!((found.sensor.noise().sd() / 3e-4 - 1.0).abs() < 0.1, "{:?}", found.sensor.noise());
    // Without the shifts most of the pattern would pass for noise.
    let blind = FitSettings { max_shift: 0, ..settings };
    assert!(fit(&frames, &blind).unwrap().sensor.noise().sd() > 6e-4);
}

#[test]
fn margins_of_holes_are_found() {
    let (camera, mut image) = board(240, 60);
    for (i, depth) in image.depth.iter_mut().enumerate() {
        *depth = if i % 240 > 150 { 0.5 } else { 0.9 };
    }
    let sensor =
        StereoSensor { edge_margin: 3.0, left_margin: 7.0, ..StereoSensor::new(FOCAL, BASELINE) };
    let shot = DepthSensor::Stereo(sensor).observe(&camera, &image, 0).unwrap();
    let frames = FlatFrames::from_stereo(&[shot], &camera, BASELINE, 0.0).unwrap();
    let region = Region { x: 60, y: 0, width: 60, height: 60 };
    let settings =
        FitSettings { regions: vec![region], trend_degree: 1, max_lag: 5, ..Default::default() };
    let found = fit(&frames, &settings).unwrap();
    let DepthSensor::Stereo(got) = found.sensor else { panic!("{:?}", found.sensor) };
    assert_eq!(found.edge_holes, 60);
    assert!((got.edge_margin - 3.0).abs() < 1.0, "{}", got.edge_margin);
    assert!((got.left_margin - 7.0).abs() < 1.5, "{}", got.left_margin);
    assert!(got.noise.sd() < 1e-5 && got.quantisation == 0.0, "{got:?}");
}

#[test]
fn what_cannot_be_fitted_is_named() {
    let (camera, image) = board(40, 30);
    assert!(matches!(
        FlatFrames::from_stereo(&[], &camera, BASELINE, 1e-3),
        Err(FeatureError::TooFewPoints { got: 0, .. })
    ));
    let frames = FlatFrames::from_stereo(&[image], &camera, BASELINE, 1e-3).unwrap();
    let outside = Region { x: 30, y: 0, width: 20, height: 30 };
    let settings = FitSettings { regions: vec![outside], ..Default::default() };
    assert!(matches!(fit(&frames, &settings), Err(FeatureError::OutOfRange { got: 50.0, .. })));
    let settings = FitSettings { trend_degree: 9, ..Default::default() };
    assert!(matches!(fit(&frames, &settings), Err(FeatureError::OutOfRange { .. })));
}

#[test]
fn what_is_not_flat_is_refused() {
    let camera = Camera::overhead(2.0, 2.0, 80).unwrap();
    // A floor two metres away with boxes of half a metre.
    let depth = |i: usize| if (i / 10) % 2 == (i / 800) % 2 { 2.0_f32 } else { 1.5 };
    let image = DepthImage::new(80, 80, (0..6400).map(depth).collect()).unwrap();
    let settings = FitSettings { max_lag: 5, sessions: 2, ..FitSettings::default() };
    for frames in [
        FlatFrames::from_stereo(std::slice::from_ref(&image), &camera, 0.05, 1e-3).unwrap(),
        FlatFrames::from_time_of_flight(std::slice::from_ref(&image), &camera, 1e-3).unwrap(),
        FlatFrames::from_height_maps(&[HeightMap::new(
            80,
            80,
            3e-3,
            3e-3,
            (0..6400).map(|i| f64::from(depth(i))).collect(),
        )
        .unwrap()])
        .unwrap(),
    ] {
        let error = fit(&frames, &settings).unwrap_err();
        assert!(matches!(error, FeatureError::NotFlat { .. }), "{error}");
    }
}
