//! The surface up to which a fluid fills the grains, and its slope.
//!
//! ```text
//! h(x, y) = sum over grains of V_i / 0.6 W(x - x_i, y - y_i)
//! ```
//!
//! the thickness of what lies there if it is packed, as in shallow-water particle methods (Ata and Soulaimani,
//! International Journal for Numerical Methods in Fluids 47 (2005) 139, doi:10.1002/fld.801). W is a binomial filter,
//! with a standard deviation of 1.4 grains, on a grid of cells as wide as a typical grain. Slopes are central
//! differences between cells, interpolated linearly.

use crate::particles::Particles;

/// Solid fraction of a random packing `[-]`.
pub(crate) const PACKED: f64 = 0.6;
/// Times that the heights are filtered with 1/4, 1/2, 1/4 along either axis: half a cell squared of variance each.
const FILTERS: usize = 4;
/// Cells along an axis, at most: grains that have been thrown far must not ask for a map of the room.
const MOST: usize = 512;

/// Heights `[m]` above the ground on a grid.
#[derive(Clone, Debug)]
pub(super) struct PoreSurface {
    /// The low corner of the grid `[m]`.
    low: [f64; 2],
    cell: f64,
    counts: [usize; 2],
    heights: Vec<f64>,
}

impl PoreSurface {
    /// The surface of the grains in the scene; `radius` is that of a typical grain `[m]`.
    pub fn of(particles: &Particles, radius: f64) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for place in particles.present().map(|grain| particles.position(grain)) {
            for axis in 0..2 {
                low[axis] = low[axis].min(place[axis]);
                high[axis] = high[axis].max(place[axis]);
            }
        }
        let cell = 2.0 * radius;
        // What the filters and the differences reach on either side.
        let around = FILTERS + 2;
        let low = low.map(|low| if low.is_finite() { low - around as f64 * cell } else { 0.0 });
        let counts = [0, 1].map(|axis| {
            let cells = ((high[axis] - low[axis]) / cell).max(0.0) as usize + 1 + around;
            cells.min(MOST)
        });
        let mut surface = Self { low, cell, counts, heights: vec![0.0; counts[0] * counts[1]] };
        for grain in particles.present() {
            let (place, radius) = (particles.position(grain), particles.radius(grain));
            let thickness =
                4.0 / 3.0 * std::f64::consts::PI * radius.powi(3) / (PACKED * cell * cell);
            // Shared by the four cells whose middles are around it, so that it moves smoothly.
            let [a, b] = [0, 1].map(|axis| surface.cell_of(axis, place[axis] - 0.5 * cell));
            for (da, share_a) in [(0, 1.0 - a.fract()), (1, a.fract())] {
                for (db, share_b) in [(0, 1.0 - b.fract()), (1, b.fract())] {
                    let (a, b) = (a as usize + da, b as usize + db);
                    if a < counts[0] && b < counts[1] {
                        surface.heights[a * counts[1] + b] += share_a * share_b * thickness;
                    }
                }
            }
        }
        let mut spare = Vec::new();
        for _ in 0..FILTERS {
            surface.filter(&mut spare);
        }
        surface
    }

    /// The cell of a coordinate, in cells from the low corner.
    fn cell_of(&self, axis: usize, at: f64) -> f64 {
        let last = (self.counts[axis] - 1) as f64;
        ((at - self.low[axis]) / self.cell).clamp(0.0, last)
    }

    fn height(&self, a: isize, b: isize) -> f64 {
        let [rows, columns] = self.counts.map(|count| count as isize);
        let is_inside = (0..rows).contains(&a) && (0..columns).contains(&b);
        if is_inside { self.heights[(a * columns + b) as usize] } else { 0.0 }
    }

    /// Replaces every height by half of its own and a quarter of either neighbour's, along both axes.
    fn filter(&mut self, spare: &mut Vec<f64>) {
        let columns = self.counts[1];
        spare.clone_from(&self.heights);
        blend(spare, columns, &mut self.heights);
        spare.clone_from(&self.heights);
        for (row, filtered) in spare.chunks(columns).zip(self.heights.chunks_mut(columns)) {
            blend(row, 1, filtered);
        }
    }

    /// Slope of the surface along x and y above a point `[-]`.
    pub fn slope(&self, x: f64, y: f64) -> [f64; 2] {
        // Heights stand at the middles of cells.
        let [a, b] = [(0, x), (1, y)].map(|(axis, at)| self.cell_of(axis, at - 0.5 * self.cell));
        let (share_a, share_b) = (a.fract(), b.fract());
        let (a, b) = (a as isize, b as isize);
        let mut slope = [0.0; 2];
        for (da, weight_a) in [(0, 1.0 - share_a), (1, share_a)] {
            for (db, weight_b) in [(0, 1.0 - share_b), (1, share_b)] {
                let (a, b, weight) = (a + da, b + db, weight_a * weight_b);
                slope[0] += weight * (self.height(a + 1, b) - self.height(a - 1, b));
                slope[1] += weight * (self.height(a, b + 1) - self.height(a, b - 1));
            }
        }
        slope.map(|difference| difference / (2.0 * self.cell))
    }
}

/// Half of each height and a quarter of those `step` before and after it, of which there are none beyond the ends.
fn blend(own: &[f64], step: usize, filtered: &mut [f64]) {
    let last = own.len() - step;
    let of = |own: f64, before: f64, after: f64| 0.5 * own + 0.25 * (before + after);
    for at in 0..step {
        filtered[at] = of(own[at], 0.0, own[at + step]);
        filtered[last + at] = of(own[last + at], own[last + at - step], 0.0);
    }
    let beside = own[..last - step].iter().zip(&own[2 * step..]);
    let inner = filtered[step..last].iter_mut().zip(&own[step..last]);
    for ((filtered, &own), (&before, &after)) in inner.zip(beside) {
        *filtered = of(own, before, after);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::Row;

    #[test]
    fn a_wedge_of_grains_has_the_wedges_slope() {
        // Stacks of grains whose number falls by one from row to row.
        let (radius, mut spheres) = (2e-3, Vec::new());
        let cell = 2.0 * radius;
        for a in 0..14 {
            for b in -14..=14 {
                for c in 0..(14 - a) {
                    let [x, y, z] = [a, b, c].map(|k| cell * f64::from(k));
                    spheres.push(Row([x, y, radius + z, radius]));
                }
            }
        }
        let inverse_mass = vec![1.0; spheres.len()];
        let surface = PoreSurface::of(&Particles::new(spheres, inverse_mass, None), radius);
        // A grain a cell is a thickness of pi / 6 / 0.6 cells.
        let expected = -std::f64::consts::PI / 3.6;
        for [x, y] in [[0.03, 0.0], [0.027, -0.0071]] {
            let [along_x, along_y] = surface.slope(x, y);
            assert!(
                (along_x - expected).abs() < 1e-6 && along_y.abs() < 1e-6,
                "{along_x} {along_y}"
            );
        }
        // Far away there is nothing.
        assert_eq!(surface.slope(10.0, 10.0), [0.0, 0.0]);
    }
}
