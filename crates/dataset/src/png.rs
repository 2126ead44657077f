//! Depth as 16-bit grey PNG, colour as 8-bit RGB PNG.

use std::io::Cursor;
use std::path::Path;

use granulcal_features::{ColourImage, DepthImage};
use image::{ImageBuffer, ImageFormat, Luma};

use crate::depth_frame::SATURATED;
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

/// Whether so many metres a count are a unit: a depth is a number of 32 bits, in which 1 count must be more than 0 and
/// 65535 counts less than infinity.
pub(crate) fn is_unit(depth_unit: f64) -> bool {
    depth_unit as f32 > 0.0 && ((f64::from(u16::MAX) * depth_unit) as f32).is_finite()
}

/// What [`is_unit`] allows.
pub(crate) const UNITS: &str = "positive and finite, in 32 bits";

fn require_unit(depth_unit: f64) -> Result<(), DatasetError> {
    let refuse = |got| Err(DatasetError::Argument { what: "depth unit [m]", got, allowed: UNITS });
    if is_unit(depth_unit) { Ok(()) } else { refuse(depth_unit.to_string()) }
}

/// Reads a 16-bit grey PNG as depth, `depth_unit` metres a count; 0 is no data.
///
/// # Errors
/// [`DatasetError::Io`], [`DatasetError::Png`], [`DatasetError::Content`] for other pixels, or
/// [`DatasetError::Argument`] for a unit that is not positive and finite.
pub fn read_depth(path: &Path, depth_unit: f64) -> Result<DepthImage, DatasetError> {
    require_unit(depth_unit)?;
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

/// Writes depth as 16-bit grey PNG, `depth_unit` metres a count; what is not positive and finite is no data.
///
/// # Errors
/// [`DatasetError::Io`], [`DatasetError::Png`], [`DatasetError::Content`] for an image whose pixels are not those of
/// its size, or [`DatasetError::Argument`] for a unit in which a depth does not fit 16 bits, or in which no depth is
/// anything but 0.
pub fn write_depth(path: &Path, image: &DepthImage, depth_unit: f64) -> Result<(), DatasetError> {
    let counts = counts(image, depth_unit)?;
    let buffer = (|| {
        let (width, height) = (u32::try_from(image.width), u32::try_from(image.height));
        // The buffer takes more values than it has pixels, too.
        let is_whole = image.width.checked_mul(image.height) == Some(counts.len());
        let buffer = ImageBuffer::<Luma<u16>, _>::from_raw(width.ok()?, height.ok()?, counts);
        buffer.filter(|buffer| is_whole && !buffer.is_empty())
    })();
    let Some(buffer) = buffer else {
        let found = format!("{} values for {}x{}", image.depth.len(), image.width, image.height);
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
    require_unit(depth_unit)?;
    let refuse =
        |got, allowed| Err(DatasetError::Argument { what: "depth unit [m]", got, allowed });
    let deepest = image.depth.iter().copied().filter(|d| d.is_finite()).fold(0.0, f32::max);
    let most = (f64::from(deepest) / depth_unit).round();
    let got = || format!("{depth_unit} with a farthest depth of {deepest} m");
    if most >= f64::from(SATURATED) {
        return refuse(got(), "large enough that 65534 counts reach the deepest pixel");
    }
    if deepest > 0.0 && most == 0.0 {
        return refuse(got(), "at most twice the farthest depth (else every depth is 0)");
    }
    // Casts of floats saturate: below 0 and NaN become 0, which is no data, but infinity would become a depth.
    let count = |depth: f32| (f64::from(depth) / depth_unit).round() as u16;
    Ok(image.depth.iter().map(|&d| if d.is_finite() { count(d) } else { 0 }).collect())
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
    fn what_is_no_depth_is_no_data() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("d.png");
        let depth = vec![f32::INFINITY, f32::NEG_INFINITY, f32::NAN, -0.3, 0.0, 0.2];
        write_depth(&path, &DepthImage::new(3, 2, depth).unwrap(), DEPTH_UNIT).unwrap();
        assert_eq!(read_depth(&path, DEPTH_UNIT).unwrap().depth, [0.0, 0.0, 0.0, 0.0, 0.0, 0.2]);
        let none = DepthImage::new(1, 1, vec![f32::INFINITY]).unwrap();
        write_depth(&path, &none, DEPTH_UNIT).unwrap();
        assert_eq!(read_depth(&path, DEPTH_UNIT).unwrap().depth, [0.0]);
    }

    #[test]
    fn a_unit_that_is_none_and_an_image_that_is_not_whole_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("d.png");
        let image = DepthImage::new(2, 1, vec![0.1, 0.2]).unwrap();
        write_depth(&path, &image, DEPTH_UNIT).unwrap();
        for unit in [0.0, -1e-3, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e-50, 1e36] {
            for error in [
                read_depth(&path, unit).unwrap_err(),
                write_depth(&path, &image, unit).unwrap_err(),
            ] {
                let error = error.to_string();
                assert!(error.contains(&format!("positive and finite, in 32 bits, got {unit}")));
            }
        }
        for (width, height) in [(1, 1), (3, 1), (0, 2), (1 << 32, 1), (usize::MAX, 2)] {
            let other = DepthImage { width, height, ..image.clone() };
            let error = write_depth(&path, &other, DEPTH_UNIT).unwrap_err().to_string();
            assert!(error.contains(&format!("found 2 values for {width}x{height}")), "{error}");
        }
        assert_eq!(read_depth(&path, DEPTH_UNIT).unwrap(), image);
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
