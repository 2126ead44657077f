//! Is an observation inside the model? Its residual at the best fit, against held-out simulations.
//!
//! With Q the squared length of the residual in units of the noise and r the residuals of the single statistics, the
//! smaller p-value of Q and max |r|, ranked among those of held-out pairs, is itself ranked among theirs. For several
//! pours of one material the held-out residuals are bootstrapped: the share that pours have each for themselves is
//! averaged over as many of them, the share that they have in common is taken from one, and what the emulator does not
//! know of its means is drawn. Their scatter, `sum_ij (1 - s_j^2) (y_ij - mean_j)^2 / s_j^2`, is ranked as well: pours
//! of two materials may have the mean of a third. `python/granulcal/bayessim/check/misfit.py` has the derivation.

use std::fmt;

use rayon::prelude::*;

use crate::ModelError;
use crate::best_fit::{BestFit, Fit, Pooled};
use crate::emulator::Prediction;
use crate::likelihood::averaging_share;
use crate::matrix::{Matrix, dot};
use crate::odd_pour::OddPour;
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
    /// Of how much several pours differ from each other; none of one pour.
    pub scatter_p_value: Option<f64>,
    /// Each statistic, the largest residual first.
    pub statistics: Vec<StatisticMisfit>,
    /// A pour that lies apart from the others; no part of the p-values.
    pub odd_pour: Option<OddPour>,
}

impl Misfit {
    /// Whether the model explains the observation; wrong in 5 % of right models.
    pub fn is_inside(&self) -> bool {
        self.p_value >= SIGNIFICANCE
    }
}

impl fmt::Display for Misfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.tell(f)?;
        self.odd_pour.iter().try_for_each(|odd| write!(f, "\n{odd}"))
    }
}

impl Misfit {
    fn tell(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = match self.pours {
            1 => "this pour".to_owned(),
            count => format!("these {count} pours"),
        };
        let p = format!("{:.2}", self.p_value);
        if self.is_inside() {
            return write!(f, "inside the model: some parameters explain {what} (p = {p})");
        }
        let others = self.statistics.iter().map(|s| s.p_value).fold(self.joint_p_value, f64::min);
        if let Some(scatter) = self.scatter_p_value.filter(|&scatter| scatter <= others) {
            return write!(
                f,
                "OUTSIDE THE MODEL: {what} differ more from each other than pours of one material do (p = \
                 {scatter:.3}). The posterior below is of none of them.",
            );
        }
        let mut worst: Vec<_> =
            self.statistics.iter().filter(|s| s.p_value < SIGNIFICANCE).take(NAMED).collect();
        if worst.is_empty() {
            worst.extend(self.statistics.first());
        }
        // Beyond a million how many is no matter of digits.
        let sds = |r: f64| if r.abs() < 1e6 { format!("{r:+.1}") } else { format!("{r:+.1e}") };
        let shown: Vec<_> =
            worst.iter().map(|s| format!("{} {} sd", s.name, sds(s.residual))).collect();
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
        let left = fit.back.after(&best.left);
        let found = Left { square: best.square, residuals: &left };
        if z.len() == 1 {
            return compared(names, 1, &found, &self.squares, &self.residuals, None);
        }
        let null = self.replicates(fit, &best.u, z.len(), pooled);
        let here = fit.predict(&best.u);
        let noise = Prediction::of(&here).noise;
        let scatter = (0..size).map(|j| signal(noise[j]) * spread(j) / noise[j]).sum();
        let scatters = Some((scatter, &null.scatters[..]));
        // The noise of models of before is not in units of where its pair is.
        let unit = self.is_unit.then_some(&self.own_noise);
        let odd_pour = unit.and_then(|own| OddPour::among(&y, noise, own));
        let found = compared(names, z.len(), &found, &null.squares, &null.residuals, scatters);
        Misfit { odd_pour, ..found }
    }

    /// What sets of pours at `u` leave.
    fn replicates(&self, fit: &BestFit, u: &[f64], pours: usize, pooled: Pooled) -> Replicates {
        let (mut random, size) = (Random::new(0), fit.axes.columns);
        let here = fit.predict(u);
        let here = Prediction::of(&here);
        let shared = 1.0 - pooled.share / (fit.widening * fit.widening);
        // The noise of pairs from the whole prior, as large as it is here.
        let scale = |j: usize| if self.is_unit { here.noise[j].sqrt() } else { 1.0 };
        let weight =
            |j: usize| signal(here.noise[j]) / if self.is_unit { 1.0 } else { here.noise[j] };
        // All that is random is drawn first, so that threads may share the fits.
        let (errors, scatters): (Vec<Vec<f64>>, Vec<f64>) = (0..REPLICATES)
            .map(|_| {
                let rows: Vec<_> = (0..pours)
                    .map(|_| self.own_noise.row(random.below(self.own_noise.rows())))
                    .collect();
                let mut own = vec![0.0; size];
                for row in &rows {
                    own.iter_mut().zip(*row).for_each(|(sum, n)| *sum += n / pours as f64);
                }
                let spread = |j: usize| {
                    weight(j) * rows.iter().map(|row| (row[j] - own[j]).powi(2)).sum::<f64>()
                };
                let scatter: f64 = (0..size).map(spread).sum();
                let common = self.own_noise.row(random.below(self.own_noise.rows()));
                let normal: Vec<_> = (0..size).map(|_| random.normal()).collect();
                let unknown = |j: usize| here.unknown[j].sqrt() * dot(fit.root.row(j), &normal);
                let error = |j: usize| {
                    let noise = (1.0 - shared).sqrt() * own[j] + shared.sqrt() * common[j];
                    scale(j) * noise + unknown(j)
                };
                ((0..size).map(error).collect(), scatter)
            })
            .unzip();
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
        let residuals = Matrix { data: residuals.concat(), columns: size };
        Replicates { squares, residuals, scatters }
    }
}

/// Share of an axis' variance over the prior, 1, that its noise leaves to the parameters: where they do not show, pours
/// of two materials differ no more than those of one.
fn signal(noise: f64) -> f64 {
    (1.0 - noise).max(0.0)
}

/// What sets of pours of the model itself leave.
struct Replicates {
    /// Squared length of what each leaves at its fit.
    squares: Vec<f64>,
    /// A row of residuals for each.
    residuals: Matrix,
    /// How much the pours of each differ from each other.
    scatters: Vec<f64>,
}

/// What an observation leaves at its fit.
struct Left<'a> {
    square: f64,
    residuals: &'a [f64],
}

/// P-values of a fit among those of the model itself; of several pours with the scatter of both.
fn compared(
    names: &[String],
    pours: usize,
    found: &Left<'_>,
    null_squares: &[f64],
    null_residuals: &Matrix,
    scatters: Option<(f64, &[f64])>,
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
    let sizes: Vec<_> = found.residuals.iter().zip(&spread).map(|(left, sd)| left / sd).collect();
    let largest =
        |row: &[f64]| row.iter().zip(&spread).map(|(r, sd)| (r / sd).abs()).fold(0.0, f64::max);
    let null_largest: Vec<_> = (0..count).map(|i| largest(null_residuals.row(i))).collect();
    let joint_p_value = p_value(null_squares, found.square);
    let scatter_p_value = scatters.map(|(scatter, null)| p_value(null, scatter));
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
    // The smallest of the p-values, itself ranked among held-out pairs.
    let all = joint_p_value.min(scatter_p_value.unwrap_or(1.0));
    let smallest = statistics.iter().map(|s| s.p_value).fold(all, f64::min);
    let null = |i: usize| {
        let scatter = scatters.map_or(1.0, |(_, null)| p_value(null, null[i]));
        let largest = p_value(&null_largest, null_largest[i]);
        p_value(null_squares, null_squares[i]).min(largest).min(scatter)
    };
    let below = (0..count).filter(|&i| null(i) <= smallest).count();
    let p_value = (1 + below) as f64 / (1 + count) as f64;
    Misfit { pours, p_value, joint_p_value, scatter_p_value, statistics, odd_pour: None }
}

/// Rank among values of the model itself.
fn p_value(null: &[f64], observed: f64) -> f64 {
    (1 + null.iter().filter(|&&value| value >= observed).count()) as f64 / (1 + null.len()) as f64
}
