//! Distribution of the free parameters after one or several pours.

use std::fmt;
use std::sync::Arc;

use granulcal_numbers::short;
use rayon::prelude::*;

use crate::ModelError;
use crate::average::{Average, Form};
use crate::coordinates::Coordinates;
use crate::emulated::Emulated;
use crate::identifiability::{self, Identifiability};
use crate::importance::Importance;
use crate::likelihood::{FEWEST_EFFECTIVE, Scratch};
use crate::log_ratio::LogRatio;
use crate::matrix::log_sum_exp;
use crate::mixture::{Mixture, TruncatedMixture};
use crate::mode;
use crate::random::{KeepGoing, Random};

/// Draws among which the search for the mode begins.
const MODE_DRAWS: usize = 1000;
/// Odds against one shared material from which pours are said to contradict each other.
const LEAST_ODDS: f64 = 20.0;

/// What a reader must know before trusting the numbers.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Warning {
    /// A statistic lies beyond those of the training data.
    OutOfRange {
        /// Index of the pour.
        pour: usize,
        /// The statistic.
        name: String,
        /// What was observed, own unit.
        value: f64,
        /// Lowest training value.
        low: f64,
        /// Highest training value.
        high: f64,
    },
    /// Nearly all mass of the network's mixture lies outside the prior.
    MassOutsidePrior {
        /// Index of the pour.
        pour: usize,
        /// Share inside before truncation.
        inside: f64,
    },
    /// The weighted draws are worth few independent ones.
    FewEffectiveDraws {
        /// How many.
        effective: f64,
        /// Fewer than this are told.
        needed: f64,
    },
    /// One material explains the pours much worse than a material for each would.
    PoursDisagree {
        /// Log evidence of one material against several `[nat]`.
        log_evidence_ratio: f64,
        /// Less than this is told.
        needed: f64,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OutOfRange { pour, name, value, low, high } => write!(
                f,
                "pour {pour} is outside the training range: {name} = {} (trained on {} .. {})",
                short(*value),
                short(*low),
                short(*high)
            ),
            Self::MassOutsidePrior { pour, inside } => {
                write!(f, "pour {pour}: only {inside:.2} of the network's mass is inside the prior")
            }
            Self::FewEffectiveDraws { effective, needed } => write!(
                f,
                "the posterior is worth {effective:.0} draws only, at least {needed:.0} are wanted: it is a small part of the \
                 prior, or pours that were given together are of different materials"
            ),
            Self::PoursDisagree { log_evidence_ratio, needed } => write!(
                f,
                "the pours contradict each other: log evidence of one material against several is \
                 {log_evidence_ratio:.1}, told below {needed:.1}"
            ),
        }
    }
}

/// One parameter alone.
#[derive(Clone, Debug, PartialEq)]
pub struct Marginal {
    /// Path of the parameter.
    pub name: String,
    /// Mean, own unit.
    pub mean: f64,
    /// Median, own unit.
    pub median: f64,
    /// Central 90 % interval, own unit.
    pub interval90: (f64, f64),
}

/// How draws come from weighted ones.
#[derive(Clone, Copy)]
enum Draws {
    /// Those that weigh most several times: enough to begin a climb from.
    Resampled,
    /// Each then walks, so that hardly any two are the same.
    Walked,
}

/// A posterior as weighted draws: prior times ratio, normalised.
struct Weighted {
    ratio: LogRatio,
    density: Importance,
}

impl Weighted {
    fn of(ratio: LogRatio) -> Self {
        Self { density: ratio.posterior(), ratio }
    }

    fn log_prob(&self, coordinates: &Coordinates, u: &[f64]) -> f64 {
        if !coordinates.is_inside(u) {
            return f64::NEG_INFINITY;
        }
        let ratio = self.ratio.log(u, &mut Scratch::default());
        ratio + coordinates.log_density(u) - self.density.log_normaliser
    }

    fn sample(
        &self,
        n: usize,
        random: &mut Random,
        draws: Draws,
        keep_going: &KeepGoing<'_>,
    ) -> Option<Vec<Vec<f64>>> {
        match draws {
            Draws::Resampled => Some(self.density.resample(n, random)),
            Draws::Walked => self.ratio.sample(&self.density, n, random, keep_going),
        }
    }
}

/// Where a posterior comes from.
enum Source {
    /// The emulator, alone or in a geometric average with the network; or networks' posteriors of several pours.
    Weighted(Weighted),
    /// The network alone, of one pour.
    Learnt(TruncatedMixture),
    /// The arithmetic average of both, and the weight of the first.
    Sum(Weighted, TruncatedMixture, f64),
}

/// What is known of one material: its standardised pours under one or several conditions, and what a network says of
/// each pour.
pub struct Evidence {
    /// Emulator of each condition and its pours, standardised.
    pub conditions: Vec<(Emulated, Vec<Vec<f64>>)>,
    /// The network's mixture of each pour over coordinates; none where there is no network.
    pub mixtures: Vec<Mixture>,
    /// How much both count.
    pub average: Average,
}

/// A normalised density over the parameters, in own units, zero outside the prior's bounds.
pub struct Posterior {
    coordinates: Arc<Coordinates>,
    source: Source,
    /// What to know before trusting it.
    pub warnings: Vec<Warning>,
}

// Derived, these would print thousands of draws.
impl fmt::Debug for Evidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let pours: Vec<_> = self.conditions.iter().map(|(_, pours)| pours.len()).collect();
        f.debug_struct("Evidence")
            .field("pours", &pours)
            .field("mixtures", &self.mixtures.len())
            .field("average", &self.average)
            .finish_non_exhaustive()
    }
}

impl fmt::Debug for Posterior {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let source = match self.source {
            Source::Weighted(_) => "Weighted",
            Source::Learnt(_) => "Learnt",
            Source::Sum(..) => "Sum",
        };
        f.debug_struct("Posterior")
            .field("names", &self.names())
            .field("source", &source)
            .field("warnings", &self.warnings)
            .finish_non_exhaustive()
    }
}

impl Posterior {
    /// The posterior of one material.
    ///
    /// Under the emulator several pours have one likelihood. A network's posteriors of k pours count as much as its
    /// weight b says, `prod (q_i / p)^(b / k)`: together as one at b = 1, because their error is the same in all. At
    /// b = k they are multiplied and the prior is divided out all but once, which is right of exact ones. An arithmetic
    /// average is of one pour: several are the emulator's alone.
    pub fn of(coordinates: &Arc<Coordinates>, evidence: Evidence) -> Self {
        let Evidence { conditions, mut mixtures, average } = evidence;
        let is_sum = average.form == Form::Arithmetic && average.emulator > 0.0;
        if average.network == 0.0 || (is_sum && mixtures.len() > 1) {
            mixtures.clear();
        }
        let mut warnings = Vec::new();
        let cut = |mixture| TruncatedMixture::cut(coordinates, mixture);
        let mut learnt: Vec<_> = mixtures.into_iter().map(cut).collect();
        for (pour, cut) in learnt.iter().enumerate().filter(|(_, cut)| cut.is_mostly_outside()) {
            warnings.push(Warning::MassOutsidePrior { pour, inside: cut.log_mass.exp() });
        }
        let log_masses: f64 = learnt.iter().map(|cut| cut.log_mass).sum();
        let is_product =
            average.emulator == 0.0 && learnt.len() > 1 && average.network == learnt.len() as f64;
        let conditions: Vec<_> = if average.emulator > 0.0 || learnt.is_empty() {
            conditions.into_iter().map(|(emulated, z)| (emulated.likelihood, z)).collect()
        } else {
            Vec::new()
        };
        let ratio = LogRatio::of(coordinates, &conditions);
        let all =
            |learnt: Vec<TruncatedMixture>| learnt.into_iter().map(|cut| cut.mixture).collect();
        let source = if learnt.is_empty() {
            Source::Weighted(Weighted::of(ratio))
        } else if average.emulator == 0.0 && learnt.len() == 1 {
            Source::Learnt(learnt.remove(0))
        } else if is_sum {
            Source::Sum(Weighted::of(ratio), learnt.remove(0), average.emulator)
        } else {
            Source::Weighted(Weighted::of(ratio.averaged(all(learnt), average)))
        };
        if let (true, Source::Weighted(weighted)) = (is_product, &source) {
            let (found, needed) = (weighted.density.log_normaliser - log_masses, -LEAST_ODDS.ln());
            if found < needed {
                warnings.push(Warning::PoursDisagree { log_evidence_ratio: found, needed });
            }
        }
        if let Source::Weighted(weighted) | Source::Sum(weighted, ..) = &source {
            let (effective, needed) = (weighted.density.effective_sample_size(), FEWEST_EFFECTIVE);
            if effective < needed {
                warnings.push(Warning::FewEffectiveDraws { effective, needed });
            }
        }
        Self { coordinates: Arc::clone(coordinates), source, warnings }
    }

    /// Paths of the parameters.
    pub fn names(&self) -> &[String] {
        self.coordinates.names()
    }

    /// Log density at parameters in own units; minus infinity outside the prior's bounds.
    ///
    /// # Errors
    /// [`ModelError::Argument`] for another number of parameters, or a NaN.
    pub fn log_prob(&self, theta: &[f64]) -> Result<f64, ModelError> {
        self.coordinates.require_point("the parameters", theta)?;
        let density = self.log_density(&self.coordinates.of_values(theta));
        // Where there is none, the slope of a logarithm may be no number.
        let is_none = density == f64::NEG_INFINITY;
        Ok(if is_none { density } else { density + self.coordinates.log_slope(theta) })
    }

    /// Log density of the prior's coordinates; minus infinity outside the bounds.
    ///
    /// # Errors
    /// As [`Posterior::log_prob`].
    pub fn coordinate_log_prob(&self, u: &[f64]) -> Result<f64, ModelError> {
        self.coordinates.require_point("the coordinates", u)?;
        Ok(self.log_density(u))
    }

    /// The same of a point of the right dimension.
    fn log_density(&self, u: &[f64]) -> f64 {
        let coordinates = &self.coordinates;
        match &self.source {
            Source::Weighted(weighted) => weighted.log_prob(coordinates, u),
            Source::Learnt(learnt) => learnt.log_prob(coordinates, u),
            Source::Sum(weighted, learnt, weight) => log_sum_exp(
                [
                    weight.ln() + weighted.log_prob(coordinates, u),
                    (1.0 - weight).ln() + learnt.log_prob(coordinates, u),
                ]
                .into_iter(),
            ),
        }
    }

    /// The same at each of many.
    ///
    /// # Errors
    /// As [`Posterior::log_prob`], of the first that is refused.
    pub fn coordinate_log_probs(&self, u: &[Vec<f64>]) -> Result<Vec<f64>, ModelError> {
        u.iter().try_for_each(|u| self.coordinates.require_point("the coordinates", u))?;
        Ok(u.par_iter().map(|u| self.log_density(u)).collect())
    }

    /// Number of independent draws that the weighted ones are worth; `None` where no draw is weighted.
    pub fn effective_sample_size(&self) -> Option<f64> {
        match &self.source {
            Source::Learnt(_) => None,
            Source::Weighted(weighted) | Source::Sum(weighted, ..) => {
                Some(weighted.density.effective_sample_size())
            }
        }
    }

    /// `n` draws in own units; the same seed gives the same draws on any number of threads.
    pub fn sample(&self, n: usize, seed: u64) -> Vec<Vec<f64>> {
        self.coordinate_sample(n, seed).iter().map(|u| self.coordinates.values(u)).collect()
    }

    /// The parameters of highest density in coordinates, in own units; always the same.
    pub fn mode(&self) -> Vec<f64> {
        self.coordinates.values(&self.coordinate_mode())
    }

    /// The coordinates of highest density; always the same.
    pub fn coordinate_mode(&self) -> Vec<f64> {
        let draws = self.draws(MODE_DRAWS, 0, Draws::Resampled);
        mode::climb(&self.coordinates, |u| self.log_density(u), &draws)
    }

    /// `n` draws of the coordinates.
    pub fn coordinate_sample(&self, n: usize, seed: u64) -> Vec<Vec<f64>> {
        self.draws(n, seed, Draws::Walked)
    }

    /// The same, or none where `keep_going` gives up; it is asked every some thousand draws.
    pub fn coordinate_sample_while(
        &self,
        n: usize,
        seed: u64,
        keep_going: &dyn Fn() -> bool,
    ) -> Option<Vec<Vec<f64>>> {
        self.draws_while(n, seed, Draws::Walked, keep_going)
    }

    /// What it knows of the parameters.
    pub fn identifiability(&self) -> Identifiability {
        let draws = self.draws(identifiability::DRAWS, 0, Draws::Walked);
        Identifiability::of(&self.coordinates, &draws)
    }

    /// The same, and the covariance in spreads of the prior, row by row.
    pub fn knowledge(&self) -> (Identifiability, Vec<Vec<f64>>) {
        let draws = self.draws(identifiability::DRAWS, 0, Draws::Walked);
        let covariance = identifiability::covariance(&self.coordinates, &draws);
        let rows = covariance.row_iter().map(|row| row.iter().copied().collect()).collect();
        (Identifiability::of(&self.coordinates, &draws), rows)
    }

    fn draws(&self, n: usize, seed: u64, kind: Draws) -> Vec<Vec<f64>> {
        // What goes on always gives all.
        self.draws_while(n, seed, kind, &|| true).unwrap_or_default()
    }

    fn draws_while(
        &self,
        n: usize,
        seed: u64,
        kind: Draws,
        keep_going: &KeepGoing<'_>,
    ) -> Option<Vec<Vec<f64>>> {
        let (coordinates, mut random) = (&self.coordinates, Random::new(seed));
        match &self.source {
            Source::Weighted(weighted) => weighted.sample(n, &mut random, kind, keep_going),
            Source::Learnt(learnt) => learnt.sample(coordinates, n, &mut random, keep_going),
            Source::Sum(weighted, learnt, weight) => {
                let of_first: Vec<_> = (0..n).map(|_| random.uniform() < *weight).collect();
                let count = of_first.iter().filter(|&&is_first| is_first).count();
                let first = weighted.sample(count, &mut random, kind, keep_going)?;
                let second = learnt.sample(coordinates, n - count, &mut random, keep_going)?;
                let (mut first, mut second) = (first.into_iter(), second.into_iter());
                // In random order: any of them are draws of both.
                let draw = |is_first| if is_first { first.next() } else { second.next() };
                Some(of_first.into_iter().filter_map(draw).collect())
            }
        }
    }

    /// Mean, median and central interval of each parameter.
    ///
    /// # Errors
    /// [`ModelError::Argument`] for no draws.
    pub fn marginals(&self, draws: usize, seed: u64) -> Result<Vec<Marginal>, ModelError> {
        if draws == 0 {
            let (what, allowed) = ("the number of draws", "at least 1".to_owned());
            return Err(ModelError::Argument { what, allowed, found: "0".to_owned() });
        }
        // The draws that `sample` gives, so that an interval is one of them.
        let values = self.sample(draws, seed);
        let marginal = |(i, name): (usize, &String)| {
            let mut column: Vec<_> = values.iter().map(|row| row[i]).collect();
            column.sort_by(f64::total_cmp);
            let at = |share: f64| column[((column.len() - 1) as f64 * share).round() as usize];
            Marginal {
                name: name.clone(),
                mean: column.iter().sum::<f64>() / column.len() as f64,
                median: at(0.5),
                interval90: (at(0.05), at(0.95)),
            }
        };
        Ok(self.names().iter().enumerate().map(marginal).collect())
    }
}
