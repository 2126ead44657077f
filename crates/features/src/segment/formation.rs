//! The points of a formation and how they were found.

use nalgebra::{Vector2, Vector3};

use super::levelled::Levelled;
use super::part::Part;
use super::settings::side_of;
use super::shape::{self, Shape};
use crate::error::FeatureError;
use crate::plane::PlaneFit;

/// The points of a formation and how they were found.
#[derive(Debug, Clone, PartialEq)]
pub struct Formation {
    /// Points of the grains `[m]`: ground at z = 0, z up, centroid at x = y = 0.
    pub points: Vec<Vector3<f64>>,
    /// Which pixels the points are, row by row, shape [height · width].
    pub mask: Vec<bool>,
    /// Columns of the mask `[px]`, after down-sampling.
    pub width: usize,
    /// Rows of the mask `[px]`, after down-sampling.
    pub height: usize,
    /// Height above the fitted ground `[m]` of every pixel, not only of the grains, row by row, shape
    /// [height · width]; `None` = no data.
    pub heights: Vec<Option<f64>>,
    /// The ground in the frame of the input, normal towards the camera.
    pub plane: PlaneFit,
    /// Robust standard deviation of the ground about its plane `[m]`.
    pub ground_sd: f64,
    /// Pixels that carry data, within the border.
    pub valid_count: usize,
    /// Share of the square of ground that was asked for which the image shows `[-]`; none without one.
    pub shown: Option<f64>,
    /// Whether the image shows more, which was cut off.
    pub is_cropped: bool,
    /// Patches of grains beyond it, which were left out.
    pub left_out: Vec<Part>,
    /// Pixels taken for grains.
    pub masked_count: usize,
    /// Height above the ground from which a pixel counts as grain `[m]`; not applied when a colour
    /// decides.
    pub threshold: f64,
    /// Whether a colour decides which pixels are grain.
    pub is_by_colour: bool,
    /// Where the centroid was in the levelled frame, before it was moved to 0 `[m]`.
    pub centroid: Vector2<f64>,
    /// Volume between the ground and the surface of the grains' pixels `[m³]`; what is hidden under
    /// an overhang counts as grain.
    pub volume: f64,
    /// Pile or ring.
    pub shape: Shape,
    /// The factor by which the image was down-sampled.
    pub downsample: usize,
    /// Width of a pixel on the ground, along x and y `[m/px]`.
    pub resolution: (f64, f64),
}

impl Levelled {
    /// The points of the grains, centred.
    ///
    /// # Errors
    /// `EmptyMask` on a flat bed.
    pub fn into_formation(self) -> Result<Formation, FeatureError> {
        let masked = || self.pixels.iter().zip(0..).filter(|(pixel, _)| self.mask[**pixel]);
        let mut points: Vec<_> = masked().map(|(_, i)| self.points[i]).collect();
        if points.is_empty() {
            let highest = self.points.iter().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max);
            let (along_x, along_y) = self.resolution;
            let extent = (along_x * self.width as f64, along_y * self.height as f64);
            let Self { valid_count: valid, threshold, above_count: above, cleaned, .. } = self;
            return Err(FeatureError::EmptyMask {
                valid,
                highest,
                threshold,
                above,
                cleaned,
                extent: Some(Box::new(extent)),
            });
        }
        let volume = masked().map(|(_, i): (_, usize)| self.volumes[i]).sum();
        let shape = shape::of(&self);
        let centroid = centre(&mut points);
        Ok(Formation {
            masked_count: points.len(),
            points,
            mask: self.mask,
            heights: self.heights,
            width: self.width,
            height: self.height,
            plane: self.plane,
            ground_sd: self.ground_sd,
            valid_count: self.valid_count,
            shown: self.shown,
            is_cropped: self.is_cropped,
            left_out: self.left_out,
            threshold: self.threshold,
            is_by_colour: self.is_by_colour,
            centroid,
            volume,
            shape,
            downsample: self.downsample,
            resolution: self.resolution,
        })
    }
}

impl Formation {
    /// Side of a pixel on the ground `[m]`, the root of its area: what diagnostic statistics take for the spacing of
    /// points, as they do of a pour.
    pub fn spacing(&self) -> f64 {
        side_of(self.resolution)
    }
}

/// Moves the points' centroid to x = y = 0 and returns where it was.
fn centre(points: &mut [Vector3<f64>]) -> Vector2<f64> {
    let centroid = points.iter().map(Vector3::xy).sum::<Vector2<f64>>() / points.len() as f64;
    for point in points {
        point.x -= centroid.x;
        point.y -= centroid.y;
    }
    centroid
}
