//! Image files in memory: PNG, and JPEG for colour; no more is unpacked than a limit allows.

use std::io::Cursor;

use granulcal_features::ColourImage;
use image::{ColorType, DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};

use crate::depth_frame::{DepthFrame, Values};
use crate::fault::Fault;

/// Why an image file cannot be used.
#[derive(Debug)]
pub(crate) enum Unreadable {
    /// The decoder refuses it.
    Damaged(ImageError),
    /// It is whole, but something else.
    Unfit(Fault),
}

impl From<ImageError> for Unreadable {
    fn from(error: ImageError) -> Self {
        Self::Damaged(error)
    }
}

impl From<Fault> for Unreadable {
    fn from(fault: Fault) -> Self {
        Self::Unfit(fault)
    }
}

/// Size in pixels and kind of pixels, without unpacking them.
pub(crate) struct Head {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) colour: ColorType,
}

/// Reads the head of a PNG or JPEG.
pub(crate) fn head(bytes: &[u8], limit: u64) -> Result<Head, Unreadable> {
    let decoder = reader(bytes, limit).into_decoder()?;
    let (width, height) = decoder.dimensions();
    Ok(Head { width: width as usize, height: height as usize, colour: decoder.color_type() })
}

/// Depth counts of a 16-bit grey PNG.
pub(crate) fn depth(bytes: &[u8], limit: u64) -> Result<DepthFrame, Unreadable> {
    match decode(bytes, limit)? {
        DynamicImage::ImageLuma16(image) => Ok(DepthFrame {
            width: image.width() as usize,
            height: image.height() as usize,
            values: Values::Counts(image.into_raw()),
        }),
        other => Err(unfit(&other, "16-bit grey (L16)")),
    }
}

/// The colours of an 8-bit image; an alpha channel is dropped.
pub(crate) fn colour(bytes: &[u8], limit: u64) -> Result<ColourImage, Unreadable> {
    let image = match decode(bytes, limit)? {
        image @ (DynamicImage::ImageRgb8(_) | DynamicImage::ImageRgba8(_)) => image.into_rgb8(),
        other => {
            return Err(unfit(
                &other,
                "16-bit grey for a depth, 8-bit colour (Rgb8) for a colour image",
            ));
        }
    };
    let (width, height) = (image.width() as usize, image.height() as usize);
    ColourImage::new(width, height, image.into_raw())
        .map_err(|error| Fault::new("the pixels", error.to_string(), "three bytes each").into())
}

fn unfit(image: &DynamicImage, allowed: &str) -> Unreadable {
    Fault::new("the pixels", format!("{:?}", image.color()), allowed).into()
}

fn decode(bytes: &[u8], limit: u64) -> Result<DynamicImage, Unreadable> {
    let decoder = reader(bytes, limit).into_decoder()?;
    let needed = decoder.total_bytes();
    if needed > limit {
        let (width, height) = decoder.dimensions();
        let found = format!("{needed} bytes for {width}x{height} pixels");
        let allowed = format!("at most {limit} bytes, from an image file of {}", bytes.len());
        return Err(Fault::new("the unpacked image", found, allowed).into());
    }
    Ok(DynamicImage::from_decoder(decoder)?)
}

fn reader(bytes: &[u8], limit: u64) -> ImageReader<Cursor<&[u8]>> {
    let format = match bytes {
        [0xff, 0xd8, 0xff, ..] => ImageFormat::Jpeg,
        // Whatever is no PNG is refused as a damaged one.
        _ => ImageFormat::Png,
    };
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    limits.max_alloc = Some(limit);
    reader.limits(limits);
    reader
}
