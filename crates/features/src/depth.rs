//! Depth image and its down-sampling.

use crate::camera::{MAX_SIDE_PX, downsampled_size, sample_offset};
use crate::error::{FeatureError, require_in, require_length};

/// Depth along the optical axis, one number a pixel, as a RealSense delivers it.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthImage {
    /// Columns `[px]`.
    pub width: usize,
    /// Rows `[px]`.
    pub height: usize,
    /// z-depth `[m]`, row by row from the top, shape [height · width]; 0.0 = no data.
    pub depth: Vec<f32>,
}

impl DepthImage {
    /// An image of the given size.
    ///
    /// # Errors
    /// `OutOfRange` for an empty image, `LengthMismatch` when `depth` has not width · height values.
    pub fn new(width: usize, height: usize, depth: Vec<f32>) -> Result<Self, FeatureError> {
        let image = Self { width, height, depth };
        image.require_valid()?;
        Ok(image)
    }

    /// Depth of pixel (u, v) `[m]`; 0.0 = no data, also outside the image.
    pub fn at(&self, u: usize, v: usize) -> f32 {
        if u < self.width && v < self.height {
            self.depth.get(v * self.width + u).copied().unwrap_or(0.0)
        } else {
            0.0
        }
    }

    /// Keeps the middle pixel of every n × n block; a last, incomplete block is dropped.
    ///
    /// The paper says "downsampled by factor n" and no more. Decimation is the plainest reading,
    /// and the one that does no harm: a block mean or median across the edge of a grain is a
    /// depth at which there is nothing, and would lower max(z) and smear the rim of every grain.
    /// The matching camera is [`crate::Camera::downsampled`].
    ///
    /// # Errors
    /// `DownsampleFactor` when no pixel would be left.
    pub fn downsample(&self, n: usize) -> Result<Self, FeatureError> {
        self.require_valid()?;
        let depth = decimate(&self.depth, self.width, self.height, n)?;
        Ok(Self { width: self.width / n, height: self.height / n, depth })
    }

    /// Refuses an image whose public fields contradict each other.
    pub(crate) fn require_valid(&self) -> Result<(), FeatureError> {
        require_in("image width [px]", self.width as f64, 1.0, MAX_SIDE_PX as f64)?;
        require_in("image height [px]", self.height as f64, 1.0, MAX_SIDE_PX as f64)?;
        require_length("depth", self.depth.len(), self.width * self.height)
    }
}

/// Whether a depth value is a measurement.
pub(crate) fn is_valid(depth: f32) -> bool {
    depth > 0.0 && depth.is_finite()
}

/// The middle pixel of every n × n block of a row-major image.
pub(crate) fn decimate<T: Copy>(
    pixels: &[T],
    width: usize,
    height: usize,
    n: usize,
) -> Result<Vec<T>, FeatureError> {
    let (small_width, small_height) = downsampled_size(width, height, n)?;
    let offset = sample_offset(n);
    let mut kept = Vec::with_capacity(small_width * small_height);
    for row in pixels.chunks_exact(width).skip(offset).step_by(n).take(small_height) {
        kept.extend(row.iter().skip(offset).step_by(n).take(small_width).copied());
    }
    Ok(kept)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(width: usize, height: usize) -> DepthImage {
        let depth = (0..width * height).map(|i| i as f32).collect();
        DepthImage::new(width, height, depth).unwrap()
    }

    #[test]
    fn keeps_the_middle_pixel_of_each_block() {
        let small = ramp(7, 6).downsample(3).unwrap();
        assert_eq!((small.width, small.height), (2, 2));
        // Rows 1 and 4, columns 1 and 4 of an image of width 7.
        assert_eq!(small.depth, [8.0, 11.0, 29.0, 32.0]);
    }

    #[test]
    fn factor_one_is_the_identity() {
        assert_eq!(ramp(5, 4).downsample(1).unwrap(), ramp(5, 4));
    }

    #[test]
    fn refuses_a_factor_that_leaves_no_pixel() {
        for n in [0, 5] {
            let got = ramp(7, 4).downsample(n);
            assert_eq!(got, Err(FeatureError::DownsampleFactor { got: n, max: 4 }));
        }
    }

    #[test]
    fn outside_the_image_there_is_no_data() {
        assert_eq!(ramp(3, 2).at(2, 1), 5.0);
        assert_eq!(ramp(3, 2).at(3, 0), 0.0);
        assert_eq!(ramp(3, 2).at(0, 2), 0.0);
    }

    #[test]
    fn refuses_a_buffer_of_the_wrong_length() {
        let got = DepthImage::new(2, 2, vec![1.0; 3]);
        assert!(matches!(got, Err(FeatureError::LengthMismatch { got: 3, expected: 4, .. })));
    }
}
