//! Depth images as an array of NumPy, as programs in Python keep what a camera hands them.

use std::ops::Range;

use granulcal_features::Intrinsics;

use super::options::ReadOptions;
use crate::depth_frame::SATURATED;
use crate::input::Input;
use crate::{CameraFile, DatasetError, npy};

/// The images of an array that are averaged, and the camera that took them.
pub(super) struct Depths {
    pub(super) camera: CameraFile,
    pub(super) lens: Intrinsics,
    /// Depths row by row `[m]`, one image after the other.
    pub(super) images: Vec<Vec<f32>>,
    /// Their places among all.
    pub(super) window: Range<u64>,
    /// Images that there are.
    pub(super) count: u64,
}

/// Reads one image, shape (h, w), or frames of one formation, shape (k, h, w): floats are metres, whole numbers counts
/// of the camera's unit.
///
/// # Errors
/// [`DatasetError::Content`] for another shape, a size that is not the lens's, whole numbers without a unit.
pub(super) fn read(input: Input<'_>, options: &ReadOptions) -> Result<Depths, DatasetError> {
    let path = input.path().to_owned();
    options.refuse_topics(&path)?;
    let camera_path = options.camera_of_images(&path)?;
    let camera = CameraFile::load(&camera_path)?;
    let limit = npy::array_limit(input.length());
    let (array, is_counts) = npy::parse_typed(&path, "", &mut input.into_reader()?, limit)?;
    let (count, height, width) = match array.shape[..] {
        [height, width] | [height, width, 1] => (1, height, width),
        [count, height, width] => (count, height, width),
        _ => {
            let found = format!("{:?}", array.shape);
            return Err(DatasetError::content(&path, "the shape", found, "(h, w) or (k, h, w)"));
        }
    };
    let (lens, unit) = if is_counts {
        let (lens, unit) = camera.lens_and_unit(&camera_path)?;
        (lens, Some(unit))
    } else {
        let allowed = "width, height, fx, fy, cx and cy for a depth image";
        let none = || DatasetError::content(&camera_path, "the camera", "no lens", allowed);
        (camera.lens.ok_or_else(none)?, None)
    };
    if (width, height) != (lens.width, lens.height) {
        let allowed = format!("{}x{} as in {}", lens.width, lens.height, camera_path.display());
        return Err(DatasetError::content(&path, "the size", format!("{width}x{height}"), allowed));
    }
    if count == 0 {
        let allowed = "at least one image, (h, w) or (k, h, w)";
        return Err(DatasetError::content(&path, "the array", "none", allowed));
    }
    if array.values.iter().all(|&value| value.is_nan() || value <= 0.0)
        && let Some(found) = array.values.iter().find(|&&value| value < 0.0)
    {
        let allowed = "positive away from the camera, 0 or NaN where there is no data";
        return Err(DatasetError::content(&path, "the depths", found.to_string(), allowed));
    }
    let window = options.window(&path, count as u64)?;
    let metres = |value: &f64| match unit {
        Some(_) if *value == f64::from(SATURATED) => 0.0,
        Some(unit) => (value * unit) as f32,
        None => *value as f32,
    };
    let frames = array.values.chunks_exact(width * height);
    let chosen = frames.skip(window.start as usize).take((window.end - window.start) as usize);
    let images = chosen.map(|frame| frame.iter().map(metres).collect()).collect();
    Ok(Depths { camera, lens, images, window, count: count as u64 })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::npy;
    use crate::recording::{ReadOptions, Recording, Source};

    const CAMERA: &str = "width = 3\nheight = 2\nfx = 4.0\nfy = 4.0\ncx = 1.0\ncy = 0.5\n";

    /// What is read of an array, or the message.
    fn read(camera: &str, bytes: &[u8], options: &ReadOptions) -> Result<Recording, String> {
        let folder = tempfile::tempdir().unwrap();
        let (toml, array) = (folder.path().join("camera.toml"), folder.path().join("d.npy"));
        std::fs::write(toml, camera).unwrap();
        std::fs::write(&array, bytes).unwrap();
        Recording::open(&array, options).map_err(|error| error.to_string())
    }

    fn depth(recording: &Recording) -> Vec<f32> {
        let Source::Depth { image, .. } = &recording.source else { panic!("a height map") };
        image.depth.clone()
    }

    #[test]
    fn floats_are_metres_and_whole_numbers_counts() {
        let (options, unit) = (ReadOptions::default(), format!("{CAMERA}depth_unit = 0.001\n"));
        let metres = npy::encode(&[2, 3], [0.4, 0.4, f64::NAN, 0.4, 0.5, 0.0]);
        let wanted = vec![0.4, 0.4, 0.0, 0.4, 0.5, 0.0];
        assert_eq!(depth(&read(CAMERA, &metres, &options).unwrap()), wanted);
        let counts = npy::encode_integers(&[2, 3], [400, 400, 0, 400, 500, 0]);
        let found = read(&unit, &counts, &options).unwrap();
        assert_eq!((depth(&found), found.depth_unit), (wanted, Some(1e-3)));
        let full = npy::encode_integers(&[2, 3], [400, 400, 65535, 400, 500, 0]);
        assert_eq!(depth(&read(&unit, &full, &options).unwrap()), depth(&found));
        assert!(read(CAMERA, &counts, &options).unwrap_err().contains("no depth_unit"));
        // The unit says what the depths are rounded to, not what they are in.
        let found = read(&unit, &metres, &options).unwrap();
        assert_eq!((depth(&found)[0], found.depth_unit), (0.4, Some(1e-3)));
    }

    #[test]
    fn frames_are_averaged_and_chosen() {
        let frames = npy::encode(&[3, 2, 3], (0..18).map(|i| [0.2, 0.4, 0.6][i / 6]));
        let found = read(CAMERA, &frames, &ReadOptions::default()).unwrap();
        assert_eq!((found.frames, found.whole_frames, found.window.clone()), (3, 3, 0..3));
        assert!(depth(&found).iter().all(|z| (z - 0.4).abs() < 1e-6));
        let last = ReadOptions { frames: 1, ..ReadOptions::default() };
        assert!((depth(&read(CAMERA, &frames, &last).unwrap())[0] - 0.6).abs() < 1e-6);
    }

    #[test]
    fn what_is_no_depth_image_is_named() {
        let camera = format!("{CAMERA}depth_unit = 0.001\n");
        for (array, words) in [
            (npy::encode(&[6], [0.4; 6]), "(h, w) or (k, h, w)"),
            (npy::encode(&[3, 2], [0.4; 6]), "the size must be 3x2 as in"),
            (npy::encode(&[2, 3], [400.0; 6]), "are they counts or millimetres?"),
            (npy::encode(&[0, 2, 3], []), "the array must be at least one image"),
            (npy::encode(&[2, 3], [-0.4; 6]), "the depths must be positive away from the camera"),
            (npy::encode_text("depth"), "the dtype"),
        ] {
            let told = read(&camera, &array, &ReadOptions::default()).unwrap_err();
            assert!(told.contains(words), "{told}");
        }
        let lensless = "depth_unit = 0.001\n";
        let image = npy::encode(&[2, 3], [0.4; 6]);
        assert!(read(lensless, &image, &ReadOptions::default()).unwrap_err().contains("no lens"));
        let missing = Path::new("nothing.npy");
        assert!(Recording::open(missing, &ReadOptions::default()).is_err());
    }
}
