//! Images with known formations.

use super::*;
use crate::Observe;
use crate::colour::HsvRange;
use crate::raster::{height_map, render};
use crate::rng::Stream;
use crate::sensor::SensorNoise;
use nalgebra::Vector2;

const RADIUS: f64 = 0.002;

/// A cone of grains, its axis away from the origin.
fn pile() -> (Vec<Vector3<f64>>, Vec<f64>) {
    let mut stream = Stream::new(11);
    let positions: Vec<_> = (0..800)
        .map(|_| {
            let (x, y) = (0.04 * (stream.uniform() - 0.5), 0.04 * (stream.uniform() - 0.5));
            let z = (RADIUS + 0.02 - 0.8 * x.hypot(y)).max(RADIUS);
            Vector3::new(x + 0.03, y - 0.02, z)
        })
        .collect();
    let radii = vec![RADIUS; positions.len()];
    (positions, radii)
}

fn camera() -> Camera {
    Camera::overhead(0.4, 0.4, 240).unwrap()
}

#[test]
fn known_ground_and_fitted_ground_agree_on_a_noise_free_image() {
    let (positions, radii) = pile();
    let image = render(&camera(), &positions, &radii).unwrap();
    let settings =
        Segmentation { height_threshold: Threshold::Absolute(0.5 * RADIUS), ..Default::default() };
    let formation = segment_depth(&camera(), &image, None, &settings).unwrap();
    let points = grain_points(&camera(), &image, 0.5 * RADIUS).unwrap();
    assert_eq!(points.len(), formation.masked_count);
    assert_eq!(formation.mask.iter().filter(|&&m| m).count(), formation.masked_count);
    assert!(formation.plane.tilt_rad < 1e-6);
    for (known, fitted) in points.iter().zip(&formation.points) {
        let back = fitted + Vector3::new(formation.centroid.x, formation.centroid.y, 0.0);
        assert!((known - back).norm() < 1e-7, "{known} {back}");
    }
    let sum: Vector3<f64> = formation.points.iter().sum();
    assert!(sum.xy().norm() < 1e-10);
}

#[test]
fn a_tilt_that_the_caller_does_not_know_is_taken_out() {
    let (positions, radii) = pile();
    let tilted = camera().tilted(0.05, -0.03);
    let image = render(&tilted, &positions, &radii).unwrap();
    // The caller believes that the camera looks straight down.
    let formation = segment_depth(&camera(), &image, None, &Segmentation::default()).unwrap();
    assert!((formation.plane.tilt_rad - (0.05_f64.cos() * 0.03_f64.cos()).acos()).abs() < 1e-5);
    let truth = grain_points(&tilted, &image, formation.threshold).unwrap();
    assert_eq!(truth.len(), formation.masked_count);
    for (got, truth) in formation.points.iter().zip(&truth) {
        assert!((got.z - truth.z).abs() < 1e-6);
    }
}

#[test]
fn noise_sets_the_automatic_threshold() {
    let (positions, radii) = pile();
    let image = render(&camera(), &positions, &radii).unwrap();
    let noisy = SensorNoise { blur_px: 0.0, depth_sigma: 0.001 }.apply(&image, 4).unwrap();
    let formation = segment_depth(&camera(), &noisy, None, &Segmentation::default()).unwrap();
    assert!((formation.threshold / 0.003 - 1.0).abs() < 0.1, "{}", formation.threshold);
    let every = Threshold::Absolute(formation.threshold);
    let every = Segmentation { height_threshold: every, ..Default::default() };
    let specks = segment_depth(&camera(), &noisy, None, &every).unwrap();
    let settings = Segmentation { min_component_px: 20, ..every };
    let cleaned = segment_depth(&camera(), &noisy, None, &settings).unwrap();
    assert!(cleaned.masked_count < specks.masked_count);
    assert!(formation.masked_count < specks.masked_count);
    // Without the specks the centroid is that of the pile, seen from above.
    assert!((cleaned.centroid.x - 0.03).abs() < 0.001 && (cleaned.centroid.y + 0.02).abs() < 0.001);
}

#[test]
fn colour_decides_when_it_is_given() {
    let (positions, radii) = pile();
    let image = render(&camera(), &positions, &radii).unwrap();
    let by_height = segment_depth(&camera(), &image, None, &Segmentation::default()).unwrap();
    let rgb = by_height.mask.iter().flat_map(|&m| if m { [220, 200, 150] } else { [12, 12, 14] });
    let colour = ColourImage::new(image.width, image.height, rgb.collect()).unwrap();
    let range = HsvRange { value_min: 0.4, ..HsvRange::default() };
    let settings = Segmentation { colour: Some(range), ..Default::default() };
    let by_colour = segment_depth(&camera(), &image, Some(&colour), &settings).unwrap();
    assert_eq!(by_colour.mask, by_height.mask);

    let alone = segment_depth(&camera(), &image, Some(&colour), &Segmentation::default());
    assert_eq!(alone, Err(FeatureError::IncompleteColour { image: true, range: false }));
    let alone = segment_depth(&camera(), &image, None, &settings);
    assert_eq!(alone, Err(FeatureError::IncompleteColour { image: false, range: true }));
    let small = ColourImage::new(1, 1, vec![0; 3]).unwrap();
    let got = segment_depth(&camera(), &image, Some(&small), &settings);
    assert!(matches!(got, Err(FeatureError::SizeMismatch { got: (1, 1), .. })));
}

#[test]
fn downsampling_happens_inside() {
    let (positions, radii) = pile();
    let image = render(&camera(), &positions, &radii).unwrap();
    let settings = Segmentation { downsample: Some(4), ..Default::default() };
    let inside = segment_depth(&camera(), &image, None, &settings).unwrap();
    let small = image.downsample(4).unwrap();
    let small_camera = camera().downsampled(4).unwrap();
    let before = segment_depth(&small_camera, &small, None, &Segmentation::default()).unwrap();
    assert_eq!((&inside.points, &inside.mask), (&before.points, &before.mask));
    assert_eq!((inside.width, inside.height), (60, 60));
    assert_eq!((inside.downsample, before.downsample), (4, 1));
    assert!((inside.resolution.0 - 0.4 / 60.0).abs() < 1e-6, "{:?}", inside.resolution);
}

#[test]
fn a_height_map_survives_dead_pixels() {
    let (positions, radii) = pile();
    let mut map = height_map(&positions, &radii, 157, 0.0028, (0.0, 0.0)).unwrap();
    let mut stream = Stream::new(3);
    for z in &mut map.z {
        *z += 3e-4 * stream.normal();
    }
    let clean = segment_height_map(&map, &Segmentation::default()).unwrap();
    for (i, z) in map.z.iter_mut().enumerate() {
        let column = i % 157;
        // A dead strip, a dead edge without data, and a spike.
        *z = match column {
            0..4 => -0.12,
            156 => f64::NAN,
            _ if i == 20 * 157 + 20 => 0.5,
            _ => *z,
        };
    }
    let settings = Segmentation { border_px: 4, max_height: Some(0.1), ..Default::default() };
    for settings in [Segmentation { max_height: Some(0.1), ..Default::default() }, settings] {
        let got = segment_height_map(&map, &settings).unwrap();
        assert!((got.threshold - clean.threshold).abs() < 1e-4);
        assert!((got.plane.plane.offset - clean.plane.plane.offset).abs() < 2e-5);
        assert!((got.centroid - clean.centroid).norm() < 1e-3);
    }
}

#[test]
fn refuses_what_has_no_formation() {
    let empty = DepthImage::new(240, 240, vec![0.0; 240 * 240]).unwrap();
    let got = segment_depth(&camera(), &empty, None, &Segmentation::default());
    assert!(matches!(got, Err(FeatureError::NoValidDepth { got: 0, .. })));
    assert!(matches!(
        grain_points(&camera(), &empty, 0.001),
        Err(FeatureError::NoValidDepth { .. })
    ));
    let bare = render(&camera(), &[], &[]).unwrap();
    let got = segment_depth(&camera(), &bare, None, &Segmentation::default());
    assert!(matches!(got, Err(FeatureError::EmptyMask { valid: 57600, .. })));
    assert!(matches!(grain_points(&camera(), &bare, 0.001), Err(FeatureError::EmptyMask { .. })));
    assert!(matches!(
        grain_points(&camera(), &bare, f64::NAN),
        Err(FeatureError::NonFinite { .. })
    ));
    let small = bare.downsample(2).unwrap();
    assert!(matches!(
        grain_points(&camera(), &small, 0.001),
        Err(FeatureError::SizeMismatch { got: (120, 120), expected: (240, 240), .. })
    ));
    let border = Segmentation { border_px: 120, ..Default::default() };
    let got = segment_depth(&camera(), &bare, None, &border);
    assert!(matches!(got, Err(FeatureError::NoValidDepth { .. })));
    let absurd = Segmentation { inlier_distance: Some(-1.0), ..Default::default() };
    let got = segment_depth(&camera(), &bare, None, &absurd);
    assert!(matches!(got, Err(FeatureError::OutOfRange { .. })));
    let none = Segmentation { downsample: Some(0), ..Default::default() };
    let got = segment_depth(&camera(), &bare, None, &none);
    assert!(matches!(got, Err(FeatureError::DownsampleFactor { got: 0, .. })));
}

#[test]
fn settings_are_read_strictly() {
    let settings: Segmentation =
        serde_json::from_str(r#"{"height_threshold": {"absolute": 0.002}, "border_px": 6}"#)
            .unwrap();
    assert_eq!(settings.height_threshold, Threshold::Absolute(0.002));
    assert_eq!(settings.border_px, 6);
    let text = serde_json::to_string(&Segmentation::default()).unwrap();
    assert_eq!(serde_json::from_str::<Segmentation>(&text).unwrap(), Segmentation::default());
    assert!(serde_json::from_str::<Segmentation>(r#"{"boarder_px": 6}"#).is_err());
    assert!(
        serde_json::from_str::<crate::Intrinsics>(
            r#"{"width": 4, "height": 4, "fx": -1, "fy": 1, "cx": 0, "cy": 0}"#
        )
        .is_err()
    );
}

#[test]
fn twenty_degrees_of_tilt_are_taken_out() {
    let (positions, radii) = pile();
    let camera = Camera::overhead(0.4, 0.6, 480).unwrap();
    let straight = render(&camera, &positions, &radii).unwrap();
    let straight = segment_depth(&camera, &straight, None, &Segmentation::default()).unwrap();
    let expected = crate::stats::paper16(&straight.points).unwrap();
    for (x_deg, y_deg) in [(20.0_f64, 0.0_f64), (0.0, -20.0), (-14.0, 14.0), (5.0, -19.0)] {
        let tilted = camera.tilted(x_deg.to_radians(), y_deg.to_radians());
        let image = render(&tilted, &positions, &radii).unwrap();
        let noisy = SensorNoise { blur_px: 0.0, depth_sigma: 3e-4 }.apply(&image, 2).unwrap();
        // The caller believes that the camera looks straight down.
        let got = segment_depth(&camera, &noisy, None, &Segmentation::default()).unwrap();
        let truth = (x_deg.to_radians().cos() * y_deg.to_radians().cos()).acos();
        assert!((got.plane.tilt_rad - truth).abs() < 2e-3, "{}", got.plane.tilt_rad);
        let statistics = crate::stats::paper16(&got.points).unwrap();
        // Heights to the noise; radii to what a pile hides behind itself.
        assert!((statistics[0] - expected[0]).abs() < 4.0 * 3e-4, "{x_deg} {y_deg}");
        for index in [1, 3, 4, 7] {
            let ratio = statistics[index] / expected[index];
            assert!((ratio - 1.0).abs() < 0.08, "{x_deg} {y_deg} [{index}]: {ratio}");
        }
        assert!((got.volume / straight.volume - 1.0).abs() < 0.08, "{}", got.volume);
    }
}

#[test]
fn the_volume_of_a_cone_is_that_of_a_cone() {
    // A cone of radius 60 mm and height 30 mm: pi r² h/3, minus what is below the threshold.
    let (radius, height, threshold) = (0.06, 0.03, 0.001);
    let cut = threshold / height;
    let whole = std::f64::consts::PI * radius * radius * height / 3.0;
    let expected = whole * (1.0 - 3.0 * cut.powi(2) + 2.0 * cut.powi(3));
    let cone = |x: f64, y: f64| (height * (1.0 - x.hypot(y) / radius)).max(0.0);
    let settings =
        Segmentation { height_threshold: Threshold::Absolute(threshold), ..Default::default() };

    let tilt = 0.1_f64;
    let mut map = HeightMap::new(200, 200, 1e-3, 1e-3, vec![0.0; 40_000]).unwrap();
    for v in 0..200 {
        for u in 0..200 {
            let point = map.point(u, v);
            map.z[v * 200 + u] = cone(point.x, point.y) + tilt * point.x;
        }
    }
    let got = segment_height_map(&map, &settings).unwrap();
    // The threshold is counted along the normal of the tilted ground.
    assert!((got.volume / expected - 1.0).abs() < 0.005, "{} {expected}", got.volume);
    assert_eq!(got.shape.kind, Kind::Pile);

    let camera = Camera::overhead(0.4, 0.25, 500).unwrap();
    let mut image = render(&camera, &[], &[]).unwrap();
    for v in 0..500 {
        for u in 0..500 {
            // Where the ray meets the cone, by bisection.
            let (mut near, mut far) = (0.3, 0.4);
            for _ in 0..40 {
                let middle = 0.5 * (near + far);
                let p = camera.unproject(u as f64 + 0.5, v as f64 + 0.5, middle);
                if p.z < cone(p.x, p.y) { far = middle } else { near = middle }
            }
            image.depth[v * 500 + u] = far as f32;
        }
    }
    let got = segment_depth(&camera, &image, None, &settings).unwrap();
    assert!((got.volume / expected - 1.0).abs() < 0.005, "{} {expected}", got.volume);
}

#[test]
fn a_ring_is_told_from_a_pile() {
    let mut map = HeightMap::new(120, 120, 2e-3, 2e-3, vec![0.0; 14_400]).unwrap();
    for (rim, kind) in [(0.0, Kind::Pile), (0.05, Kind::Ring), (0.02, Kind::Pile)] {
        for v in 0..120 {
            for u in 0..120 {
                let point = map.point(u, v);
                let r = (point.x - 0.02).hypot(point.y + 0.01);
                map.z[v * 120 + u] = 0.02 * (-0.5 * ((r - rim) / 0.02).powi(2)).exp();
            }
        }
        let got = segment_height_map(&map, &Segmentation::default()).unwrap();
        assert_eq!(got.shape.kind, kind, "{rim}: {:?}", got.shape);
    }
}

#[test]
fn a_rough_ground_is_found_without_being_told_how_rough() {
    let camera = Camera::overhead(1.7, 1.7, 240).unwrap();
    let image = render(&camera, &[], &[]).unwrap();
    for sigma in [5e-4, 3e-3, 0.01, 0.025] {
        let noisy = SensorNoise { blur_px: 0.0, depth_sigma: sigma }.apply(&image, 4).unwrap();
        let got = level_depth(&camera, &noisy, None, &Segmentation::default()).unwrap();
        assert!((got.ground_sd / sigma - 1.0).abs() < 0.1, "{sigma}: {}", got.ground_sd);
        assert!(got.plane.tilt_rad < 2e-3 && got.plane.rms / sigma < 1.1, "{:?}", got.plane);
        let told = Segmentation { inlier_distance: Some(0.003), ..Default::default() };
        let told = level_depth(&camera, &noisy, None, &told).unwrap();
        assert_eq!(told.ground_sd > 0.9 * sigma, sigma < 2e-3, "{}", told.ground_sd);
    }
}

#[test]
fn a_mat_on_a_table_is_the_ground_and_not_a_plane_between_them() {
    let (positions, radii) = pile();
    let map = height_map(&positions, &radii, 200, 2e-3, (0.0, 0.0)).unwrap();
    for step in [2e-3, 4e-3, 6e-3] {
        let mut map = map.clone();
        let mut stream = Stream::new(5);
        for (i, z) in map.z.iter_mut().enumerate() {
            let (u, v) = (i % 200, i / 200);
            // A mat that fills two thirds of the view, the heap on it.
            let is_mat = (18..182).contains(&u) && (18..182).contains(&v);
            *z += 1e-4 * stream.normal() - if is_mat { 0.0 } else { step };
        }
        let got = segment_height_map(&map, &Segmentation::default()).unwrap();
        assert!(got.ground_sd < 1.5e-4, "{step}: {}", got.ground_sd);
        assert!(got.plane.plane.offset.abs() < 1e-4, "{step}: {:?}", got.plane);
    }
}

#[test]
fn correlated_noise_is_no_grain_and_a_single_grain_is() {
    let camera = Camera::overhead(0.4, 0.4, 400).unwrap();
    let grain = [Vector3::new(0.1, 0.05, RADIUS)];
    let image = render(&camera, &grain, &[RADIUS]).unwrap();
    let noise = crate::NoiseField {
        correlated: 0.06,
        correlation_x: 8.0,
        correlation_y: 6.0,
        ..Default::default()
    };
    let sensor =
        crate::StereoSensor { noise, ..crate::StereoSensor::new(camera.intrinsics.fx, 0.05) };
    let noisy = crate::DepthSensor::Stereo(sensor).observe(&camera, &image, 3).unwrap();
    let got = segment_depth(&camera, &noisy, None, &Segmentation::default()).unwrap();
    // 0.06 px are 0.48 mm: blobs of 10 px exceed three of them somewhere, a grain of 4 mm six.
    for point in &got.points {
        assert!(point.x.hypot(point.y) < 2.5 * RADIUS, "{point}");
    }
    assert!((got.centroid - Vector2::new(0.1, 0.05)).norm() < 1e-3);
    let every = Threshold::Absolute(got.threshold);
    let every = Segmentation { height_threshold: every, ..Default::default() };
    let every = segment_depth(&camera, &noisy, None, &every).unwrap();
    assert!(every.masked_count > got.masked_count, "{}", every.masked_count);
}

#[test]
fn flying_pixels_are_no_grain() {
    // A block of 60 mm under a blurred edge: the blur puts pixels between block and ground.
    let camera = Camera::overhead(0.5, 0.5, 250).unwrap();
    let mut image = render(&camera, &[], &[]).unwrap();
    for (i, depth) in image.depth.iter_mut().enumerate() {
        let (u, v) = (i % 250, i / 250);
        if (100..150).contains(&u) && (100..150).contains(&v) {
            *depth -= 0.06;
        }
    }
    let blurred = SensorNoise { blur_px: 0.8, depth_sigma: 0.0 }.apply(&image, 0).unwrap();
    let settings = Segmentation::default();
    let clean = segment_depth(&camera, &blurred, None, &settings).unwrap();
    let kept = Segmentation { flying_deg: 90.0, ..settings };
    let kept = segment_depth(&camera, &blurred, None, &kept).unwrap();
    let between =
        |points: &[Vector3<f64>]| points.iter().filter(|p| p.z > 0.012 && p.z < 0.048).count();
    assert!(between(&kept.points) > 300, "{}", between(&kept.points));
    assert!(between(&clean.points) < 10, "{}", between(&clean.points));
    assert!(clean.points.iter().filter(|p| p.z > 0.048).count() >= 2300);
}

#[test]
fn the_downsampling_matches_the_resolution_of_the_simulated_images() {
    // The paper: 1920 px over 0.58 m and n = 20; a D435 of 1280 px (f = 640 px) at 0.4 m and n = 10.
    let wanted = 0.58 / 1920.0 * 20.0;
    let (positions, radii) = pile();
    let camera = Camera::overhead(0.4, 0.4 * 800.0 / 640.0, 800).unwrap();
    let image = render(&camera.tilted(0.1, 0.0), &positions, &radii).unwrap();
    let settings = Segmentation { ground_resolution: Some(wanted), ..Default::default() };
    let got = segment_depth(&camera, &image, None, &settings).unwrap();
    assert_eq!(got.downsample, 10);
    assert!((got.resolution.0 / wanted - 1.0).abs() < 0.05, "{:?}", got.resolution);
    let told = Segmentation { downsample: Some(3), ..settings.clone() };
    assert_eq!(segment_depth(&camera, &image, None, &told).unwrap().downsample, 3);
    let map = height_map(&positions, &radii, 157, 0.0028, (0.0, 0.0)).unwrap();
    assert_eq!(segment_height_map(&map, &settings).unwrap().downsample, 2);
    assert_eq!(segment_height_map(&map, &Segmentation::default()).unwrap().downsample, 1);
}

#[test]
fn a_flat_bed_has_a_ground_and_no_formation() {
    let bare = render(&camera(), &[], &[]).unwrap();
    let noisy = SensorNoise { blur_px: 0.0, depth_sigma: 1e-3 }.apply(&bare, 0).unwrap();
    let got = level_depth(&camera(), &noisy, None, &Segmentation::default()).unwrap();
    assert!(got.mask.iter().all(|&m| !m) && got.heights.iter().all(Option::is_some));
    assert!((got.ground_sd / 1e-3 - 1.0).abs() < 0.05);
    let error = got.into_formation().unwrap_err();
    assert!(matches!(error, FeatureError::EmptyMask { valid: 57600, .. }));
    // Some of the noise is above three standard deviations, none above six.
    let text = error.to_string();
    assert!(
        text.contains("above the threshold of 0.00") && text.contains("reaches 0.005"),
        "{text}"
    );
    assert!(text.contains("average more frames"), "{text}");
    let exact = Segmentation { height_threshold: Threshold::Absolute(5e-4), ..Default::default() };
    let small = Segmentation { min_component_px: 60_000, ..exact };
    let refused = segment_depth(&camera(), &noisy, None, &small).unwrap_err().to_string();
    assert!(refused.contains("no patch of them has min_component_px = 60000 pixels"), "{refused}");
}

#[test]
fn lengths_of_another_unit_are_told_by_what_they_would_show() {
    let (positions, radii) = pile();
    let map = height_map(&positions, &radii, 157, 0.0028, (0.0, 0.0)).unwrap();
    let thousandth = |value: f64| 1e-3 * value;
    let (small, z) = (thousandth(0.0028), map.z.iter().copied().map(thousandth).collect());
    let small = HeightMap::new(157, 157, small, small, z).unwrap();
    let settings = Segmentation { ground_resolution: Some(5e-3), ..Default::default() };
    let text = segment_height_map(&small, &settings).unwrap_err().to_string();
    assert!(text.starts_with("the image shows 0.0004396 m x 0.0004396 m"), "{text}");
    assert!(text.contains("pixels of 0.005 m leave 1") && text.contains("in metres?"), "{text}");
}

/// A height map of a ground tilted about y, 2 mm a pixel, without and with rubble on its low side.
fn ramp(tilt_deg: f64, rubble: f64) -> HeightMap {
    let mut stream = Stream::new(8);
    let z = (0..3600).map(|i| {
        let x = 2e-3 * (f64::from(i % 60) - 29.5);
        let on_it = if x < -0.03 { rubble * stream.uniform() } else { 0.0 };
        tilt_deg.to_radians().tan() * x + on_it + 2e-4 * stream.normal()
    });
    HeightMap::new(60, 60, 2e-3, 2e-3, z.collect()).unwrap()
}

#[test]
fn no_ground_is_steeper_than_it_may_be() {
    let level = |map: &HeightMap, max_tilt_deg: f64, inlier_distance: Option<f64>| {
        let settings = Segmentation { inlier_distance, max_tilt_deg, ..Default::default() };
        level_height_map(map, &settings).map(|found| found.plane.tilt_rad.to_degrees())
    };
    let wall = level(&ramp(50.0, 0.0), 45.0, None).unwrap_err();
    assert!(matches!(wall, FeatureError::TooSteep { max_deg: 45.0, .. }), "{wall:?}");
    let text = wall.to_string();
    assert!(text.contains("at most 45 deg (max_tilt_deg)") && text.contains(" 50.0"), "{text}");
    // The rubble hides some of the tilt from the wide first fit, not from the narrow last one.
    let hidden = ramp(10.0, 0.02);
    assert!((level(&hidden, 45.0, Some(0.02)).unwrap() - 10.0).abs() < 0.1);
    let points = hidden.to_points();
    assert!(crate::fit_plane(&points, 0.02, 0).unwrap().tilt_rad.to_degrees() < 8.5);
    let got = level(&hidden, 9.0, Some(0.02));
    assert!(matches!(got, Err(FeatureError::TooSteep { .. })), "{got:?}");
}

#[test]
fn a_level_that_is_too_steep_does_not_lose_the_ground() {
    // Rough as two levels are: the few points of a narrow second look tip by 0.3 degrees, all of them by 0.09.
    let mut stream = Stream::new(0);
    let z = (0..3600).map(|_| 2e-3 * stream.normal()).collect();
    let map = HeightMap::new(60, 60, 2e-3, 2e-3, z).unwrap();
    let settings = Segmentation { max_tilt_deg: 0.2, ..Default::default() };
    let found = level_height_map(&map, &settings).unwrap();
    assert!(found.plane.tilt_rad.to_degrees() < 0.1, "{:?}", found.plane);
}
