//! Belief about the free parameters after one or several pours.

use std::fmt;

use crate::coordinates::Coordinates;
use crate::identifiability::{self, Identifiability};
use crate::importance::Importance;
use crate::likelihood::Scratch;
use crate::matrix::log_sum_exp;
use crate::mixture::TruncatedMixture;
use crate::mode;
use crate::random::Random;
use crate::tilt::Tilt;

/// Draws among which the search for the mode begins.
const MODE_DRAWS: usize = 1000;

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
        /// Share inside before truncation.
        inside: f64,
    },
    /// The weighted draws are worth few independent ones.
    FewEffectiveDraws {
        /// How many.
        effective: f64,
    },
    /// One material explains the pours much worse than a material for each would.
    PoursDisagree {
        /// Log evidence of one material against several `[nat]`.
        log_evidence_ratio: f64,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OutOfRange { pour, name, value, low, high } => write!(
                f,
                "pour {pour} is outside the training range: {name} = {value:.4e} (trained on {low:.4e} .. {high:.4e})"
            ),
            Self::MassOutsidePrior { inside } => {
                write!(f, "only {inside:.2} of the network's mass is inside the prior")
            }
            Self::FewEffectiveDraws { effective } => {
                write!(f, "the posterior is worth {effective:.0} draws only")
            }
            Self::PoursDisagree { log_evidence_ratio } => write!(
                f,
                "the pours contradict each other: log evidence of one material against several is {log_evidence_ratio:.1}"
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
    /// Those that weigh most several times: enough for quantiles.
    Resampled,
    /// Each then walks, so that hardly any two are the same.
    Walked,
}

/// A posterior as weighted draws: prior times tilt, normalised.
pub(crate) struct Tilted<'a> {
    pub tilt: Tilt<'a>,
    pub density: Importance,
}

impl Tilted<'_> {
    fn log_prob(&self, coordinates: &Coordinates, u: &[f64]) -> f64 {
        if !coordinates.is_inside(u) {
            return f64::NEG_INFINITY;
        }
        let tilt = self.tilt.log(coordinates, u, &mut Scratch::default());
        tilt + coordinates.log_density(u) - self.density.log_normaliser
    }

    fn sample(
        &self,
        coordinates: &Coordinates,
        n: usize,
        random: &mut Random,
        draws: Draws,
    ) -> Vec<Vec<f64>> {
        match draws {
            Draws::Resampled => self.density.resample(n, random),
            Draws::Walked => self.tilt.sample(&self.density, coordinates, n, random),
        }
    }
}

/// Where a posterior comes from.
pub(crate) enum Belief<'a> {
    /// The emulator, alone or in a geometric average with the network.
    Tilted(Tilted<'a>),
    /// The network alone.
    Learnt(TruncatedMixture),
    /// The arithmetic average of both, and the weight of the first.
    Sum(Tilted<'a>, TruncatedMixture, f64),
}

/// A normalised density over the parameters, in own units, zero outside the prior's bounds.
pub struct Posterior<'a> {
    pub(crate) coordinates: &'a Coordinates,
    pub(crate) names: &'a [String],
    pub(crate) belief: Belief<'a>,
    /// What to know before trusting it.
    pub warnings: Vec<Warning>,
}

impl Posterior<'_> {
    /// Paths of the parameters.
    pub fn names(&self) -> &[String] {
        self.names
    }

    /// Log density at parameters in own units.
    pub fn log_prob(&self, theta: &[f64]) -> f64 {
        let u = self.coordinates.of_values(theta);
        self.coordinate_log_prob(&u) + self.coordinates.log_slope(theta)
    }

    /// Log density of the prior's coordinates.
    pub fn coordinate_log_prob(&self, u: &[f64]) -> f64 {
        let coordinates = self.coordinates;
        match &self.belief {
            Belief::Tilted(tilted) => tilted.log_prob(coordinates, u),
            Belief::Learnt(learnt) => learnt.log_prob(coordinates, u),
            Belief::Sum(tilted, learnt, weight) => log_sum_exp(
                [
                    weight.ln() + tilted.log_prob(coordinates, u),
                    (1.0 - weight).ln() + learnt.log_prob(coordinates, u),
                ]
                .into_iter(),
            ),
        }
    }

    /// `n` draws in own units; the same seed gives the same draws on any number of threads.
    pub fn sample(&self, n: usize, seed: u64) -> Vec<Vec<f64>> {
        self.values(n, seed, Draws::Walked)
    }

    /// The parameters of highest density in coordinates, in own units; always the same.
    pub fn mode(&self) -> Vec<f64> {
        let draws = self.draws(MODE_DRAWS, 0, Draws::Resampled);
        let best = mode::climb(self.coordinates, |u| self.coordinate_log_prob(u), &draws);
        self.coordinates.values(&best)
    }

    /// What it knows of the parameters.
    pub fn identifiability(&self) -> Identifiability {
        let draws = self.draws(identifiability::DRAWS, 0, Draws::Walked);
        Identifiability::of(self.names, self.coordinates, &draws)
    }

    fn values(&self, n: usize, seed: u64, kind: Draws) -> Vec<Vec<f64>> {
        self.draws(n, seed, kind).iter().map(|u| self.coordinates.values(u)).collect()
    }

    fn draws(&self, n: usize, seed: u64, kind: Draws) -> Vec<Vec<f64>> {
        let (coordinates, mut random) = (self.coordinates, Random::new(seed));
        match &self.belief {
            Belief::Tilted(tilted) => tilted.sample(coordinates, n, &mut random, kind),
            Belief::Learnt(learnt) => learnt.sample(coordinates, n, &mut random),
            Belief::Sum(tilted, learnt, weight) => {
                let count = (0..n).filter(|_| random.uniform() < *weight).count();
                let mut draws = tilted.sample(coordinates, count, &mut random, kind);
                draws.extend(learnt.sample(coordinates, n - count, &mut random));
                draws
            }
        }
    }

    /// Mean, median and central interval of each parameter.
    pub fn marginals(&self, draws: usize, seed: u64) -> Vec<Marginal> {
        let values = self.values(draws, seed, Draws::Resampled);
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
        self.names.iter().enumerate().map(marginal).collect()
    }
}
