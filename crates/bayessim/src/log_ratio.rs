//! What the prior is multiplied by to become the posterior: likelihoods of pours under one or several conditions, their
//! geometric average with a network's posterior, or a product of networks' posteriors.

use std::sync::Arc;

use rayon::prelude::*;

use crate::average::Average;
use crate::coordinates::Coordinates;
use crate::importance::{Effort, Importance};
use crate::likelihood::{FEWEST_EFFECTIVE, Likelihood, Observed, Scratch, pool_points};
use crate::mixture::Mixture;
use crate::random::{KeepGoing, Random};

/// A point whose weight is that much below another's cannot matter `[nat]`.
const NEGLIGIBLE: f64 = 30.0;

/// `L(u)` of k pours, or `L^a prod (q_i/p)^(b/k)`.
pub struct LogRatio {
    coordinates: Arc<Coordinates>,
    conditions: Vec<(Arc<Likelihood>, Observed)>,
    network: Option<(Vec<Mixture>, Average)>,
}

impl LogRatio {
    /// Of the standardised pours under each condition; of no condition it is one.
    pub fn of(
        coordinates: &Arc<Coordinates>,
        conditions: &[(Arc<Likelihood>, Vec<Vec<f64>>)],
    ) -> Self {
        let observe = |(likelihood, z): &(Arc<Likelihood>, Vec<Vec<f64>>)| {
            (Arc::clone(likelihood), likelihood.observe(z))
        };
        Self {
            coordinates: Arc::clone(coordinates),
            conditions: conditions.iter().map(observe).collect(),
            network: None,
        }
    }

    /// The same with the network's mixture of each pour.
    pub fn averaged(self, mixtures: Vec<Mixture>, average: Average) -> Self {
        Self { network: Some((mixtures, average)), ..self }
    }

    /// Its logarithm at coordinates inside the bounds, up to a constant.
    pub fn log(&self, u: &[f64], scratch: &mut Scratch) -> f64 {
        let each = self.conditions.iter();
        let emulated = each.map(|(likelihood, seen)| likelihood.log_prob(seen, u, scratch)).sum();
        self.with(u, emulated)
    }

    /// The same times the prior.
    fn log_target(&self, u: &[f64], scratch: &mut Scratch) -> f64 {
        self.log(u, scratch) + self.coordinates.log_density(u)
    }

    /// Draws of the posterior; none where `keep_going` gives up.
    pub fn sample(
        &self,
        posterior: &Importance,
        n: usize,
        random: &mut Random,
        keep_going: &KeepGoing<'_>,
    ) -> Option<Vec<Vec<f64>>> {
        let log_target = |u: &[f64], scratch: &mut Scratch| self.log_target(u, scratch);
        posterior.sample(n, random, &self.coordinates, &log_target, keep_going)
    }

    /// The posterior, normalised.
    pub fn posterior(&self) -> Importance {
        let points = match self.conditions.first() {
            Some((likelihood, _)) => Arc::clone(&likelihood.pool().points),
            None => pool_points(&self.coordinates),
        };
        let mut emulated = vec![0.0; points.rows()];
        for (likelihood, observed) in &self.conditions {
            let log_likelihood = likelihood.at_pool(observed);
            emulated.iter_mut().zip(log_likelihood).for_each(|(sum, each)| *sum += each);
        }
        let log_weights = match &self.network {
            None => emulated,
            Some((mixtures, average)) => {
                // Mixtures are expensive, and nowhere above their bounds.
                let at_most = mean(mixtures, Mixture::log_bound);
                let bound = |u: &[f64], emulated: f64| {
                    let learnt = at_most - self.coordinates.log_density(u);
                    average.of(emulated, learnt)
                };
                let best = (0..emulated.len()).max_by(|&i, &j| emulated[i].total_cmp(&emulated[j]));
                let reached =
                    best.map_or(f64::NEG_INFINITY, |i| self.with(points.row(i), emulated[i]));
                let weigh = |(i, &emulated): (usize, &f64)| {
                    let u = points.row(i);
                    if bound(u, emulated) < reached - NEGLIGIBLE {
                        return f64::NEG_INFINITY;
                    }
                    self.with(u, emulated)
                };
                emulated.par_iter().enumerate().map(weigh).collect()
            }
        };
        let found = Importance::of_prior_draws(points, &log_weights, &self.coordinates);
        let is_product = self.conditions.is_empty();
        if found.effective_sample_size() >= FEWEST_EFFECTIVE && !is_product {
            return found;
        }
        let log_target = |u: &[f64], scratch: &mut Scratch| self.log_target(u, scratch);
        let network = self.network.as_ref().map(|(mixtures, _)| Mixture::pooled(mixtures));
        // Its normaliser is the evidence that the pours are of one material: worth more draws.
        let effort = if is_product { Effort::OF_A_PRODUCT } else { Effort::OF_A_LIKELIHOOD };
        let adapted = found.adapted(&self.coordinates, &log_target, network.as_ref(), &effort);
        // Of several narrow peaks the prior's draws may be worth more.
        let is_better = adapted.effective_sample_size() >= found.effective_sample_size();
        if is_product || is_better { adapted } else { found }
    }

    fn with(&self, u: &[f64], emulated: f64) -> f64 {
        self.network.as_ref().map_or(emulated, |(mixtures, average)| {
            let learnt =
                mean(mixtures, |mixture| mixture.log_prob(u)) - self.coordinates.log_density(u);
            average.of(emulated, learnt)
        })
    }
}

fn mean(mixtures: &[Mixture], of: impl Fn(&Mixture) -> f64) -> f64 {
    mixtures.iter().map(of).sum::<f64>() / mixtures.len() as f64
}
