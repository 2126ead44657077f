//! What every target asks of a reader: no panic, bounded memory, an error that names the file.

use std::io::Cursor;
use std::path::Path;

use granulcal_dataset::{CameraFile, DatasetError, ReadOptions, Recording, Survey};
use peak_alloc::PeakAlloc;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Memory per byte of the file, and the least that is allowed (docs/theory/dataset.md).
const MEMORY_RATIO: usize = 4;
const MEMORY_FLOOR: usize = 128 << 20;

/// Runs `read` on a file of `length` bytes and checks how much memory it took.
fn bounded<T>(length: usize, read: impl FnOnce() -> T) -> T {
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    let result = read();
    let used = MEMORY.peak_usage().saturating_sub(before);
    let allowed = MEMORY_FLOOR.max(MEMORY_RATIO * length);
    assert!(used <= allowed, "{used} bytes of memory for a file of {length}, allowed are {allowed}");
    result
}

fn require_name(name: &str, error: &DatasetError) {
    assert!(error.to_string().contains(name), "the file is not named: {error}");
}

/// Reads a .bag, .mcap or .npz.
pub fn recording(name: &str, bytes: &[u8]) {
    let path = Path::new(name);
    let read = |options| bounded(bytes.len(), || Recording::read(path, Cursor::new(bytes), options));
    match read(&ReadOptions::default()) {
        Ok(recording) => {
            assert!(recording.frames >= 1 && recording.frames as u64 <= recording.whole_frames);
            let all = ReadOptions { frames: usize::MAX, first_frame: Some(0), ..ReadOptions::default() };
            if let Err(error) = read(&all) {
                require_name(name, &error);
            }
        }
        Err(error) => require_name(name, &error),
    }
}

/// Looks through a .bag or .mcap, as `inspect` does.
pub fn survey(name: &str, bytes: &[u8]) {
    match bounded(bytes.len(), || Survey::read(Path::new(name), Cursor::new(bytes))) {
        Ok(survey) => {
            for topic in &survey.topics {
                let _ = (topic.to_string(), survey.lost(topic));
                // Every topic is asked for as depth and as lens.
                let _ = survey.choose(Some(&topic.topic), None);
                let _ = survey.choose(None, Some(&topic.topic));
            }
        }
        Err(error) => require_name(name, &error),
    }
}

/// Reads a camera's TOML and, behind the first zero, a PNG.
pub fn png_with_toml(bytes: &[u8]) {
    let (name, camera_name) = ("fuzz.png", Path::new("fuzz.toml"));
    let at = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    let (toml, png) = (&bytes[..at], bytes.get(at + 1..).unwrap_or_default());
    let Ok(toml) = str::from_utf8(toml) else { return };
    let mut camera = match bounded(toml.len(), || CameraFile::parse(camera_name, toml)) {
        Ok(camera) => camera,
        Err(error) => return require_name("fuzz.toml", &error),
    };
    // A path of the fuzzer's must not be opened.
    camera.colour = None;
    let frame = || [Ok((name.into(), png.to_vec()))];
    let read =
        || Recording::of_frames(Path::new(name), frame(), &camera, camera_name);
    if let Err(error) = bounded(png.len(), read) {
        assert!(error.to_string().contains("fuzz."), "the file is not named: {error}");
    }
}
