//! Messages of ROS, versions 1 and 2: they differ in how they are packed, not in what they say.
//!
//! Reference: the definitions of `sensor_msgs`, `geometry_msgs` and `std_msgs` in common_msgs
//! (ROS 1) and common_interfaces (ROS 2).

use std::borrow::Cow;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use super::facts::Lens;
use super::picture::{Picture, Pixels};
use super::pixels::Raw;
use super::wire::Wire;
use crate::fault::Fault;

/// `sensor_msgs/Image`.
pub(super) fn image(mut wire: Wire<'_>) -> Result<Picture<'_>, Fault> {
    let frame_id = wire.header()?.to_owned();
    let (height, width) = (wire.u32("height")?, wire.u32("width")?);
    let encoding = wire.text("encoding")?.to_owned();
    let is_big_endian = wire.u8("is_bigendian")? != 0;
    let step = wire.u32("step")?;
    let data = Cow::Borrowed(wire.bytes("data")?);
    let pixels = Pixels::Raw(Raw { width, height, encoding, is_big_endian, step, data });
    Ok(Picture { frame_id, pixels })
}

/// `sensor_msgs/CompressedImage`.
pub(super) fn compressed(mut wire: Wire<'_>) -> Result<Picture<'_>, Fault> {
    let frame_id = wire.header()?.to_owned();
    let format = wire.text("format")?.to_owned();
    let data = Cow::Borrowed(wire.bytes("data")?);
    Ok(Picture { frame_id, pixels: Pixels::Compressed { format, data } })
}

/// `sensor_msgs/CameraInfo`, as far as its projection.
pub(super) fn lens(mut wire: Wire<'_>) -> Result<Lens, Fault> {
    let frame_id = wire.header()?.to_owned();
    let (height, width) = (wire.u32("height")?, wire.u32("width")?);
    wire.text("distortion_model")?;
    let distortion = wire.f64_list("D")?;
    let k = wire.f64s("K")?;
    wire.f64s::<9>("R")?;
    let p = wire.f64s("P")?;
    Ok(Lens { frame_id, width, height, distortion, k, p })
}

/// `geometry_msgs/Transform`.
pub(super) fn transform(mut wire: Wire<'_>) -> Result<Isometry3<f64>, Fault> {
    let [x, y, z] = wire.f64s("translation")?;
    let [i, j, k, w] = wire.f64s("rotation")?;
    let turn = UnitQuaternion::try_new(Quaternion::new(w, i, j, k), f64::EPSILON);
    let is_finite = [x, y, z, i, j, k, w].iter().all(|value| value.is_finite());
    match turn {
        Some(turn) if is_finite => Ok(Isometry3::from_parts(Translation3::new(x, y, z), turn)),
        _ => {
            let found = format!("({x}, {y}, {z}), ({i}, {j}, {k}, {w})");
            Err(Fault::new("the transform", found, "finite, with a quaternion that is not zero"))
        }
    }
}
