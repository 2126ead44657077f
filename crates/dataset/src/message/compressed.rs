//! Pictures that stand in a message as an image file.
//!
//! `compressedDepth` of ROS puts twelve bytes before its PNG: a format and two numbers A, B. Metres
//! (32FC1) are stored as inverse depth, z = A / (count - B); millimetres (16UC1) as they are.
//!
//! Reference: `compressed_depth_image_transport`, `compression_common.h` and `codec.cpp`.

use granulcal_features::ColourImage;
use image::ColorType;

use super::facts::{PictureFacts, Shows};
use crate::depth_frame::{DepthFrame, Values};
use crate::fault::Fault;
use crate::image_file::{self, Unreadable};

/// Bytes before the PNG of a `compressedDepth` image.
const HEADER: usize = 12;
/// Room for the head of an image file.
const HEAD_LIMIT: u64 = 1 << 20;

pub(super) fn facts(format: &str, data: &[u8]) -> Result<PictureFacts, Fault> {
    let file = Packed::of(format, data)?;
    let head = image_file::head(file.png, HEAD_LIMIT.max(data.len() as u64)).map_err(fault)?;
    let shows = match head.colour {
        ColorType::L16 => Shows::Depth,
        ColorType::Rgb8 | ColorType::Rgba8 => Shows::Colour,
        _ => Shows::Other,
    };
    Ok(PictureFacts {
        width: head.width,
        height: head.height,
        encoding: format.trim().to_owned(),
        shows,
    })
}

pub(super) fn depth(format: &str, data: &[u8], limit: u64) -> Result<DepthFrame, Fault> {
    let file = Packed::of(format, data)?;
    let frame = image_file::depth(file.png, limit).map_err(fault)?;
    Ok(match (file.inverse, frame.values) {
        (Some((a, b)), Values::Counts(counts)) => {
            let metres = counts.iter().map(|&count| match count {
                0 => 0.0,
                count => a / (f32::from(count) - b),
            });
            DepthFrame { values: Values::Metres(metres.collect()), ..frame }
        }
        (_, values) => DepthFrame { values, ..frame },
    })
}

pub(super) fn colour(format: &str, data: &[u8], limit: u64) -> Result<ColourImage, Fault> {
    image_file::colour(Packed::of(format, data)?.png, limit).map_err(fault)
}

/// The image file in the data, and A and B where it holds inverse depth.
struct Packed<'a> {
    png: &'a [u8],
    inverse: Option<(f32, f32)>,
}

impl<'a> Packed<'a> {
    fn of(format: &str, data: &'a [u8]) -> Result<Self, Fault> {
        if format.contains("rvl") {
            return Err(Fault::new("the format", format!("{format:?}"), "PNG or JPEG"));
        }
        if !format.contains("compressedDepth") {
            return Ok(Self { png: data, inverse: None });
        }
        let [_, _, _, _, a0, a1, a2, a3, b0, b1, b2, b3, png @ ..] = data else {
            let found = format!("{} bytes", data.len());
            return Err(Fault::new(
                "the data of compressedDepth",
                found,
                format!("over {HEADER} bytes"),
            ));
        };
        let a = f32::from_le_bytes([*a0, *a1, *a2, *a3]);
        let b = f32::from_le_bytes([*b0, *b1, *b2, *b3]);
        let inverse = format.starts_with("32FC1").then_some((a, b));
        Ok(Self { png, inverse })
    }
}

fn fault(error: Unreadable) -> Fault {
    match error {
        Unreadable::Unfit(fault) => fault,
        Unreadable::Damaged(error) => {
            Fault::new("the image file", error.to_string(), "whole PNG or JPEG")
        }
    }
}
