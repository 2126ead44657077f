//! How far apart the points of a formation lie.

use nalgebra::Vector3;

use super::Formation;
use crate::median::median;

impl Formation {
    /// Distance on the ground of points from neighbouring pixels `[m]`, `None` of a single point.
    ///
    /// The median over consecutive points, row by row, of their horizontal distance over the distance of
    /// their pixels: what a pixel is wide on the ground, whatever camera took the image.
    pub fn spacing(&self) -> Option<f64> {
        let pixels = self.mask.iter().enumerate().filter(|(_, is_grain)| **is_grain);
        let places = pixels.map(|(pixel, _)| {
            let (u, v) = (pixel % self.width.max(1), pixel / self.width.max(1));
            nalgebra::Vector2::new(u as f64, v as f64)
        });
        let located: Vec<_> = self.points.iter().map(Vector3::xy).zip(places).collect();
        let mut steps: Vec<f64> = located
            .windows(2)
            .map(|pair| (pair[1].0 - pair[0].0).norm() / (pair[1].1 - pair[0].1).norm())
            .collect();
        median(&mut steps)
    }
}
