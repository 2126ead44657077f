//! Images with known formations.

use super::*;
use crate::colour::HsvRange;
use crate::raster::{height_map, render};
use crate::rng::Stream;
use crate::sensor::SensorNoise;

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
    let settings = Segmentation { min_component_px: 20, ..Default::default() };
    let cleaned = segment_depth(&camera(), &noisy, None, &settings).unwrap();
    assert!(cleaned.masked_count < formation.masked_count);
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
    let settings = Segmentation { downsample: 4, ..Default::default() };
    let inside = segment_depth(&camera(), &image, None, &settings).unwrap();
    let small = image.downsample(4).unwrap();
    let small_camera = camera().downsampled(4).unwrap();
    let before = segment_depth(&small_camera, &small, None, &Segmentation::default()).unwrap();
    assert_eq!(inside, before);
    assert_eq!((inside.width, inside.height), (60, 60));
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
    let absurd = Segmentation { inlier_distance: -1.0, ..Default::default() };
    let got = segment_depth(&camera(), &bare, None, &absurd);
    assert!(matches!(got, Err(FeatureError::OutOfRange { .. })));
    let none = Segmentation { downsample: 0, ..Default::default() };
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
