//! Memory of the readers: every allocation is counted, on real files, on files that were damaged, and
//! on files made to unpack to more than they are. One test, for the count is of the whole process.

use std::fs;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

use foxglove::Encode;
use granulcal_dataset::{CameraFile, DatasetError, ReadOptions, Recording, Survey, measured_data};
use peak_alloc::PeakAlloc;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Memory per byte of the file, and the least that is allowed: docs/theory/dataset.md.
const RATIO: usize = 4;
const FLOOR: usize = 128 << 20;

/// Runs `read` and returns its result and how much memory it took at most.
fn counted<T>(length: usize, read: impl FnOnce() -> T) -> (T, usize) {
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    let result = read();
    let used = MEMORY.peak_usage().saturating_sub(before);
    assert!(used <= FLOOR.max(RATIO * length), "{used} bytes for a file of {length}");
    (result, used)
}

fn read(name: &str, bytes: &[u8]) -> (Result<Recording, DatasetError>, usize) {
    counted(bytes.len(), || {
        Recording::read(Path::new(name), Cursor::new(bytes), &ReadOptions::default())
    })
}

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn files(folder: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(repository().join(folder)).unwrap();
    let mut files: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    assert!(!files.is_empty(), "{folder}");
    files
}

/// The corpus of the fuzz targets, as they read it.
fn replay_the_corpus() {
    for target in ["bag", "mcap", "npz"] {
        for path in files(&format!("fuzz/corpus/{target}")) {
            let (name, bytes) = (path.to_string_lossy().into_owned(), fs::read(&path).unwrap());
            let (result, _) = read(&name, &bytes);
            if let Err(error) = result {
                assert!(error.to_string().contains(&name), "{error}");
            }
            let survey = || Survey::read(&path, Cursor::new(&bytes));
            assert_eq!(counted(bytes.len(), survey).0.is_ok(), target != "npz", "{name}");
        }
    }
    for path in files("fuzz/corpus/png_toml") {
        let bytes = fs::read(&path).unwrap();
        let at = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
        let Ok(toml) = str::from_utf8(&bytes[..at]) else { continue };
        let Ok(mut camera) = CameraFile::parse(&path, toml) else { continue };
        camera.colour = None;
        let png = bytes.get(at + 1..).unwrap_or_default().to_vec();
        let frames = [Ok((path.clone(), png))];
        let read = || Recording::of_frames(&path, frames, &camera, &path);
        let _ = counted(bytes.len(), read);
    }
}

/// A bag with one chunk, which holds `packed`.
fn bag(compression: &str, packed: &[u8], size: u32) -> Vec<u8> {
    let field = |name: &str, value: &[u8]| {
        let text = [name.as_bytes(), b"=", value].concat();
        [&(text.len() as u32).to_le_bytes()[..], &text].concat()
    };
    let record = |fields: &[Vec<u8>], data: &[u8]| {
        let header = fields.concat();
        let length = |bytes: &[u8]| (bytes.len() as u32).to_le_bytes();
        [&length(&header)[..], &header, &length(data), data].concat()
    };
    let header = [
        field("op", &[3]),
        field("index_pos", &[0; 8]),
        field("conn_count", &[0; 4]),
        field("chunk_count", &[1, 0, 0, 0]),
    ];
    let chunk = [
        field("op", &[5]),
        field("compression", compression.as_bytes()),
        field("size", &size.to_le_bytes()),
    ];
    [b"#ROSBAG V2.0\n".to_vec(), record(&header, &[]), record(&chunk, packed)].concat()
}

/// Files of kilobytes that would unpack to a hundred megabytes and more, or that claim to.
fn defuse_bombs() {
    const SIZE: usize = 100 << 20;
    let zeros = vec![0; 1 << 20];
    let mut lz4 = lz4_flex::frame::FrameEncoder::new(Vec::new());
    let mut bz2 = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
    for _ in 0..SIZE >> 20 {
        lz4.write_all(&zeros).unwrap();
        bz2.write_all(&zeros).unwrap();
    }
    let (lz4, bz2) = (lz4.finish().unwrap(), bz2.finish().unwrap());
    for (compression, packed) in [("lz4", &lz4), ("bz2", &bz2)] {
        // What the chunk says and what it holds; both ways of lying.
        for size in [SIZE as u32, u32::MAX, 1 << 20] {
            let bytes = bag(compression, packed, size);
            let error = read("bomb.bag", &bytes).0.unwrap_err().to_string();
            assert!(error.contains("bomb.bag") && error.contains("byte"), "{error}");
        }
    }

    let mut png = Cursor::new(Vec::new());
    image::ImageBuffer::<image::Luma<u16>, _>::new(2, 2)
        .write_to(&mut png, image::ImageFormat::Png)
        .unwrap();
    let mut png = png.into_inner();
    // The head says 32768 x 32768; its checksum is made to agree.
    png[16..24].copy_from_slice(&[0, 0, 0x80, 0, 0, 0, 0x80, 0]);
    let sum = crc32fast::hash(&png[12..29]).to_be_bytes();
    png[29..33].copy_from_slice(&sum);
    let camera = granulcal_features::Camera::overhead(0.5, 0.5, 2).unwrap();
    let camera = CameraFile::of(&camera, 1e-3);
    let name = Path::new("bomb.png");
    let frames = [Ok((name.to_owned(), png.clone()))];
    let read_png = || Recording::of_frames(name, frames, &camera, Path::new("camera.toml"));
    let error = counted(png.len(), read_png).0.unwrap_err().to_string();
    assert!(error.contains("bomb.png") && error.contains("at most"), "{error}");

    let mut npz = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default();
    npz.start_file("depthmap.npy", options).unwrap();
    let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (3600, 3600), }\n";
    npz.write_all(b"\x93NUMPY\x01\x00").unwrap();
    npz.write_all(&(header.len() as u16).to_le_bytes()).unwrap();
    npz.write_all(header.as_bytes()).unwrap();
    for _ in 0..SIZE >> 20 {
        npz.write_all(&zeros).unwrap();
    }
    let npz = npz.finish().unwrap().into_inner();
    let error = read("bomb.npz", &npz).0.unwrap_err().to_string();
    assert!(error.contains("bomb.npz") && error.contains("at most"), "{error}");
}

/// A long recording is not held: its memory does not grow with its frames.
fn stream_a_long_recording() {
    let film = |frames: u16| {
        let options = mcap::WriteOptions::new().compression(None).chunk_size(Some(1 << 18));
        let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
        let mut send = |topic: &str, schema: foxglove::Schema, data: &[u8]| {
            let id = writer.add_schema(&schema.name, &schema.encoding, &schema.data).unwrap();
            let none = std::collections::BTreeMap::new();
            let channel_id = writer.add_channel(id, topic, "protobuf", &none).unwrap();
            let (sequence, log_time, publish_time) = (0, 0, 0);
            let header =
                mcap::records::MessageHeader { channel_id, sequence, log_time, publish_time };
            writer.write_to_known_channel(&header, data).unwrap();
        };
        let (width, height) = (320, 240);
        let k = vec![300.0, 0.0, 159.5, 0.0, 300.0, 119.5, 0.0, 0.0, 1.0];
        let lens = foxglove::messages::CameraCalibration { width, height, k, ..Default::default() };
        let encoded = |message: &dyn Fn(&mut Vec<u8>)| {
            let mut bytes = Vec::new();
            message(&mut bytes);
            bytes
        };
        let schema = foxglove::messages::CameraCalibration::get_schema().unwrap();
        send("/lens", schema, &encoded(&|bytes| lens.encode(bytes).unwrap()));
        for frame in 0..frames {
            let data: Vec<u8> = (0..width * height)
                .flat_map(|pixel| (500 + frame + (pixel % 7) as u16).to_le_bytes())
                .collect();
            let image = foxglove::messages::RawImage {
                width,
                height,
                encoding: "16UC1".to_owned(),
                step: 2 * width,
                data: data.into(),
                ..Default::default()
            };
            let schema = foxglove::messages::RawImage::get_schema().unwrap();
            send("/depth", schema, &encoded(&|bytes| image.encode(bytes).unwrap()));
        }
        writer.finish().unwrap();
        writer.into_inner().into_inner()
    };
    let used = |frames: u16| {
        let bytes = film(frames);
        let (result, used) = read("film.mcap", &bytes);
        assert_eq!(result.unwrap().frames, 10);
        (used, bytes.len())
    };
    let ((short, _), (long, length)) = (used(20), used(200));
    assert!(long < short + (1 << 17), "{short} {long}");
    assert!(long < length / 8, "{long} of {length}");
}

/// What the recording of a D435 takes, where it is; `--nocapture` shows the number.
fn measure_a_real_recording() {
    let Some(data) = measured_data(&repository()) else { return };
    let path = data.join("realsense-d435-frames/single_depth_color_640x480.bag");
    let bytes = fs::read(&path).unwrap();
    let (result, used) = read("d435.bag", &bytes);
    assert_eq!(result.unwrap().frames, 2);
    println!("{used} bytes for {} of {}", bytes.len(), path.display());
}

#[test]
fn readers_keep_within_their_memory() {
    measure_a_real_recording();
    replay_the_corpus();
    defuse_bombs();
    stream_a_long_recording();
}
