//! The free surface of grains that keep moving, seen from the side against a light.
//!
//! A point (x, z) of the view along y is hidden in a frame when a grain is in front of it. The mean over frames is
//! the share of time for which it is hidden, which is what a time-averaged picture of a drum shows; the surface is
//! where, from above, that share first reaches a level, half as a rule. So are the profiles of measured drums made.

use nalgebra::Vector3;

use crate::error::{FeatureError, require_in, require_length};

/// Cells of a column in a grain's radius.
const CELLS: f64 = 16.0;
/// Most cells of a column.
const MAX_CELLS: f64 = 1e6;

/// Columns of a picture from the side, and for how many frames each of their cells was hidden.
#[derive(Debug, Clone)]
pub struct Silhouette {
    x: Vec<f64>,
    bottom: f64,
    step: f64,
    cells: usize,
    hidden: Vec<u32>,
    /// The last frame in which a cell was hidden, from 1.
    last: Vec<u32>,
    frames: u32,
}

impl Silhouette {
    /// Columns at `x` (rising) `[m]` between the heights `bottom` and `top` `[m]`, with cells of a sixteenth of
    /// `radius`.
    ///
    /// # Errors
    /// `OutOfRange` for heights that hold no cell or more than a million.
    pub fn new(x: &[f64], (bottom, top): (f64, f64), radius: f64) -> Result<Self, FeatureError> {
        let step = radius / CELLS;
        let cells = ((top - bottom) / step).ceil();
        require_in("cells of a silhouette's column", cells, 1.0, MAX_CELLS)?;
        let cells = cells as usize;
        let count = cells * x.len();
        let (hidden, last) = (vec![0; count], vec![0; count]);
        Ok(Self { x: x.to_vec(), bottom, step, cells, hidden, last, frames: 0 })
    }

    /// Frames so far.
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// Adds a frame: centres and radii `[m]`.
    ///
    /// # Errors
    /// `LengthMismatch` when there is not one radius per position; nothing is added then.
    pub fn add(&mut self, positions: &[Vector3<f64>], radii: &[f64]) -> Result<(), FeatureError> {
        require_length("radii", radii.len(), positions.len())?;
        self.frames += 1;
        for (centre, &radius) in positions.iter().zip(radii) {
            let first = self.x.partition_point(|&x| x <= centre.x - radius);
            for column in first..self.x.len() {
                let off = self.x[column] - centre.x;
                if off >= radius {
                    break;
                }
                let half = (radius * radius - off * off).sqrt();
                self.hide(column, centre.z - half, centre.z + half);
            }
        }
        Ok(())
    }

    /// Hides the cells of a column whose centres are between two heights.
    fn hide(&mut self, column: usize, from: f64, to: f64) {
        let cell =
            |height: f64| ((height - self.bottom) / self.step + 0.5).floor().max(0.0) as usize;
        let (from, to) = (cell(from).min(self.cells), cell(to).min(self.cells));
        for cell in column * self.cells + from..column * self.cells + to {
            if self.last[cell] != self.frames {
                self.last[cell] = self.frames;
                self.hidden[cell] += 1;
            }
        }
    }

    /// Height of the surface in each column `[m]`: where from above the share of frames that hide first reaches
    /// `level`, linear between cells; NaN where it does nowhere, where the top of the picture is hidden so that the
    /// surface is above it, or without a frame.
    pub fn surface(&self, level: f64) -> Vec<f64> {
        self.hidden.chunks(self.cells).map(|column| self.height(column, level)).collect()
    }

    fn height(&self, column: &[u32], level: f64) -> f64 {
        let share = |cell: usize| f64::from(column[cell]) / f64::from(self.frames);
        let is_hidden = |cell: &usize| share(*cell) >= level;
        let Some(cell) = (0..self.cells).rev().find(is_hidden).filter(|_| self.frames > 0) else {
            return f64::NAN;
        };
        if cell + 1 == self.cells {
            return f64::NAN;
        }
        let beyond = (share(cell) - level) / (share(cell) - share(cell + 1));
        self.bottom + self.step * (cell as f64 + 0.5 + beyond)
    }
}

/// The angle by which a surface falls towards +x `[deg]`, by the least-squares line through its points with |x| at most
/// `within`; NaN with fewer than two, or where the surface is NaN.
///
/// # Errors
/// `LengthMismatch` when there is not one z per x.
pub fn slope_deg(x: &[f64], z: &[f64], within: f64) -> Result<f64, FeatureError> {
    require_length("z", z.len(), x.len())?;
    let points: Vec<_> = x.iter().zip(z).filter(|(x, _)| x.abs() <= within).collect();
    let mean = |of: &dyn Fn(&(&f64, &f64)) -> f64| {
        points.iter().map(of).sum::<f64>() / points.len() as f64
    };
    let (x0, z0) = (mean(&|p| *p.0), mean(&|p| *p.1));
    let covariance = mean(&|p| (p.0 - x0) * (p.1 - z0));
    Ok(-(covariance / mean(&|p| (p.0 - x0).powi(2))).atan().to_degrees())
}

#[cfg(test)]
mod tests {
    use super::*;

    const RADIUS: f64 = 1e-3;

    #[test]
    fn the_top_of_a_grain_is_found_to_a_cell() {
        let mut side = Silhouette::new(&[-6e-4, 0.0, 8e-4, 2e-3], (0.0, 0.01), RADIUS).unwrap();
        assert!(side.surface(0.5).iter().all(|z| z.is_nan()));
        side.add(&[Vector3::new(0.0, 0.5, 5e-3)], &[RADIUS]).unwrap();
        let found = side.surface(0.5);
        for (z, expected) in found.iter().zip([5.8e-3, 6e-3, 5.6e-3]) {
            assert!((z - expected).abs() <= 0.5 * RADIUS / CELLS + 1e-12, "{found:?}");
        }
        assert!(found[3].is_nan());
    }

    #[test]
    fn the_surface_is_where_frames_hide_for_half_of_the_time() {
        // A surface that rises evenly from 2 to 6 mm is above 4 mm for half of the time.
        let mut side = Silhouette::new(&[0.0], (0.0, 0.01), RADIUS).unwrap();
        for frame in 0..400 {
            let top = 2e-3 + 4e-3 * (f64::from(frame) + 0.5) / 400.0;
            let grain = |top: f64| Vector3::new(0.0, 0.0, top - RADIUS);
            side.add(&[grain(top), grain(top - 1.5e-3), grain(top - 3e-3)], &[RADIUS; 3]).unwrap();
        }
        assert!((side.surface(0.5)[0] - 4e-3).abs() < 2e-5, "{:?}", side.surface(0.5));
        assert!((side.surface(0.25)[0] - 5e-3).abs() < 2e-5, "{:?}", side.surface(0.25));
    }

    #[test]
    fn a_surface_above_the_picture_is_nowhere() {
        // Grains stand 12 mm high; the picture ends at 10 mm beside them and below the top of the lower heap.
        let mut side = Silhouette::new(&[0.0, 5e-3], (0.0, 0.01), RADIUS).unwrap();
        let heap = |x: f64, count: i32| (0..count).map(move |i| (x, 1e-3 * f64::from(2 * i + 1)));
        let grains: Vec<_> =
            heap(0.0, 6).chain(heap(5e-3, 3)).map(|(x, z)| Vector3::new(x, 0.0, z)).collect();
        side.add(&grains, &vec![RADIUS; grains.len()]).unwrap();
        let found = side.surface(0.5);
        assert!(found[0].is_nan() && (found[1] - 6e-3).abs() < 1e-4, "{found:?}");
    }

    #[test]
    fn a_grain_in_flight_is_no_surface() {
        let mut side = Silhouette::new(&[0.0], (0.0, 0.02), RADIUS).unwrap();
        for frame in 0..10 {
            let flier = Vector3::new(0.0, 0.0, 5e-3 + 1e-3 * f64::from(frame));
            side.add(&[Vector3::new(0.0, 0.0, 2e-3), flier], &[RADIUS; 2]).unwrap();
        }
        assert!((side.surface(0.5)[0] - 3e-3).abs() < 1e-4, "{:?}", side.surface(0.5));
    }

    #[test]
    fn a_frame_has_a_radius_for_each_grain() {
        let mut side = Silhouette::new(&[0.0], (0.0, 0.02), RADIUS).unwrap();
        let got = side.add(&[Vector3::zeros()], &[RADIUS; 2]);
        assert_eq!(got, Err(FeatureError::LengthMismatch { what: "radii", got: 2, expected: 1 }));
        assert_eq!(side.frames(), 0);
    }

    #[test]
    fn an_incline_has_its_angle() {
        let x: Vec<_> = (-20..=20).map(|i| 1e-3 * f64::from(i)).collect();
        let z: Vec<_> =
            x.iter().map(|x| if x.abs() <= 0.015 { 0.01 - 0.5 * x } else { 9.0 }).collect();
        assert!((slope_deg(&x, &z, 0.015).unwrap() - 0.5f64.atan().to_degrees()).abs() < 1e-9);
        assert!(slope_deg(&x[..1], &z[..1], 0.05).unwrap().is_nan());
        assert!(slope_deg(&x, &z[1..], 0.015).is_err());
    }
}
