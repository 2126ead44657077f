//! How much the ground is bent: a quadratic through what of it is seen.

use nalgebra::{Matrix2, SMatrix, SVector};

use super::formation::Formation;
use super::levelled::Levelled;
use crate::median::median;

/// Blocks along a side of the image whose medians the quadratic goes through: single pixels may be faults, and the
/// flanks of grains that are below the threshold.
const BLOCKS: usize = 8;
/// Share of a block that is ground, at least; less of it are the gaps between grains.
const GROUND: f64 = 0.5;
/// Blocks with ground, at least: of fewer, on one side, the rest is guessed.
const LEAST_BLOCKS: usize = 24;

impl Formation {
    /// How far the middle of the ground lies off its edges, over the shorter side of the image and in the direction in
    /// which it is bent most `[m]`, 0 of a plane; none where too little of the ground is seen.
    pub fn ground_bow(&self) -> Option<f64> {
        bow(&self.heights, &self.mask, (self.width, self.height), self.resolution)
    }
}

impl Levelled {
    /// As [`Formation::ground_bow`], of an image that may have no grain.
    pub fn ground_bow(&self) -> Option<f64> {
        bow(&self.heights, &self.mask, (self.width, self.height), self.resolution)
    }
}

fn bow(
    heights: &[Option<f64>],
    mask: &[bool],
    (width, height): (usize, usize),
    pixel: (f64, f64),
) -> Option<f64> {
    let (across, down) = (block_of(width), block_of(height));
    let mut blocks = vec![(Vec::new(), 0_usize); BLOCKS * BLOCKS];
    for (at, (seen, is_grain)) in heights.iter().zip(mask).enumerate() {
        let (all, count) = &mut blocks[down(at / width) * BLOCKS + across(at % width)];
        *count += 1;
        all.extend(seen.filter(|_| !is_grain));
    }
    // Places of the blocks' middles about that of the image, in halves of its shorter side.
    let sides = (width as f64 * pixel.0, height as f64 * pixel.1);
    let place = |block: usize, side: f64| {
        ((2 * block + 1) as f64 / BLOCKS as f64 - 1.0) * side / sides.0.min(sides.1)
    };
    let mut normal = SMatrix::<f64, 6, 6>::zeros();
    let mut right = SVector::<f64, 6>::zeros();
    let mut seen = 0;
    for (block, (mut all, count)) in blocks.into_iter().enumerate() {
        let is_ground = all.len() as f64 >= GROUND * count as f64;
        let Some(z) = median(&mut all).filter(|_| is_ground) else { continue };
        let (x, y) = (place(block % BLOCKS, sides.0), place(block / BLOCKS, sides.1));
        let row = SVector::from([1.0, x, y, x * x, x * y, y * y]);
        normal += row * row.transpose();
        right += z * row;
        seen += 1;
    }
    if seen < LEAST_BLOCKS {
        return None;
    }
    let fit = normal.cholesky()?.solve(&right);
    let bent = Matrix2::new(fit[3], 0.5 * fit[4], 0.5 * fit[4], fit[5]);
    Some(bent.symmetric_eigenvalues().amax())
}

/// The block in which a pixel of a side of so many is.
fn block_of(side: usize) -> impl Fn(usize) -> usize {
    move |pixel| pixel * BLOCKS / side.max(1)
}

#[cfg(test)]
mod tests {
    use crate::{HeightMap, Segmentation, Threshold, segment_height_map};

    /// What is found of a ground of `columns` x 80 pixels with a cone near its middle.
    fn bow(columns: usize, bend: impl Fn(f64, f64) -> f64, cone: f64) -> Option<f64> {
        let at = |pixel: usize| {
            let (x, y) = ((pixel % columns) as f64 + 0.5, (pixel / columns) as f64 + 0.5);
            let (x, y) = (x / 40.0 - columns as f64 / 80.0, y / 40.0 - 1.0);
            bend(x, y) + (0.03 * (1.0 - x.hypot(y + 0.1) / cone)).max(0.0)
        };
        let heights = (0..columns * 80).map(at).collect();
        let map = HeightMap::new(columns, 80, 2e-3, 2e-3, heights).unwrap();
        let height_threshold = Threshold::Absolute(2e-3);
        let settings = Segmentation { height_threshold, ..Segmentation::default() };
        segment_height_map(&map, &settings).unwrap().ground_bow()
    }

    #[test]
    fn it_is_how_far_the_middle_lies_off_the_edges() {
        for columns in [80, 120] {
            let near = |bend: &dyn Fn(f64, f64) -> f64, expected: f64| {
                let found = bow(columns, bend, 0.4).unwrap();
                assert!((found - expected).abs() < 0.03 * expected + 2e-6, "{found} {expected}");
            };
            near(&|x, y| 0.02 * x - 0.05 * y, 0.0);
            near(&|x, y| 5e-4 * (x * x + y * y), 5e-4);
            // Along a diagonal, and down at two edges while up at two.
            near(&|x, y| -4e-4 * (x + y) * (x + y), 8e-4);
            near(&|x, y| 3e-4 * (x * x - y * y), 3e-4);
        }
    }

    #[test]
    fn of_a_strip_of_ground_nothing_is_said() {
        let strip = |from: f64| {
            let bend = |x: f64, y: f64| {
                if x > from {
                    f64::NAN
                } else if x < y - 1.8 {
                    0.01
                } else {
                    0.0
                }
            };
            bow(80, bend, 0.1)
        };
        assert_eq!(strip(-0.5), None);
        assert!(strip(0.0).unwrap().abs() < 1e-6);
    }
}
