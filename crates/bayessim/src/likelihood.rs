//! Likelihood of the coordinates by the emulator of the leading signal axes.

use std::sync::{Arc, OnceLock};

use rayon::prelude::*;

use crate::ModelError;
use crate::coordinates::Coordinates;
use crate::document::EmulatorScalars;
use crate::emulator::{Emulator, Prediction, Workings};
use crate::matrix::Matrix;
use crate::noise::Noise;
use crate::tensors::Tensors;

/// Points of the prior that a posterior is made of, unless too few of them carry weight.
const POOL: usize = 16_384;
/// One axis alone does not say that all noise is the pours' own.
const LARGEST_RATIO: f64 = 2.0;
/// With fewer effective draws than this the proposal is adapted.
pub const FEWEST_EFFECTIVE: f64 = 500.0;

/// Density of standardised statistics given coordinates.
#[derive(Debug)]
pub struct Likelihood {
    coordinates: Arc<Coordinates>,
    axes: Matrix,
    emulator: Emulator,
    noise: Noise,
    widening: f64,
    pool: OnceLock<Pool>,
}

/// Evenly spread points of the prior and what the emulator expects there.
#[derive(Debug)]
pub struct Pool {
    /// A row for each point.
    pub points: Arc<Matrix>,
    /// A prediction for each point.
    rows: Matrix,
}

impl Pool {
    /// What is expected at each point: means, variances of one pour, variances of the means.
    pub fn rows(&self) -> &Matrix {
        &self.rows
    }

    /// The same, one after the other.
    pub fn predictions(&self) -> impl IndexedParallelIterator<Item = Prediction<'_>> {
        self.rows.data.par_chunks_exact(self.rows.columns).map(Prediction::of)
    }
}

/// What a model's file says that its emulator of so many axes expects at the pool, if it does.
fn expected_at_pool(tensors: &Tensors<'_>, axes: usize) -> Result<Option<Matrix>, ModelError> {
    let read = |name| tensors.matrix_if_there(name, POOL, axes);
    let (Some(means), Some(scales), Some(unknown)) =
        (read("pool_means")?, read("pool_scales")?, read("pool_unknown")?)
    else {
        return Ok(None);
    };
    let mut data = Vec::with_capacity(3 * axes * POOL);
    for i in 0..POOL {
        data.extend_from_slice(means.row(i));
        data.extend([scales.row(i), unknown.row(i)].into_iter().flatten().map(|sd| sd * sd));
    }
    Ok(Some(Matrix { data, columns: 3 * axes }))
}

/// Room for the numbers on the way to a likelihood, used again for the next.
#[derive(Default)]
pub struct Scratch {
    workings: Workings,
    row: Vec<f64>,
    scaled: Vec<f64>,
}

/// Mean of some pours on the signal axes, and how much they differ.
pub struct Observed {
    pours: f64,
    mean: Vec<f64>,
    variance: Vec<f64>,
}

impl Likelihood {
    /// Of an emulator of `s` statistics.
    pub fn read(
        tensors: &Tensors<'_>,
        coordinates: &Arc<Coordinates>,
        s: usize,
        scalars: &EmulatorScalars,
        features: Option<usize>,
    ) -> Result<Self, ModelError> {
        let count = scalars.axis_count;
        let root = tensors.matrix("emulator_leading_root", count, count)?;
        let pool = OnceLock::new();
        if let Some(rows) = expected_at_pool(tensors, count)? {
            let points = pool_points(coordinates);
            pool.set(Pool { points, rows }).expect("a lock that is still empty");
        }
        Ok(Self {
            coordinates: Arc::clone(coordinates),
            axes: tensors.matrix("emulator_axes", s, s)?,
            emulator: Emulator::read(tensors, coordinates.dimension(), s, features, count)?,
            noise: Noise::new(&root, scalars.leading_degrees),
            widening: scalars.widening,
            pool,
        })
    }

    /// The points of the prior, made at the first call unless the model's file had the table.
    pub fn pool(&self) -> &Pool {
        self.pool.get_or_init(|| {
            let points = pool_points(&self.coordinates);
            let columns = 3 * self.emulator.axis_count();
            let mut data = vec![0.0; columns * points.rows()];
            let rows = data.par_chunks_exact_mut(columns).enumerate();
            rows.for_each_init(Workings::default, |workings, (i, row)| {
                self.emulator.predict(points.row(i), workings, row);
            });
            Pool { points, rows: Matrix { data, columns } }
        })
    }

    /// Log likelihood at coordinates.
    pub fn log_prob(&self, observed: &Observed, u: &[f64], scratch: &mut Scratch) -> f64 {
        let Scratch { workings, row, scaled } = scratch;
        row.resize(3 * self.emulator.axis_count(), 0.0);
        self.emulator.predict(u, workings, row);
        self.at(observed, Prediction::of(row), scaled)
    }

    /// Log likelihood at each point of the pool.
    pub fn at_pool(&self, observed: &Observed) -> Vec<f64> {
        let at = |scaled: &mut Vec<f64>, at| self.at(observed, at, scaled);
        self.pool().predictions().map_init(Vec::new, at).collect()
    }

    /// What the likelihood needs of k standardised pours.
    pub fn observe(&self, z: &[Vec<f64>]) -> Observed {
        let pours = z.len() as f64;
        let rows: Vec<_> = z.iter().map(|row| self.axes.after(row)).collect();
        let axes = 0..self.noise_size();
        let mean: Vec<_> =
            axes.clone().map(|j| rows.iter().map(|y| y[j]).sum::<f64>() / pours).collect();
        let spread = |j: usize| rows.iter().map(|y| (y[j] - mean[j]).powi(2)).sum::<f64>();
        let variance = axes.map(|j| spread(j) / (pours - 1.0).max(1.0)).collect();
        Observed { pours, mean, variance }
    }

    fn noise_size(&self) -> usize {
        self.emulator.axis_count()
    }

    /// Log likelihood where the emulator expects this, with `V_k = c^2 (s^2 + h^2) - (1 - 1/k) eta s^2`, eta the
    /// share by which the pours differ; `scaled` is room for what is computed on the way.
    pub fn at(&self, observed: &Observed, at: Prediction<'_>, scaled: &mut Vec<f64>) -> f64 {
        let size = at.means.len();
        let share = observed.share(at.noise);
        let averaged = (1.0 - 1.0 / observed.pours) * share;
        let widened = self.widening * self.widening;
        let variance = |j: usize| widened * (at.noise[j] + at.unknown[j]) - averaged * at.noise[j];
        scaled.clear();
        let mut product = 1.0;
        for j in 0..size {
            let variance = variance(j);
            product *= variance;
            scaled.push((observed.mean[j] - at.means[j]) / variance.sqrt());
        }
        let log_product = if product.is_normal() {
            product.ln()
        } else {
            (0..size).map(|j| variance(j).ln()).sum()
        };
        let found = self.noise.log_density(scaled, 0.5 * log_product);
        // Far out in an unbounded prior the emulator's polynomials overflow.
        if found.is_finite() { found } else { f64::NEG_INFINITY }
    }
}

impl Observed {
    fn share(&self, noise: &[f64]) -> f64 {
        averaging_share(self.pours, &self.variance, noise)
    }
}

/// The share of the noise that k pours have each for themselves, by their variance on each axis.
pub fn averaging_share(pours: f64, variance: &[f64], noise: &[f64]) -> f64 {
    if pours == 1.0 {
        return 1.0;
    }
    let size = noise.len() as f64;
    let ratios = variance.iter().zip(noise).map(|(w, s)| (w / s).min(LARGEST_RATIO));
    let doubt = 1.0 + 2.0 * (2.0 / (size * (pours - 1.0))).sqrt();
    (doubt * ratios.sum::<f64>() / size).min(1.0)
}

/// The points of the prior, the same for all likelihoods over it.
pub fn pool_points(coordinates: &Coordinates) -> Arc<Matrix> {
    let data = coordinates.quasi_prior(POOL).concat();
    Arc::new(Matrix { data, columns: coordinates.dimension() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn variance(rows: &[Vec<f64>]) -> Vec<f64> {
        let count = rows.len() as f64;
        let one = |j: usize| {
            let mean = rows.iter().map(|row| row[j]).sum::<f64>() / count;
            rows.iter().map(|row| (row[j] - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0)
        };
        (0..rows[0].len()).map(one).collect()
    }

    #[test]
    fn pours_share_what_they_do_not_differ_by() {
        let mut random = Random::new(1);
        let mut share = |size: f64| {
            let mut row = || (0..16).map(|_| size * random.normal()).collect();
            let rows: Vec<Vec<f64>> = (0..5).map(|_| row()).collect();
            averaging_share(5.0, &variance(&rows), &[1.0; 16])
        };
        let noisy = (0..200).map(|_| share(1.0)).sum::<f64>() / 200.0;
        assert!(noisy > 0.98, "{noisy}");
        let quiet = share(0.3);
        assert!(0.05 < quiet && quiet < 0.2, "{quiet}");
        assert_eq!(averaging_share(1.0, &[0.0; 16], &[1.0; 16]), 1.0);
    }
}
