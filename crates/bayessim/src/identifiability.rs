//! What a posterior knows: information over the prior, directions that are known, the one along which least is.
//! `python/granulcal/bayessim/check/identifiability.py` averages it over posteriors and has the references.

use nalgebra::{DMatrix, SymmetricEigen};
use serde::Serialize;

use crate::coordinates::Coordinates;
use crate::short_names::short_names;

/// Draws that are asked, and bins of the prior's quantiles.
pub const DRAWS: usize = 1000;
const BINS: usize = 20;

/// What one posterior knows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Identifiability {
    /// Paths of the parameters.
    pub names: Vec<String>,
    /// Information gained over the prior for each parameter `[nat]`.
    pub gains: Vec<f64>,
    /// Directions that are known, 0 to the number of parameters.
    pub effective_dimension: f64,
    /// Unit vector along which least is known, in spreads of the prior.
    pub ridge: Vec<f64>,
    /// Posterior spread along it over the prior's.
    pub ridge_spread: f64,
    /// Parts of the prior where a parameter leaves no trace, in words; none of one posterior.
    pub blind: Vec<String>,
}

impl Identifiability {
    /// Of draws of coordinates.
    pub(crate) fn of(coordinates: &Coordinates, draws: &[Vec<f64>]) -> Self {
        let (p, count) = (coordinates.dimension(), draws.len() as f64);
        let gains = (0..p)
            .map(|i| {
                let mut shares = [0.0; BINS];
                for u in draws {
                    let bin = (coordinates.prior_quantile(i, u[i]) * BINS as f64) as usize;
                    shares[bin.min(BINS - 1)] += 1.0 / count;
                }
                let filled = shares.iter().filter(|&&share| share > 0.0);
                // Empty evidence has a positive gain by chance: (bins - 1) / 2n.
                let bias = (filled.clone().count() as f64 - 1.0) / (2.0 * count);
                let gain: f64 = filled.map(|share| share * (share * BINS as f64).ln()).sum();
                (gain - bias).max(0.0)
            })
            .collect();
        let covariance = covariance(coordinates, draws);
        let found = Directions::of(covariance);
        Self {
            names: coordinates.names().to_vec(),
            gains,
            effective_dimension: found.effective_dimension,
            ridge: found.ridge,
            ridge_spread: found.ridge_spread,
            blind: Vec::new(),
        }
    }
}

/// Covariance of draws of coordinates, in spreads of the prior.
pub(crate) fn covariance(coordinates: &Coordinates, draws: &[Vec<f64>]) -> DMatrix<f64> {
    let (p, count) = (coordinates.dimension(), draws.len() as f64);
    let (_, variance) = coordinates.moments();
    let mean: Vec<_> = (0..p).map(|i| draws.iter().map(|u| u[i]).sum::<f64>() / count).collect();
    DMatrix::from_fn(p, p, |i, j| {
        let product = |u: &Vec<f64>| (u[i] - mean[i]) * (u[j] - mean[j]);
        let sum: f64 = draws.iter().map(product).sum();
        sum / (count - 1.0) / (variance[i] * variance[j]).sqrt()
    })
}

/// How many directions are known, and along which least is.
#[derive(Clone, Debug, PartialEq)]
pub struct Directions {
    /// Directions that are known, 0 to the number of parameters.
    pub effective_dimension: f64,
    /// Unit vector along which least is known, in spreads of the prior.
    pub ridge: Vec<f64>,
    /// Posterior spread along it over the prior's.
    pub ridge_spread: f64,
}

impl Directions {
    /// Of a covariance in spreads of the prior.
    pub fn of(covariance: DMatrix<f64>) -> Self {
        let p = covariance.nrows();
        // A search for eigenvalues of what is not finite has no end.
        let is_finite = covariance.iter().all(|value| value.is_finite());
        let covariance = if is_finite { covariance } else { DMatrix::identity(p, p) };
        let eigen = SymmetricEigen::new(covariance);
        let widest = eigen.eigenvalues.imax();
        let ridge: Vec<f64> = eigen.eigenvectors.column(widest).iter().copied().collect();
        let longest =
            ridge.iter().copied().fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
        Self {
            effective_dimension: eigen.eigenvalues.iter().map(|v| (1.0 - v).clamp(0.0, 1.0)).sum(),
            ridge: ridge.iter().map(|part| part * longest.signum()).collect(),
            ridge_spread: eigen.eigenvalues[widest].max(0.0).sqrt(),
        }
    }
}

impl std::fmt::Display for Identifiability {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let short = short_names(&self.names);
        let gains: Vec<_> =
            short.iter().zip(&self.gains).map(|(name, gain)| format!("{name} {gain:.2}")).collect();
        let ridge: Vec<_> = short
            .iter()
            .zip(&self.ridge)
            .map(|(name, part)| format!("{part:+.2} {name}"))
            .collect();
        writeln!(f, "  information gained [nat]: {}", gains.join(", "))?;
        write!(
            f,
            "  {:.1} of {} directions are known; least along {}, where {:.0} % of the prior's spread is left",
            self.effective_dimension,
            short.len(),
            ridge.join(" "),
            100.0 * self.ridge_spread
        )
    }
}
