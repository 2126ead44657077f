//! The relief of a surface: its heights less their mean over a square about each of them. Grains and noise are left.

use std::f64::consts::{FRAC_PI_2, PI};

/// Relief `[m]` of the pixels of a part of an image, in their order.
pub(super) struct Relief(Vec<f64>);

impl Relief {
    /// Takes the mean over squares of `2 reach + 1` pixels, of what is `within`; heights there are numbers.
    pub fn of(pixels: &[(f32, bool)], width: usize, within: &[bool], reach: usize) -> Self {
        let height = |pixel: usize| f64::from(pixels[pixel].0);
        let rows = pixels.len() / width;
        // Sums and counts of all above and to the left of a corner.
        let mut sums = vec![(0.0, 0_u32); (rows + 1) * (width + 1)];
        for (pixel, _) in within.iter().enumerate().filter(|(_, is_in)| **is_in) {
            let corner = (pixel / width + 1) * (width + 1) + pixel % width + 1;
            sums[corner] = (height(pixel), 1);
        }
        for corner in 0..sums.len() {
            let (row, column) = (corner / (width + 1), corner % (width + 1));
            let before = |steps: usize, is_there: bool| {
                if is_there { sums[corner - steps] } else { (0.0, 0) }
            };
            let left = before(1, column > 0);
            let above = before(width + 1, row > 0);
            let both = before(width + 2, row > 0 && column > 0);
            let own = sums[corner];
            sums[corner] = (own.0 + left.0 + above.0 - both.0, own.1 + left.1 + above.1 - both.1);
        }
        let mean = |pixel: usize| {
            let (row, column) = (pixel / width, pixel % width);
            let (top, bottom) = (row.saturating_sub(reach), (row + reach + 1).min(rows));
            let (left, right) = (column.saturating_sub(reach), (column + reach + 1).min(width));
            let at = |row: usize, column: usize| sums[row * (width + 1) + column];
            let [a, b, c, d] = [at(bottom, right), at(top, left), at(top, right), at(bottom, left)];
            (a.0 + b.0 - c.0 - d.0) / f64::from(a.1 + b.1 - c.1 - d.1)
        };
        let inside = (0..pixels.len()).filter(|&pixel| within[pixel]);
        Self(inside.map(|pixel| height(pixel) - mean(pixel)).collect())
    }

    /// Correlation with the relief of another image of the same part, by how often both have the same sign, so that a
    /// few high steps do not decide: `sin(pi (P - 1/2))` for normal numbers (Greiner's relation). 0 of nothing.
    pub fn correlation(&self, other: &Self) -> f64 {
        let (a, b) = (&self.0, &other.0);
        let same = a.iter().zip(b).filter(|(a, b)| *a * *b > 0.0).count();
        let opposite = a.iter().zip(b).filter(|(a, b)| *a * *b < 0.0).count();
        if same + opposite == 0 {
            return 0.0;
        }
        (PI * same as f64 / (same + opposite) as f64 - FRAC_PI_2).sin()
    }
}
