//! Recordings of messages. The files of `data/recordings` were written by other people's writers
//! (`data/generate_recordings.py`); what they must say is computed here again.

mod recorded;

use std::fs;
use std::path::Path;

use granulcal_dataset::{DatasetError, Lost, ReadOptions, Recording, measured_data, png};
use granulcal_features::ColourImage;
use recorded::{Film, HEIGHT, WIDTH, assert_close, bytes, depth, files, folder, mean, read};

#[test]
fn every_writer_is_understood() {
    for path in files() {
        let recording = Recording::open(&path, &ReadOptions::default()).unwrap();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        assert_eq!((recording.frames, recording.whole_frames), (3, 3), "{name}");
        assert_eq!(recording.lost, None, "{name}: {:?}", recording.damage);
        // Inverse depth is stored to 1 part in A / z of z: 25 um at half a metre.
        let tolerance = if name.contains("inverse") { 3e-5 } else { 1e-7 };
        assert_close(&recording, &mean(0..3), tolerance);
        let (_, lens, colour) = depth(&recording);
        // The files' convention puts the first pixel's centre at (0, 0), ours at (0.5, 0.5).
        assert_eq!((lens.fx, lens.fy, lens.cx, lens.cy), (20.0, 21.0, 6.0, 4.0), "{name}");
        assert_eq!(colour, None, "colours are read when they are asked for");
        let expected = match name.split('_').next().unwrap() {
            "realsense" => "/device_0/sensor_0/Depth_0/image/data",
            "foxglove" => "/depth",
            _ if name.contains("depth") => "/camera/depth/image_rect_raw/compressedDepth",
            _ if name.contains("png") => "/camera/depth/image_rect_raw/compressedDepth",
            _ => "/camera/depth/image_rect_raw",
        };
        assert_eq!(recording.topic.as_deref(), Some(expected));
        assert!(recording.formation().is_ok(), "{name}");
    }
}

#[test]
fn the_frames_that_are_asked_for_are_averaged() {
    let path = folder().join("realsense_lz4.bag");
    for (frames, first_frame, expected) in [
        (1, None, 2..3),
        (2, None, 1..3),
        (usize::MAX, None, 0..3),
        (1, Some(0), 0..1),
        (2, Some(0), 0..2),
        (9, Some(1), 1..3),
    ] {
        let options = ReadOptions { frames, first_frame, ..ReadOptions::default() };
        let recording = Recording::open(&path, &options).unwrap();
        assert_eq!(recording.frames, expected.len());
        assert_close(&recording, &mean(expected), 1e-7);
    }
    let beyond = ReadOptions { first_frame: Some(3), ..ReadOptions::default() };
    let error = Recording::open(&path, &beyond).unwrap_err().to_string();
    assert!(error.contains("first frame must be below 3") && error.contains("found 3"), "{error}");
}

/// A TOML that marks grains by colour; the lens stays that of the recording.
fn by_colour(folder: &Path) -> ReadOptions {
    let path = folder.join("colour.toml");
    fs::write(&path, "[segmentation.colour]\nvalue_min = 0.5\n").unwrap();
    ReadOptions::with_camera(path)
}

#[test]
fn colours_are_read_and_registered() {
    let place = tempfile::tempdir().unwrap();
    let options = by_colour(place.path());
    // ROS 2 aligned them: the pixels are the same.
    let aligned = Recording::open(&folder().join("ros2_16uc1_zstd.mcap"), &options).unwrap();
    let (_, _, colour) = depth(&aligned);
    let colour = colour.unwrap();
    let pixel =
        |colour: &ColourImage, u: usize, v: usize| colour.rgb[3 * (v * WIDTH + u)..][..3].to_vec();
    assert_eq!(pixel(colour, 7, 3), [140, 90, 77]);
    // The RealSense's colour camera has twice the focal length and stands 25 mm beside.
    let registered = Recording::open(&folder().join("realsense_none.bag"), &options).unwrap();
    let (image, _, colour) = depth(&registered);
    let colour = colour.unwrap();
    let mut seen = 0;
    for v in 0..HEIGHT {
        for u in 0..WIDTH {
            let z = f64::from(image.at(u, v));
            let x = (u as f64 - 5.5) / 20.0 * z + 0.025;
            let column = (40.0 * x / z + 6.0).floor();
            let row = (2.0 * (v as f64 - 3.5) + 4.0).floor();
            let is_inside = (0.0..=11.0).contains(&column) && (0.0..=7.0).contains(&row);
            let expected = if is_inside && z > 0.0 {
                seen += 1;
                vec![20 * column as u8, 30 * row as u8, 77]
            } else {
                vec![0, 0, 0]
            };
            assert_eq!(pixel(colour, u, v), expected, "({u}, {v})");
        }
    }
    assert!(seen > 10, "{seen}");
    // A recording without colours says so.
    let error = Recording::open(&folder().join("foxglove_raw.mcap"), &options).unwrap_err();
    assert!(error.to_string().contains("the colour topic"), "{error}");
}

#[test]
fn a_camera_file_replaces_what_it_names() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("camera.toml");
    fs::write(&path, "depth_unit = 0.002\n[segmentation]\nborder_px = 1\n").unwrap();
    let options = ReadOptions::with_camera(&path);
    let recording = Recording::open(&folder().join("foxglove_raw.mcap"), &options).unwrap();
    let doubled: Vec<_> = mean(0..3).iter().map(|depth| 2.0 * depth).collect();
    assert_close(&recording, &doubled, 1e-6);
    assert_eq!(recording.segmentation.border_px, 1);
    assert_eq!(depth(&recording).1.fx, 20.0);

    fs::write(&path, "width = 12\nheight = 8\nfx = 9.0\nfy = 9.0\ncx = 5.5\ncy = 3.5\n").unwrap();
    let recording = Recording::open(&folder().join("foxglove_raw.mcap"), &options).unwrap();
    assert_eq!(depth(&recording).1.fx, 9.0);
    fs::write(&path, "width = 6\nheight = 8\nfx = 9.0\nfy = 9.0\ncx = 2.5\ncy = 3.5\n").unwrap();
    let error = Recording::open(&folder().join("foxglove_raw.mcap"), &options).unwrap_err();
    assert!(error.to_string().contains("6x8, as the lens has it, found 12x8"), "{error}");
}

#[test]
fn where_several_topics_fit_they_are_listed_with_the_flag() {
    let film = || {
        Film::new()
            .depth("/left/depth", "left", 500)
            .depth("/right/depth", "right", 600)
            .lens("/left/info", "left", 10.0, vec![])
            .lens("/right/info", "right", 20.0, vec![0.0; 5])
    };
    let default = ReadOptions::default();
    let error = film().error(&default);
    for word in [
        "film.mcap",
        "--topic",
        "/left/depth (foxglove.RawImage, 2x2 16UC1, 1 messages)",
        "/right/depth",
    ] {
        assert!(error.contains(word), "{word}: {error}");
    }
    let topic = |name: &str| ReadOptions { topic: Some(name.to_owned()), ..ReadOptions::default() };
    let right = film().read(&topic("/right/depth")).unwrap();
    assert_eq!((depth(&right).0.depth[0], depth(&right).1.fx), (0.6, 20.0));
    let error = film().error(&topic("/middle"));
    assert!(error.contains("no topic /middle") && error.contains("/left/depth"), "{error}");
    let error = film().error(&topic("/left/info"));
    assert!(error.contains("/left/info (foxglove.CameraCalibration"), "{error}");

    // Two lenses of one frame and equally near names: which is meant cannot be known.
    let film = || {
        Film::new().depth("/depth", "c", 1).lens("/a", "c", 1.0, vec![]).lens(
            "/b",
            "c",
            2.0,
            vec![],
        )
    };
    let error = film().error(&default);
    assert!(
        error.contains("--camera-topic") && error.contains("/a (") && error.contains("/b ("),
        "{error}"
    );
    let chosen = ReadOptions { camera_topic: Some("/b".to_owned()), ..ReadOptions::default() };
    assert_eq!(depth(&film().read(&chosen).unwrap()).1.fx, 2.0);
    let wrong = ReadOptions { camera_topic: Some("/c".to_owned()), ..ReadOptions::default() };
    assert!(film().error(&wrong).contains("one of: /a"));
}

#[test]
fn a_lens_that_is_not_the_depths_is_not_taken() {
    let default = ReadOptions::default();
    let other_frame =
        Film::new().depth("/depth", "depth", 1).lens("/colour", "colour", 1.0, vec![]);
    let error = other_frame.error(&default);
    assert!(error.contains("the lens of /depth") && error.contains("--camera"), "{error}");
    let none = Film::new().depth("/depth", "", 1).error(&default);
    assert!(none.contains("found none"), "{none}");
    let bent = Film::new().depth("/depth", "", 1).lens("/lens", "", 1.0, vec![0.0, 0.1]);
    let error = bent.error(&default);
    assert!(error.contains("the distortion of /lens") && error.contains("[0.0, 0.1]"), "{error}");
    let uncalibrated = Film::new().depth("/depth", "", 1).lens("/lens", "", 0.0, vec![]);
    assert!(matches!(uncalibrated.read(&default), Err(DatasetError::Recording { .. })));
    let nothing = Film::new().lens("/lens", "", 1.0, vec![]).error(&default);
    assert!(nothing.contains("the depth topic") && nothing.contains("found none"), "{nothing}");
}

#[test]
fn what_is_no_recording_is_named() {
    let error = |name: &str, bytes: &[u8]| {
        read(name, bytes, &ReadOptions::default()).unwrap_err().to_string()
    };
    assert!(error("empty.bag", b"").contains("an empty file"));
    let old = error("old.bag", b"#ROSBAG V1.2\n---");
    assert!(old.contains("#ROSBAG V1.2") && old.contains("#ROSBAG V2.0"), "{old}");
    assert!(error("text.mcap", b"hello").contains("MCAP"));
    assert!(
        error("a_0.db3", b"SQLite format 3\0...").contains("`ros2 bag convert` turns into .mcap")
    );
    // The content counts, not the name.
    let options = ReadOptions::default();
    assert!(read("misnamed.png", &bytes("foxglove_raw.mcap"), &options).is_ok());
}

#[test]
fn a_folder_of_a_ros_2_recorder_is_its_mcap() {
    let place = tempfile::tempdir().unwrap();
    fs::write(place.path().join("metadata.yaml"), "").unwrap();
    let open = || Recording::open(place.path(), &ReadOptions::default());
    assert!(open().unwrap_err().to_string().contains("no .png, .mcap or .bag"));
    fs::write(place.path().join("a.db3"), "").unwrap();
    assert!(open().unwrap_err().to_string().contains("ros2 bag convert"));
    fs::copy(folder().join("ros2_png.mcap"), place.path().join("a_0.mcap")).unwrap();
    assert_eq!(open().unwrap().frames, 3);
    fs::copy(folder().join("ros2_png.mcap"), place.path().join("a_1.mcap")).unwrap();
    assert!(open().unwrap_err().to_string().contains("2 recordings"));
}

/// A recording of a D435 by the RealSense viewer; the test is empty where the data are not.
#[test]
fn a_recording_of_the_realsense_viewer_is_read() {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let Some(data) = measured_data(&repository) else { return };
    let data = data.join("realsense-d435-frames");
    let path = data.join("single_depth_color_640x480.bag");
    let recording = Recording::open(&path, &ReadOptions::default()).unwrap();
    assert_eq!((recording.frames, recording.lost), (2, None), "{:?}", recording.damage);
    let (image, lens, _) = depth(&recording);
    assert!((lens.fx - 390.43145752).abs() < 1e-6 && (lens.cx - 0.5 - 331.38787842).abs() < 1e-6);
    // The same two frames, taken out of the file by other means.
    let frames =
        ["depth0.png", "depth1.png"].map(|name| png::read_depth(&data.join(name), 1e-3).unwrap());
    for (index, &mean) in image.depth.iter().enumerate() {
        let valid: Vec<_> = frames.iter().map(|f| f.depth[index]).filter(|&d| d > 0.0).collect();
        let expected = valid.iter().sum::<f32>() / valid.len().max(1) as f32;
        assert!((mean - expected).abs() < 1e-6, "{index}: {mean} {expected}");
    }
    let whole = fs::read(&path).unwrap();
    let cut = read("cut.bag", &whole[..700_000], &ReadOptions::default()).unwrap();
    assert_eq!(cut.frames, 1);
    assert!(matches!(cut.lost, Some(Lost::About(1..))), "{:?}", cut.lost);
}
