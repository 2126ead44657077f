//! An emulator of statistics, as training makes it and as a model's file holds it.

use std::sync::Arc;

use rayon::prelude::*;

use crate::ModelError;
use crate::best_fit::{BestFit, Fit, Pooled};
use crate::coordinates::Coordinates;
use crate::document::EmulatorScalars;
use crate::likelihood::{Likelihood, Scratch};
use crate::misfit::{Misfit, MisfitReference};
use crate::tensors::Tensors;

/// The likelihood of its leading signal axes, and the best fit of all of them.
#[derive(Clone, Debug)]
pub struct Emulated {
    pub(crate) likelihood: Arc<Likelihood>,
    fit: Arc<BestFit>,
    statistics: usize,
}

impl Emulated {
    /// Of arrays named as in a model's file, of `statistics` statistics; `features` is the number of random
    /// frequencies, if it is known.
    ///
    /// # Errors
    /// [`ModelError::Content`] for an array that is missing, of another shape, or not finite.
    pub fn read(
        tensors: &Tensors<'_>,
        coordinates: &Arc<Coordinates>,
        statistics: usize,
        scalars: &EmulatorScalars,
        features: Option<usize>,
    ) -> Result<Self, ModelError> {
        let axes = scalars.axis_count;
        if axes == 0 || axes > statistics {
            let allowed = format!("between 1 and {statistics}");
            return Err(tensors.unfit("axis_count", &allowed, &axes.to_string()));
        }
        let likelihood = Likelihood::read(tensors, coordinates, statistics, scalars, features)?;
        let fit = BestFit::read(tensors, coordinates, statistics, scalars, features)?;
        Ok(Self { likelihood: Arc::new(likelihood), fit: Arc::new(fit), statistics })
    }

    /// Number of statistics.
    pub fn statistics(&self) -> usize {
        self.statistics
    }

    /// Log likelihood of standardised pours at each of some coordinates.
    pub fn log_prob(&self, z: &[Vec<f64>], u: &[Vec<f64>]) -> Vec<f64> {
        let observed = self.likelihood.observe(z);
        let at =
            |scratch: &mut Scratch, u: &Vec<f64>| self.likelihood.log_prob(&observed, u, scratch);
        u.par_iter().map_init(Scratch::default, at).collect()
    }

    /// Log likelihood of standardised pours at each point of the pool.
    pub fn at_pool(&self, z: &[Vec<f64>]) -> Vec<f64> {
        self.likelihood.at_pool(&self.likelihood.observe(z))
    }

    /// Number of points of the pool.
    pub fn pool_size(&self) -> usize {
        self.likelihood.pool().points.rows()
    }

    /// What is expected at each point of the pool: means, standard deviations of one pour and of the means, row by row.
    pub fn expected_at_pool(&self) -> [Vec<f64>; 3] {
        let rows = self.likelihood.pool().rows();
        let axes = rows.columns / 3;
        let part =
            |which: usize| (0..rows.rows()).flat_map(move |i| &rows.row(i)[which * axes..][..axes]);
        let root = |which: usize| part(which).map(|variance| variance.sqrt()).collect();
        [part(0).copied().collect(), root(1), root(2)]
    }

    /// Squared length of what the best fit leaves of each standardised pour in units of the noise, and what it leaves
    /// of the statistics.
    pub fn best_fits(&self, z: &[Vec<f64>]) -> Vec<(f64, Vec<f64>)> {
        let fit = &self.fit;
        let one = |row: &Vec<f64>| {
            let Fit { square, left, .. } = fit.of(&fit.axes.after(row), Pooled::ONE);
            (square, fit.back.after(&left))
        };
        z.iter().map(one).collect()
    }

    /// Whether any parameters explain pours that are standardised without being moved into the training range.
    pub fn misfit(&self, reference: &MisfitReference, z: &[Vec<f64>], names: &[String]) -> Misfit {
        reference.test(&self.fit, z, names)
    }
}
