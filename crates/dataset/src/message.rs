//! What the messages of a recording say: pictures, lenses, units, poses.
//!
//! Which kind a message is stands in the name of its schema, how it is serialised in the encoding of
//! its channel. Kinds that a recording needs nothing of are [`Kind::Other`].

mod compressed;
mod foxglove;
mod pixels;
mod ros;
mod wire;

use std::borrow::Cow;

use nalgebra::Isometry3;

pub(crate) use pixels::{DepthFrame, Values};

use crate::fault::Fault;
use crate::message_file::Channel;

/// What a message is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Pixels as they are.
    Image,
    /// Pixels as PNG, JPEG or the like.
    CompressedImage,
    /// Size and lens of a camera.
    Lens,
    /// A rigid transform.
    Transform,
    /// One f32.
    Float,
    /// Anything else.
    Other,
}

/// How messages are serialised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    Ros1,
    Cdr,
    Protobuf,
}

impl Kind {
    /// What the messages of a channel are about.
    pub(crate) fn of(channel: &Channel) -> Self {
        // ROS 2 puts `msg` between package and name.
        let schema = channel.schema.replacen("/msg/", "/", 1);
        match (encoding(channel), schema.as_str()) {
            (Some(Encoding::Protobuf), "foxglove.RawImage") => Self::Image,
            (Some(Encoding::Protobuf), "foxglove.CompressedImage") => Self::CompressedImage,
            (Some(Encoding::Protobuf), "foxglove.CameraCalibration") => Self::Lens,
            (Some(Encoding::Ros1 | Encoding::Cdr), name) => match name {
                "sensor_msgs/Image" => Self::Image,
                "sensor_msgs/CompressedImage" => Self::CompressedImage,
                "sensor_msgs/CameraInfo" => Self::Lens,
                "geometry_msgs/Transform" => Self::Transform,
                "std_msgs/Float32" => Self::Float,
                _ => Self::Other,
            },
            _ => Self::Other,
        }
    }
}

fn encoding(channel: &Channel) -> Option<Encoding> {
    match channel.encoding.as_str() {
        "ros1" => Some(Encoding::Ros1),
        "cdr" => Some(Encoding::Cdr),
        "protobuf" => Some(Encoding::Protobuf),
        _ => None,
    }
}

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

/// What a picture is known to be before its pixels are read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PictureFacts {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Encoding of the pixels, or the format of the compression.
    pub(crate) encoding: String,
    pub(crate) shows: Shows,
}

/// What the pixels of a picture mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shows {
    /// Counts of a unit, or metres.
    Depth,
    /// Red, green and blue.
    Colour,
    /// Neither.
    Other,
}

/// Size and lens of a camera, as ROS and Foxglove give them.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Lens {
    pub(crate) frame_id: String,
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// Coefficients of the distortion of the raw image.
    pub(crate) distortion: Vec<f64>,
    /// Lens of the raw image, 3 × 3 by rows.
    pub(crate) k: [f64; 9],
    /// Lens of the rectified image, 3 × 4 by rows.
    pub(crate) p: [f64; 12],
}

/// Reads a message of kind [`Kind::Image`] or [`Kind::CompressedImage`].
pub(crate) fn picture<'a>(channel: &Channel, data: &'a [u8]) -> Result<Picture<'a>, Fault> {
    let is_raw = Kind::of(channel) == Kind::Image;
    match encoding(channel) {
        Some(Encoding::Protobuf) if is_raw => foxglove::image(data),
        Some(Encoding::Protobuf) => foxglove::compressed(data),
        _ if is_raw => ros::image(ros_wire(channel, data)?),
        _ => ros::compressed(ros_wire(channel, data)?),
    }
}

/// Reads a message of kind [`Kind::Lens`].
pub(crate) fn lens(channel: &Channel, data: &[u8]) -> Result<Lens, Fault> {
    match encoding(channel) {
        Some(Encoding::Protobuf) => foxglove::lens(data),
        _ => ros::lens(ros_wire(channel, data)?),
    }
}

/// Reads a message of kind [`Kind::Transform`].
pub(crate) fn transform(channel: &Channel, data: &[u8]) -> Result<Isometry3<f64>, Fault> {
    ros::transform(ros_wire(channel, data)?)
}

/// Reads a message of kind [`Kind::Float`].
pub(crate) fn float(channel: &Channel, data: &[u8]) -> Result<f64, Fault> {
    ros_wire(channel, data)?.f32("data").map(f64::from)
}

fn ros_wire<'a>(channel: &Channel, data: &'a [u8]) -> Result<wire::Wire<'a>, Fault> {
    match encoding(channel) {
        Some(Encoding::Cdr) => wire::Wire::cdr(data),
        _ => Ok(wire::Wire::ros1(data)),
    }
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
    pub(crate) fn colour(&self, limit: u64) -> Result<granulcal_features::ColourImage, Fault> {
        match &self.pixels {
            Pixels::Raw(raw) => raw.colour(),
            Pixels::Compressed { format, data } => compressed::colour(format, data, limit),
        }
    }
}
