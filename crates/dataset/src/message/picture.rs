//! A picture of a recording: its pixels, as they are or compressed.

use std::borrow::Cow;

use granulcal_features::ColourImage;

use super::facts::PictureFacts;
use super::{compressed, pixels};
use crate::depth_frame::DepthFrame;
use crate::fault::Fault;

/// A picture, its pixels not yet read.
#[derive(Clone, Debug)]
pub(crate) struct Picture<'a> {
    /// The frame of reference that the camera stands in, empty where none is given.
    pub(crate) frame_id: String,
    pub(crate) pixels: Pixels<'a>,
}

/// The pixels of a picture.
#[derive(Clone, Debug)]
pub(crate) enum Pixels<'a> {
    /// Row by row, `step` bytes each.
    Raw(pixels::Raw<'a>),
    /// An image file.
    Compressed {
        /// As ROS and Foxglove name it: `png`, `jpeg`, `16UC1; compressedDepth png` and so on.
        format: String,
        /// Its bytes.
        data: Cow<'a, [u8]>,
    },
}

impl Picture<'_> {
    /// Size and meaning, checked as far as it costs no more than a look at the header.
    pub(crate) fn facts(&self) -> Result<PictureFacts, Fault> {
        match &self.pixels {
            Pixels::Raw(raw) => raw.facts(),
            Pixels::Compressed { format, data } => compressed::facts(format, data),
        }
    }

    /// The depth of each pixel, in counts or metres. No more than `limit` bytes are unpacked.
    pub(crate) fn depth(&self, limit: u64) -> Result<DepthFrame, Fault> {
        match &self.pixels {
            Pixels::Raw(raw) => raw.depth(),
            Pixels::Compressed { format, data } => compressed::depth(format, data, limit),
        }
    }

    /// The colour of each pixel, red, green and blue, row by row.
    pub(crate) fn colour(&self, limit: u64) -> Result<ColourImage, Fault> {
        match &self.pixels {
            Pixels::Raw(raw) => raw.colour(),
            Pixels::Compressed { format, data } => compressed::colour(format, data, limit),
        }
    }
}
