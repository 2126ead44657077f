//! Planes with known answers.

use proptest::prelude::*;

use super::*;
use crate::rng::Stream;

/// A tilted ground with noise, a fifth of it buried under a pile.
fn scene(tilt: f64, noise: f64, seed: u64) -> Vec<Vector3<f64>> {
    let mut stream = Stream::new(seed);
    (0..5000)
        .map(|i| {
            let (x, y) = (stream.uniform() - 0.5, stream.uniform() - 0.5);
            let pile = if i % 5 == 0 { 0.01 + 0.02 * stream.uniform() } else { 0.0 };
            Vector3::new(x, y, 0.1 + tilt.tan() * x + noise * stream.normal() + pile)
        })
        .collect()
}

#[test]
fn three_points_give_their_plane() {
    let points = [Vector3::x(), Vector3::y(), Vector3::z()];
    let fit = fit_plane(&points, 1e-3, 0).unwrap();
    let third = 1.0 / 3.0_f64.sqrt();
    assert!((fit.plane.normal - Vector3::repeat(third)).norm() < 1e-14);
    assert!((fit.plane.offset - third).abs() < 1e-14);
    assert_eq!(fit.inliers, 3);
}

#[test]
fn a_pile_does_not_pull_the_plane() {
    let fit = fit_plane(&scene(0.05, 0.001, 3), 0.004, 1).unwrap();
    // Tilt known to noise/(extent √n) = 0.001/(0.29 · 63) = 5e-5 rad, times 4.
    assert!((fit.tilt_rad - 0.05).abs() < 2e-4, "{}", fit.tilt_rad);
    assert!((fit.rms - 0.001).abs() < 1e-4, "{}", fit.rms);
    assert!((3950..=4050).contains(&fit.inliers), "{}", fit.inliers);
}

#[test]
fn dead_pixels_have_no_say() {
    let mut points = scene(0.0, 0.0, 4);
    for point in points.iter_mut().take(2000) {
        point.z = -0.12;
    }
    let fit = fit_plane(&points, 0.002, 1).unwrap();
    assert!((fit.plane.offset - 0.1).abs() < 1e-12 && fit.tilt_rad < 1e-12);
}

#[test]
fn the_seed_decides_the_bits_not_the_answer() {
    let points = scene(0.02, 0.001, 5);
    let fit = |seed| fit_plane(&points, 0.004, seed).unwrap();
    assert_eq!(fit(1), fit(1));
    assert!((fit(1).tilt_rad - fit(2).tilt_rad).abs() < 1e-5);
}

#[test]
fn ground_from_world_levels_the_plane() {
    for normal in [Vector3::new(0.1, -0.2, 0.9), Vector3::z(), -Vector3::z(), Vector3::x()] {
        let normal = normal.normalize();
        let plane = Plane { normal, offset: 0.3 };
        let ground_from_world = plane.ground_from_world();
        let side = normal.cross(&Vector3::new(0.3, 0.5, 0.7));
        let point = nalgebra::Point3::from(normal * 0.3 + side + normal * 0.05);
        assert!(((ground_from_world * point).z - 0.05).abs() < 1e-14, "{normal}");
        let flipped = plane.flipped();
        assert!((flipped.signed_distance(&point.coords) + 0.05).abs() < 1e-14);
    }
}

#[test]
fn refuses_what_is_no_plane() {
    let line: Vec<_> = (0..10).map(|i| Vector3::new(f64::from(i), 0.0, 0.0)).collect();
    assert!(matches!(fit_plane(&line, 0.1, 0), Err(FeatureError::DegeneratePlane { .. })));
    let spot = [Vector3::zeros(); 5];
    assert!(matches!(fit_plane(&spot, 0.1, 0), Err(FeatureError::DegeneratePlane { .. })));
    assert!(matches!(
        fit_plane(&line[..2], 0.1, 0),
        Err(FeatureError::TooFewPoints { got: 2, min: 3, .. })
    ));
    assert!(matches!(fit_plane(&line, 0.0, 0), Err(FeatureError::OutOfRange { .. })));
    let nan = [Vector3::repeat(f64::NAN); 3];
    assert!(matches!(fit_plane(&nan, 0.1, 0), Err(FeatureError::NonFinite { .. })));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn an_exact_plane_is_found(nx in -1.0..1.0_f64, ny in -1.0..1.0_f64, offset in -1.0..1.0_f64, seed: u64) {
        let normal = Vector3::new(nx, ny, 1.0).normalize();
        let mut stream = Stream::new(seed);
        let points: Vec<_> = (0..50)
            .map(|_| {
                let (x, y) = (stream.uniform(), stream.uniform());
                Vector3::new(x, y, (offset - normal.x * x - normal.y * y) / normal.z)
            })
            .collect();
        let fit = fit_plane(&points, 1e-4, seed).unwrap();
        prop_assert!((fit.plane.normal - normal).norm() < 1e-10);
        prop_assert!((fit.plane.offset - offset).abs() < 1e-10);
        prop_assert_eq!(fit.inliers, 50);
    }
}

#[test]
fn a_wall_is_no_ground() {
    // Twice as many points on a wall at 70 degrees as on the ground below it.
    let mut stream = Stream::new(5);
    let mut points = Vec::new();
    for i in 0..900 {
        let (a, b) = (stream.uniform(), stream.uniform());
        let error = 1e-3 * stream.normal();
        points.push(if i % 3 == 0 {
            Vector3::new(a, b, error)
        } else {
            Vector3::new(1.0 + 0.34 * a, b, 0.94 * a + error)
        });
    }
    let largest = fit_plane(&points, 3e-3, 0).unwrap();
    assert!(largest.tilt_rad > 1.1, "{largest:?}");
    let ground = fit_plane_within(&points, 3e-3, 0.8, 0).unwrap();
    assert!(ground.tilt_rad < 0.01 && ground.inliers > 280, "{ground:?}");
}

/// A wall of the given tilt, square on its own face, with noise along z.
fn wall(tilt_deg: f64, noise: f64) -> Vec<Vector3<f64>> {
    let (sin, cos) = tilt_deg.to_radians().sin_cos();
    let mut stream = Stream::new(7);
    (0..600)
        .map(|_| {
            let (a, b) = (stream.uniform(), stream.uniform());
            Vector3::new(cos * a, b, sin * a + noise * stream.normal())
        })
        .collect()
}

#[test]
fn the_largest_tilt_holds_for_the_plane_that_is_returned() {
    // Of an exact wall no sample is upright enough; of a noisy one some are, and least squares tips them over.
    for (noise, tolerance) in [(0.0, 1e-9), (2e-3, 0.1)] {
        let found = fit_plane_within(&wall(60.0, noise), 5e-3, 45_f64.to_radians(), 0);
        let Err(FeatureError::TooSteep { got_deg, max_deg }) = found else { panic!("{found:?}") };
        assert!((got_deg - 60.0).abs() < tolerance && (max_deg - 45.0).abs() < 1e-9, "{got_deg}");
        assert!(fit_plane_within(&wall(60.0, noise), 5e-3, 1.06, 0).is_ok());
    }
}

#[test]
fn rounding_refuses_neither_a_flat_ground_nor_a_vertical_wall() {
    let flat = fit_plane_within(&scene(0.0, 0.0, 2), 0.004, 0.0, 0).unwrap();
    assert!(flat.tilt_rad < 1e-9, "{flat:?}");
    let upright = [wall(90.0, 0.0), wall(90.0 - 1e-13, 0.0), wall(90.0 + 1e-13, 0.0)];
    for points in upright {
        let fit = fit_plane(&points, 1e-3, 0).unwrap();
        assert!((fit.tilt_rad - std::f64::consts::FRAC_PI_2).abs() < 1e-9, "{fit:?}");
        assert_eq!(fit.inliers, 600);
    }
}
