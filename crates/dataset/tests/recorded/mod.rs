//! The recordings of `data/recordings`, what they must say, and MCAP files made here.

#![allow(dead_code)] // Not every test file needs all of it.

use std::collections::BTreeMap;
use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use granulcal_dataset::{DatasetError, ReadOptions, Recording, Source};
use granulcal_features::{ColourImage, DepthImage, Intrinsics};

pub const WIDTH: usize = 12;
pub const HEIGHT: usize = 8;

pub fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/recordings")
}

pub fn files() -> Vec<PathBuf> {
    let mut files: Vec<_> =
        fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    assert_eq!(files.len(), 11);
    files
}

pub fn bytes(name: &str) -> Vec<u8> {
    fs::read(folder().join(name)).unwrap()
}

pub fn read(name: &str, bytes: &[u8], options: &ReadOptions) -> Result<Recording, DatasetError> {
    Recording::read(Path::new(name), Cursor::new(bytes.to_vec()), options)
}

/// The depth of a pixel in a frame, in counts of a millimetre; 0 is a hole.
pub fn count(frame: usize, u: usize, v: usize) -> u32 {
    let block = if (4..8).contains(&u) && (2..5).contains(&v) { 40 } else { 0 };
    if (u + v) % 7 == frame { 0 } else { (500 + 2 * u + 3 * v + frame - block) as u32 }
}

/// The mean of some frames `[m]`.
pub fn mean(frames: std::ops::Range<usize>) -> Vec<f32> {
    let pixel = |u, v| {
        let valid: Vec<_> = frames.clone().map(|f| count(f, u, v)).filter(|&c| c > 0).collect();
        let sum: u32 = valid.iter().sum();
        (f64::from(sum) / valid.len().max(1) as f64 * 1e-3) as f32
    };
    (0..HEIGHT).flat_map(|v| (0..WIDTH).map(move |u| (u, v))).map(|(u, v)| pixel(u, v)).collect()
}

pub fn depth(recording: &Recording) -> (&DepthImage, &Intrinsics, Option<&ColourImage>) {
    match &recording.source {
        Source::Depth { image, camera, colour } => (image, &camera.intrinsics, colour.as_ref()),
        Source::Heights(_) => panic!("a depth image is expected"),
    }
}

pub fn assert_close(recording: &Recording, expected: &[f32], tolerance: f32) {
    let (image, ..) = depth(recording);
    assert_eq!((image.width, image.height), (WIDTH, HEIGHT));
    for (index, (a, b)) in image.depth.iter().zip(expected).enumerate() {
        assert!((a - b).abs() <= tolerance, "{}: pixel {index}: {a} {b}", recording.path.display());
    }
}

/// An MCAP of Foxglove messages, made here to be ambiguous or wrong.
pub struct Film {
    pub writer: mcap::Writer<Cursor<Vec<u8>>>,
    time: u64,
}

impl Film {
    pub fn new() -> Self {
        let options = mcap::WriteOptions::new().compression(None);
        Self { writer: options.create(Cursor::new(Vec::new())).unwrap(), time: 0 }
    }

    pub fn send<T: foxglove::Encode>(mut self, topic: &str, message: &T) -> Self {
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

    pub fn depth(self, topic: &str, frame: &str, count: u16) -> Self {
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

    pub fn lens(self, topic: &str, frame: &str, focal: f64, distortion: Vec<f64>) -> Self {
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

    pub fn bytes(mut self) -> Vec<u8> {
        self.writer.finish().unwrap();
        self.writer.into_inner().into_inner()
    }

    pub fn read(self, options: &ReadOptions) -> Result<Recording, DatasetError> {
        read("film.mcap", &self.bytes(), options)
    }

    pub fn error(self, options: &ReadOptions) -> String {
        self.read(options).unwrap_err().to_string()
    }
}
