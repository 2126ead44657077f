//! What the messages of a recording say: pictures, lenses, units, poses.
//!
//! Which kind a message is stands in the name of its schema, how it is serialised in the encoding of
//! its channel. Kinds that a recording needs nothing of are [`Kind::Other`].

mod compressed;
mod facts;
mod foxglove;
mod picture;
mod pixels;
mod ros;
mod wire;

use nalgebra::Isometry3;

use crate::fault::Fault;
use crate::message_file::Channel;
pub(crate) use facts::{Lens, PictureFacts, Shows};
pub(crate) use picture::Picture;

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
