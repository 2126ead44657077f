//! The raster against a ray caster that tests every pixel against every sphere in another way.

use nalgebra::{Point3, Vector3};
use proptest::prelude::*;

use super::*;
use crate::rng::Stream;

/// Depth of one pixel by geometry: foot of the perpendicular from the sphere's centre on the ray,
/// then back by the half chord.
fn cast(camera: &Camera, positions: &[Vector3<f64>], radii: &[f64], u: usize, v: usize) -> f64 {
    let origin = camera.centre_in_world();
    let unit_depth = camera.unproject(u as f64 + 0.5, v as f64 + 0.5, 1.0) - origin;
    let length = unit_depth.norm();
    let direction = unit_depth / length;
    let mut nearest = f64::INFINITY;
    let ground = -origin.z / direction.z;
    if ground > 0.0 {
        nearest = ground;
    }
    for (position, &radius) in positions.iter().zip(radii) {
        let to_centre = position - origin;
        let along = to_centre.dot(&direction);
        let miss = (to_centre - direction * along).norm();
        if miss < radius && to_centre.norm() > radius && along > 0.0 {
            nearest = nearest.min(along - (radius * radius - miss * miss).sqrt());
        }
    }
    if nearest.is_finite() { nearest / length } else { 0.0 }
}

/// Compares all pixels; a grazing ray may hit for one and miss for the other, so pixels within
/// 1e-9 m of a silhouette are left out.
fn assert_ray_exact(camera: &Camera, positions: &[Vector3<f64>], radii: &[f64]) {
    let image = render(camera, positions, radii).unwrap();
    let origin = camera.centre_in_world();
    for v in 0..image.height {
        for u in 0..image.width {
            let expected = cast(camera, positions, radii, u, v);
            let got = f64::from(image.at(u, v));
            if (got - expected).abs() < 1e-6 {
                continue;
            }
            let direction =
                (camera.unproject(u as f64 + 0.5, v as f64 + 0.5, 1.0) - origin).normalize();
            let grazes = positions.iter().zip(radii).any(|(p, r)| {
                let along = (p - origin).dot(&direction);
                (((p - origin) - direction * along).norm() - r).abs() < 1e-9
            });
            // f32 rounding dominates far away: 2^-24 of the depth.
            let far = (got - expected).abs() <= expected * 1.2e-7;
            assert!(grazes || far, "pixel ({u}, {v}): {got} instead of {expected}");
        }
    }
}

fn heap(seed: u64, count: usize, spread: f64, radius: f64) -> (Vec<Vector3<f64>>, Vec<f64>) {
    let mut stream = Stream::new(seed);
    (0..count)
        .map(|_| {
            let x = spread * stream.normal();
            let y = spread * stream.normal();
            let z = radius + 0.5 * spread * stream.uniform();
            (Vector3::new(x, y, z), radius * (0.5 + stream.uniform()))
        })
        .unzip()
}

#[test]
fn overhead_image_is_ray_exact() {
    let (positions, radii) = heap(1, 60, 0.05, 0.006);
    assert_ray_exact(&Camera::overhead(0.29, 0.58, 160).unwrap(), &positions, &radii);
}

#[test]
fn tilted_image_with_horizon_is_ray_exact() {
    let (positions, radii) = heap(2, 60, 0.05, 0.006);
    let camera = Camera::overhead(0.29, 0.58, 120).unwrap();
    for (x, y) in [(0.3, 0.0), (0.0, -0.4), (1.2, 0.2), (2.5, 0.1)] {
        assert_ray_exact(&camera.tilted(x, y), &positions, &radii);
    }
}

#[test]
fn grains_around_and_beside_the_camera_are_ray_exact() {
    let camera = Camera::overhead(0.3, 0.6, 64).unwrap();
    let positions = [
        Vector3::new(0.01, 0.0, 0.31),
        Vector3::new(0.15, 0.0, 0.3),
        Vector3::new(0.0, 0.1, 0.26),
        Vector3::new(0.0, 0.0, 0.5),
    ];
    assert_ray_exact(&camera, &positions, &[0.05, 0.1, 0.05, 0.1]);
}

#[test]
fn one_grain_under_the_camera() {
    let camera = Camera::overhead(0.29, 0.58, 101).unwrap();
    let image = render(&camera, &[Vector3::new(0.0, 0.0, 0.01)], &[0.01]).unwrap();
    assert!((f64::from(image.at(50, 50)) - 0.27).abs() < 1e-7);
    assert_eq!(image.at(0, 0), 0.29_f32);
}

#[test]
fn a_camera_that_looks_up_sees_nothing() {
    let camera = Camera::overhead(0.29, 0.58, 16).unwrap().tilted(std::f64::consts::PI, 0.0);
    let image = render(&camera, &[], &[]).unwrap();
    assert!(image.depth.iter().all(|&d| d == 0.0));
}

#[test]
fn refuses_bad_input() {
    let camera = Camera::overhead(0.29, 0.58, 16).unwrap();
    let grain = [Vector3::new(0.0, 0.0, 0.01)];
    assert!(matches!(render(&camera, &grain, &[]), Err(FeatureError::LengthMismatch { .. })));
    for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(render(&camera, &grain, &[radius]), Err(FeatureError::OutOfRange { .. })));
    }
    let nowhere = [Vector3::new(f64::NAN, 0.0, 0.0)];
    assert!(matches!(render(&camera, &nowhere, &[0.1]), Err(FeatureError::OutOfRange { .. })));
    assert!(matches!(
        render_grid(&camera, &grain, &[0.1], 17),
        Err(FeatureError::DownsampleFactor { got: 17, max: 16 })
    ));
    let mut broken = camera;
    broken.intrinsics.fx = f64::NAN;
    assert!(render(&broken, &grain, &[0.1]).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn grid_is_the_downsampled_image(
        seed: u64,
        pixels in 1_usize..150,
        step in 1_usize..30,
        tilt_x in -1.5..1.5_f64,
        tilt_y in -1.5..1.5_f64,
    ) {
        let (positions, radii) = heap(seed, 40, 0.08, 0.01);
        let camera = Camera::overhead(0.29, 0.58, pixels).unwrap().tilted(tilt_x, tilt_y);
        let grid = render_grid(&camera, &positions, &radii, step);
        let whole = render(&camera, &positions, &radii).unwrap().downsample(step);
        prop_assert_eq!(grid, whole);
    }

    #[test]
    fn order_of_the_grains_is_irrelevant(seed: u64, swap in 1_usize..39) {
        let (mut positions, mut radii) = heap(seed, 40, 0.05, 0.01);
        let camera = Camera::overhead(0.29, 0.58, 90).unwrap();
        let before = render(&camera, &positions, &radii).unwrap();
        positions.rotate_left(swap);
        radii.rotate_left(swap);
        prop_assert_eq!(before, render(&camera, &positions, &radii).unwrap());
    }

    #[test]
    fn projection_inverts_unprojection(
        u in -10.0..100.0_f64, v in -10.0..100.0_f64, depth in 0.01..5.0_f64,
        tilt_x in -3.0..3.0_f64, tilt_y in -3.0..3.0_f64,
    ) {
        let camera = Camera::overhead(0.29, 0.58, 96).unwrap().tilted(tilt_x, tilt_y);
        let (u2, v2, depth2) = camera.project(&camera.unproject(u, v, depth)).unwrap();
        prop_assert!((u - u2).abs() < 1e-9 && (v - v2).abs() < 1e-9 && (depth - depth2).abs() < 1e-12);
    }

    #[test]
    fn downsampled_camera_unprojects_to_the_same_point(
        i in 0_usize..9, j in 0_usize..9, n in 1_usize..10,
    ) {
        let camera = Camera::overhead(0.29, 0.58, 96).unwrap().tilted(0.1, 0.2);
        let offset = sample_offset(n);
        let centre = |k: usize| k as f64 + 0.5;
        let small = camera.downsampled(n).unwrap().unproject(centre(i), centre(j), 0.3);
        let large = camera.unproject(centre(n * i + offset), centre(n * j + offset), 0.3);
        prop_assert!((small - large).norm() < 1e-14);
    }
}

#[test]
fn overhead_camera_sees_its_field_and_no_more() {
    let camera = Camera::overhead(0.29, 0.58, 1920).unwrap();
    assert_eq!(camera.intrinsics.fx, 960.0);
    let (u, v, depth) = camera.project(&Vector3::new(0.1, 0.2, 0.0)).unwrap();
    // +x is right of the middle, +y above it.
    assert!(u > 960.0 && v < 960.0 && (depth - 0.29).abs() < 1e-15);
    assert!(camera.sees(&Vector3::new(0.2899, -0.2899, 0.0)));
    assert!(!camera.sees(&Vector3::new(0.2901, 0.0, 0.0)));
    assert!(!camera.sees(&Vector3::new(0.0, 0.0, 0.3)));
    assert!((Point3::from(camera.centre_in_world()) - Point3::new(0.0, 0.0, 0.29)).norm() < 1e-15);
}
