//! Is an observation inside the model? Its residual at the best fit, against held-out simulations.
//!
//! With Q the squared length of the residual in units of the noise and r the residuals of the single statistics, the
//! smaller p-value of Q and max |r|, ranked among those of held-out pairs, is itself ranked among theirs. For several
//! pours of one material the held-out residuals are bootstrapped: the share that pours have each for themselves is
//! averaged over as many of them, the share that they have in common is taken from one, and what the emulator does not
//! know of its means is drawn. `python/granulcal/bayessim/check/misfit.py` has the derivation.

use std::fmt;

use rayon::prelude::*;

use crate::ModelError;
use crate::best_fit::{BestFit, Fit, Pooled};
use crate::emulator::Prediction;
use crate::likelihood::averaging_share;
use crate::matrix::{Matrix, dot};
use crate::random::Random;
use crate::tensors::Tensors;

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

/// Residuals of held-out pairs: what an observation of a right model can leave.
#[derive(Clone, Debug)]
pub struct MisfitReference {
    /// Squared length, residual and noise of held-out pairs.
    squares: Vec<f64>,
    residuals: Matrix,
    own_noise: Matrix,
    /// Whether the noise is in standard deviations where its pair is; models of before have it as it is.
    is_unit: bool,
}

impl MisfitReference {
    /// Those of a model of `s` statistics.
    ///
    /// # Errors
    /// [`ModelError::Content`] for arrays that are missing, of another shape, not finite, or of no pair.
    pub fn read(tensors: &Tensors<'_>, s: usize) -> Result<Self, ModelError> {
        let residuals = tensors.rows("misfit_residuals", None, Some(s))?;
        let rows = residuals.rows();
        let unit_noise = tensors.matrix_if_there("misfit_unit_noise", rows, s)?;
        let is_unit = unit_noise.is_some();
        let own_noise = match unit_noise {
            Some(noise) => noise,
            None => tensors.rows("misfit_noise", None, Some(s))?,
        };
        let squares = tensors.take("misfit_squares", &[rows])?;
        if squares.is_empty() || own_noise.rows() == 0 {
            return Err(tensors.unfit("misfit_squares", "of at least one pair", "none"));
        }
        Ok(Self { squares, residuals, own_noise, is_unit })
    }

    /// The test of pours that are standardised without being moved into the training range.
    pub(crate) fn test(&self, fit: &BestFit, z: &[Vec<f64>], names: &[String]) -> Misfit {
        let y: Vec<_> = z.iter().map(|row| fit.axes.after(row)).collect();
        let pours = y.len() as f64;
        let size = fit.axes.columns;
        let mean: Vec<_> =
            (0..size).map(|j| y.iter().map(|row| row[j]).sum::<f64>() / pours).collect();
        // Which share of the noise is the pours' own is asked once, at the best cell.
        let nearest = fit.predict(fit.nearest(&mean, Pooled { pours, share: 1.0 }));
        let spread = |j: usize| y.iter().map(|row| (row[j] - mean[j]).powi(2)).sum::<f64>();
        let variance: Vec<_> = (0..size).map(|j| spread(j) / (pours - 1.0).max(1.0)).collect();
        let noise = Prediction::of(&nearest).noise;
        let pooled = Pooled { pours, share: averaging_share(pours, &variance, noise) };
        let best = fit.of(&mean, pooled);
        let replicates = (z.len() > 1).then(|| self.replicates(fit, &best.u, z.len(), pooled));
        let (null_squares, null_residuals) = match &replicates {
            Some((squares, residuals)) => (squares, residuals),
            None => (&self.squares, &self.residuals),
        };
        let left = fit.back.after(&best.left);
        compared(names, z.len(), best.square, &left, null_squares, null_residuals)
    }

    /// Squared lengths and residuals of sets of pours at `u`.
    fn replicates(
        &self,
        fit: &BestFit,
        u: &[f64],
        pours: usize,
        pooled: Pooled,
    ) -> (Vec<f64>, Matrix) {
        let (mut random, size) = (Random::new(0), fit.axes.columns);
        let here = fit.predict(u);
        let here = Prediction::of(&here);
        let shared = 1.0 - pooled.share / (fit.widening * fit.widening);
        // The noise of pairs from the whole prior, as large as it is here.
        let scale = |j: usize| if self.is_unit { here.noise[j].sqrt() } else { 1.0 };
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
                let unknown = |j: usize| here.unknown[j].sqrt() * dot(fit.root.row(j), &normal);
                (0..size)
                    .map(|j| {
                        let noise = (1.0 - shared).sqrt() * own[j] + shared.sqrt() * common[j];
                        scale(j) * noise + unknown(j)
                    })
                    .collect()
            })
            .collect();
        // A fit near u is no better than the best one: false alarms can only become fewer.
        let fits: Vec<_> = errors
            .par_iter()
            .map(|error| {
                let mean: Vec<_> = here.means.iter().zip(error).map(|(m, e)| m + e).collect();
                let Fit { square, left, .. } = fit.improved(u.to_vec(), &mean, pooled);
                (square, fit.back.after(&left))
            })
            .collect();
        let (squares, residuals): (Vec<_>, Vec<_>) = fits.into_iter().unzip();
        (squares, Matrix { data: residuals.concat(), columns: size })
    }
}

/// P-values of a fit among those of the model itself.
fn compared(
    names: &[String],
    pours: usize,
    square: f64,
    left: &[f64],
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
    let sizes: Vec<_> = left.iter().zip(&spread).map(|(left, sd)| left / sd).collect();
    let largest =
        |row: &[f64]| row.iter().zip(&spread).map(|(r, sd)| (r / sd).abs()).fold(0.0, f64::max);
    let null_largest: Vec<_> = (0..count).map(|i| largest(null_residuals.row(i))).collect();
    let joint_p_value = p_value(null_squares, square);
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

/// Rank among values of the model itself.
fn p_value(null: &[f64], observed: f64) -> f64 {
    (1 + null.iter().filter(|&&value| value >= observed).count()) as f64 / (1 + null.len()) as f64
}
