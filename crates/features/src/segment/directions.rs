//! The directions in which a formation's volume lies: how much longer it is than wide, and how far aside of the image's
//! middle.

use nalgebra::Vector2;

use super::formation::Formation;

impl Formation {
    /// Length of the mean of exp(2 i phi) over the volume, with phi the direction from its middle `[-]`: 0 of what is
    /// round, square or regular otherwise, (s - 1)/(s + 1) of that stretched by s, 1 of a line.
    ///
    /// Whatever its profile, few grains that have rolled far turn it no further than grains nearby. Of n grains that
    /// lie independently of each other, in any direction alike, it is above t with the chance exp(-n t²).
    pub fn elongation(&self) -> f64 {
        let weights = || self.points.iter().map(|point| (point.xy(), point.z.max(0.0)));
        let all: f64 = weights().map(|(_, weight)| weight).sum();
        let middle = weights().map(|(at, weight)| weight * at).sum::<Vector2<f64>>() / all;
        let of_one = |(at, weight): (Vector2<f64>, f64)| {
            let Some(way) = (at - middle).try_normalize(0.0) else { return Vector2::zeros() };
            weight * Vector2::new(way.x * way.x - way.y * way.y, 2.0 * way.x * way.y)
        };
        // Nothing above the ground has no direction.
        if all > 0.0 { weights().map(of_one).sum::<Vector2<f64>>().norm() / all } else { 0.0 }
    }

    /// Length of the mean of exp(i phi) over the volume, with phi the direction from the middle of the image `[-]`: 0
    /// of what lies evenly about it, whatever of it has left the image, 1 of what lies on one side. Of n grains that
    /// lie independently of each other it is above t with the chance exp(-n t²).
    pub fn lopsidedness(&self) -> f64 {
        let middle = 0.5 * Vector2::new((self.width - 1) as f64, (self.height - 1) as f64);
        let (mut sum, mut all) = (Vector2::zeros(), 0.0);
        for pixel in (0..self.mask.len()).filter(|&pixel| self.mask[pixel]) {
            let at = Vector2::new((pixel % self.width) as f64, (pixel / self.width) as f64);
            let weight = self.heights[pixel].unwrap_or(0.0).max(0.0);
            let pixel = Vector2::new(self.resolution.0, self.resolution.1);
            let way = (at - middle).component_mul(&pixel).try_normalize(0.0);
            sum += weight * way.unwrap_or_else(Vector2::zeros);
            all += weight;
        }
        if all > 0.0 { sum.norm() / all } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use crate::{Formation, HeightMap, Segmentation, Threshold, segment_height_map};

    /// A heap stretched by `stretch` along a direction, or one with a square foot, on 1 mm pixels.
    fn heap(stretch: f64, turn: f64, is_square: bool) -> Formation {
        let at = |pixel: usize| {
            let (x, y) = ((pixel % 160) as f64 - 79.3, (pixel / 160) as f64 - 80.1);
            let (along, across) =
                (x * turn.cos() + y * turn.sin(), y * turn.cos() - x * turn.sin());
            let (u, v) = (along / stretch.sqrt(), across * stretch.sqrt());
            let away = if is_square { u.abs().max(v.abs()) } else { u.hypot(v) };
            (0.02 * (1.0 - away / 35.0)).max(0.0)
        };
        let map = HeightMap::new(160, 160, 1e-3, 1e-3, (0..160 * 160).map(at).collect()).unwrap();
        let height_threshold = Threshold::Absolute(1e-6);
        let settings = Segmentation { height_threshold, ..Segmentation::default() };
        segment_height_map(&map, &settings).unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]
        #[test]
        fn it_is_that_of_the_stretch_in_any_direction(stretch in 1.0..2.5_f64, turn in 0.0..3.1_f64) {
            let expected = (stretch - 1.0) / (stretch + 1.0);
            let found = heap(stretch, turn, false).elongation();
            prop_assert!((found - expected).abs() < 0.01, "{} {}", found, expected);
        }
    }

    #[test]
    fn what_lies_aside_of_the_images_middle_is_known() {
        let seen = |columns: std::ops::Range<usize>| {
            let whole = heap(1.0, 0.0, false);
            let width = columns.len();
            let at =
                |pixel: usize| whole.heights[pixel / width * 160 + columns.start + pixel % width];
            let z = (0..width * 160).map(|pixel| at(pixel).unwrap()).collect();
            let map = HeightMap::new(width, 160, 1e-3, 1e-3, z).unwrap();
            let height_threshold = Threshold::Absolute(1e-6);
            let settings = Segmentation { height_threshold, ..Segmentation::default() };
            segment_height_map(&map, &settings).unwrap().lopsidedness()
        };
        assert!(seen(0..160) < 0.05 && seen(60..100) < 0.1, "{}", seen(60..100));
        // Half of it, at the edge: directions from the image's middle are one.
        assert!(seen(80..160) > 0.6, "{}", seen(80..160));
    }

    #[test]
    fn a_square_foot_is_not_long() {
        assert!(heap(1.0, 0.4, true).elongation() < 0.01);
    }
}
