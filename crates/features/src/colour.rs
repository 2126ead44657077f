//! Colour image and the range of colours that marks grains on dark velvet.

mod pick;

use serde::{Deserialize, Serialize};

use crate::camera::MAX_SIDE_PX;
use crate::depth::decimate;
use crate::error::{FeatureError, require_in, require_length};
pub use pick::{Picked, pick_range};

/// An 8-bit RGB image, registered to the depth image: same size, same viewpoint.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ColourImage {
    /// Columns `[px]`.
    pub width: usize,
    /// Rows `[px]`.
    pub height: usize,
    /// Red, green, blue of each pixel, row by row, shape [height · width · 3].
    pub rgb: Vec<u8>,
}

impl ColourImage {
    /// An image of the given size.
    ///
    /// # Errors
    /// `OutOfRange` for an empty image, `LengthMismatch` when `rgb` has not 3 · width · height values.
    pub fn new(width: usize, height: usize, rgb: Vec<u8>) -> Result<Self, FeatureError> {
        let image = Self { width, height, rgb };
        image.require_valid()?;
        Ok(image)
    }

    /// Colour of pixel (u, v), which must lie inside.
    fn at(&self, u: usize, v: usize) -> [u8; 3] {
        let i = 3 * (v * self.width + u);
        [self.rgb[i], self.rgb[i + 1], self.rgb[i + 2]]
    }

    /// Which pixels lie in the range, row by row.
    ///
    /// # Errors
    /// `OutOfRange` for a range whose bounds are out of order or an empty image, `LengthMismatch` for a broken one.
    pub fn mask_of(&self, range: &HsvRange) -> Result<Vec<bool>, FeatureError> {
        self.mask(range, 1)
    }

    /// Which pixels of the image down-sampled by `n` lie in the range.
    pub(crate) fn mask(&self, range: &HsvRange, n: usize) -> Result<Vec<bool>, FeatureError> {
        self.require_valid()?;
        range.require_valid()?;
        let (pixels, _) = self.rgb.as_chunks::<3>();
        let kept = decimate(pixels, self.width, self.height, n)?;
        Ok(kept.into_iter().map(|rgb| range.contains(rgb)).collect())
    }

    /// Refuses an image whose public fields contradict each other.
    pub(crate) fn require_valid(&self) -> Result<(), FeatureError> {
        require_in("colour image width [px]", self.width as f64, 1.0, MAX_SIDE_PX as f64)?;
        require_in("colour image height [px]", self.height as f64, 1.0, MAX_SIDE_PX as f64)?;
        require_length("rgb", self.rgb.len(), 3 * self.width * self.height)
    }
}

/// A range of hue, saturation and value, all bounds included.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HsvRange {
    /// First hue `[deg]`, in [0, 360].
    pub hue_min_deg: f64,
    /// Last hue `[deg]`, in [0, 360]; below the first when the range runs through red.
    pub hue_max_deg: f64,
    /// Least saturation `[-]`, in [0, 1].
    pub saturation_min: f64,
    /// Greatest saturation `[-]`, in [0, 1].
    pub saturation_max: f64,
    /// Least value `[-]`, in [0, 1]; raise it to leave out black velvet.
    pub value_min: f64,
    /// Greatest value `[-]`, in [0, 1].
    pub value_max: f64,
}

impl Default for HsvRange {
    /// Everything: a file names only the bounds that it narrows.
    fn default() -> Self {
        Self {
            hue_min_deg: 0.0,
            hue_max_deg: 360.0,
            saturation_min: 0.0,
            saturation_max: 1.0,
            value_min: 0.0,
            value_max: 1.0,
        }
    }
}

impl HsvRange {
    /// Whether a colour lies in the range; a grey has no hue and passes any hue range.
    pub fn contains(&self, rgb: [u8; 3]) -> bool {
        let (hue, saturation, value) = hsv(rgb);
        let hue_fits = hue.is_none_or(|hue| {
            if self.hue_min_deg <= self.hue_max_deg {
                (self.hue_min_deg..=self.hue_max_deg).contains(&hue)
            } else {
                hue >= self.hue_min_deg || hue <= self.hue_max_deg
            }
        });
        hue_fits
            && (self.saturation_min..=self.saturation_max).contains(&saturation)
            && (self.value_min..=self.value_max).contains(&value)
    }

    /// Refuses bounds outside their scale.
    fn require_valid(&self) -> Result<(), FeatureError> {
        require_in("hue_min_deg [deg]", self.hue_min_deg, 0.0, 360.0)?;
        require_in("hue_max_deg [deg]", self.hue_max_deg, 0.0, 360.0)?;
        require_in("saturation_max [-]", self.saturation_max, 0.0, 1.0)?;
        require_in("saturation_min [-]", self.saturation_min, 0.0, self.saturation_max)?;
        require_in("value_max [-]", self.value_max, 0.0, 1.0)?;
        require_in("value_min [-]", self.value_min, 0.0, self.value_max)
    }
}

/// Hue `[deg]` (none for a grey), saturation and value of an 8-bit colour.
///
/// # Reference
/// Smith 1978, "Color gamut transform pairs", doi:10.1145/965139.807361.
fn hsv(rgb: [u8; 3]) -> (Option<f64>, f64, f64) {
    let [r, g, b] = rgb.map(|channel| f64::from(channel) / 255.0);
    let value = r.max(g).max(b);
    let chroma = value - r.min(g).min(b);
    if chroma == 0.0 {
        return (None, 0.0, value);
    }
    let sector = if value == r {
        ((g - b) / chroma).rem_euclid(6.0)
    } else if value == g {
        (b - r) / chroma + 2.0
    } else {
        (r - g) / chroma + 4.0
    };
    (Some(60.0 * sector), chroma / value, value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pure_colours_have_their_hue() {
        for (rgb, hue) in [([255, 0, 0], 0.0), ([0, 255, 0], 120.0), ([0, 0, 255], 240.0)] {
            assert_eq!(hsv(rgb), (Some(hue), 1.0, 1.0));
        }
        assert_eq!(hsv([255, 0, 255]).0, Some(300.0));
        assert_eq!(hsv([51, 51, 51]), (None, 0.0, 0.2));
    }

    #[test]
    fn a_range_may_run_through_red() {
        let reds = HsvRange { hue_min_deg: 340.0, hue_max_deg: 20.0, ..HsvRange::default() };
        assert!(reds.contains([255, 0, 0]) && reds.contains([255, 0, 30]));
        assert!(!reds.contains([0, 255, 0]));
    }

    #[test]
    fn value_leaves_out_velvet() {
        let bright = HsvRange { value_min: 0.4, ..HsvRange::default() };
        assert!(bright.contains([200, 180, 140]) && !bright.contains([20, 20, 22]));
    }

    #[test]
    fn refuses_bad_ranges_and_buffers() {
        assert!(ColourImage::new(2, 2, vec![0; 11]).is_err());
        for (width, height) in [(0, 0), (0, 2), (2, 0), (usize::MAX, usize::MAX)] {
            let got = ColourImage::new(width, height, Vec::new());
            assert!(matches!(got, Err(FeatureError::OutOfRange { .. })), "{got:?}");
        }
        let image = ColourImage::new(1, 1, vec![0; 3]).unwrap();
        let crossed = HsvRange { value_min: 0.5, value_max: 0.4, ..HsvRange::default() };
        assert!(matches!(image.mask(&crossed, 1), Err(FeatureError::OutOfRange { .. })));
        let nan = HsvRange { hue_min_deg: f64::NAN, ..HsvRange::default() };
        assert!(image.mask(&nan, 1).is_err());
    }
}
