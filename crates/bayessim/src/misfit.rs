//! Is an observation inside the model? Its residual at the best fit, against held-out simulations: the same as Python's
//! `bayessim/check/misfit.py`, which has the derivation. For one pour the numbers are equal to rounding; for several
//! the replicates are other random draws.

use std::fmt;
use std::sync::OnceLock;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::ModelError;
use crate::coordinates::Coordinates;
use crate::document::Document;
use crate::emulator::{Emulator, Prediction, Workings};
use crate::likelihood::averaging_share;
use crate::matrix::{Matrix, dot};
use crate::noise::Noise;
use crate::random::Random;
use crate::tensors::Tensors;

/// Points of the prior among which the best fit begins.
const CELLS: usize = 4096;
const STEPS: usize = 3;
const DIFFERENCE: f64 = 1e-3;
const REPLICATES: usize = 199;
/// Smallest spread of a residual.
const LEAST_SPREAD: f64 = 1e-12;
/// A model that is right is called wrong as often as this.
pub const SIGNIFICANCE: f64 = 0.05;
/// Residuals that a message names.
const NAMED: usize = 4;

/// Residual of one statistic at the best fit.
#[derive(Clone, Debug, PartialEq)]
pub struct StatisticMisfit {
    /// The statistic.
    pub name: String,
    /// Observed less fitted, in standard deviations of held-out residuals.
    pub residual: f64,
    /// Chance of one so large among all statistics, if the model is right.
    pub p_value: f64,
}

/// Whether any parameters explain an observation.
#[derive(Clone, Debug, PartialEq)]
pub struct Misfit {
    /// Number of pours.
    pub pours: usize,
    /// Of joint and single residuals together; small if no parameters explain them.
    pub p_value: f64,
    /// Of the squared length of all residuals.
    pub joint_p_value: f64,
    /// Each statistic, the largest residual first.
    pub statistics: Vec<StatisticMisfit>,
}

impl Misfit {
    /// Whether the model explains the observation; wrong in 5 % of right models.
    pub fn is_inside(&self) -> bool {
        self.p_value >= SIGNIFICANCE
    }
}

impl fmt::Display for Misfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = match self.pours {
            1 => "this pour".to_owned(),
            count => format!("these {count} pours"),
        };
        let p = format!("{:.2}", self.p_value);
        if self.is_inside() {
            return write!(f, "inside the model: some parameters explain {what} (p = {p})");
        }
        let mut worst: Vec<_> =
            self.statistics.iter().filter(|s| s.p_value < SIGNIFICANCE).take(NAMED).collect();
        if worst.is_empty() {
            worst.extend(self.statistics.first());
        }
        let shown: Vec<_> =
            worst.iter().map(|s| format!("{} {:+.1} sd", s.name, s.residual)).collect();
        write!(
            f,
            "OUTSIDE THE MODEL: no parameters explain {what} (p = {p}); largest residuals: {}. The posterior below is \
             of the model's best compromise.",
            shown.join(", ")
        )
    }
}

/// What the test needs of a model.
#[derive(Debug)]
pub struct MisfitTest {
    axes: Matrix,
    /// From signal axes to statistics.
    back: Matrix,
    emulator: Emulator,
    noise: Noise,
    root: Matrix,
    widening: f64,
    /// Squared length, residual and noise of held-out pairs.
    squares: Vec<f64>,
    residuals: Matrix,
    own_noise: Matrix,
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
struct Pooled {
    pours: f64,
    share: f64,
}

/// The best fit.
struct Fit {
    u: Vec<f64>,
    square: f64,
    left: Vec<f64>,
}

impl MisfitTest {
    pub fn read(tensors: &Tensors, document: &Document, p: usize) -> Result<Self, ModelError> {
        let s = document.x_names.len();
        let axes = tensors.matrix("emulator_axes", s, s)?;
        let inverse = DMatrix::from_row_slice(s, s, &axes.data).try_inverse();
        let back =
            inverse.ok_or_else(|| tensors.unfit("emulator_axes", "invertible", "singular"))?;
        let root = tensors.matrix("emulator_root", s, s)?;
        let residuals = tensors.rows("misfit_residuals", None, Some(s))?;
        let own_noise = tensors.rows("misfit_noise", None, Some(s))?;
        let squares = tensors.take("misfit_squares", &[residuals.rows()])?;
        if squares.is_empty() || own_noise.rows() == 0 {
            return Err(tensors.unfit("misfit_squares", "of at least one pair", "none"));
        }
        Ok(Self {
            emulator: Emulator::read(tensors, p, s, document.config.emulator_features, s)?,
            noise: Noise::new(&root, document.emulator.degrees),
            root,
            axes,
            // Row-major is the transposed of what nalgebra holds.
            back: Matrix { data: back.transpose().as_slice().to_vec(), columns: s },
            widening: document.emulator.widening,
            squares,
            residuals,
            own_noise,
            cells: OnceLock::new(),
        })
    }

    /// The test of pours that are standardised without being moved into the training range.
    pub fn test(&self, coordinates: &Coordinates, z: &[Vec<f64>], names: &[String]) -> Misfit {
        let cells = self.cells(coordinates);
        let y: Vec<_> = z.iter().map(|row| self.axes.after(row)).collect();
        let pours = y.len() as f64;
        let size = self.axes.columns;
        let mean: Vec<_> =
            (0..size).map(|j| y.iter().map(|row| row[j]).sum::<f64>() / pours).collect();
        // Which share of the noise is the pours' own is asked once, at the best cell.
        let all_own = Pooled { pours, share: 1.0 };
        let nearest = Prediction::of(cells.rows.row(self.nearest(cells, &mean, all_own)));
        let spread = |j: usize| y.iter().map(|row| (row[j] - mean[j]).powi(2)).sum::<f64>();
        let variance: Vec<_> = (0..size).map(|j| spread(j) / (pours - 1.0).max(1.0)).collect();
        let pooled = Pooled { pours, share: averaging_share(pours, &variance, nearest.noise) };
        let start = self.nearest(cells, &mean, pooled);
        let best = self.improved(cells, cells.points[start].clone(), &mean, pooled);
        let replicates = (z.len() > 1).then(|| self.replicates(cells, &best.u, z.len(), pooled));
        let (null_squares, null_residuals) = match &replicates {
            Some((squares, residuals)) => (squares, residuals),
            None => (&self.squares, &self.residuals),
        };
        self.compared(names, z.len(), &best, null_squares, null_residuals)
    }

    /// P-values of a fit among those of the model itself.
    fn compared(
        &self,
        names: &[String],
        pours: usize,
        best: &Fit,
        null_squares: &[f64],
        null_residuals: &Matrix,
    ) -> Misfit {
        let (size, count) = (names.len(), null_squares.len());
        let column = |j: usize| (0..count).map(move |i| null_residuals.row(i)[j]);
        let spread: Vec<_> = (0..size)
            .map(|j| {
                let mean = column(j).sum::<f64>() / count as f64;
                let variance = column(j).map(|r| (r - mean).powi(2)).sum::<f64>() / count as f64;
                variance.sqrt().max(LEAST_SPREAD)
            })
            .collect();
        let sizes: Vec<_> =
            self.back.after(&best.left).iter().zip(&spread).map(|(left, sd)| left / sd).collect();
        let largest =
            |row: &[f64]| row.iter().zip(&spread).map(|(r, sd)| (r / sd).abs()).fold(0.0, f64::max);
        let null_largest: Vec<_> = (0..count).map(|i| largest(null_residuals.row(i))).collect();
        let joint_p_value = p_value(null_squares, best.square);
        let mut statistics: Vec<_> = names
            .iter()
            .zip(&sizes)
            .map(|(name, &residual)| StatisticMisfit {
                name: name.clone(),
                residual,
                p_value: p_value(&null_largest, residual.abs()),
            })
            .collect();
        statistics.sort_by(|a, b| b.residual.abs().total_cmp(&a.residual.abs()));
        // The smaller of two p-values, itself ranked among held-out pairs.
        let smallest = statistics.iter().map(|s| s.p_value).fold(joint_p_value, f64::min);
        let null = |i: usize| {
            p_value(null_squares, null_squares[i]).min(p_value(&null_largest, null_largest[i]))
        };
        let below = (0..count).filter(|&i| null(i) <= smallest).count();
        let p_value = (1 + below) as f64 / (1 + count) as f64;
        Misfit { pours, p_value, joint_p_value, statistics }
    }

    /// Squared lengths and residuals of sets of pours at `u`.
    fn replicates(
        &self,
        cells: &Cells,
        u: &[f64],
        pours: usize,
        pooled: Pooled,
    ) -> (Vec<f64>, Matrix) {
        let (mut random, size) = (Random::new(0), self.axes.columns);
        let here = self.predict(u);
        let here = Prediction::of(&here);
        let shared = 1.0 - pooled.share / (self.widening * self.widening);
        // All that is random is drawn first, so that threads may share the fits.
        let errors: Vec<Vec<f64>> = (0..REPLICATES)
            .map(|_| {
                let mut own = vec![0.0; size];
                for _ in 0..pours {
                    let row = self.own_noise.row(random.below(self.own_noise.rows()));
                    own.iter_mut().zip(row).for_each(|(sum, n)| *sum += n / pours as f64);
                }
                let common = self.own_noise.row(random.below(self.own_noise.rows()));
                let normal: Vec<_> = (0..size).map(|_| random.normal()).collect();
                let unknown = |j: usize| here.unknown[j].sqrt() * dot(self.root.row(j), &normal);
                (0..size)
                    .map(|j| {
                        (1.0 - shared).sqrt() * own[j] + shared.sqrt() * common[j] + unknown(j)
                    })
                    .collect()
            })
            .collect();
        // A fit near u is no better than the best one: false alarms can only become fewer.
        let fits: Vec<_> = errors
            .par_iter()
            .map(|error| {
                let mean: Vec<_> = here.means.iter().zip(error).map(|(m, e)| m + e).collect();
                let fit = self.improved(cells, u.to_vec(), &mean, pooled);
                (fit.square, self.back.after(&fit.left))
            })
            .collect();
        let (squares, residuals): (Vec<_>, Vec<_>) = fits.into_iter().unzip();
        (squares, Matrix { data: residuals.concat(), columns: size })
    }

    /// The cell that fits best.
    fn nearest(&self, cells: &Cells, mean: &[f64], pooled: Pooled) -> usize {
        let rows = cells.rows.data.par_chunks_exact(cells.rows.columns);
        let squares: Vec<_> =
            rows.map(|row| self.square(Prediction::of(row), mean, pooled)).collect();
        let smallest = squares.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1));
        smallest.map_or(0, |(cell, _)| cell)
    }

    /// A better fit by Gauss and Newton, from `u`.
    fn improved(&self, cells: &Cells, mut u: Vec<f64>, mean: &[f64], pooled: Pooled) -> Fit {
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

    fn predict(&self, u: &[f64]) -> Vec<f64> {
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

    fn cells(&self, coordinates: &Coordinates) -> &Cells {
        self.cells.get_or_init(|| {
            let points = coordinates.quasi_prior(CELLS);
            let columns = 3 * self.emulator.axis_count();
            let mut data = vec![0.0; columns * CELLS];
            let rows = data.par_chunks_exact_mut(columns).zip(&points);
            rows.for_each_init(Workings::default, |workings, (row, u)| {
                self.emulator.predict(u, workings, row);
            });
            let edge = |i: usize, pick: fn(f64, f64) -> f64, start: f64| {
                points.iter().map(|u| u[i]).fold(start, pick)
            };
            let dimensions = 0..coordinates.dimension();
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

/// Rank among values of the model itself.
fn p_value(null: &[f64], observed: f64) -> f64 {
    (1 + null.iter().filter(|&&value| value >= observed).count()) as f64 / (1 + null.len()) as f64
}
