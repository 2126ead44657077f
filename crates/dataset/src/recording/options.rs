//! What of a recording is read.

use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::DatasetError;

/// Frames that are averaged unless told otherwise: as many as Matl et al. 2020 average.
pub const FRAMES: usize = 10;

/// What of a recording is read, and what is known besides.
#[derive(Clone, Debug)]
pub struct ReadOptions {
    /// TOML of the camera. Without one images as PNG or .npy take that under their own name, else `camera.toml` in
    /// their folder or the one above; for other recordings it replaces what they say.
    pub camera: Option<PathBuf>,
    /// Topic of the depth images, where several fit.
    pub topic: Option<String>,
    /// Topic of the colour images, where several fit.
    pub colour_topic: Option<String>,
    /// Topic of the lens, where several fit.
    pub camera_topic: Option<String>,
    /// Most frames that are averaged; at least 1.
    pub frames: usize,
    /// Index of the first of them, counted from 0; else the last `frames` frames are taken.
    pub first_frame: Option<u64>,
}

/// The camera of an image as PNG or .npy, or of a folder of them: a TOML under the image's name, as images are written
/// with, else `camera.toml` in its folder or the one above.
fn camera_of_images_beside(path: &Path) -> Option<PathBuf> {
    let own = path.is_file().then(|| path.with_extension("toml"));
    let folder = if path.is_dir() { path } else { path.parent()? };
    // The folder above the one where one stands is in no path that is relative to it.
    let is_here = folder.as_os_str().is_empty() || folder == Path::new(".");
    let above = if is_here { Some(Path::new("..")) } else { folder.parent() };
    let shared = [Some(folder), above].into_iter().flatten().map(|place| place.join("camera.toml"));
    own.into_iter().chain(shared).find(|file| file.is_file())
}

/// The camera by which a recording is read that is given none: beside an image as PNG or .npy or a folder of PNGs. None
/// of recordings that say themselves what saw them, or that are not there.
pub fn camera_beside(path: &Path) -> Option<PathBuf> {
    let ends = |path: &Path, all: &[&str]| {
        path.extension().is_some_and(|end| all.iter().any(|of| end.eq_ignore_ascii_case(of)))
    };
    let is_images = if path.is_dir() {
        path.read_dir().is_ok_and(|all| all.flatten().any(|file| ends(&file.path(), &["png"])))
    } else {
        ends(path, &["png", "npy"])
    };
    if is_images { camera_of_images_beside(path) } else { None }
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            camera: None,
            topic: None,
            colour_topic: None,
            camera_topic: None,
            frames: FRAMES,
            first_frame: None,
        }
    }
}

impl ReadOptions {
    /// The defaults, with a camera.
    pub fn with_camera(camera: impl Into<PathBuf>) -> Self {
        Self { camera: Some(camera.into()), ..Self::default() }
    }

    /// Which of `whole` frames are averaged.
    pub(super) fn window(&self, path: &Path, whole: u64) -> Result<Range<u64>, DatasetError> {
        let count = self.frames as u64;
        if count == 0 {
            let (what, got) = ("the number of frames", "0".to_owned());
            return Err(DatasetError::Argument { what, got, allowed: "at least 1" });
        }
        let first = self.first_frame.unwrap_or(whole.saturating_sub(count));
        if first >= whole {
            let allowed = format!("below {whole}, the number of frames");
            return Err(DatasetError::content(path, "the first frame", first.to_string(), allowed));
        }
        Ok(first..whole.min(first.saturating_add(count)))
    }

    /// The TOML of the camera that took the images at `path`, which say nothing of it themselves.
    pub(super) fn camera_of_images(&self, path: &Path) -> Result<PathBuf, DatasetError> {
        self.camera.clone().or_else(|| camera_of_images_beside(path)).ok_or_else(|| {
            let allowed = "given for depth images as PNG or .npy (--camera camera.toml), or beside them as camera.toml or \
                           under an image's own name";
            DatasetError::content(path, "the camera", "none", allowed)
        })
    }

    /// Refuses names of topics for a file that has none.
    pub(super) fn refuse_topics(&self, path: &Path) -> Result<(), DatasetError> {
        match [&self.topic, &self.colour_topic, &self.camera_topic].into_iter().flatten().next() {
            None => Ok(()),
            Some(topic) => {
                let allowed = "absent: only .bag and .mcap have topics";
                Err(DatasetError::content(path, "the topic", topic.as_str(), allowed))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_frames_are_taken_unless_told_otherwise() {
        let window = |frames, first_frame, whole| {
            let options = ReadOptions { frames, first_frame, ..ReadOptions::default() };
            options.window(Path::new("a"), whole).ok()
        };
        assert_eq!(window(10, None, 30), Some(20..30));
        assert_eq!(window(10, None, 3), Some(0..3));
        assert_eq!(window(usize::MAX, None, 30), Some(0..30));
        assert_eq!(window(5, Some(2), 30), Some(2..7));
        assert_eq!(window(5, Some(28), 30), Some(28..30));
        assert_eq!(window(usize::MAX, Some(28), 30), Some(28..30));
        assert_eq!(window(5, Some(30), 30), None);
        assert_eq!(window(0, None, 30), None);
        assert_eq!(window(1, None, 0), None);
    }

    #[test]
    fn the_camera_of_images_lies_beside_them_and_of_others_nowhere() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["camera.toml", "own.toml", "own.png", "one.npy", "map.npz", "a.mcap"] {
            std::fs::write(at(name), "").unwrap();
        }
        std::fs::create_dir_all(at("frames/deep")).unwrap();
        assert_eq!(camera_beside(&at("frames")), None, "no image is in it");
        std::fs::write(at("frames/0.png"), "").unwrap();
        std::fs::write(at("frames/deep/0.PNG"), "").unwrap();
        let shared = Some(at("camera.toml"));
        assert_eq!(camera_beside(&at("own.png")), Some(at("own.toml")));
        for images in ["one.npy", "frames", "frames/0.png"] {
            assert_eq!(camera_beside(&at(images)), shared, "{images}");
        }
        for other in ["frames/deep/0.PNG", "map.npz", "a.mcap", "absent"] {
            assert_eq!(camera_beside(&at(other)), None, "{other}");
        }
    }
}
