//! From a scene to 16 numbers: solver, camera and statistics in one go, against `tests/golden`.

mod heap;

use std::fmt::Write as _;

use granulcal::dataset::{View, observe, overhead};
use granulcal::dem::Status;
use granulcal::features::{
    PAPER16, Segmentation, SensorNoise, paper16, render, render_grid, segment_depth,
};

use heap::{golden_path, pour, scene};

/// A line of the golden file: `"name": {"value": ..., "tolerance": ...}`.
fn golden_line(line: &str) -> Option<(&str, f64, f64)> {
    let (name, numbers) = line.trim().strip_prefix('"')?.split_once("\": {\"value\": ")?;
    let (value, tolerance) = numbers.split_once(", \"tolerance\": ")?;
    Some((name, value.parse().ok()?, tolerance.split('}').next()?.parse().ok()?))
}

#[test]
fn a_heap_has_the_statistics_it_always_had() {
    let pour = pour();
    assert_eq!(pour.status, Status::AtRest);
    let seen = observe(&scene().camera, &pour, 11).expect("a camera");
    let statistics = seen.statistics.expect("grains in view");
    let text = std::fs::read_to_string(golden_path()).expect("the golden file");
    let golden: Vec<_> = text.lines().filter_map(golden_line).collect();
    let names: Vec<_> = golden.iter().map(|(name, ..)| *name).collect();
    assert_eq!(names, PAPER16.map(|statistic| statistic.name));
    let mut difference = String::new();
    for ((name, value, tolerance), got) in golden.iter().zip(statistics) {
        // Not `>`: a NaN must fail.
        if !matches!((got - value).abs().partial_cmp(tolerance), Some(o) if o.is_le()) {
            writeln!(difference, "{name}: {got}, expected {value} +- {tolerance}").expect("memory");
        }
    }
    assert!(difference.is_empty(), "{difference}");
}

#[test]
fn the_image_shows_ground_and_grains() {
    let camera = scene().camera;
    let seen = observe(&camera, &pour(), 11).expect("a camera");
    let View::Depth(_, image) = &seen.view else { panic!("a pinhole camera delivers depth") };
    assert_eq!((image.width, image.height), (480, 480));
    let ground = image.depth.iter().filter(|d| (f64::from(**d) - camera.height).abs() < 1e-6);
    let (ground, pixels) = (ground.count(), image.depth.len());
    assert!(image.depth.iter().all(|d| *d > 0.0 && f64::from(*d) <= camera.height + 1e-6));
    assert!(ground > pixels / 2, "{ground} of {pixels}");
    // 400 grains cover at least what a disc of a tenth of them covers.
    let grain_pixels = 40.0 * (std::f64::consts::PI * 0.002 * 0.002) / (0.58_f64 / 480.0).powi(2);
    assert!(seen.points.len() as f64 > grain_pixels, "{} points", seen.points.len());
    let highest = seen.points.iter().map(|p| p.z).fold(0.0, f64::max);
    let top = pour().positions.iter().map(|p| p.z + 0.002).fold(0.0, f64::max);
    assert!(highest <= top + 1e-6 && highest > top - 0.002, "{highest} of {top}");
}

#[test]
fn a_tilted_noisy_camera_sees_nearly_the_same() {
    let (pour, spec) = (pour(), scene().camera);
    let direct = observe(&spec, &pour, 11).expect("a camera").statistics.expect("grains in view");
    let camera = overhead(&spec).expect("a camera").tilted(0.04, -0.03);
    let image = render_grid(&camera, &pour.positions, &pour.radii, spec.downsample);
    let noise = SensorNoise { blur_px: 0.0, depth_sigma: 2e-4 };
    let image = noise.apply(&image.expect("an image"), 3).expect("noise");
    let small = camera.downsampled(spec.downsample).expect("a smaller camera");
    let formation = segment_depth(&small, &image, None, &Segmentation::default());
    let formation = formation.expect("a formation");
    let seen = paper16(&formation.points).expect("statistics");
    let mut difference = String::new();
    for ((statistic, got), expected) in PAPER16.iter().zip(seen).zip(direct) {
        // Measured over two pours: 3 % at iqr_x, 2 % at iqr_r and max_z, about 1 % elsewhere. The shift
        // of the chi distribution is a small length that belongs to its scale; an excess kurtosis, which
        // hangs on single far grains, is compared with the 3 of a normal distribution.
        let scale = match statistic.name {
            "chi_shift" => direct[15],
            "kurtosis_r" => 3.0,
            _ => expected,
        };
        if (got - expected).abs() > 0.05 * scale.abs() {
            writeln!(difference, "{}: {got}, straight down {expected}", statistic.name)
                .expect("memory");
        }
    }
    assert!(difference.is_empty(), "{difference}");
}

#[test]
fn a_down_sampled_camera_is_the_full_one() {
    let (pour, spec) = (pour(), scene().camera);
    let camera = overhead(&spec).expect("a camera");
    let full = render(&camera, &pour.positions, &pour.radii).expect("an image");
    let small = full.downsample(spec.downsample).expect("a smaller image");
    let seen = observe(&spec, &pour, 11).expect("a camera");
    let View::Depth(_, image) = &seen.view else { panic!("a pinhole camera delivers depth") };
    assert_eq!(*image, small);
}
