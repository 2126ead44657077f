//! A density known up to a factor, by weighted draws of a proposal: Cappe, Guillin, Marin and Robert (2004). A draw of
//! it is one of those that then walks some steps of Metropolis along differences of others (Gilks and Berzuini 2001;
//! ter Braak 2006): without them a thousand draws are some hundred points, each several times.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::component::Component;
use crate::coordinates::Coordinates;
use crate::kernels::Kernels;
use crate::likelihood::{FEWEST_EFFECTIVE, Scratch};
use crate::matrix::Matrix;
use crate::mixture::Mixture;
use crate::random::{BLOCK, KeepGoing, Random, cumulative};

const CENTRES: usize = 60;
/// Share of every proposal that stays as wide as the prior.
const DEFENSIVE_SHARE: f64 = 0.1;
/// Steps of each draw: to part equal draws, and to mend a pool that is worth few draws.
const STEPS: usize = 3;
const MENDING_STEPS: usize = 20;
/// Factors on the length of a step that is best for a normal.
const STEP_FACTORS: [f64; 3] = [0.3, 0.7, 1.0];

/// How much work a density is worth.
pub struct Effort {
    /// Draws of one round of adaptation.
    draws: usize,
    /// Weighted draws in the end.
    pool: usize,
    rounds: usize,
    /// The target is tempered until so many draws carry weight.
    effective: f64,
    /// Adaptation ends when this share of an untempered round's draws carries weight.
    good_share: f64,
}

impl Effort {
    pub const OF_A_LIKELIHOOD: Self =
        Self { draws: 1000, pool: 2000, rounds: 6, effective: 150.0, good_share: 0.25 };
    pub const OF_A_PRODUCT: Self =
        Self { draws: 4000, pool: 20_000, rounds: 8, effective: 300.0, good_share: 0.3 };
}

/// The log of a density up to a constant, of coordinates inside the bounds.
pub type LogTarget<'a> = dyn Fn(&[f64], &mut Scratch) -> f64 + Sync + 'a;

/// A normalised density and weighted draws of it.
#[derive(Clone, Debug)]
pub struct Importance {
    pub log_normaliser: f64,
    /// A row for each draw.
    draws: Arc<Matrix>,
    /// Log target of each.
    heights: Vec<f64>,
    weights: Vec<f64>,
}

impl Importance {
    /// Of draws of the prior and the log of the target over it.
    pub fn of_prior_draws(
        draws: Arc<Matrix>,
        log_ratios: &[f64],
        coordinates: &Coordinates,
    ) -> Self {
        let rows = draws.data.chunks_exact(draws.columns).zip(log_ratios);
        let heights = rows.map(|(u, ratio)| ratio + coordinates.log_density(u)).collect();
        Self::of(draws, heights, log_ratios)
    }

    fn of(draws: Arc<Matrix>, heights: Vec<f64>, log_ratios: &[f64]) -> Self {
        let (weights, log_sum) = normalised(log_ratios, 1.0);
        Self { log_normaliser: log_sum - (log_ratios.len() as f64).ln(), draws, heights, weights }
    }

    pub fn effective_sample_size(&self) -> f64 {
        effective(&self.weights)
    }

    /// Draws by resampling alone: some of them are the same.
    pub fn resample(&self, n: usize, random: &mut Random) -> Vec<Vec<f64>> {
        let sums = cumulative(self.weights.iter().copied());
        (0..n).map(|_| self.draws.row(random.index(&sums)).to_vec()).collect()
    }

    /// Draws that walk; none where `keep_going` gives up.
    pub fn sample(
        &self,
        n: usize,
        random: &mut Random,
        coordinates: &Coordinates,
        log_target: &LogTarget<'_>,
        keep_going: &KeepGoing<'_>,
    ) -> Option<Vec<Vec<f64>>> {
        let sums = cumulative(self.weights.iter().copied());
        let is_poor = self.effective_sample_size() < FEWEST_EFFECTIVE;
        let best = 2.38 / (2.0 * coordinates.dimension() as f64).sqrt();
        let mut chain = || MetropolisChain {
            from: random.index(&sums),
            steps: (0..if is_poor { MENDING_STEPS } else { STEPS })
                .map(|_| Step {
                    between: [random.index(&sums), random.index(&sums)],
                    length: best * STEP_FACTORS[random.below(STEP_FACTORS.len())],
                    log_level: random.uniform().ln(),
                })
                .collect(),
        };
        let run = |scratch: &mut Scratch, chain: &MetropolisChain| {
            let mut draw = self.draws.row(chain.from).to_vec();
            let mut height = self.heights[chain.from];
            for step in &chain.steps {
                let [first, second] = step.between.map(|row| self.draws.row(row));
                let along = first.iter().zip(second).map(|(a, b)| step.length * (a - b));
                let tried: Vec<_> = draw.iter().zip(along).map(|(u, along)| u + along).collect();
                if !coordinates.is_inside(&tried) {
                    continue;
                }
                let reached = log_target(&tried, scratch);
                if step.log_level < reached - height {
                    (draw, height) = (tried, reached);
                }
            }
            draw
        };
        let mut draws = Vec::with_capacity(n);
        while draws.len() < n {
            if !keep_going() {
                return None;
            }
            // All that is random is drawn first, so that threads may share the chains.
            let chains: Vec<_> = (0..BLOCK.min(n - draws.len())).map(|_| chain()).collect();
            draws.par_extend(chains.par_iter().map_init(Scratch::default, run));
        }
        Some(draws)
    }

    /// The same density by a proposal that starts at these draws, and half at what may be known of the
    /// density, and is adapted to `log_target`.
    pub fn adapted(
        &self,
        coordinates: &Coordinates,
        log_target: &LogTarget<'_>,
        known: Option<&Mixture>,
        effort: &Effort,
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
            proposal = Mixture::pooled(&[proposal, known.clone()]);
        }
        let mut tried = ProposalDraws::none(coordinates.dimension());
        for _ in 0..effort.rounds {
            tried.add(effort.draws, &proposal, coordinates, log_target, &mut random);
            let (weights, _) = normalised(&tried.log_ratios, 1.0);
            if effective(&weights) > effort.good_share * effort.draws as f64 {
                // A round whose proposal is kept is the beginning of the draws.
                break;
            }
            let weights = tempered(&tried.log_ratios, effort.effective);
            proposal = kernel_estimate(&tried.draws, &weights, &wide, &mut random);
            tried = ProposalDraws::none(coordinates.dimension());
        }
        let missing = effort.pool - tried.draws.rows();
        tried.add(missing, &proposal, coordinates, log_target, &mut random);
        Self::of(Arc::new(tried.draws), tried.heights, &tried.log_ratios)
    }
}

/// A draw and the steps that it tries.
struct MetropolisChain {
    from: usize,
    steps: Vec<Step>,
}

/// Along the difference of two other draws.
struct Step {
    between: [usize; 2],
    length: f64,
    /// Taken where the log density rises by more.
    log_level: f64,
}

/// Draws of a proposal, log target and log of target over proposal at them.
struct ProposalDraws {
    draws: Matrix,
    heights: Vec<f64>,
    log_ratios: Vec<f64>,
}

impl ProposalDraws {
    fn none(dimension: usize) -> Self {
        let draws = Matrix { data: Vec::new(), columns: dimension };
        Self { draws, heights: Vec::new(), log_ratios: Vec::new() }
    }

    fn add(
        &mut self,
        count: usize,
        proposal: &Mixture,
        coordinates: &Coordinates,
        log_target: &LogTarget<'_>,
        random: &mut Random,
    ) {
        let (sampler, first) = (proposal.sampler(), self.draws.data.len());
        for _ in 0..count {
            self.draws.data.extend(sampler.draw(random));
        }
        let height = |scratch: &mut Scratch, u: &[f64]| {
            if coordinates.is_inside(u) { log_target(u, scratch) } else { f64::NEG_INFINITY }
        };
        let new = self.draws.data[first..].par_chunks_exact(self.draws.columns);
        self.heights.par_extend(new.clone().map_init(Scratch::default, height));
        let heights = self.heights[self.log_ratios.len()..].par_iter();
        let ratio = |(u, height): (&[f64], &f64)| height - proposal.log_prob(u);
        self.log_ratios.par_extend(new.zip(heights).map(ratio));
    }
}

/// Normals around some of the weighted draws, and the wide one.
fn kernel_estimate(
    draws: &Matrix,
    weights: &[f64],
    wide: &Component,
    random: &mut Random,
) -> Mixture {
    let kernels = Kernels::of(draws, weights, CENTRES);
    let sums = cumulative(weights.iter().copied());
    let centres: Vec<usize> = (0..CENTRES).map(|_| random.index(&sums)).collect();
    let log_weight = ((1.0 - DEFENSIVE_SHARE) / CENTRES as f64).ln();
    let component = |&centre: &usize| {
        let factor = kernels.as_ref().and_then(|kernels| kernels.factor(centre));
        Component {
            log_weight,
            mean: DVector::from_column_slice(draws.row(centre)),
            factor: factor.unwrap_or_else(|| wide.factor.clone()),
        }
    };
    let mut components: Vec<_> = centres.par_iter().map(component).collect();
    components.push(wide.clone());
    Mixture::of(components)
}

fn tempered(log_ratios: &[f64], least: f64) -> Vec<f64> {
    let mut power = 1.0;
    loop {
        let (weights, _) = normalised(log_ratios, power);
        if effective(&weights) >= least || power < 1e-3 {
            return weights;
        }
        power *= 0.7;
    }
}

/// Weights of sum one, and the log of the sum that they had.
fn normalised(log_ratios: &[f64], power: f64) -> (Vec<f64>, f64) {
    let largest = power * log_ratios.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !largest.is_finite() {
        return (vec![1.0 / log_ratios.len() as f64; log_ratios.len()], largest);
    }
    let mut weights: Vec<_> = log_ratios.iter().map(|r| (power * r - largest).exp()).collect();
    let sum: f64 = weights.iter().sum();
    for weight in &mut weights {
        *weight /= sum;
    }
    (weights, largest + sum.ln())
}

fn effective(weights: &[f64]) -> f64 {
    1.0 / weights.iter().map(|weight| weight * weight).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use granulcal_scene::Prior;

    /// A narrow normal in the corner of a cube, whose mass and mean are known.
    #[test]
    fn a_narrow_density_is_found_and_normalised() {
        let coordinates = Coordinates::of(&Prior::default());
        let (at, sd) = ([0.0, 0.4, 0.9], 0.01);
        let log_target = |u: &[f64], _: &mut Scratch| {
            -0.5 * u.iter().zip(at).map(|(u, m)| ((u - m) / sd).powi(2)).sum::<f64>()
        };
        let draws = coordinates.quasi_prior(4096);
        let likelihood: Vec<_> =
            draws.iter().map(|u| log_target(u, &mut Scratch::default())).collect();
        let draws = Matrix { data: draws.concat(), columns: 3 };
        let start = Importance::of_prior_draws(Arc::new(draws), &likelihood, &coordinates);
        assert!(start.effective_sample_size() < 100.0);
        let found = start.adapted(&coordinates, &log_target, None, &Effort::OF_A_LIKELIHOOD);
        assert!(found.effective_sample_size() > 500.0, "{}", found.effective_sample_size());
        // Half of the mass is cut off.
        let exact = 1.5 * (std::f64::consts::TAU * sd * sd).ln() - 2f64.ln();
        assert!((found.log_normaliser - exact).abs() < 0.1, "{} {exact}", found.log_normaliser);
        let sample =
            found.sample(4000, &mut Random::new(1), &coordinates, &log_target, &|| true).unwrap();
        let mean = sample.iter().map(|u| u[1]).sum::<f64>() / 4000.0;
        let variance = sample.iter().map(|u| (u[1] - mean).powi(2)).sum::<f64>() / 4000.0;
        assert!((mean - 0.4).abs() < 1e-3, "{mean}");
        assert!((variance.sqrt() / sd - 1.0).abs() < 0.05, "{variance}");
        assert!(sample.iter().all(|u| coordinates.is_inside(u)));
        let different = |draws: &[Vec<f64>]| {
            let mut first: Vec<_> = draws.iter().map(|u| u[0]).collect();
            first.sort_by(f64::total_cmp);
            first.dedup();
            first.len()
        };
        assert!(different(&sample) > 3700, "{} of 4000", different(&sample));
        assert!(different(&found.resample(4000, &mut Random::new(1))) < 2000);
    }

    /// Two narrow peaks, of which one has three times the other's mass.
    #[test]
    fn each_of_two_peaks_has_its_mass() {
        let coordinates = Coordinates::of(&Prior::default());
        let (places, sd) = ([[0.2, 0.3, 0.6], [0.8, 0.3, 0.4]], 0.02);
        let peak = |u: &[f64], place: [f64; 3]| {
            -0.5 * u.iter().zip(place).map(|(u, m)| ((u - m) / sd).powi(2)).sum::<f64>()
        };
        let log_target = |u: &[f64], _: &mut Scratch| {
            let [one, other] = places.map(|place| peak(u, place));
            let (one, other) = (one + 0.75f64.ln(), other + 0.25f64.ln());
            one.max(other) + (-(one - other).abs()).exp().ln_1p()
        };
        let draws = coordinates.quasi_prior(16_384);
        let of_prior: Vec<_> =
            draws.iter().map(|u| log_target(u, &mut Scratch::default())).collect();
        let draws = Matrix { data: draws.concat(), columns: 3 };
        let start = Importance::of_prior_draws(Arc::new(draws), &of_prior, &coordinates);
        let found = start.adapted(&coordinates, &log_target, None, &Effort::OF_A_LIKELIHOOD);
        // Kernels of the total covariance leave 282.
        assert!(found.effective_sample_size() > 400.0, "{}", found.effective_sample_size());
        let exact = 1.5 * (std::f64::consts::TAU * sd * sd).ln();
        assert!((found.log_normaliser - exact).abs() < 0.1, "{} {exact}", found.log_normaliser);
        let sample =
            found.sample(4000, &mut Random::new(1), &coordinates, &log_target, &|| true).unwrap();
        let right = sample.iter().filter(|u| u[0] > 0.5).count() as f64 / 4000.0;
        assert!((right - 0.25).abs() < 0.06, "{right}");
    }

    /// Six normals that hang together, from a proposal as wide as the prior and too few rounds.
    #[test]
    fn draws_worth_little_are_mended_by_the_steps() {
        let parameter = |i: usize| {
            format!(
                "[[parameter]]\npath = \"p{i}\"\ndistribution = \"normal\"\nmean = 0.0\nsd = 1.0\n"
            )
        };
        let text: String = (0..6).map(parameter).collect();
        let coordinates = Coordinates::of(&Prior::from_toml(&text).unwrap());
        // An autoregression: the first has spread 0.3, each other hangs on the one before.
        let (mean, sd) = ([0.8, -0.5, 0.3, 0.6, -0.9, 0.1], 0.3);
        let log_target = |u: &[f64], _: &mut Scratch| {
            let off = |i: usize| u[i] - mean[i];
            let step = |i: usize| off(i) - if i > 0 { 0.5 * off(i - 1) } else { 0.0 };
            -0.5 * (0..6).map(|i| (step(i) / sd).powi(2)).sum::<f64>()
        };
        let points = coordinates.quasi_prior(4096);
        let over_prior =
            |u: &Vec<f64>| log_target(u, &mut Scratch::default()) - coordinates.log_density(u);
        let log_ratios: Vec<_> = points.iter().map(over_prior).collect();
        let draws = Arc::new(Matrix { data: points.concat(), columns: 6 });
        let start = Importance::of_prior_draws(draws, &log_ratios, &coordinates);
        let effort = Effort { draws: 300, pool: 300, rounds: 2, effective: 60.0, good_share: 0.9 };
        let found = start.adapted(&coordinates, &log_target, None, &effort);
        let effective = found.effective_sample_size();
        assert!(effective < 200.0, "{effective}");
        let sample =
            found.sample(4000, &mut Random::new(1), &coordinates, &log_target, &|| true).unwrap();
        let mut variance = 0.0;
        for i in 0..6 {
            variance = 0.25 * variance + sd * sd;
            let spread = f64::sqrt(variance);
            let found = sample.iter().map(|u| u[i]).sum::<f64>() / 4000.0;
            assert!((found - mean[i]).abs() < 0.25 * spread, "{i}: {found}");
            let square = sample.iter().map(|u| (u[i] - found).powi(2)).sum::<f64>() / 4000.0;
            assert!((square.sqrt() / spread - 1.0).abs() < 0.2, "{i}: {square}");
        }
    }
}
