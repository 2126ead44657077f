//! Recordings: measured height maps as their authors published them, and images of our own.

use std::path::{Path, PathBuf};

use granulcal_dataset::{
    CameraFile, DatasetError, Npz, ReadOptions, Recording, Source, measured_data, png,
    write_height_map,
};
use granulcal_features::{
    Camera, DepthImage, HeightMap, HsvRange, Segmentation, Threshold, render,
};
use nalgebra::Vector3;

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A cone of grains, base radius 30 mm, height 20 mm.
fn heap() -> (Vec<Vector3<f64>>, Vec<f64>) {
    let mut positions = Vec::new();
    for x in -8i32..=8 {
        for y in -8i32..=8 {
            let (x, y) = (4e-3 * f64::from(x), 4e-3 * f64::from(y));
            let height = 0.02 * (1.0 - x.hypot(y) / 0.03);
            if height > 0.0 {
                positions.push(Vector3::new(x, y, height.max(2e-3)));
            }
        }
    }
    let radii = vec![2.5e-3; positions.len()];
    (positions, radii)
}

/// Measured maps of sand mounds (a Kinect's); the test is empty where the data are not.
#[test]
fn published_height_maps_are_read() {
    let Some(folder) = measured_data(&repository()) else { return };
    let folder = folder.join("granular-impact-kinect/data");
    let mut seen = 0;
    for entry in std::fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        let recording = Recording::open(&path, &ReadOptions::default()).unwrap();
        let Source::Heights(map) = &recording.source else { panic!("{path:?}") };
        assert_eq!((map.width, map.height), (157, 157));
        assert!((map.resolution_x - 2.8025e-3).abs() < 1e-12);
        assert!(map.z.iter().all(|z| z.abs() < 0.5));
        seen += 1;
    }
    assert!(seen > 50, "{seen}");
    // A mound: 109 +- 17 ml of sand, some 20 mm high and 40 mm wide.
    let mound = Recording::open(&folder.join("compacted_5.npz"), &ReadOptions::default()).unwrap();
    let formation = mound.formation().unwrap();
    assert!(formation.plane.tilt_rad < 0.05, "{:?}", formation.plane);
    let statistics = mound.statistics_of(&formation).unwrap();
    assert!((5e-3..0.1).contains(&statistics[0]), "{statistics:?}");
    assert!((0.01..0.15).contains(&statistics[4]), "{statistics:?}");
}

#[test]
fn height_maps_survive_the_disk() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.npz");
    let map = HeightMap::new(3, 2, 1e-3, 2e-3, vec![0.1, 0.2, f64::NAN, 0.4, -0.5, 0.6]).unwrap();
    write_height_map(&path, &map).unwrap();
    let back = Npz::open(&path).unwrap().height_map().unwrap();
    assert_eq!((back.width, back.height), (3, 2));
    assert_eq!((back.resolution_x, back.resolution_y), (1e-3, 2e-3));
    for (a, b) in map.z.iter().zip(&back.z) {
        assert!(a == b || a.is_nan() && b.is_nan());
    }
    // A map whose fields contradict each other is not written over it.
    for wrong in [HeightMap { height: 3, ..map.clone() }, HeightMap { resolution_x: 0.0, ..map }] {
        let error = write_height_map(&path, &wrong).unwrap_err();
        assert!(matches!(error, DatasetError::Features(_)), "{error}");
    }
    let bytes = std::fs::read(&path).unwrap();
    for length in [0, 10, bytes.len() / 2, bytes.len() - 1] {
        std::fs::write(&path, &bytes[..length]).unwrap();
        let error = Recording::open(&path, &ReadOptions::default()).unwrap_err();
        let is_refused = matches!(error, DatasetError::Npz { .. } | DatasetError::Content { .. });
        assert!(is_refused && error.to_string().contains("map.npz"), "{length}: {error}");
    }
}

/// Frames of a tilted camera, two of them with holes, become the formation of the grains themselves.
#[test]
fn frames_are_averaged_levelled_and_described() {
    let folder = tempfile::tempdir().unwrap();
    let frames = folder.path().join("frames");
    std::fs::create_dir(&frames).unwrap();
    let (positions, radii) = heap();
    let camera = Camera::overhead(0.29, 0.2, 240).unwrap().tilted(0.04, -0.03);
    let image = render(&camera, &positions, &radii).unwrap();
    for (name, offset, hole) in [("a.png", -2e-4, 5), ("b.png", 2e-4, 7), ("c.png", 0.0, 0)] {
        let depth = image.depth.iter().enumerate();
        let depth = depth.map(|(i, &d)| if hole > 0 && i % hole == 0 { 0.0 } else { d + offset });
        let frame = DepthImage::new(image.width, image.height, depth.collect()).unwrap();
        png::write_depth(&frames.join(name), &frame, 1e-4).unwrap();
    }
    let toml = folder.path().join("camera.toml");
    let mut file = CameraFile::of(&camera, 1e-4);
    file.segmentation.height_threshold = Threshold::Absolute(1e-3);
    file.save(&toml).unwrap();
    let recording = Recording::open(&frames, &ReadOptions::with_camera(&toml)).unwrap();
    assert_eq!(recording.frames, 3);
    let formation = recording.formation().unwrap();
    assert!((formation.plane.tilt_rad - 0.04f64.hypot(0.03)).abs() < 2e-3, "{:?}", formation.plane);
    assert_eq!(formation.valid_count, 240 * 240);
    let statistics = recording.statistics().unwrap();
    // The top grain's top, and the cone's outline.
    assert!((statistics[0] - 0.0225).abs() < 1e-3, "{statistics:?}");
    assert!((statistics[3] - 0.0325).abs() < 3e-3, "{statistics:?}");
}

#[test]
fn colour_decides_where_it_is_given() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (positions, radii) = heap();
    let camera = Camera::overhead(0.29, 0.2, 120).unwrap();
    let image = render(&camera, &positions, &radii).unwrap();
    png::write_depth(&at("d.png"), &image, 1e-4).unwrap();
    // Wheat-coloured grains on black velvet, as the depth has them.
    let ground = image.depth.iter().copied().fold(0.0, f32::max);
    let mut colour = image::RgbImage::new(120, 120);
    for (pixel, depth) in colour.pixels_mut().zip(&image.depth) {
        let grain = ground - depth > 5e-4;
        *pixel = image::Rgb(if grain { [220, 190, 120] } else { [10, 10, 12] });
    }
    colour.save(at("c.png")).unwrap();
    let segmentation = Segmentation {
        colour: Some(HsvRange { value_min: 0.4, ..HsvRange::default() }),
        ..Segmentation::default()
    };
    let mut file = CameraFile::of(&camera, 1e-4);
    (file.colour, file.segmentation) = (Some("c.png".into()), segmentation);
    file.save(&at("camera.toml")).unwrap();
    let formation = Recording::open(&at("d.png"), &ReadOptions::with_camera(at("camera.toml")))
        .unwrap()
        .formation()
        .unwrap();
    let grains = image.depth.iter().filter(|&&d| ground - d > 5e-4).count();
    assert_eq!(formation.masked_count, grains);

    // A colour of another size is refused, with both sizes, whether or not it would decide.
    image::RgbImage::new(60, 120).save(at("narrow.png")).unwrap();
    let narrow = CameraFile { colour: Some("narrow.png".into()), ..file.clone() };
    narrow.save(&at("narrow.toml")).unwrap();
    let options = ReadOptions::with_camera(at("narrow.toml"));
    let error = Recording::open(&at("d.png"), &options).unwrap_err().to_string();
    assert!(error.contains("narrow.png") && error.contains("120x120"), "{error}");
    assert!(error.contains("found 60x120"), "{error}");

    // Half of the pair is refused, not ignored.
    file.segmentation = Segmentation::default();
    file.save(&at("half.toml")).unwrap();
    let half = Recording::open(&at("d.png"), &ReadOptions::with_camera(at("half.toml"))).unwrap();
    let error = half.formation().unwrap_err();
    let reason = std::error::Error::source(&error).unwrap().to_string();
    assert!(reason.contains("colour image and a colour range"), "{reason}");
}
