//! What of a formation is flatter than grains are: a mat, a ruler, a marker that was left in view.

use super::component::patches;
use super::formation::Formation;
use super::part::Part;

/// Standard deviation of heights about a pixel, over a grain's diameter, below which it is flat; the noise of the
/// ground comes on top, and tells nothing where it is more than that. Of 60 pours of the default prior, seen with noise
/// of 0.05 diameters and pixels of 0.3 to 1.4, none had more than 3 such pixels together.
const FLAT: f64 = 0.06;
/// Width of what is looked at about a pixel, over a grain's diameter: a grain's own top is flat.
const ABOUT: f64 = 0.6;
/// Flat pixels together that no grains make.
const LEAST_PIXELS: usize = 9;

impl Formation {
    /// The parts of it that are flat where grains of `diameter` `[m]` would be uneven, and more than a few of them.
    pub fn flat_parts(&self, diameter: f64) -> Vec<Part> {
        let tolerance = FLAT * diameter;
        if self.ground_sd > tolerance {
            return Vec::new();
        }
        let most = tolerance * tolerance + self.ground_sd * self.ground_sd;
        let reach = |pixel: f64| ((ABOUT * diameter / pixel).ceil() as usize).max(1);
        let about = (reach(self.resolution.0), reach(self.resolution.1));
        let is_flat = |pixel| self.variance_about(pixel, about).is_some_and(|got| got < most);
        let flat: Vec<bool> = (0..self.mask.len()).map(is_flat).collect();
        let parts = patches(&flat, self.width).into_iter();
        let wide = parts.filter(|patch| patch.len() >= LEAST_PIXELS).map(|patch| self.part(&patch));
        wide.filter(|part| part.is_many(diameter)).collect()
    }

    /// Variance of the heights about a pixel, so many to each side `[m²]`; none if one of them is no grain.
    fn variance_about(&self, pixel: usize, (across, down): (usize, usize)) -> Option<f64> {
        let (u, v) = (pixel % self.width, pixel / self.width);
        let (left, top) = (u.checked_sub(across)?, v.checked_sub(down)?);
        if u + across >= self.width || v + down >= self.height {
            return None;
        }
        let (mut count, mut mean, mut squares) = (0.0, 0.0, 0.0);
        for row in top..=v + down {
            for at in row * self.width + left..=row * self.width + u + across {
                let height = self.heights[at].filter(|_| self.mask[at])?;
                count += 1.0;
                let off = height - mean;
                mean += off / count;
                squares += off * (height - mean);
            }
        }
        Some(squares / (count - 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Stream;
    use crate::{HeightMap, Segmentation, Threshold, segment_height_map};

    const DIAMETER: f64 = 4e-3;
    const SIDE: usize = 90;

    /// A square of grains side by side, noise, and what `height` adds at a place `[m]`.
    fn seen(step: f64, noise: f64, height: impl Fn(f64, f64) -> f64) -> Formation {
        let mut stream = Stream::new(5);
        let mut z = Vec::new();
        for pixel in 0..SIDE * SIDE {
            let [x, y] = [pixel % SIDE, pixel / SIDE].map(|at| step * (at as f64 - 44.3));
            // Rows of grains, each shifted against the one before.
            let (row, v) = ((y / DIAMETER).floor(), (y / DIAMETER).rem_euclid(1.0) - 0.5);
            let u = (x / DIAMETER + 0.38 * row).rem_euclid(1.0) - 0.5;
            let top = 0.5 * DIAMETER + DIAMETER * (0.25 - u * u - v * v).max(0.0).sqrt();
            let grain = if x.abs().max(y.abs()) < 20.0 * step { top } else { 0.0 };
            z.push(grain.max(height(x, y)) + noise * (stream.uniform() - 0.5) * 12_f64.sqrt());
        }
        let map = HeightMap::new(SIDE, SIDE, step, step, z).unwrap();
        let height_threshold = Threshold::Absolute(1e-3);
        let settings = Segmentation { height_threshold, ..Segmentation::default() };
        segment_height_map(&map, &settings).unwrap()
    }

    #[test]
    fn a_ruler_is_flat_and_grains_are_not() {
        for step in [0.7e-3, 1.3e-3, 3.7e-3] {
            for noise in [0.0, 1.5e-4] {
                assert_eq!(
                    seen(step, noise, |_, _| 0.0).flat_parts(DIAMETER),
                    [],
                    "{step} {noise}"
                );
            }
        }
        for (step, noise) in [(1.3e-3_f64, 0.0), (1.3e-3, 1.5e-4), (3.7e-3, 0.0), (3.7e-3, 1.5e-4)]
        {
            let (length, width) = (60.0 * step, 8.0 * step.max(1.5e-3));
            let ruler = |x: f64, y: f64| {
                let is_on = x.abs() < 0.5 * length && (0.0..width).contains(&(y - 25.0 * step));
                if is_on { 3e-3 } else { 0.0 }
            };
            let [found] = seen(step, noise, ruler).flat_parts(DIAMETER)[..] else {
                panic!("{step} {noise}")
            };
            // A window about a pixel of its edge is not all on it.
            let share = found.volume / (length * width * 3e-3);
            assert!((0.4..1.0).contains(&share), "{share} {step} {noise}");
            assert!((found.height - 3e-3).abs() < 6e-4, "{found:?}");
        }
        // Noise of more than a twentieth of a grain hides it.
        let noisy = seen(3.7e-3, 5e-4, |_, y| if y > 0.1 { 3e-3 } else { 0.0 });
        assert_eq!(noisy.flat_parts(DIAMETER), []);
    }
}
