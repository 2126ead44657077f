//! Images whose errors have a closed form.

use granulcal_scene::{NoiseField, SceneError, StereoSensor, TimeOfFlightSensor};

use super::*;
use crate::camera::{Camera, Intrinsics};
use crate::depth::DepthImage;
use crate::height_map::HeightMap;
use crate::raster::render;

/// The D435 of `docs/results/sensor.md`: focal length [px] and baseline [m].
const FOCAL: f64 = 390.43;
const BASELINE: f64 = 0.05017;

fn stereo(noise: NoiseField) -> DepthSensor {
    DepthSensor::Stereo(StereoSensor { noise, ..StereoSensor::new(FOCAL, BASELINE) })
}

fn white(sd: f64) -> NoiseField {
    NoiseField { white: sd, ..NoiseField::default() }
}

/// A camera at the origin that looks at a wall `depth` away.
fn wall(width: usize, height: usize, depth: f32) -> (Camera, DepthImage) {
    let (w, h) = (width as f64, height as f64);
    let intrinsics = Intrinsics::new(width, height, FOCAL, FOCAL, 0.5 * w, 0.5 * h).unwrap();
    let camera = Camera { intrinsics, camera_from_world: nalgebra::Isometry3::identity() };
    (camera, DepthImage::new(width, height, vec![depth; width * height]).unwrap())
}

fn sd(image: &DepthImage, mean: f64) -> f64 {
    let kept = image.depth.iter().filter(|&&d| d > 0.0);
    let (sum, count) =
        kept.fold((0.0, 0.0), |(s, n), &d| (s + (f64::from(d) - mean).powi(2), n + 1.0));
    f64::sqrt(sum / count)
}

#[test]
fn a_sensor_without_errors_is_the_identity() {
    let (camera, image) = wall(60, 40, 0.5);
    let got = stereo(NoiseField::default()).observe(&camera, &image, 1).unwrap();
    // Left of u = d the right imager sees nothing: d = 39.2 px.
    for (i, &d) in got.depth.iter().enumerate() {
        assert_eq!(d > 0.0, i % 60 >= 39, "{i}");
        assert!(d == 0.0 || (d - 0.5).abs() < 1e-6);
    }
}

#[test]
fn depth_noise_grows_with_the_square_of_the_depth() {
    for depth in [0.4, 0.8, 1.6] {
        let (camera, image) = wall(400, 200, depth);
        let got = stereo(white(0.1)).observe(&camera, &image, 3).unwrap();
        let z = f64::from(depth);
        let expected = 0.1 * z * z / (FOCAL * BASELINE);
        // 60 000 pixels: 0.3 %; the second order of 1/(d + e) is 1 % at 1.6 m.
        assert!((sd(&got, z) / expected - 1.0).abs() < 0.02, "{depth}: {}", sd(&got, z));
    }
}

#[test]
fn disparity_and_depth_come_in_steps() {
    let (camera, image) = wall(200, 100, 1.5);
    let sensor = StereoSensor {
        noise: white(0.1),
        quantisation: 1.0 / 32.0,
        ..StereoSensor::new(FOCAL, BASELINE)
    };
    let got = DepthSensor::Stereo(sensor).observe(&camera, &image, 3).unwrap();
    let (mut worst, mut seen) = (0.0_f64, 0);
    for &d in got.depth.iter().filter(|&&d| d > 0.0) {
        let steps = 32.0 * FOCAL * BASELINE / f64::from(d);
        worst = worst.max((steps - steps.round()).abs());
        seen += 1;
    }
    assert!(worst < 1e-3 && seen > 10_000, "{worst} {seen}");
    let sensor = StereoSensor { depth_unit: 1e-3, ..sensor };
    let got = DepthSensor::Stereo(sensor).observe(&camera, &image, 3).unwrap();
    assert!(got.depth.iter().all(|&d| (d * 1e3 - (d * 1e3).round()).abs() < 1e-3));
}

#[test]
fn a_near_surface_hides_what_is_left_of_it() {
    // A step from 1 m to 0.5 m: the disparity jumps by f B = 19.6 px.
    let (camera, mut image) = wall(200, 3, 1.0);
    for (i, d) in image.depth.iter_mut().enumerate() {
        *d = if (100..150).contains(&(i % 200)) { 0.5 } else { 1.0 };
    }
    let holes = |sensor: StereoSensor| {
        let got = DepthSensor::Stereo(sensor).observe(&camera, &image, 0).unwrap();
        (20..200).filter(|&u| got.at(u, 1) == 0.0).collect::<Vec<_>>()
    };
    let sensor = StereoSensor { grazing_deg: 90.0, ..StereoSensor::new(FOCAL, BASELINE) };
    assert_eq!(holes(sensor), (80..100).collect::<Vec<_>>());
    let margin = StereoSensor { edge_margin: 3.0, ..sensor };
    assert_eq!(holes(margin), (77..100).collect::<Vec<_>>());
}

#[test]
fn a_grazing_surface_gives_no_depth_and_an_edge_does() {
    // 1/z affine in u is a plane; steep enough it is seen at more than 80 degrees.
    let (camera, mut image) = wall(200, 3, 1.0);
    let slope = 79.9_f64.to_radians().tan() / FOCAL;
    for (steeper, gone) in [(1.0, false), (1.2, true)] {
        for (i, d) in image.depth.iter_mut().enumerate() {
            let u = (i % 200) as f64 + 0.5 - 100.0;
            *d = (1.0 / (1.0 + steeper * slope * u)) as f32;
        }
        let sensor = StereoSensor { ..StereoSensor::new(FOCAL, BASELINE) };
        let got = DepthSensor::Stereo(sensor).observe(&camera, &image, 0).unwrap();
        assert_eq!(got.at(100, 1) == 0.0, gone, "{steeper}");
    }
    let step: Vec<f64> = (0..60).map(|i| if i % 20 < 10 { 0.0 } else { 0.3 }).collect();
    let map = HeightMap::new(20, 3, 0.01, 0.01, step).unwrap();
    let sensor = DepthSensor::TimeOfFlight(TimeOfFlightSensor::new(0.01));
    assert_eq!(sensor.observe_height_map(&map, 0).unwrap(), map);
}

#[test]
fn noise_is_new_and_the_pattern_is_not() {
    let pattern = white(0.2);
    let sensor = |serial| {
        DepthSensor::Stereo(StereoSensor {
            noise: white(0.05),
            fixed_pattern: pattern,
            pattern_seed: serial,
            ..StereoSensor::new(FOCAL, BASELINE)
        })
    };
    let (camera, image) = wall(300, 100, 0.5);
    let frames: Vec<_> =
        (0..8).map(|seed| sensor(0).observe(&camera, &image, seed).unwrap()).collect();
    let mean: Vec<f32> = (0..image.depth.len())
        .map(|i| frames.iter().map(|f| f.depth[i]).sum::<f32>() / 8.0)
        .collect();
    let mean = DepthImage::new(300, 100, mean).unwrap();
    let per_px = 0.25 / (FOCAL * BASELINE);
    let expected = (0.2_f64.powi(2) + 0.05_f64.powi(2) / 8.0).sqrt() * per_px;
    assert!((sd(&mean, 0.5) / expected - 1.0).abs() < 0.02, "{}", sd(&mean, 0.5));
    assert_eq!(frames[3], sensor(0).observe(&camera, &image, 3).unwrap());
    assert_ne!(frames[3], sensor(1).observe(&camera, &image, 3).unwrap());
}

#[test]
fn a_downsampled_image_gets_the_errors_of_its_pixels() {
    let camera = Camera::overhead(0.4, 0.4, 120).unwrap();
    let noise = NoiseField {
        correlated: 0.1,
        correlation_x: 8.0,
        correlation_y: 5.0,
        ..NoiseField::default()
    };
    let focal = camera.intrinsics.fx;
    let sensor = StereoSensor { noise, dropout: 0.05, ..StereoSensor::new(focal, BASELINE) };
    let sensor = DepthSensor::Stereo(sensor);
    let full = render(&camera, &[], &[]).unwrap();
    let noisy = sensor.observe(&camera, &full, 2).unwrap().downsample(4).unwrap();
    let small = full.downsample(4).unwrap();
    let direct = sensor.observe(&camera.downsampled(4).unwrap(), &small, 2).unwrap();
    // Half a pixel of difference decides at the edge of the right imager's view.
    let mut compared = 0;
    for (i, (a, b)) in noisy.depth.iter().zip(&direct.depth).enumerate().filter(|(i, _)| i % 30 > 3)
    {
        assert!((a - b).abs() < 1e-6, "{i}: {a} {b}");
        compared += usize::from(*a > 0.0);
    }
    assert!(compared > 600, "{compared}");
}

#[test]
fn dropout_has_its_share() {
    let (camera, image) = wall(300, 100, 3.0);
    let sensor =
        DepthSensor::Stereo(StereoSensor { dropout: 0.1, ..StereoSensor::new(FOCAL, BASELINE) });
    let got = sensor.observe(&camera, &image, 5).unwrap();
    let lost = got.depth.iter().enumerate().filter(|(i, d)| i % 300 > 10 && **d == 0.0).count();
    let share = lost as f64 / (289.0 * 100.0);
    assert!((share - 0.1).abs() < 0.01, "{share}");
}

#[test]
fn time_of_flight_errs_in_metres() {
    let camera = Camera::overhead(0.8, 0.8, 200).unwrap();
    let sensor = DepthSensor::TimeOfFlight(TimeOfFlightSensor {
        noise: white(1e-3),
        depth_unit: 1e-4,
        ..TimeOfFlightSensor::new(0.004)
    });
    let image = render(&camera, &[], &[]).unwrap();
    let got = sensor.observe(&camera, &image, 1).unwrap();
    assert!((sd(&got, 0.8) / 1e-3 - 1.0).abs() < 0.02, "{}", sd(&got, 0.8));
    let map = HeightMap::new(100, 100, 0.004, 0.004, vec![0.0; 10_000]).unwrap();
    let noisy = sensor.observe_height_map(&map, 1).unwrap();
    let variance = noisy.z.iter().map(|z| z * z).sum::<f64>() / 1e4;
    assert!((variance.sqrt() / 1e-3 - 1.0).abs() < 0.03);
    assert_eq!(stereo(white(0.1)).observe_height_map(&map, 1), Err(FeatureError::NeedsPinhole));
}

#[test]
fn sensors_are_read_strictly() {
    let text = r#"{"kind": "stereo", "focal_length": 390.0, "baseline": 0.05,
        "noise": {"correlated": 0.1, "correlation_x": 8, "correlation_y": 6}}"#;
    let sensor: DepthSensor = serde_json::from_str(text).unwrap();
    assert_eq!(sensor.noise().correlated, 0.1);
    let back = serde_json::to_string(&sensor).unwrap();
    assert_eq!(serde_json::from_str::<DepthSensor>(&back).unwrap(), sensor);
    for wrong in [text.replace("baseline", "base"), text.replace("correlated", "correlate")] {
        assert!(serde_json::from_str::<DepthSensor>(&wrong).is_err());
    }
    let negative = DepthSensor::Stereo(StereoSensor::new(-1.0, 0.05));
    assert!(matches!(negative.check("sensor"), Err(SceneError::OutOfRange { .. })));
}
