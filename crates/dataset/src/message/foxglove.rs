//! Messages in Foxglove's own schemas, as protobuf.

use std::borrow::Cow;

use foxglove::Decode;
use foxglove::messages::{CameraCalibration, CompressedImage, RawImage};

use super::facts::Lens;
use super::picture::{Picture, Pixels};
use super::pixels::Raw;
use crate::fault::Fault;

fn decode<T: Decode>(name: &str, data: &[u8]) -> Result<T, Fault> {
    T::decode(data).map_err(|error| Fault::new("the message", error.to_string(), name))
}

/// `foxglove.RawImage`: its numbers are little-endian.
pub(super) fn image(data: &[u8]) -> Result<Picture<'static>, Fault> {
    let message: RawImage = decode("a foxglove.RawImage", data)?;
    let pixels = Pixels::Raw(Raw {
        width: message.width,
        height: message.height,
        encoding: message.encoding,
        is_big_endian: false,
        step: message.step,
        data: Cow::Owned(message.data.into()),
    });
    Ok(Picture { frame_id: message.frame_id, pixels })
}

/// `foxglove.CompressedImage`.
pub(super) fn compressed(data: &[u8]) -> Result<Picture<'static>, Fault> {
    let message: CompressedImage = decode("a foxglove.CompressedImage", data)?;
    let (format, data) = (message.format, Cow::Owned(message.data.into()));
    Ok(Picture { frame_id: message.frame_id, pixels: Pixels::Compressed { format, data } })
}

/// `foxglove.CameraCalibration`; a projection that is left out is zero.
pub(super) fn lens(data: &[u8]) -> Result<Lens, Fault> {
    let message: CameraCalibration = decode("a foxglove.CameraCalibration", data)?;
    let k = matrix("K", &message.k)?;
    let p = if message.p.is_empty() { [0.0; 12] } else { matrix("P", &message.p)? };
    Ok(Lens {
        frame_id: message.frame_id,
        width: message.width,
        height: message.height,
        distortion: message.d,
        k,
        p,
    })
}

fn matrix<const N: usize>(what: &str, values: &[f64]) -> Result<[f64; N], Fault> {
    values
        .try_into()
        .map_err(|_| Fault::new(what, format!("{} numbers", values.len()), format!("{N} numbers")))
}
