//! The shape of a density from weighted draws of it: normals around some of them, each as wide as the draws near it.
//!
//! Near is a window of covariance `h^2 / (1 - h^2) S` about the draw, S the covariance of all and h of Silverman's
//! rule. Seen through it a normal of covariance S has `h^2 S`, the kernel of that rule; of several peaks each has what
//! is its own, where kernels of the total covariance would be as wide as the peaks are apart.

use nalgebra::{Cholesky, DMatrix, DMatrixView, DVector};

use crate::matrix::Matrix;

/// How often a window is taken of what was seen through the one before: the first still sees other peaks.
const LOOKS: usize = 2;

/// Weighted draws, seen where their covariance is the unit.
pub struct Kernels<'a> {
    weights: &'a [f64],
    /// A column for each draw.
    draws: DMatrix<f64>,
    /// S = L L^T.
    root: DMatrix<f64>,
    /// h^2.
    square: f64,
}

impl<'a> Kernels<'a> {
    /// For `count` kernels of weighted draws; None of draws without a covariance.
    pub fn of(draws: &Matrix, weights: &'a [f64], count: usize) -> Option<Self> {
        let p = draws.columns;
        let mut points = DMatrixView::from_slice(&draws.data, p, draws.rows()).into_owned();
        let total: f64 = weights.iter().sum();
        let mut mean = DVector::zeros(p);
        for (u, weight) in points.column_iter().zip(weights) {
            mean.axpy(weight / total, &u, 1.0);
        }
        let mut covariance = DMatrix::zeros(p, p);
        for (mut u, weight) in points.column_iter_mut().zip(weights) {
            u -= &mean;
            covariance.ger(weight / total, &u, &u, 1.0);
        }
        let trace = covariance.trace();
        for i in 0..p {
            covariance[(i, i)] += 1e-12 * trace + 1e-18;
        }
        let root = Cholesky::new(covariance)?.unpack();
        if !root.solve_lower_triangular_mut(&mut points) {
            return None;
        }
        let dimension = p as f64;
        let width = (4.0 / ((dimension + 2.0) * count as f64)).powf(1.0 / (dimension + 4.0));
        Some(Self { weights, draws: points, root, square: width * width })
    }

    /// F of the precision `F F^T` of the kernel about a draw; None if rounding leaves none.
    pub fn factor(&self, centre: usize) -> Option<DMatrix<f64>> {
        let covariance = &self.root * self.near(centre) * self.root.transpose();
        Some(covariance.try_inverse().and_then(Cholesky::new)?.unpack())
    }

    /// Covariance of what is near a draw, in units of that of all.
    fn near(&self, centre: usize) -> DMatrix<f64> {
        let p = self.draws.nrows();
        let mut covariance = DMatrix::identity(p, p) * self.square;
        for _ in 0..LOOKS {
            covariance = self.seen(centre, &covariance);
        }
        covariance
    }

    /// The same through a window that leaves a normal a covariance as it was found `before`.
    fn seen(&self, centre: usize, before: &DMatrix<f64>) -> DMatrix<f64> {
        let p = self.draws.nrows();
        let Some(window) = Cholesky::new(before / (1.0 - self.square)) else {
            return before.clone();
        };
        let (mut sum, mut squares) = (0.0, 0.0);
        let (mut mean, mut covariance) = (DVector::zeros(p), DMatrix::zeros(p, p));
        let at = self.draws.column(centre);
        let (mut off, mut unit) = (DVector::zeros(p), DVector::zeros(p));
        for (u, weight) in self.draws.column_iter().zip(self.weights) {
            off.copy_from(&u);
            off -= at;
            unit.copy_from(&off);
            if !window.l_dirty().solve_lower_triangular_mut(&mut unit) {
                return before.clone();
            }
            let seen = weight * (-0.5 * unit.norm_squared()).exp();
            sum += seen;
            squares += seen * seen;
            mean.axpy(seen, &off, 1.0);
            covariance.ger(seen, &off, &off, 1.0);
        }
        mean /= sum;
        covariance /= sum;
        covariance.ger(-1.0, &mean, &mean, 1.0);
        // So many equal draws; few have a size but no shape, and hardly any not even that.
        let (count, dimension) = (sum * sum / squares, p as f64);
        let round = DMatrix::identity(p, p) * (covariance.trace() / dimension);
        let shrunk = (covariance * count + round * dimension) / (count + dimension);
        let unknown = 1.0 / (1.0 + (count / (dimension + 1.0)).powi(2));
        shrunk * (1.0 - unknown) + before * unknown
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Draws of normals of this spread about some places, one after the other.
    fn draws(places: &[[f64; 2]], spread: f64) -> Matrix {
        let mut random = Random::new(3);
        let near =
            |place: [f64; 2], random: &mut Random| place.map(|c| c + spread * random.normal());
        let all = (0..2000).flat_map(|n| near(places[n % places.len()], &mut random));
        Matrix { data: all.collect(), columns: 2 }
    }

    #[test]
    fn a_peaks_kernel_is_no_wider_than_the_peak() {
        let weights = vec![1.0; 2000];
        for (places, widest) in [(&[[0.0, 0.0]][..], 0.03), (&[[-1.0, 0.0], [1.0, 0.5]], 0.03)] {
            let draws = draws(places, 0.03);
            let kernels = Kernels::of(&draws, &weights, 60).unwrap();
            for centre in [0, 1] {
                let factor = kernels.factor(centre).unwrap();
                let precision = &factor * factor.transpose();
                let variance = precision.try_inverse().unwrap();
                for axis in 0..2 {
                    let width = variance[(axis, axis)].sqrt();
                    assert!(width > 0.3 * widest && width < 1.3 * widest, "{places:?} {width}");
                }
            }
        }
    }
}
