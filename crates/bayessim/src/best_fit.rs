//! The parameters that explain statistics best, and what they leave: the best of many points of the prior, improved by
//! the steps of Gauss and Newton.

use std::sync::{Arc, OnceLock};

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::ModelError;
use crate::coordinates::Coordinates;
use crate::document::EmulatorScalars;
use crate::emulator::{Emulator, Prediction, Workings};
use crate::matrix::Matrix;
use crate::noise::Noise;
use crate::tensors::Tensors;

/// Points of the prior among which the best fit begins.
const CELLS: usize = 4096;
const STEPS: usize = 3;
const DIFFERENCE: f64 = 1e-3;

/// An emulator of all signal axes, and where to look for the best fit.
#[derive(Debug)]
pub struct BestFit {
    pub axes: Matrix,
    /// From signal axes to statistics.
    pub back: Matrix,
    /// Root of the correlation between the axes.
    pub root: Matrix,
    pub widening: f64,
    coordinates: Arc<Coordinates>,
    emulator: Emulator,
    noise: Noise,
    cells: OnceLock<Cells>,
}

/// Points of the prior, what is expected there, and the box that they fill.
#[derive(Debug)]
struct Cells {
    points: Vec<Vec<f64>>,
    rows: Matrix,
    low: Vec<f64>,
    high: Vec<f64>,
}

/// How the mean of some pours is compared: their number, and the share of the noise that is each pour's own.
#[derive(Clone, Copy)]
pub struct Pooled {
    pub pours: f64,
    pub share: f64,
}

impl Pooled {
    /// One pour, whose noise is all its own.
    pub const ONE: Self = Self { pours: 1.0, share: 1.0 };
}

/// The best fit: where, its squared length, and what it leaves of the signal axes.
pub struct Fit {
    pub u: Vec<f64>,
    pub square: f64,
    pub left: Vec<f64>,
}

impl BestFit {
    /// Of an emulator of `s` statistics.
    pub fn read(
        tensors: &Tensors<'_>,
        coordinates: &Arc<Coordinates>,
        s: usize,
        scalars: &EmulatorScalars,
        features: Option<usize>,
    ) -> Result<Self, ModelError> {
        let axes = tensors.matrix("emulator_axes", s, s)?;
        let inverse = DMatrix::from_row_slice(s, s, &axes.data).try_inverse();
        let back =
            inverse.ok_or_else(|| tensors.unfit("emulator_axes", "invertible", "singular"))?;
        let root = tensors.matrix("emulator_root", s, s)?;
        Ok(Self {
            emulator: Emulator::read(tensors, coordinates.dimension(), s, features, s)?,
            noise: Noise::new(&root, scalars.degrees),
            root,
            axes,
            // Row-major is the transposed of what nalgebra holds.
            back: Matrix { data: back.transpose().as_slice().to_vec(), columns: s },
            widening: scalars.widening,
            coordinates: Arc::clone(coordinates),
            cells: OnceLock::new(),
        })
    }

    /// The best fit to the mean of some pours on the signal axes.
    pub fn of(&self, mean: &[f64], pooled: Pooled) -> Fit {
        self.improved(self.nearest(mean, pooled).to_vec(), mean, pooled)
    }

    /// The point of the prior that fits best.
    pub fn nearest(&self, mean: &[f64], pooled: Pooled) -> &[f64] {
        let cells = self.cells();
        let rows = cells.rows.data.par_chunks_exact(cells.rows.columns);
        let squares: Vec<_> =
            rows.map(|row| self.square(Prediction::of(row), mean, pooled)).collect();
        let smallest = squares.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1));
        &cells.points[smallest.map_or(0, |(cell, _)| cell)]
    }

    /// A better fit by Gauss and Newton, from `u`.
    pub fn improved(&self, mut u: Vec<f64>, mean: &[f64], pooled: Pooled) -> Fit {
        let cells = self.cells();
        let mut row = self.predict(&u);
        let mut square = self.square(Prediction::of(&row), mean, pooled);
        for _ in 0..STEPS {
            let here = Prediction::of(&row);
            let scales = self.scales(here, pooled);
            let white = |of: &dyn Fn(usize) -> f64| {
                let scaled: Vec<_> = (0..scales.len()).map(|j| of(j) / scales[j]).collect();
                self.noise.whitened(&scaled)
            };
            let slopes: Vec<_> = (0..u.len())
                .map(|i| {
                    let mut beside = u.clone();
                    beside[i] += DIFFERENCE;
                    let there = self.predict(&beside);
                    white(&|j| (there[j] - here.means[j]) / DIFFERENCE)
                })
                .collect();
            let left = white(&|j| mean[j] - here.means[j]);
            let slopes = DMatrix::from_columns(
                &slopes.into_iter().map(DVector::from_vec).collect::<Vec<_>>(),
            );
            let Some(step) = least_squares(slopes, &DVector::from_vec(left)) else { break };
            // The emulator knows nothing beyond the prior.
            let tried: Vec<_> = (0..u.len())
                .map(|i| (u[i] + step[i]).max(cells.low[i]).min(cells.high[i]))
                .collect();
            let there = self.predict(&tried);
            let reached = self.square(Prediction::of(&there), mean, pooled);
            // Not a number is no better, either.
            if reached.is_nan() || reached >= square {
                break;
            }
            (u, row, square) = (tried, there, reached);
        }
        let left = mean.iter().zip(Prediction::of(&row).means).map(|(a, b)| a - b).collect();
        Fit { u, square, left }
    }

    /// What is expected at a point: see [`Prediction::of`].
    pub fn predict(&self, u: &[f64]) -> Vec<f64> {
        let mut row = vec![0.0; 3 * self.emulator.axis_count()];
        self.emulator.predict(u, &mut Workings::default(), &mut row);
        row
    }

    /// Squared length of what is left, in units of the noise.
    fn square(&self, at: Prediction<'_>, mean: &[f64], pooled: Pooled) -> f64 {
        let scales = self.scales(at, pooled);
        let scaled: Vec<_> =
            (0..scales.len()).map(|j| (mean[j] - at.means[j]) / scales[j]).collect();
        self.noise.whitened(&scaled).iter().map(|white| white * white).sum()
    }

    /// `sqrt(V_k)`, as in the likelihood.
    fn scales(&self, at: Prediction<'_>, pooled: Pooled) -> Vec<f64> {
        let widened = self.widening * self.widening;
        let averaged = (1.0 - 1.0 / pooled.pours) * pooled.share;
        let both = at.noise.iter().zip(at.unknown);
        both.map(|(s, h)| (widened * (s + h) - averaged * s).sqrt()).collect()
    }

    fn cells(&self) -> &Cells {
        self.cells.get_or_init(|| {
            let points = self.coordinates.quasi_prior(CELLS);
            let columns = 3 * self.emulator.axis_count();
            let mut data = vec![0.0; columns * CELLS];
            let rows = data.par_chunks_exact_mut(columns).zip(&points);
            rows.for_each_init(Workings::default, |workings, (row, u)| {
                self.emulator.predict(u, workings, row);
            });
            let edge = |i: usize, pick: fn(f64, f64) -> f64, start: f64| {
                points.iter().map(|u| u[i]).fold(start, pick)
            };
            let dimensions = 0..self.coordinates.dimension();
            let low = dimensions.clone().map(|i| edge(i, f64::min, f64::INFINITY)).collect();
            let high = dimensions.map(|i| edge(i, f64::max, f64::NEG_INFINITY)).collect();
            Cells { points, rows: Matrix { data, columns }, low, high }
        })
    }
}

fn least_squares(matrix: DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    if matrix.iter().chain(right.iter()).any(|value| !value.is_finite()) {
        return None;
    }
    let larger = matrix.nrows().max(matrix.ncols()) as f64;
    let svd = matrix.svd(true, true);
    let cut = larger * f64::EPSILON * svd.singular_values.max();
    svd.solve(right, cut).ok()
}
