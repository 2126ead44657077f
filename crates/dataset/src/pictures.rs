//! Pictures of the steps of a segmentation, to be viewed.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use granulcal_features::{ColourImage, Levelled};
use image::{ImageBuffer, ImageFormat, Rgb};

use crate::{DatasetError, Form, files};

/// Pixels that the shorter side of a picture has at least; small images are enlarged.
const LEAST_SIDE: usize = 400;
/// Pixels that the longer side of an enlarged one has at most.
const MOST_SIDE: usize = 8192;
/// Robust standard deviations of the ground at the ends of the scale of the residual.
const RESIDUAL_SDS: f64 = 4.0;
/// Colour of a pixel without data.
const NO_DATA: [u8; 3] = [90, 90, 90];
/// Colour of the outline of the mask.
const OUTLINE: [u8; 3] = [255, 90, 0];
/// Residuals from low to high.
const RESIDUAL: [[u8; 3]; 3] = [[30, 70, 190], [247, 247, 247], [190, 30, 45]];
/// Heights from the ground up.
const HEIGHT: [[u8; 3]; 5] =
    [[25, 15, 70], [45, 85, 140], [35, 145, 130], [130, 205, 75], [250, 235, 60]];
/// Heights under the mask's outline.
const GREY: [[u8; 3]; 2] = [[15, 15, 15], [235, 235, 235]];

/// Pictures that were written, and what the ends of their scales mean.
#[derive(Clone, Debug, PartialEq)]
pub struct Pictures {
    /// The files: plane residual, height map, mask.
    pub files: [PathBuf; 3],
    /// The residual's scale runs from minus this to this `[m]`: blue is below the plane, red above.
    pub residual: f64,
    /// The height's scale runs from 0 to this `[m]`: dark is low, yellow is high.
    pub height: f64,
}

/// Writes `residual.png`, `height.png` and `mask.png` into `folder`, which is made if it does not exist.
///
/// # Errors
/// [`DatasetError::Content`] for heights, or a mask, that are not one for each pixel; [`DatasetError::Io`] or
/// [`DatasetError::Png`].
pub fn write_pictures(folder: &Path, levelled: &Levelled) -> Result<Pictures, DatasetError> {
    let size = (levelled.width, levelled.height);
    require_pixels(folder, "the heights", levelled.heights.len(), 1, size)?;
    require_pixels(folder, "the mask", levelled.mask.len(), 1, size)?;
    std::fs::create_dir_all(folder).map_err(DatasetError::io("create", folder))?;
    let residual = RESIDUAL_SDS * levelled.ground_sd.max(1e-6);
    let masked = levelled.heights.iter().zip(&levelled.mask).filter(|(_, masked)| **masked);
    let top = masked.filter_map(|(height, _)| *height).fold(0.0, f64::max);
    let height = if top > 0.0 { top } else { residual };
    let picture = |colours: &[[u8; 3]], low: f64, high: f64| {
        let pixels = levelled.heights.iter();
        pixels
            .map(|z| z.map_or(NO_DATA, |z| ramp(colours, (z - low) / (high - low))))
            .collect::<Vec<_>>()
    };
    let mut mask = picture(&GREY, 0.0, height);
    draw_outline(&mut mask, &levelled.mask, levelled.width);
    let files = ["residual.png", "height.png", "mask.png"].map(|name| folder.join(name));
    let pictures = [picture(&RESIDUAL, -residual, residual), picture(&HEIGHT, 0.0, height), mask];
    for (path, pixels) in files.iter().zip(pictures) {
        write(path, &pixels, levelled.width)?;
    }
    Ok(Pictures { files, residual, height })
}

/// Writes a colour image with the outline of a mask over it.
///
/// # Errors
/// [`DatasetError::Content`] for a mask, or colours, that are not one for each pixel; [`DatasetError::Io`] or
/// [`DatasetError::Png`].
pub fn write_mask(path: &Path, image: &ColourImage, mask: &[bool]) -> Result<(), DatasetError> {
    let size = (image.width, image.height);
    require_pixels(path, "the mask", mask.len(), 1, size)?;
    require_pixels(path, "the colours", image.rgb.len(), 3, size)?;
    let mut pixels: Vec<[u8; 3]> =
        image.rgb.chunks_exact(3).map(|rgb| [rgb[0], rgb[1], rgb[2]]).collect();
    draw_outline(&mut pixels, mask, image.width);
    write(path, &pixels, image.width)
}

/// Refuses what is not so many for each pixel of a picture of this size, and a picture that has none.
fn require_pixels(
    path: &Path,
    what: &str,
    found: usize,
    each: usize,
    (width, height): (usize, usize),
) -> Result<(), DatasetError> {
    let expected = width.checked_mul(height).and_then(|pixels| pixels.checked_mul(each));
    if found > 0 && expected == Some(found) {
        return Ok(());
    }
    let allowed = format!("{each} for each of at least one pixel, {width}x{height}");
    Err(DatasetError::content(path, what, found.to_string(), allowed))
}

/// The colour at a place of a scale that runs from 0 to 1; beyond its ends it stays.
fn ramp(colours: &[[u8; 3]], place: f64) -> [u8; 3] {
    let last = colours.len() - 1;
    // Of a range of no width every place is the first.
    let place = if place.is_nan() { 0.0 } else { place.clamp(0.0, 1.0) } * last as f64;
    let below = (place as usize).min(last - 1);
    let share = place - below as f64;
    let (a, b) = (colours[below], colours[below + 1]);
    [0, 1, 2].map(|i| {
        let (a, b) = (f64::from(a[i]), f64::from(b[i]));
        (a + share * (b - a)).round() as u8
    })
}

/// Colours the pixels of the mask that have a neighbour outside of it.
fn draw_outline(pixels: &mut [[u8; 3]], mask: &[bool], width: usize) {
    let masked = |u: Option<usize>, v: Option<usize>| match (u, v) {
        (Some(u), Some(v)) if u < width => mask.get(v * width + u).copied().unwrap_or(true),
        // The edge of the image is no edge of the mask.
        _ => true,
    };
    for (i, pixel) in pixels.iter_mut().enumerate().filter(|(i, _)| mask.get(*i) == Some(&true)) {
        let (u, v) = (i % width, i / width);
        let neighbours = [
            (u.checked_sub(1), Some(v)),
            (Some(u + 1), Some(v)),
            (Some(u), v.checked_sub(1)),
            (Some(u), Some(v + 1)),
        ];
        if neighbours.into_iter().any(|(u, v)| !masked(u, v)) {
            *pixel = OUTLINE;
        }
    }
}

fn write(path: &Path, pixels: &[[u8; 3]], width: usize) -> Result<(), DatasetError> {
    let height = pixels.len() / width;
    let wanted = LEAST_SIDE.div_ceil(width.min(height).max(1));
    let factor = wanted.min(MOST_SIDE / width.max(height).max(1)).max(1);
    let (wide, tall) = (width * factor, height * factor);
    let enlarged = ImageBuffer::from_fn(wide as u32, tall as u32, |x, y| {
        let (u, v) = (x as usize / factor, y as usize / factor);
        Rgb(pixels[v * width + u])
    });
    let mut bytes = Cursor::new(Vec::new());
    enlarged
        .write_to(&mut bytes, ImageFormat::Png)
        .map_err(|source| DatasetError::Png { path: path.to_owned(), source })?;
    files::write_file(path, Form::Png, &bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use granulcal_features::{HeightMap, Segmentation, level_height_map};

    use super::*;

    fn read(path: &Path) -> image::RgbImage {
        image::open(path).unwrap().into_rgb8()
    }

    #[test]
    fn every_step_is_a_picture() {
        let mut z = vec![0.0; 10_000];
        for (i, z) in z.iter_mut().enumerate() {
            let (u, v) = ((i % 100) as f64 - 49.5, (i / 100) as f64 - 49.5);
            *z = (0.02 - 1e-3 * u.hypot(v)).max(0.0) + 1e-4 * ((i * i % 17) as f64 - 8.0);
        }
        z[0] = f64::NAN;
        let map = HeightMap::new(100, 100, 2e-3, 2e-3, z).unwrap();
        let levelled = level_height_map(&map, &Segmentation::default()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("steps");
        let pictures = write_pictures(&place, &levelled).unwrap();
        assert!((pictures.height - 0.02).abs() < 1.5e-3, "{pictures:?}");
        let [residual, height, mask] = pictures.files.clone().map(|path| read(&path));
        for picture in [&residual, &height, &mask] {
            assert_eq!(picture.dimensions(), (400, 400));
            assert_eq!(picture.get_pixel(1, 1).0, NO_DATA);
        }
        // The top of the cone is the brightest of heights and far above the plane.
        assert_eq!(residual.get_pixel(200, 200).0, RESIDUAL[2]);
        assert!(height.get_pixel(200, 200).0[0] > 200 && height.get_pixel(380, 20).0[0] < 60);
        let outlined = mask.pixels().filter(|p| p.0 == OUTLINE).count() / 16;
        let expected = 2.0 * std::f64::consts::PI * 19.0;
        assert!((outlined as f64 / expected - 1.0).abs() < 0.25, "{outlined} {expected}");
    }

    #[test]
    fn a_strip_is_not_enlarged_without_end() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("strip.png");
        for (width, size) in [(2000, (8000, 4)), (10_000, (10_000, 1))] {
            let strip = ColourImage::new(width, 1, vec![0; 3 * width]).unwrap();
            write_mask(&path, &strip, &vec![false; width]).unwrap();
            assert_eq!(read(&path).dimensions(), size);
        }
    }

    #[test]
    fn a_mask_of_another_size_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mask.png");
        let image = ColourImage::new(3, 2, vec![0; 18]).unwrap();
        write_mask(&path, &image, &[true; 6]).unwrap();
        let refused = |image: &ColourImage, mask: &[bool]| {
            write_mask(&path, image, mask).unwrap_err().to_string()
        };
        let error = refused(&image, &[true; 5]);
        assert!(
            error.contains("the mask must be 1 for each of") && error.contains("3x2"),
            "{error}"
        );
        assert!(error.contains("found 5"), "{error}");
        let error = refused(&ColourImage { rgb: vec![0; 17], ..image.clone() }, &[true; 6]);
        assert!(
            error.contains("the colours must be 3 for each") && error.contains("17"),
            "{error}"
        );
        assert!(refused(&ColourImage { width: 0, rgb: Vec::new(), ..image }, &[]).contains("0x2"));

        let map =
            HeightMap::new(20, 20, 1e-3, 1e-3, (0..400).map(|i| f64::from(i % 7) * 1e-5).collect());
        let mut half = level_height_map(&map.unwrap(), &Segmentation::default()).unwrap();
        half.mask.truncate(200);
        let error = write_pictures(folder.path(), &half).unwrap_err().to_string();
        assert!(error.contains("the mask") && error.contains("20x20"), "{error}");
    }

    #[test]
    fn ramps_end_where_they_end() {
        assert_eq!(ramp(&HEIGHT, -1.0), HEIGHT[0]);
        assert_eq!(ramp(&HEIGHT, 2.0), HEIGHT[4]);
        assert_eq!(ramp(&RESIDUAL, 0.5), RESIDUAL[1]);
        assert_eq!(ramp(&GREY, f64::NAN), GREY[0]);
    }
}
