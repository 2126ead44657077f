//! The contact problem of one substep by itself, to compare solvers on.

use nalgebra::Vector3;

use crate::DemError;
use crate::bed::Bed;
use crate::contact::ContactSet;
use crate::preset::SolverSettings;
use crate::solver;
use crate::solver::nsgs::ResidualSums;

/// Contacts with normals, biases and warm impulses, and the velocities before they are solved, as
/// [`Simulation::contact_problem`](crate::Simulation::contact_problem) has frozen them.
#[derive(Clone, Debug)]
pub struct ContactProblem {
    sets: [ContactSet; 2],
    bed: Bed,
    radius: f64,
}

/// What a solver made of a [`ContactProblem`].
#[derive(Clone, Debug, PartialEq)]
pub struct ContactSolution {
    /// Velocities of the grains `[m/s]`, shape `[grains]`.
    pub velocities: Vec<Vector3<f64>>,
    /// Spins `r omega` of the grains `[m/s]`, shape `[grains]`.
    pub spins: Vec<Vector3<f64>>,
    /// Natural-map residual over the rms normal impulse `[-]`.
    pub residual: f64,
    /// Sum of the normal impulses over a typical mass `[m/s]`.
    pub normal_impulse: f64,
    /// Fastest closing of a contact against its constraint `[m/s]`.
    pub closing: f64,
    /// Passes over all contacts.
    pub sweeps: usize,
    /// Newton steps that the guard has damped or replaced.
    pub guarded: usize,
    /// Whether the iterations were used up before the method's own measure of success was met.
    pub unconverged: bool,
}

impl ContactProblem {
    pub(crate) fn new(sets: [ContactSet; 2], bed: Bed, radius: f64) -> Self {
        Self { sets, bed, radius }
    }

    /// Number of contacts.
    pub fn contact_count(&self) -> usize {
        self.sets.iter().map(ContactSet::len).sum()
    }

    /// Solves a copy with the method and the iterations of `settings`.
    ///
    /// # Errors
    /// [`DemError::OutOfRange`] for settings that no simulation would take.
    pub fn solve(&self, settings: &SolverSettings) -> Result<ContactSolution, DemError> {
        settings.check()?;
        let Self { mut sets, mut bed, radius } = self.clone();
        let mut both = sets.each_mut();
        let work = solver::solve(&mut both, &mut bed.bodies, settings, radius, None);
        let residual = ResidualSums::of(&both, &mut bed.bodies).relative();
        let batches = sets.iter().flat_map(|set| &set.batches);
        let grains = &bed.bodies[..bed.count()];
        Ok(ContactSolution {
            velocities: (0..bed.count()).map(|grain| bed.velocity(grain)).collect(),
            spins: grains.iter().map(|body| Vector3::from_column_slice(&body.spin[..3])).collect(),
            residual,
            normal_impulse: batches.flat_map(|batch| batch.lambda_n.0).sum(),
            closing: work.closing,
            sweeps: work.sweeps,
            guarded: work.guarded,
            unconverged: work.unconverged,
        })
    }

    /// Sums of the squares of the natural-map residual before and after a solve `[m^2/s^2]`.
    #[cfg(test)]
    pub(crate) fn merits(&self, settings: &SolverSettings) -> [f64; 2] {
        let Self { mut sets, mut bed, radius } = self.clone();
        let mut both = sets.each_mut();
        let before = ResidualSums::of(&both, &mut bed.bodies).squares();
        solver::solve(&mut both, &mut bed.bodies, settings, radius, None);
        [before, ResidualSums::of(&both, &mut bed.bodies).squares()]
    }
}
