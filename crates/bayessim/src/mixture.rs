//! A Gaussian mixture over coordinates, cut to the prior's bounds.

use nalgebra::{DMatrix, DVector};

use crate::component::Component;
use crate::coordinates::Coordinates;
use crate::lanes::Lanes;
use crate::matrix::log_sum_exp;
use crate::random::{BLOCK, KeepGoing, Random, cumulative};

/// With less mass than this inside the bounds the density is integrated over draws of the prior.
const SMALLEST_MASS: f64 = 0.02;
const PRIOR_POINTS: usize = 20_000;

/// A density over coordinates.
#[derive(Clone, Debug)]
pub struct Mixture {
    components: Vec<Component>,
    constants: Vec<f64>,
    lanes: Lanes,
}

impl Mixture {
    /// Of components whose weights sum to one.
    pub fn of(components: Vec<Component>) -> Self {
        let constants: Vec<_> = components.iter().map(Component::constant).collect();
        let lanes = Lanes::of(&components, &constants);
        Self { components, constants, lanes }
    }

    /// Log density.
    pub fn log_prob(&self, u: &[f64]) -> f64 {
        self.lanes.log_sum(u)
    }

    /// Log of what the density is nowhere above: the sum of its components' peaks.
    pub fn log_bound(&self) -> f64 {
        log_sum_exp(self.constants.iter().copied())
    }

    /// The mixture of some with the same weight each.
    pub fn pooled(mixtures: &[Self]) -> Self {
        let mut components: Vec<_> = mixtures.iter().flat_map(|m| m.components.clone()).collect();
        for component in &mut components {
            component.log_weight -= (mixtures.len() as f64).ln();
        }
        Self::of(components)
    }

    /// Standard normal points carried into a component: `m + F^-T n`.
    fn placer(&self) -> Vec<DMatrix<f64>> {
        let inverse = |c: &Component| {
            let size = c.factor.nrows();
            let identity = DMatrix::identity(size, size);
            // Positive diagonals: the triangle can be solved.
            c.factor.tr_solve_lower_triangular(&identity).unwrap_or(identity)
        };
        self.components.iter().map(inverse).collect()
    }

    /// What draws from it.
    pub fn sampler(&self) -> Sampler<'_> {
        let weights = self.components.iter().map(|c| c.log_weight.exp());
        Sampler { mixture: self, spreads: self.placer(), cumulative: cumulative(weights) }
    }
}

/// Draws of a mixture.
#[derive(Debug)]
pub struct Sampler<'a> {
    mixture: &'a Mixture,
    spreads: Vec<DMatrix<f64>>,
    cumulative: Vec<f64>,
}

impl Sampler<'_> {
    pub fn draw(&self, random: &mut Random) -> Vec<f64> {
        let chosen = random.index(&self.cumulative);
        let mean = &self.mixture.components[chosen].mean;
        let normal = DVector::from_fn(mean.len(), |_, _| random.normal());
        (mean + &self.spreads[chosen] * normal).as_slice().to_vec()
    }
}

/// A mixture cut to the prior's bounds.
#[derive(Clone, Debug)]
pub struct TruncatedMixture {
    pub mixture: Mixture,
    pub log_mass: f64,
}

impl TruncatedMixture {
    pub fn cut(coordinates: &Coordinates, mixture: Mixture) -> Self {
        if coordinates.is_unbounded() {
            return Self { mixture, log_mass: 0.0 };
        }
        let points = coordinates.normal_points();
        let mut placed = DVector::zeros(coordinates.dimension());
        let mut inside = |component: &Component, spread: &DMatrix<f64>| {
            let mut count = 0;
            for point in points.column_iter() {
                placed.copy_from(&component.mean);
                placed.gemv(1.0, spread, &point, 1.0);
                count += usize::from(coordinates.is_inside(placed.as_slice()));
            }
            count as f64 / points.ncols() as f64
        };
        let spreads = mixture.placer();
        let parts = mixture.components.iter().zip(&spreads);
        let mass: f64 = parts.map(|(c, spread)| c.log_weight.exp() * inside(c, spread)).sum();
        let log_mass = if mass >= SMALLEST_MASS {
            mass.ln()
        } else {
            let weights: Vec<_> = coordinates
                .quasi_prior(PRIOR_POINTS)
                .iter()
                .map(|u| mixture.log_prob(u) - coordinates.log_density(u))
                .collect();
            log_sum_exp(weights.iter().copied()) - (PRIOR_POINTS as f64).ln()
        };
        Self { mixture, log_mass }
    }

    pub fn is_mostly_outside(&self) -> bool {
        // Not a number is no mass, either.
        self.log_mass.is_nan() || self.log_mass < SMALLEST_MASS.ln()
    }

    pub fn log_prob(&self, coordinates: &Coordinates, u: &[f64]) -> f64 {
        if coordinates.is_inside(u) {
            self.mixture.log_prob(u) - self.log_mass
        } else {
            f64::NEG_INFINITY
        }
    }

    /// Draws; none where `keep_going` gives up.
    pub fn sample(
        &self,
        coordinates: &Coordinates,
        n: usize,
        random: &mut Random,
        keep_going: &KeepGoing<'_>,
    ) -> Option<Vec<Vec<f64>>> {
        if self.is_mostly_outside() {
            let draws = coordinates.quasi_prior(PRIOR_POINTS);
            let weight = |u: &Vec<f64>| {
                (self.mixture.log_prob(u) - coordinates.log_density(u) - self.log_mass).exp()
            };
            let sums = cumulative(draws.iter().map(weight));
            return Some((0..n).map(|_| draws[random.index(&sums)].clone()).collect());
        }
        let sampler = self.mixture.sampler();
        let (mut kept, mut tried) = (Vec::with_capacity(n), 0_usize);
        while kept.len() < n {
            if tried.is_multiple_of(BLOCK) && !keep_going() {
                return None;
            }
            tried += 1;
            let draw = sampler.draw(random);
            if coordinates.is_inside(&draw) {
                kept.push(draw);
            }
        }
        Some(kept)
    }
}
