//! Heights on a regular grid, as a time-of-flight rig or a laser scanner delivers them.

use nalgebra::Vector3;

use crate::camera::MAX_SIDE_PX;
use crate::depth::decimate;
use crate::error::{FeatureError, require_in, require_length};

/// Pixels are equally wide where they differ by less than this share: by the digits in a file, not by the camera.
/// Over a thousand pixels it is a tenth of one.
const SAME_RESOLUTION: f64 = 1e-4;

/// Height above a datum on a regular grid, seen without perspective.
#[derive(Debug, Clone, PartialEq)]
pub struct HeightMap {
    /// Columns `[px]`.
    pub width: usize,
    /// Rows `[px]`.
    pub height: usize,
    /// Distance between columns `[m/px]`.
    pub resolution_x: f64,
    /// Distance between rows `[m/px]`.
    pub resolution_y: f64,
    /// Height `[m]`, row by row, shape [height · width]; NaN = no data.
    pub z: Vec<f64>,
}

impl HeightMap {
    /// A map of the given size.
    ///
    /// # Errors
    /// `OutOfRange` for an empty map or a resolution that is not positive, `LengthMismatch` when
    /// `z` has not width · height values.
    pub fn new(
        width: usize,
        height: usize,
        resolution_x: f64,
        resolution_y: f64,
        z: Vec<f64>,
    ) -> Result<Self, FeatureError> {
        let map = Self { width, height, resolution_x, resolution_y, z };
        map.require_valid()?;
        Ok(map)
    }

    /// Height of pixel (u, v) `[m]`; NaN = no data, also outside the map.
    pub fn at(&self, u: usize, v: usize) -> f64 {
        if u < self.width && v < self.height {
            self.z.get(v * self.width + u).copied().unwrap_or(f64::NAN)
        } else {
            f64::NAN
        }
    }

    /// The point of pixel (u, v): x grows with the column, y with the row, and the middle of the
    /// map is x = y = 0 `[m]`.
    pub fn point(&self, u: usize, v: usize) -> Vector3<f64> {
        Vector3::new(
            (u as f64 + 0.5 - 0.5 * self.width as f64) * self.resolution_x,
            (v as f64 + 0.5 - 0.5 * self.height as f64) * self.resolution_y,
            self.at(u, v),
        )
    }

    /// The points of all pixels that carry data `[m]`, row by row.
    pub fn to_points(&self) -> Vec<Vector3<f64>> {
        (0..self.height)
            .flat_map(|v| (0..self.width).map(move |u| self.point(u, v)))
            .filter(|point| point.z.is_finite())
            .collect()
    }

    /// These heights less those of another map of the same ground; NaN where either has no data.
    ///
    /// # Errors
    /// `SizeMismatch` for a map of another size, `OutOfRange` for one whose pixels are not as wide.
    pub fn less(&self, other: &Self) -> Result<Self, FeatureError> {
        self.require_valid()?;
        other.require_valid()?;
        let (got, expected) = ((other.width, other.height), (self.width, self.height));
        if got != expected {
            return Err(FeatureError::SizeMismatch { what: "the other map", got, expected });
        }
        for (what, got, own) in [
            ("resolution_x of the other map [m/px]", other.resolution_x, self.resolution_x),
            ("resolution_y of the other map [m/px]", other.resolution_y, self.resolution_y),
        ] {
            let (min, max) = (own * (1.0 - SAME_RESOLUTION), own * (1.0 + SAME_RESOLUTION));
            require_in(what, got, min, max)?;
        }
        let z = self.z.iter().zip(&other.z).map(|(mine, theirs)| mine - theirs).collect();
        Self::new(self.width, self.height, self.resolution_x, self.resolution_y, z)
    }

    /// Keeps the middle pixel of every n × n block, as [`crate::DepthImage::downsample`] does.
    ///
    /// # Errors
    /// `DownsampleFactor` when no pixel would be left.
    pub fn downsample(&self, n: usize) -> Result<Self, FeatureError> {
        self.require_valid()?;
        let z = decimate(&self.z, self.width, self.height, n)?;
        Self::new(
            self.width / n,
            self.height / n,
            self.resolution_x * n as f64,
            self.resolution_y * n as f64,
            z,
        )
    }

    /// Refuses a map whose public fields contradict each other.
    ///
    /// # Errors
    /// `OutOfRange` for a size or a resolution that no map has, `LengthMismatch` for heights that are not one a pixel.
    pub fn require_valid(&self) -> Result<(), FeatureError> {
        Self::require_geometry(self.width, self.height, self.resolution_x, self.resolution_y)?;
        require_length("z", self.z.len(), self.width * self.height)
    }

    /// Refuses a size or a resolution that no map can have.
    pub(crate) fn require_geometry(
        width: usize,
        height: usize,
        resolution_x: f64,
        resolution_y: f64,
    ) -> Result<(), FeatureError> {
        require_in("map width [px]", width as f64, 1.0, MAX_SIDE_PX as f64)?;
        require_in("map height [px]", height as f64, 1.0, MAX_SIDE_PX as f64)?;
        require_in("resolution_x [m/px]", resolution_x, 1e-9, 1e3)?;
        require_in("resolution_y [m/px]", resolution_y, 1e-9, 1e3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_centred_and_skip_missing_data() {
        let map = HeightMap::new(2, 1, 0.01, 0.02, vec![0.5, f64::NAN]).unwrap();
        assert_eq!(map.to_points(), [Vector3::new(-0.005, 0.0, 0.5)]);
    }

    #[test]
    fn maps_of_two_grids_are_not_taken_from_each_other() {
        let map = |width, height, resolution| {
            HeightMap::new(width, height, resolution, 0.01, vec![0.5; 6]).unwrap()
        };
        assert_eq!(map(3, 2, 0.01).less(&map(3, 2, 0.0100001)).unwrap().z, [0.0; 6]);
        let (got, expected) = ((2, 3), (3, 2));
        let refused = FeatureError::SizeMismatch { what: "the other map", got, expected };
        assert_eq!(map(3, 2, 0.01).less(&map(2, 3, 0.01)), Err(refused));
        let coarse = map(3, 2, 0.01).less(&map(3, 2, 0.02));
        assert!(matches!(coarse, Err(FeatureError::OutOfRange { got: 0.02, .. })), "{coarse:?}");
    }

    #[test]
    fn refuses_a_resolution_of_zero() {
        let got = HeightMap::new(1, 1, 0.0, 0.01, vec![0.0]);
        assert!(matches!(got, Err(FeatureError::OutOfRange { got: 0.0, .. })));
    }
}
