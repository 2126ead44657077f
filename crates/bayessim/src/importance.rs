//! A density known up to a factor, by weighted draws of a proposal: Cappe, Guillin, Marin and Robert (2004).

use nalgebra::{DMatrix, DVector};

use crate::coordinates::Coordinates;
use crate::matrix::log_sum_exp;
use crate::mixture::{Component, Mixture};
use crate::random::{Random, cumulative};

const CENTRES: usize = 60;
/// Share of every proposal that stays as wide as the prior.
const DEFENSIVE_SHARE: f64 = 0.1;
const ADAPTING_DRAWS: usize = 1500;
const FINAL_DRAWS: usize = 3000;
const ROUNDS: usize = 5;
/// The target is tempered until so many draws carry weight.
const EFFECTIVE: f64 = 150.0;
/// Adaptation ends when this share of an untempered round's draws carries weight.
const GOOD_SHARE: f64 = 0.25;

/// A normalised density and weighted draws of it.
#[derive(Clone, Debug)]
pub struct Importance {
    pub log_normaliser: f64,
    draws: Vec<Vec<f64>>,
    weights: Vec<f64>,
}

impl Importance {
    /// Of draws of the prior and the log likelihood at them.
    pub fn of_prior_draws(draws: Vec<Vec<f64>>, log_likelihood: &[f64]) -> Self {
        Self::of(draws, log_likelihood)
    }

    fn of(draws: Vec<Vec<f64>>, log_ratios: &[f64]) -> Self {
        let log_normaliser =
            log_sum_exp(log_ratios.iter().copied()) - (log_ratios.len() as f64).ln();
        Self { log_normaliser, draws, weights: normalised(log_ratios, 1.0) }
    }

    pub fn effective_sample_size(&self) -> f64 {
        effective(&self.weights)
    }

    pub fn sample(&self, n: usize, random: &mut Random) -> Vec<Vec<f64>> {
        let sums = cumulative(self.weights.iter().copied());
        (0..n).map(|_| self.draws[random.index(&sums)].clone()).collect()
    }

    /// The same density by a proposal that starts at these draws, and half at what may be known of the
    /// density, and is adapted to `log_target`, which is asked inside the bounds only.
    pub fn adapted(
        &self,
        coordinates: &Coordinates,
        log_target: &dyn Fn(&[f64]) -> f64,
        known: Option<&Mixture>,
    ) -> Self {
        let mut random = Random::new(0);
        let (mean, variance) = coordinates.moments();
        let wide = Component {
            log_weight: DEFENSIVE_SHARE.ln(),
            mean: DVector::from_vec(mean),
            factor: DMatrix::from_diagonal(&DVector::from_iterator(
                variance.len(),
                variance.iter().map(|v| v.powf(-0.5)),
            )),
        };
        // A few draws alone have no covariance.
        let weights: Vec<_> = self.weights.iter().map(|weight| weight + 1e-6).collect();
        let mut proposal = kernel_estimate(&self.draws, &weights, &wide, &mut random);
        if let Some(known) = known {
            proposal = proposal.halved_with(known);
        }
        let ratios = |proposal: &Mixture, count: usize, random: &mut Random| {
            let sampler = proposal.sampler();
            let draws: Vec<_> = (0..count).map(|_| sampler.draw(random)).collect();
            let log_ratios: Vec<_> = draws
                .iter()
                .map(|u| {
                    if coordinates.is_inside(u) {
                        log_target(u) - proposal.log_prob(u)
                    } else {
                        f64::NEG_INFINITY
                    }
                })
                .collect();
            (draws, log_ratios)
        };
        for _ in 0..ROUNDS {
            let (draws, log_ratios) = ratios(&proposal, ADAPTING_DRAWS, &mut random);
            if effective(&normalised(&log_ratios, 1.0)) > GOOD_SHARE * ADAPTING_DRAWS as f64 {
                break;
            }
            proposal = kernel_estimate(&draws, &tempered(&log_ratios), &wide, &mut random);
        }
        let (draws, log_ratios) = ratios(&proposal, FINAL_DRAWS, &mut random);
        Self::of(draws, &log_ratios)
    }
}

/// Equal normals around some of the weighted draws with their total covariance, and the wide one.
fn kernel_estimate(
    draws: &[Vec<f64>],
    weights: &[f64],
    wide: &Component,
    random: &mut Random,
) -> Mixture {
    let p = wide.mean.len();
    let total: f64 = weights.iter().sum();
    let mut mean = DVector::zeros(p);
    for (u, weight) in draws.iter().zip(weights) {
        mean += DVector::from_column_slice(u) * (weight / total);
    }
    let mut covariance = DMatrix::zeros(p, p);
    for (u, weight) in draws.iter().zip(weights) {
        let off = DVector::from_column_slice(u) - &mean;
        covariance += &off * off.transpose() * (weight / total);
    }
    // Silverman's rule for a normal of this dimension.
    let dimension = p as f64;
    let width = (4.0 / ((dimension + 2.0) * CENTRES as f64)).powf(1.0 / (dimension + 4.0));
    covariance *= width * width;
    let trace = covariance.trace();
    for i in 0..p {
        covariance[(i, i)] += 1e-12 * trace + 1e-18;
    }
    let factor = covariance
        .try_inverse()
        .and_then(DMatrix::cholesky)
        .map_or_else(|| wide.factor.clone(), nalgebra::Cholesky::unpack);
    let sums = cumulative(weights.iter().copied());
    let log_weight = ((1.0 - DEFENSIVE_SHARE) / CENTRES as f64).ln();
    let centre = |random: &mut Random| Component {
        log_weight,
        mean: DVector::from_column_slice(&draws[random.index(&sums)]),
        factor: factor.clone(),
    };
    let mut components: Vec<_> = (0..CENTRES).map(|_| centre(random)).collect();
    components.push(wide.clone());
    Mixture::of(components)
}

fn tempered(log_ratios: &[f64]) -> Vec<f64> {
    let mut power = 1.0;
    loop {
        let weights = normalised(log_ratios, power);
        if effective(&weights) >= EFFECTIVE || power < 1e-3 {
            return weights;
        }
        power *= 0.7;
    }
}

fn normalised(log_ratios: &[f64], power: f64) -> Vec<f64> {
    let total = log_sum_exp(log_ratios.iter().map(|ratio| power * ratio));
    if !total.is_finite() {
        return vec![1.0 / log_ratios.len() as f64; log_ratios.len()];
    }
    log_ratios.iter().map(|ratio| (power * ratio - total).exp()).collect()
}

fn effective(weights: &[f64]) -> f64 {
    1.0 / weights.iter().map(|weight| weight * weight).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use granulcal_dataset::Prior;

    /// A narrow normal in the corner of a cube, whose mass and mean are known.
    #[test]
    fn a_narrow_density_is_found_and_normalised() {
        let coordinates = Coordinates::of(&Prior::default());
        let (at, sd) = ([0.0, 0.4, 0.9], 0.01);
        let log_target =
            |u: &[f64]| -0.5 * u.iter().zip(at).map(|(u, m)| ((u - m) / sd).powi(2)).sum::<f64>();
        let draws = coordinates.quasi_prior(4096);
        let likelihood: Vec<_> = draws.iter().map(|u| log_target(u)).collect();
        let start = Importance::of_prior_draws(draws, &likelihood);
        assert!(start.effective_sample_size() < 100.0);
        let found = start.adapted(&coordinates, &log_target, None);
        assert!(found.effective_sample_size() > 500.0, "{}", found.effective_sample_size());
        // Half of the mass is cut off.
        let exact = 1.5 * (std::f64::consts::TAU * sd * sd).ln() - 2f64.ln();
        assert!((found.log_normaliser - exact).abs() < 0.1, "{} {exact}", found.log_normaliser);
        let sample = found.sample(4000, &mut Random::new(1));
        let mean = sample.iter().map(|u| u[1]).sum::<f64>() / 4000.0;
        assert!((mean - 0.4).abs() < 2e-3, "{mean}");
    }
}
