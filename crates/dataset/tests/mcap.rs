//! An MCAP file as Foxglove would read it.

use std::collections::BTreeMap;

use foxglove::Decode;
use foxglove::messages::{CameraCalibration, FrameTransform, PointCloud, RawImage};
use granulcal_dataset::{
    Drawn, Lost, Observer, ReadOptions, Recording, Source, Survey, View, capture, capture_from,
    record_pour,
};
use granulcal_dem::Simulation;
use granulcal_scene::{Scene, ViewSpec};

fn scene() -> Scene {
    let mut scene = Scene::drop(0.02);
    scene
        .set(&[
            ("grains.count", 20.0),
            ("start.solid_fraction", 0.5),
            ("end.horizon", 0.3),
            ("camera.depth_noise", 1e-4),
        ])
        .unwrap();
    scene
}

fn simulation() -> Simulation {
    Simulation::new(&scene(), 4).unwrap()
}

#[test]
fn schemas_counts_stamps_and_bytes_are_those_of_the_pour() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pour.mcap");
    let scene = scene();
    let (pour, film) =
        record_pour(simulation(), &scene, 4, 60.0, &path, &mut Observer::new(&scene), &mut |_| {
            true
        })
        .unwrap()
        .unwrap();
    film.unwrap();
    assert_eq!(pour, simulation().run());

    let bytes = std::fs::read(&path).unwrap();
    let mut schemas = BTreeMap::new();
    let mut last = BTreeMap::new();
    let mut stamps = Vec::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let channel = &message.channel;
        assert_eq!(channel.message_encoding, "protobuf");
        let schema = channel.schema.as_ref().unwrap();
        assert_eq!(schema.encoding, "protobuf");
        schemas.insert(channel.topic.clone(), schema.name.clone());
        if channel.topic == "/grains" {
            stamps.push(message.log_time);
        }
        last.insert(channel.topic.clone(), message.data.to_vec());
    }
    let expected = [
        ("/camera", "foxglove.CameraCalibration"),
        ("/depth", "foxglove.RawImage"),
        ("/grains", "foxglove.PointCloud"),
        ("/walls", "foxglove.SceneUpdate"),
        ("/tf", "foxglove.FrameTransform"),
    ];
    assert_eq!(schemas, expected.map(|(t, s)| (t.to_owned(), s.to_owned())).into());

    // From 0 to the end, a frame every sixtieth of a second and one at the end.
    assert_eq!(stamps[0], 0);
    assert_eq!(*stamps.last().unwrap(), (pour.simulated_s * 1e9).round() as u64);
    let frames = (pour.simulated_s * 60.0).ceil() as usize + 1;
    assert!(stamps.len().abs_diff(frames) <= 1, "{} {frames}", stamps.len());
    assert!(stamps.windows(2).all(|pair| pair[0] < pair[1]));

    let cloud = PointCloud::decode(last["/grains"].as_slice()).unwrap();
    assert_eq!((cloud.point_stride, cloud.data.len()), (16, 20 * 16));
    let first = f32::from_le_bytes(cloud.data[..4].try_into().unwrap());
    assert_eq!(first, pour.positions[0].x as f32);

    let View::Depth(camera, image) = capture(&scene.camera, &Drawn::of(&pour), 4).unwrap() else {
        panic!("the scene has a pinhole camera");
    };
    let depth = RawImage::decode(last["/depth"].as_slice()).unwrap();
    assert_eq!((depth.encoding.as_str(), depth.step), ("32FC1", 4 * depth.width));
    let values: Vec<_> =
        depth.data.as_chunks::<4>().0.iter().map(|&raw| f32::from_le_bytes(raw)).collect();
    assert_eq!(values, image.depth);
    let lens = CameraCalibration::decode(last["/camera"].as_slice()).unwrap();
    assert_eq!((lens.k[0], lens.k[2]), (camera.intrinsics.fx, camera.intrinsics.cx - 0.5));

    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let attachment = mcap::read::attachment(&bytes, &summary.attachment_indexes[0]).unwrap();
    assert_eq!(Scene::from_toml(std::str::from_utf8(&attachment.data).unwrap()).unwrap(), scene);
    let metadata = mcap::read::metadata(&bytes, &summary.metadata_indexes[0]).unwrap();
    assert_eq!(metadata.metadata["seed"], "4");
    assert_eq!(metadata.metadata["status"], pour.status.name());

    let ours = Survey::open(&path).unwrap();
    assert_eq!(ours.topics.len(), 5);
    assert!((ours.end_s - pour.simulated_s).abs() < 1e-9);
    assert!(ours.damage().is_empty());

    // The film is a recording too: its last frame is the camera's image of the pour at rest.
    let last_frame = ReadOptions { frames: 1, ..ReadOptions::default() };
    let recording = Recording::open(&path, &last_frame).unwrap();
    let Source::Depth { camera: read, image: seen, .. } = &recording.source else {
        panic!("a depth image is expected");
    };
    assert_eq!(seen.depth, image.depth);
    assert_eq!(read.intrinsics, camera.intrinsics);
    assert_eq!(recording.whole_frames, stamps.len() as u64);

    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let half = Recording::open(&path, &last_frame).unwrap();
    assert!(matches!(half.lost, Some(Lost::AtLeast(_))), "{:?}", half.lost);
    assert!(half.whole_frames < recording.whole_frames && half.whole_frames > 0);
}

#[test]
fn further_views_have_topics_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pour.mcap");
    let mut scene = scene();
    scene.views.push(ViewSpec {
        name: "side".to_owned(),
        eye: [0.0, -0.4, 0.02],
        target: [0.0, 0.0, 0.02],
        field_width: 0.1,
        pixels: [40, 20],
    });
    let simulation = Simulation::new(&scene, 4).unwrap();
    let watch = &mut |_| true;
    let mut observer = Observer::new(&scene);
    let (pour, film) =
        record_pour(simulation, &scene, 4, 60.0, &path, &mut observer, watch).unwrap().unwrap();
    film.unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let mut last = BTreeMap::new();
    let mut frames = std::collections::BTreeSet::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        if message.channel.topic == "/tf" {
            let pose = FrameTransform::decode(&message.data[..]).unwrap();
            frames.insert(pose.child_frame_id);
        }
        last.insert(message.channel.topic.clone(), message.data.to_vec());
    }
    assert_eq!(frames.into_iter().collect::<Vec<_>>(), ["camera", "views/side"]);
    let depth = RawImage::decode(last["/views/side/depth"].as_slice()).unwrap();
    assert_eq!((depth.width, depth.height, &*depth.frame_id), (40, 20, "views/side"));
    let seen = capture_from(&scene.views[0], &Drawn::of(&pour)).unwrap();
    let View::Depth(_, image) = seen else { panic!("a view is a depth image") };
    let values: Vec<_> =
        depth.data.as_chunks::<4>().0.iter().map(|&raw| f32::from_le_bytes(raw)).collect();
    assert_eq!(values, image.depth);
    let lens = CameraCalibration::decode(last["/views/side/camera"].as_slice()).unwrap();
    assert_eq!(lens.frame_id, "views/side");
    // Grains near the middle of the picture, 0.4 m away.
    assert!(image.depth.iter().any(|&depth| (0.3..0.42).contains(&depth)));
}

#[test]
fn a_stopped_recording_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pour.mcap");
    let pour = record_pour(
        simulation(),
        &scene(),
        4,
        60.0,
        &path,
        &mut Observer::new(&scene()),
        &mut |time| time < 0.05,
    )
    .unwrap();
    assert!(pour.is_none());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_film_is_of_its_own_pour_and_has_an_end() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pour.mcap");
    let other = scene().with("material.restitution", 0.25).unwrap();
    let a_frame_a_substep = 1.0 / simulation().settings().dt;
    for (scene, seed, rate, named) in [
        (other, 4, 60.0, "the scene of a film must be that of the simulation, got material.rest"),
        (scene(), 5, 60.0, "the seed of a film must be that of the simulation, got 5 for 4"),
        (
            scene(),
            4,
            0.0,
            "the frames per second must be positive and at most one a substep, got 0",
        ),
        (scene(), 4, f64::NAN, "the frames per second"),
        (scene(), 4, f64::INFINITY, "the frames per second"),
        (scene(), 4, 1.01 * a_frame_a_substep, "the frames per second"),
    ] {
        let mut observer = Observer::new(&scene);
        // What is not refused stops at once.
        let watch = &mut |_| false;
        let filmed = record_pour(simulation(), &scene, seed, rate, &path, &mut observer, watch);
        let error = filmed.unwrap_err().to_string();
        assert!(error.contains(named), "{error}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
