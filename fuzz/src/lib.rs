//! What every target asks of a reader: no panic, bounded memory, an error that names the file.

use std::io::Cursor;
use std::path::Path;

use granulcal_bayessim::Model;
use granulcal_dataset::{
    CameraFile, DatasetError, Limits, Prior, ReadOptions, Recording, Room, Survey, scene_from_text,
};
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

/// Reads a model: its document and, behind the first zero, its tensors; what can be read is asked something.
pub fn model(bytes: &[u8]) {
    let at = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    let (document, tensors) = (&bytes[..at], bytes.get(at + 1..).unwrap_or_default());
    let folder = Path::new("fuzz-model");
    match bounded(bytes.len(), || Model::read(folder, document, tensors)) {
        Ok(model) => {
            let observation = [vec![1.0; model.x_names.len()]];
            let _ = model.misfit(&observation);
            if let Ok(posterior) = model.posterior(&observation) {
                assert!(posterior.mode().len() == posterior.names().len());
            }
        }
        Err(error) => assert!(error.to_string().contains("fuzz-model"), "no file is named: {error}"),
    }
}

/// Reads a scene, and asks what it would need.
pub fn scene(bytes: &[u8]) {
    let Ok(text) = str::from_utf8(bytes) else { return };
    // Files of the fuzzer's choice must not be opened.
    if text.contains("file") {
        return;
    }
    if let Ok(scene) = bounded(text.len(), || scene_from_text(text, Path::new(""))) {
        let room = Room::of_pour(&scene, Some(60.0));
        assert!(room.memory > 0.0 && room.disk > 0.0);
        if scene.grains.count < 1000 {
            let _ = Limits::of(&scene, &Prior::default());
        }
    }
}

/// Reads a prior, and draws from it.
pub fn prior(bytes: &[u8]) {
    let Ok(text) = str::from_utf8(bytes) else { return };
    if let Ok(prior) = bounded(text.len(), || Prior::from_toml(text)) {
        let drawn = prior.sample(1, 2);
        assert!(drawn.len() == prior.parameters().len() && drawn.iter().all(|value| value.is_finite()));
        assert_eq!(Prior::from_toml(&prior.to_toml().expect("a prior is TOML")).ok(), Some(prior));
    }
}
