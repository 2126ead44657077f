//! Pixels that stand in a message as they are, and what depth comes of them.
//!
//! Reference for the names of encodings: `sensor_msgs/image_encodings.h`, ROS REP 118 (depth: 16UC1
//! in millimetres, 32FC1 in metres), foxglove.RawImage. The RealSense SDK writes its depth, Z16, as
//! `mono16`.

use std::borrow::Cow;

use granulcal_features::ColourImage;
use granulcal_features::camera::MAX_SIDE_PX;

use super::facts::{PictureFacts, Shows};
use crate::depth_frame::{DepthFrame, Values};
use crate::fault::Fault;

/// Encodings that are read, for messages.
const DEPTH: &str = "16UC1, mono16 or 32FC1";
const COLOUR: &str = "rgb8, bgr8, 8UC3, rgba8, bgra8 or 8UC4";

/// An image whose pixels stand in the message.
#[derive(Clone, Debug)]
pub(crate) struct Raw<'a> {
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) encoding: String,
    pub(crate) is_big_endian: bool,
    /// Bytes from one row to the next.
    pub(crate) step: u32,
    pub(crate) data: Cow<'a, [u8]>,
}

impl Raw<'_> {
    pub(super) fn facts(&self) -> Result<PictureFacts, Fault> {
        self.row_bytes()?;
        let shows = match self.encoding.as_str() {
            "16UC1" | "mono16" | "32FC1" => Shows::Depth,
            encoding if channels(encoding).is_some() => Shows::Colour,
            _ => Shows::Other,
        };
        Ok(PictureFacts {
            width: self.width as usize,
            height: self.height as usize,
            encoding: self.encoding.clone(),
            shows,
        })
    }

    /// Bytes of a pixel, 0 where the encoding is not known.
    fn pixel_bytes(&self) -> usize {
        match self.encoding.as_str() {
            "16UC1" | "mono16" => 2,
            "32FC1" => 4,
            other => channels(other).map_or(0, |(_, count)| count),
        }
    }

    /// Bytes of a row without its padding; size, step and data are checked to agree.
    fn row_bytes(&self) -> Result<usize, Fault> {
        let (width, height, step) = (self.width as usize, self.height as usize, self.step as usize);
        let sides = 1..=MAX_SIDE_PX;
        if !sides.contains(&width) || !sides.contains(&height) {
            let allowed = format!("1x1 to {MAX_SIDE_PX}x{MAX_SIDE_PX}");
            return Err(Fault::new("the size", format!("{width}x{height}"), allowed));
        }
        let row = width * self.pixel_bytes();
        if step < row {
            return Err(Fault::new("step", step.to_string(), format!("at least {row}")));
        }
        // The last row may come without padding.
        let needed = (height - 1).saturating_mul(step).saturating_add(row);
        if self.data.len() < needed {
            let found = format!("{} bytes", self.data.len());
            return Err(Fault::new("data", found, format!("at least {needed} bytes")));
        }
        Ok(row)
    }

    /// The rows without their padding.
    fn rows(&self) -> Result<impl Iterator<Item = &[u8]>, Fault> {
        let row = self.row_bytes()?;
        let padded = self.data.chunks((self.step as usize).max(1)).take(self.height as usize);
        Ok(padded.map(move |padded| &padded[..row]))
    }

    fn values<const N: usize, T>(&self, read: impl Fn([u8; N]) -> T) -> Result<Vec<T>, Fault> {
        let mut values = Vec::with_capacity(self.width as usize * self.height as usize);
        for row in self.rows()? {
            let (pixels, _) = row.as_chunks::<N>();
            values.extend(pixels.iter().map(|&(mut pixel)| {
                if self.is_big_endian {
                    pixel.reverse();
                }
                read(pixel)
            }));
        }
        Ok(values)
    }

    pub(super) fn depth(&self) -> Result<DepthFrame, Fault> {
        // The size is checked before anything is reserved for it.
        self.row_bytes()?;
        let values = match self.encoding.as_str() {
            "16UC1" | "mono16" => Values::Counts(self.values(u16::from_le_bytes)?),
            "32FC1" => Values::Metres(self.values(f32::from_le_bytes)?),
            other => return Err(Fault::new("the encoding", other, DEPTH)),
        };
        Ok(DepthFrame { width: self.width as usize, height: self.height as usize, values })
    }

    pub(super) fn colour(&self) -> Result<ColourImage, Fault> {
        let Some((order, count)) = channels(&self.encoding) else {
            return Err(Fault::new("the encoding", self.encoding.as_str(), COLOUR));
        };
        let (width, height) = (self.width as usize, self.height as usize);
        let rows = self.rows()?;
        let mut rgb = Vec::with_capacity(3 * width * height);
        for row in rows {
            for pixel in row.chunks_exact(count) {
                rgb.extend(order.map(|channel| pixel[channel]));
            }
        }
        ColourImage::new(width, height, rgb)
            .map_err(|error| Fault::new("the colour", error.to_string(), "three bytes a pixel"))
    }
}

/// Where red, green and blue stand in a pixel of an 8-bit encoding, and its bytes.
fn channels(encoding: &str) -> Option<([usize; 3], usize)> {
    Some(match encoding {
        "rgb8" => ([0, 1, 2], 3),
        "bgr8" | "8UC3" => ([2, 1, 0], 3),
        "rgba8" => ([0, 1, 2], 4),
        "bgra8" | "8UC4" => ([2, 1, 0], 4),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raw(encoding: &str, is_big_endian: bool, step: u32, data: &[u8]) -> Raw<'static> {
        let data = Cow::Owned(data.to_vec());
        Raw { width: 2, height: 2, encoding: encoding.to_owned(), is_big_endian, step, data }
    }

    #[test]
    fn rows_lose_their_padding_and_bytes_their_order() {
        let data = [1, 0, 2, 0, 99, 3, 0, 4, 0];
        let frame = raw("16UC1", false, 5, &data).depth().unwrap();
        assert_eq!(frame.values, Values::Counts(vec![1, 2, 3, 4]));
        let big = raw("mono16", true, 4, &[0, 1, 0, 2, 0, 3, 0, 4]).depth().unwrap();
        assert_eq!(big.values, frame.values);
        let metres: Vec<u8> =
            [0.5f32, f32::NAN, 1.0, 2.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        let Values::Metres(metres) = raw("32FC1", false, 8, &metres).depth().unwrap().values else {
            panic!("32FC1 is metres")
        };
        assert!(metres[0] == 0.5 && metres[1].is_nan());
    }

    #[test]
    fn colours_are_put_in_order() {
        let bgra = raw("bgra8", false, 8, &[3, 2, 1, 0, 6, 5, 4, 0, 9, 8, 7, 0, 12, 11, 10, 0]);
        assert_eq!(bgra.colour().unwrap().rgb, (1..=12).collect::<Vec<_>>());
        assert_eq!(bgra.facts().unwrap().shows, Shows::Colour);
        assert_eq!(raw("mono8", false, 2, &[0; 4]).facts().unwrap().shows, Shows::Other);
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let error = |raw: Raw| raw.depth().unwrap_err().to_string();
        assert!(
            error(raw("16UC1", false, 3, &[0; 8])).contains("step must be at least 4, found 3")
        );
        assert!(error(raw("16UC1", false, 4, &[0; 7])).contains("at least 8 bytes, found 7 bytes"));
        assert!(error(raw("rgb8", false, 6, &[0; 12])).contains("32FC1"));
        let huge = Raw { width: u32::MAX, height: u32::MAX, ..raw("16UC1", false, u32::MAX, &[]) };
        assert!(error(huge).contains("32768"));
        let long = Raw { height: 32768, ..raw("16UC1", false, u32::MAX, &[0; 8]) };
        assert!(error(long).contains("data must be"));
    }
}
