//! Depth as 16-bit grey PNG, colour as 8-bit RGB PNG.

use std::io::Cursor;
use std::path::Path;

use granulcal_features::{ColourImage, DepthImage};
use image::{ImageBuffer, ImageFormat, Luma};

use crate::image_file::{self, Unreadable};
use crate::input::unpack_limit;
use crate::mean::Mean;
use crate::{DatasetError, Form, files};

/// Metres per count that depth is written with unless told otherwise: 0.1 mm, up to 6.5 m.
pub const DEPTH_UNIT: f64 = 1e-4;

/// The error of an image file at `path`.
pub(crate) fn unreadable(path: &Path, error: Unreadable) -> DatasetError {
    match error {
        Unreadable::Damaged(source) => DatasetError::Png { path: path.to_owned(), source },
        Unreadable::Unfit(fault) => fault.in_file(path),
    }
}

/// Reads a 16-bit grey PNG as depth, `depth_unit` metres a count; 0 is no data.
///
/// # Errors
/// [`DatasetError::Io`], [`DatasetError::Png`], or [`DatasetError::Content`] for other pixels.
pub fn read_depth(path: &Path, depth_unit: f64) -> Result<DepthImage, DatasetError> {
    let bytes = files::read_at_most(path, files::LARGEST_PART)?;
    image_file::depth(&bytes, unpack_limit(bytes.len() as u64))
        .map_err(|error| unreadable(path, error))
        .and_then(|frame| {
            Mean::new(frame, depth_unit).finish().map_err(|fault| fault.in_file(path))
        })
}

/// Reads an 8-bit RGB PNG or JPEG; an alpha channel is dropped.
///
/// # Errors
/// As [`read_depth`].
pub fn read_colour(path: &Path) -> Result<ColourImage, DatasetError> {
    let bytes = files::read_at_most(path, files::LARGEST_PART)?;
    image_file::colour(&bytes, unpack_limit(bytes.len() as u64))
        .map_err(|error| unreadable(path, error))
}

/// Writes depth as 16-bit grey PNG, `depth_unit` metres a count.
///
/// # Errors
/// [`DatasetError::Io`], [`DatasetError::Png`], or [`DatasetError::Argument`] for a unit in which a
/// depth does not fit 16 bits, or in which no depth is anything but 0.
pub fn write_depth(path: &Path, image: &DepthImage, depth_unit: f64) -> Result<(), DatasetError> {
    let counts = counts(image, depth_unit)?;
    let (width, height) = (image.width as u32, image.height as u32);
    let Some(buffer) = ImageBuffer::<Luma<u16>, _>::from_raw(width, height, counts) else {
        let found = format!("{} values for {width}x{height}", image.depth.len());
        return Err(DatasetError::content(path, "the depth image", found, "one value a pixel"));
    };
    let mut bytes = Cursor::new(Vec::new());
    buffer
        .write_to(&mut bytes, ImageFormat::Png)
        .map_err(|source| DatasetError::Png { path: path.to_owned(), source })?;
    files::write_file(path, Form::Png, &bytes.into_inner())
}

/// Depth in counts of `depth_unit`, rounded; no data is 0.
pub(crate) fn counts(image: &DepthImage, depth_unit: f64) -> Result<Vec<u16>, DatasetError> {
    let refuse =
        |got, allowed| Err(DatasetError::Argument { what: "depth unit [m]", got, allowed });
    if !(depth_unit > 0.0 && depth_unit.is_finite()) {
        return refuse(depth_unit.to_string(), "positive and finite");
    }
    let deepest = image.depth.iter().copied().filter(|d| d.is_finite()).fold(0.0, f32::max);
    let most = (f64::from(deepest) / depth_unit).round();
    let got = || format!("{depth_unit} with a farthest depth of {deepest} m");
    if most > f64::from(u16::MAX) {
        return refuse(got(), "large enough that 65535 counts reach the deepest pixel");
    }
    if deepest > 0.0 && most == 0.0 {
        return refuse(got(), "at most twice the farthest depth (else every depth is 0)");
    }
    // Casts of floats saturate and turn NaN into 0, which is no data.
    Ok(image.depth.iter().map(|&d| (f64::from(d) / depth_unit).round() as u16).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_survives_to_half_a_count() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("d.png");
        let depth: Vec<f32> = (0..12).map(|i| 0.29 - 0.003_17 * i as f32).chain([0.0; 4]).collect();
        let image = DepthImage::new(4, 4, depth).unwrap();
        write_depth(&path, &image, DEPTH_UNIT).unwrap();
        let back = read_depth(&path, DEPTH_UNIT).unwrap();
        for (a, b) in image.depth.iter().zip(&back.depth) {
            assert!((a - b).abs() <= 0.5001e-4, "{a} {b}");
        }
        assert_eq!(back.at(3, 3), 0.0);
        let error = write_depth(&path, &image, 1e-6).unwrap_err().to_string();
        assert!(error.contains("depth unit"), "{error}");
        // Every depth would be no data.
        for unit in [1.0, 0.6] {
            let error = write_depth(&path, &image, unit).unwrap_err().to_string();
            assert!(
                error.contains(&format!("got {unit} with a farthest depth of 0.29 m")),
                "{error}"
            );
        }
        write_depth(&path, &image, 0.57).unwrap();
        let empty = DepthImage::new(2, 1, vec![0.0, f32::NAN]).unwrap();
        write_depth(&path, &empty, 1.0).unwrap();
    }

    #[test]
    fn other_pixels_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.png");
        image::RgbImage::new(2, 2).save(&path).unwrap();
        let error = read_depth(&path, 1e-3).unwrap_err().to_string();
        assert!(error.contains("16-bit grey") && error.contains("Rgb8"), "{error}");
        assert_eq!(read_colour(&path).unwrap().rgb.len(), 12);
        std::fs::write(&path, b"\x89PNG\r\n\x1a\nrest").unwrap();
        assert!(matches!(read_colour(&path), Err(DatasetError::Png { .. })));
    }
}
