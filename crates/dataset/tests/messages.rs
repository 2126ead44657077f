//! Recordings of messages. The files of `data/recordings` were written by other people's writers
//! (`data/generate_recordings.py`); what they must say is computed here again.

use std::collections::BTreeMap;
use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use granulcal_dataset::{
    CameraFile, DatasetError, Lost, ReadOptions, Recording, Source, Survey, measured_data, png,
};
use granulcal_features::{ColourImage, DepthImage, Intrinsics};
use proptest::prelude::*;

const WIDTH: usize = 12;
const HEIGHT: usize = 8;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/recordings")
}

fn files() -> Vec<PathBuf> {
    let mut files: Vec<_> =
        fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    assert_eq!(files.len(), 11);
    files
}

fn bytes(name: &str) -> Vec<u8> {
    fs::read(folder().join(name)).unwrap()
}

fn read(name: &str, bytes: &[u8], options: &ReadOptions) -> Result<Recording, DatasetError> {
    Recording::read(Path::new(name), Cursor::new(bytes.to_vec()), options)
}

/// The depth of a pixel in a frame, in counts of a millimetre; 0 is a hole.
fn count(frame: usize, u: usize, v: usize) -> u32 {
    let block = if (4..8).contains(&u) && (2..5).contains(&v) { 40 } else { 0 };
    if (u + v) % 7 == frame { 0 } else { (500 + 2 * u + 3 * v + frame - block) as u32 }
}

/// The mean of some frames `[m]`.
fn mean(frames: std::ops::Range<usize>) -> Vec<f32> {
    let pixel = |u, v| {
        let valid: Vec<_> = frames.clone().map(|f| count(f, u, v)).filter(|&c| c > 0).collect();
        let sum: u32 = valid.iter().sum();
        (f64::from(sum) / valid.len().max(1) as f64 * 1e-3) as f32
    };
    (0..HEIGHT).flat_map(|v| (0..WIDTH).map(move |u| (u, v))).map(|(u, v)| pixel(u, v)).collect()
}

fn depth(recording: &Recording) -> (&DepthImage, &Intrinsics, Option<&ColourImage>) {
    match &recording.source {
        Source::Depth { image, camera, colour } => (image, &camera.intrinsics, colour.as_ref()),
        Source::Heights(_) => panic!("a depth image is expected"),
    }
}

fn assert_close(recording: &Recording, expected: &[f32], tolerance: f32) {
    let (image, ..) = depth(recording);
    assert_eq!((image.width, image.height), (WIDTH, HEIGHT));
    for (index, (a, b)) in image.depth.iter().zip(expected).enumerate() {
        assert!((a - b).abs() <= tolerance, "{}: pixel {index}: {a} {b}", recording.path.display());
    }
}

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

/// An MCAP of Foxglove messages, made here to be ambiguous or wrong.
struct Film {
    writer: mcap::Writer<Cursor<Vec<u8>>>,
    time: u64,
}

impl Film {
    fn new() -> Self {
        let options = mcap::WriteOptions::new().compression(None);
        Self { writer: options.create(Cursor::new(Vec::new())).unwrap(), time: 0 }
    }

    fn send<T: foxglove::Encode>(mut self, topic: &str, message: &T) -> Self {
        let mut data = Vec::new();
        message.encode(&mut data).unwrap();
        let schema = T::get_schema().unwrap();
        let id = self.writer.add_schema(&schema.name, &schema.encoding, &schema.data).unwrap();
        let channel_id = self.writer.add_channel(id, topic, "protobuf", &BTreeMap::new()).unwrap();
        self.time += 1;
        let (sequence, log_time, publish_time) = (0, self.time, self.time);
        let header = mcap::records::MessageHeader { channel_id, sequence, log_time, publish_time };
        self.writer.write_to_known_channel(&header, &data).unwrap();
        self
    }

    fn depth(self, topic: &str, frame: &str, count: u16) -> Self {
        let data = [count; 4].into_iter().flat_map(u16::to_le_bytes).collect::<Vec<_>>();
        self.send(
            topic,
            &foxglove::messages::RawImage {
                frame_id: frame.to_owned(),
                width: 2,
                height: 2,
                encoding: "16UC1".to_owned(),
                step: 4,
                data: data.into(),
                ..Default::default()
            },
        )
    }

    fn lens(self, topic: &str, frame: &str, focal: f64, distortion: Vec<f64>) -> Self {
        self.send(
            topic,
            &foxglove::messages::CameraCalibration {
                frame_id: frame.to_owned(),
                width: 2,
                height: 2,
                d: distortion,
                k: vec![focal, 0.0, 0.5, 0.0, focal, 0.5, 0.0, 0.0, 1.0],
                ..Default::default()
            },
        )
    }

    fn bytes(mut self) -> Vec<u8> {
        self.writer.finish().unwrap();
        self.writer.into_inner().into_inner()
    }

    fn read(self, options: &ReadOptions) -> Result<Recording, DatasetError> {
        read("film.mcap", &self.bytes(), options)
    }

    fn error(self, options: &ReadOptions) -> String {
        self.read(options).unwrap_err().to_string()
    }
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
fn a_frame_that_contradicts_itself_is_lost_and_counted() {
    let broken = foxglove::messages::RawImage {
        width: 2,
        height: 2,
        encoding: "16UC1".to_owned(),
        step: 4,
        data: vec![0; 7].into(),
        ..Default::default()
    };
    let film = || {
        Film::new().lens("/lens", "", 1.0, vec![]).depth("/depth", "", 500).send("/depth", &broken)
    };
    let recording = film().depth("/depth", "", 700).read(&ReadOptions::default()).unwrap();
    assert_eq!((recording.frames, recording.whole_frames), (2, 2));
    assert_eq!(recording.lost, Some(Lost::Exactly(1)));
    assert_eq!(depth(&recording).0.depth, [0.6; 4]);
    let only = Film::new().send("/depth", &broken).error(&ReadOptions::default());
    assert!(only.contains("data must be at least 8 bytes, found 7 bytes"), "{only}");
}

/// Whether a recording that was cut off is read as far as it goes.
fn check_cut(name: &str, whole: &[u8], length: usize) {
    match read(name, &whole[..length], &ReadOptions::default()) {
        Ok(recording) => {
            assert!((1..=3).contains(&recording.frames), "{name} {length}");
            let lost = recording.lost.unwrap_or_else(|| panic!("{name} {length}: no loss"));
            assert!(!recording.damage.is_empty());
            // What is averaged are whole frames: those at the front.
            let tolerance = if name.contains("inverse") { 3e-5 } else { 1e-7 };
            assert_close(&recording, &mean(0..recording.frames), tolerance);
            if let Lost::Exactly(lost) = lost {
                assert_eq!(recording.frames as u64 + lost, 3, "{name} {length}");
            }
        }
        Err(error) => assert!(error.to_string().contains(name), "{length}: {error}"),
    }
}

#[test]
fn a_recording_that_is_cut_off_gives_its_whole_frames() {
    for path in files() {
        let name = path.file_name().unwrap().to_str().unwrap();
        let whole = fs::read(&path).unwrap();
        // Every record's edge is within a few bytes of one of these.
        for length in (0..whole.len()).step_by(31) {
            check_cut(name, &whole, length);
        }
    }
}

#[test]
fn the_loss_is_known_as_well_as_the_format_allows() {
    let lost = |name: &str, length: usize| {
        read(name, &bytes(name)[..length], &ReadOptions::default()).unwrap().lost
    };
    // A bag says where its index should begin: without the last bytes of it no frame is missing.
    let bag = bytes("realsense_none.bag");
    assert_eq!(lost("realsense_none.bag", bag.len() - 1), Some(Lost::Exactly(0)));
    // In the last chunk, of the colour, only an estimate is possible.
    let index = u64::from_le_bytes(bag[find(&bag, b"index_pos=") + 10..][..8].try_into().unwrap());
    let Some(Lost::About(1)) = lost("realsense_none.bag", index as usize - 400) else {
        panic!("{:?}", lost("realsense_none.bag", index as usize - 400));
    };
    // An MCAP says nothing before its end.
    let film = bytes("ros2_16uc1_none.mcap");
    let Some(Lost::AtLeast(0)) = lost("ros2_16uc1_none.mcap", film.len() - 1) else {
        panic!("{:?}", lost("ros2_16uc1_none.mcap", film.len() - 1));
    };
    // A message that is cut is one frame at least.
    let third = film.windows(6).rposition(|w| w == b"16UC1\0").unwrap();
    assert_eq!(lost("ros2_16uc1_none.mcap", third + 60), Some(Lost::AtLeast(1)));
}

fn find(bytes: &[u8], needle: &[u8]) -> usize {
    bytes.windows(needle.len()).position(|window| window == needle).unwrap()
}

#[test]
fn a_damaged_chunk_is_left_out_and_its_frames_are_counted() {
    // Behind the header of the second chunk that holds a depth frame, the data are destroyed.
    for (name, mark) in
        [("realsense_lz4.bag", &b"compression=lz4"[..]), ("realsense_bz2.bag", b"compression=bz2")]
    {
        let mut bag = bytes(name);
        let chunks: Vec<_> =
            (0..bag.len() - mark.len()).filter(|&i| bag[i..].starts_with(mark)).collect();
        let mut losses = 0;
        for &chunk in &chunks {
            let before = bag.clone();
            bag[chunk + 70..chunk + 90].fill(0x55);
            match read(name, &bag, &ReadOptions::default()) {
                Ok(recording) => match recording.lost {
                    Some(Lost::Exactly(lost)) => {
                        assert_eq!(recording.whole_frames + lost, 3, "{name} {chunk}");
                        assert!(recording.damage[0].contains("byte"), "{:?}", recording.damage);
                        losses += lost;
                    }
                    other => panic!("{name} {chunk}: {other:?}"),
                },
                // The chunk with the lens, or with the unit.
                Err(error) => assert!(error.to_string().contains(name)),
            }
            bag = before;
        }
        assert!(losses >= 2, "{name}: {losses}");
    }
    // In an MCAP the checksum tells: one flipped bit of a pixel is enough.
    let mut film = bytes("ros2_16uc1_none.mcap");
    let first = find(&film, b"16UC1\0");
    film[first + 40] ^= 1;
    let recording = read("film.mcap", &film, &ReadOptions::default()).unwrap();
    assert!(matches!(recording.lost, Some(Lost::Exactly(1..=2))), "{:?}", recording.lost);
    assert!(recording.damage[0].contains("CRC"), "{:?}", recording.damage);
}

#[test]
fn a_bag_goes_on_behind_a_record_that_cannot_be_read() {
    let mut bag = bytes("realsense_none.bag");
    let needle = b"compression=none";
    let second = (0..bag.len()).filter(|&i| bag[i..].starts_with(needle)).nth(2).unwrap();
    // The length of the header of a chunk becomes absurd.
    bag[second - 8..second - 4].fill(0xff);
    let recording = read("bag.bag", &bag, &ReadOptions::default());
    match recording {
        Ok(recording) => assert!(matches!(recording.lost, Some(Lost::Exactly(_)))),
        Err(error) => assert!(error.to_string().contains("bag.bag"), "{error}"),
    }
}

/// Bytes of a real file changed in a few places.
fn mutated() -> impl Strategy<Value = (String, Vec<u8>)> {
    let file = prop::sample::select(files());
    let change = (any::<prop::sample::Index>(), any::<u8>(), 0u8..4, any::<u32>());
    (file, prop::collection::vec(change, 1..6)).prop_map(|(path, changes)| {
        let mut bytes = fs::read(&path).unwrap();
        for (at, value, how, number) in changes {
            let at = at.index(bytes.len());
            match how {
                0 => bytes[at] = value,
                1 => bytes[at] ^= 1 << (value % 8),
                2 => bytes.iter_mut().skip(at).zip(number.to_le_bytes()).for_each(|(b, n)| *b = n),
                _ => {
                    bytes.drain(at..(at + usize::from(value)).min(bytes.len()));
                    if bytes.is_empty() {
                        bytes.push(0);
                    }
                }
            }
        }
        (path.file_name().unwrap().to_string_lossy().into_owned(), bytes)
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    /// Whatever is done to a file, it is read or refused by name, and nothing panics.
    #[test]
    fn damage_is_survived((name, bytes) in mutated()) {
        let surveyed = Survey::read(Path::new(&name), Cursor::new(bytes.clone()));
        match read(&name, &bytes, &ReadOptions::default()) {
            Ok(recording) => {
                prop_assert!(recording.frames >= 1);
                prop_assert!(surveyed.is_ok());
            }
            Err(error) => prop_assert!(error.to_string().contains(&name), "{error}"),
        }
    }
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

/// Frames of a folder, one of them damaged.
#[test]
fn damaged_frames_of_a_folder_are_counted() {
    let place = tempfile::tempdir().unwrap();
    for (index, depth) in [0.5f32, 0.6, 0.7].into_iter().enumerate() {
        let image = DepthImage::new(2, 2, vec![depth; 4]).unwrap();
        png::write_depth(&place.path().join(format!("{index}.png")), &image, 1e-3).unwrap();
    }
    let middle = place.path().join("1.png");
    let whole = fs::read(&middle).unwrap();
    fs::write(&middle, &whole[..whole.len() / 2]).unwrap();
    let toml = place.path().join("camera.toml");
    let camera = granulcal_features::Camera::overhead(0.5, 0.5, 2).unwrap();
    CameraFile::of(&camera, 1e-3).save(&toml).unwrap();
    let options = ReadOptions::with_camera(&toml);
    let recording = Recording::open(place.path(), &options).unwrap();
    assert_eq!((recording.frames, recording.lost), (2, Some(Lost::Exactly(1))));
    assert_eq!(depth(&recording).0.depth, [0.6; 4]);
    assert!(recording.damage[0].contains("1.png"), "{:?}", recording.damage);
    let last = ReadOptions { frames: 1, ..options };
    assert_eq!(depth(&Recording::open(place.path(), &last).unwrap()).0.depth, [0.7; 4]);
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
