//! What the prior is multiplied by to become the posterior: a likelihood, or its geometric average with a
//! network's posterior.

use std::sync::Arc;

use rayon::prelude::*;

use crate::average::Average;
use crate::coordinates::Coordinates;
use crate::importance::Importance;
use crate::likelihood::{FEWEST_EFFECTIVE, Likelihood, Observed, Scratch};
use crate::mixture::Mixture;
use crate::random::Random;

/// A point whose weight is that much below another's cannot matter `[nat]`.
const NEGLIGIBLE: f64 = 30.0;

/// `L(u)` of k pours, or `L^a prod (q_i/p)^(b/k)`.
pub struct Tilt<'a> {
    likelihood: &'a Likelihood,
    observed: Observed,
    network: Option<(Vec<Mixture>, Average)>,
}

impl<'a> Tilt<'a> {
    /// Of k standardised pours.
    pub fn of(likelihood: &'a Likelihood, z: &[Vec<f64>]) -> Self {
        Self { likelihood, observed: likelihood.observe(z), network: None }
    }

    /// The same with the network's mixture of each pour.
    pub fn averaged(self, mixtures: Vec<Mixture>, average: Average) -> Self {
        Self { network: Some((mixtures, average)), ..self }
    }

    /// Its logarithm at coordinates inside the bounds, up to a constant.
    pub fn log(&self, coordinates: &Coordinates, u: &[f64], scratch: &mut Scratch) -> f64 {
        self.with(coordinates, u, self.likelihood.log_prob(&self.observed, u, scratch))
    }

    /// The same times the prior.
    fn log_target(&self, coordinates: &Coordinates, u: &[f64], scratch: &mut Scratch) -> f64 {
        self.log(coordinates, u, scratch) + coordinates.log_density(u)
    }

    /// Draws of the posterior.
    pub fn sample(
        &self,
        posterior: &Importance,
        coordinates: &Coordinates,
        n: usize,
        random: &mut Random,
    ) -> Vec<Vec<f64>> {
        let log_target =
            |u: &[f64], scratch: &mut Scratch| self.log_target(coordinates, u, scratch);
        posterior.sample(n, random, coordinates, &log_target)
    }

    /// The posterior, normalised.
    pub fn posterior(&self, coordinates: &Coordinates) -> Importance {
        let pool = self.likelihood.pool(coordinates);
        let at = |scaled: &mut Vec<f64>, at| self.likelihood.at(&self.observed, at, scaled);
        let emulated: Vec<_> = pool.predictions().map_init(Vec::new, at).collect();
        let log_weights = match &self.network {
            None => emulated,
            Some((mixtures, average)) => {
                // Mixtures are dear, and nowhere above their bounds.
                let at_most = mean(mixtures, Mixture::log_bound);
                let bound = |u: &[f64], emulated: f64| {
                    let learnt = at_most - coordinates.log_density(u);
                    average.of(emulated, learnt)
                };
                let best = (0..emulated.len()).max_by(|&i, &j| emulated[i].total_cmp(&emulated[j]));
                let reached = best.map_or(f64::NEG_INFINITY, |i| {
                    self.with(coordinates, pool.points.row(i), emulated[i])
                });
                let weigh = |(i, &emulated): (usize, &f64)| {
                    let u = pool.points.row(i);
                    if bound(u, emulated) < reached - NEGLIGIBLE {
                        return f64::NEG_INFINITY;
                    }
                    self.with(coordinates, u, emulated)
                };
                emulated.par_iter().enumerate().map(weigh).collect()
            }
        };
        let found = Importance::of_prior_draws(Arc::clone(&pool.points), &log_weights, coordinates);
        if found.effective_sample_size() >= FEWEST_EFFECTIVE {
            return found;
        }
        let log_target =
            |u: &[f64], scratch: &mut Scratch| self.log_target(coordinates, u, scratch);
        let network = self.network.as_ref().map(|(mixtures, _)| Mixture::pooled(mixtures));
        found.adapted(coordinates, &log_target, network.as_ref())
    }

    fn with(&self, coordinates: &Coordinates, u: &[f64], emulated: f64) -> f64 {
        self.network.as_ref().map_or(emulated, |(mixtures, average)| {
            let learnt = mean(mixtures, |mixture| mixture.log_prob(u)) - coordinates.log_density(u);
            average.of(emulated, learnt)
        })
    }
}

fn mean(mixtures: &[Mixture], of: impl Fn(&Mixture) -> f64) -> f64 {
    mixtures.iter().map(of).sum::<f64>() / mixtures.len() as f64
}
