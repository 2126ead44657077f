//! What a depth camera adds to an image.
//!
//! [`SensorNoise`] is the paper's: blur across the image, independent noise along the ray.
//! [`DepthSensor`] is a camera as it is fitted from flat frames by [`fit`].
//! Derived in `docs/theory/sensor.md`.

mod blur;
mod field;
pub mod fit;
mod holes;
mod observe;

pub use field::Moments;
pub use granulcal_scene::{DepthSensor, GRAZING_DEG, NoiseField, StereoSensor, TimeOfFlightSensor};
pub use observe::Observe;

use granulcal_scene::{MAX_BLUR, MAX_DEPTH_NOISE};
use serde::{Deserialize, Serialize};

use crate::depth::{DepthImage, is_valid};
use crate::error::{FeatureError, require_in};
use crate::height_map::HeightMap;
use crate::rng::Stream;

/// A depth camera's errors: first the blur, then the noise. The default is none.
///
/// The paper tests σ = 0…8 px of blur and σ = 0…4 mm of noise, one at a time.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SensorNoise {
    /// Standard deviation of the Gaussian with which the image is convolved `[px]` of the image given.
    pub blur_px: f64,
    /// Standard deviation of the independent Gaussian added to every depth `[m]`.
    pub depth_sigma: f64,
}

impl SensorNoise {
    /// The depth image that the camera would have delivered.
    ///
    /// A pixel without data has none afterwards and lends nothing to its neighbours. A depth that
    /// noise brings to 0 or below is no data. The same seed gives the same noise field whatever
    /// the image, so that two images can be compared under one noise.
    ///
    /// # Errors
    /// `OutOfRange` for a negative or absurd standard deviation, `LengthMismatch` for a broken image.
    pub fn apply(&self, image: &DepthImage, seed: u64) -> Result<DepthImage, FeatureError> {
        let image = self.apply_while(image, seed, &|| true)?;
        Ok(image.unwrap_or_else(|| unreachable!("nothing stops it")))
    }

    /// The same, or none if `keep_going`, asked at every row that is blurred, says no.
    ///
    /// # Errors
    /// As [`SensorNoise::apply`].
    pub fn apply_while(
        &self,
        image: &DepthImage,
        seed: u64,
        keep_going: &dyn Fn() -> bool,
    ) -> Result<Option<DepthImage>, FeatureError> {
        image.require_valid()?;
        let field = image
            .depth
            .iter()
            .map(|&d| if is_valid(d) { f64::from(d) } else { f64::NAN })
            .collect();
        let Some(depth) = self.disturb(field, image.width, seed, keep_going)? else {
            return Ok(None);
        };
        let depth = depth.into_iter().map(|d| if is_valid(d as f32) { d as f32 } else { 0.0 });
        DepthImage::new(image.width, image.height, depth.collect()).map(Some)
    }

    /// The height map that the rig would have delivered; heights may go below 0.
    ///
    /// # Errors
    /// As [`SensorNoise::apply`].
    pub fn apply_to_height_map(
        &self,
        map: &HeightMap,
        seed: u64,
    ) -> Result<HeightMap, FeatureError> {
        map.require_valid()?;
        let field = map.z.iter().map(|&z| if z.is_finite() { z } else { f64::NAN }).collect();
        let z = self.disturb(field, map.width, seed, &|| true)?;
        let z = z.unwrap_or_else(|| unreachable!("nothing stops it"));
        Ok(HeightMap { z, ..*map })
    }

    /// Blurs and disturbs a row-major field in which NaN is no data.
    fn disturb(
        &self,
        field: Vec<f64>,
        width: usize,
        seed: u64,
        keep_going: &dyn Fn() -> bool,
    ) -> Result<Option<Vec<f64>>, FeatureError> {
        require_in("blur_px [px]", self.blur_px, 0.0, MAX_BLUR)?;
        require_in("depth_sigma [m]", self.depth_sigma, 0.0, MAX_DEPTH_NOISE)?;
        let blurred = if self.blur_px > 0.0 {
            blur::normalised(&field, width, self.blur_px, keep_going)
        } else {
            Some(field)
        };
        let Some(mut field) = blurred else { return Ok(None) };
        if self.depth_sigma > 0.0 {
            let mut stream = Stream::new(seed);
            for value in &mut field {
                *value += self.depth_sigma * stream.normal();
            }
        }
        Ok(Some(field))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(width: usize, height: usize, depth: f32) -> DepthImage {
        DepthImage::new(width, height, vec![depth; width * height]).unwrap()
    }

    #[test]
    fn no_noise_is_the_identity() {
        let image = DepthImage::new(2, 2, vec![0.1, 0.0, 0.3, 0.4]).unwrap();
        assert_eq!(SensorNoise::default().apply(&image, 1).unwrap(), image);
    }

    #[test]
    fn depth_noise_has_its_standard_deviation_and_its_seed() {
        let noise = SensorNoise { blur_px: 0.0, depth_sigma: 0.002 };
        let image = flat(200, 200, 0.3);
        let noisy = noise.apply(&image, 5).unwrap();
        let variance = noisy.depth.iter().map(|&d| (f64::from(d) - 0.3).powi(2)).sum::<f64>() / 4e4;
        // The sd of n = 4e4 samples is known to 1/sqrt(2n) = 0.35 %.
        assert!((variance.sqrt() / 0.002 - 1.0).abs() < 0.015, "{}", variance.sqrt());
        assert_eq!(noisy, noise.apply(&image, 5).unwrap());
        assert_ne!(noisy, noise.apply(&image, 6).unwrap());
    }

    #[test]
    fn missing_data_stays_missing_and_does_not_bleed() {
        let mut image = flat(9, 9, 0.3);
        image.depth[40] = 0.0;
        let noise = SensorNoise { blur_px: 2.0, depth_sigma: 0.0 };
        let blurred = noise.apply(&image, 0).unwrap();
        for (i, &d) in blurred.depth.iter().enumerate() {
            let expected = if i == 40 { 0.0 } else { 0.3 };
            assert!((d - expected).abs() < 1e-7, "pixel {i}: {d}");
        }
        let map = HeightMap::new(2, 1, 1.0, 1.0, vec![f64::NAN, -0.1]).unwrap();
        let both = SensorNoise { blur_px: 1.0, depth_sigma: 1e-3 };
        let noisy = both.apply_to_height_map(&map, 0).unwrap();
        assert!(noisy.z[0].is_nan() && (noisy.z[1] + 0.1).abs() < 1e-2);
    }

    #[test]
    fn the_noise_field_does_not_depend_on_the_image() {
        let noise = SensorNoise { blur_px: 0.0, depth_sigma: 0.001 };
        let mut holed = flat(4, 4, 0.3);
        holed.depth[0] = 0.0;
        let (a, b) = (noise.apply(&holed, 9).unwrap(), noise.apply(&flat(4, 4, 0.3), 9).unwrap());
        assert_eq!(a.depth[1..], b.depth[1..]);
        assert_eq!(a.depth[0], 0.0);
    }

    #[test]
    fn refuses_negative_noise() {
        for (blur_px, depth_sigma) in
            [(-1.0, 0.0), (0.0, -1.0), (f64::NAN, 0.0), (0.0, f64::INFINITY)]
        {
            let noise = SensorNoise { blur_px, depth_sigma };
            assert!(matches!(
                noise.apply(&flat(2, 2, 1.0), 0),
                Err(FeatureError::OutOfRange { .. })
            ));
        }
    }
}
