//! The contact problem of one substep by itself, to compare solvers on.

use granulcal_scene::SolverSettings;
use nalgebra::Vector3;

use crate::contact_set::ContactSet;
use crate::error::DemError;
use crate::parallel::Threads;
use crate::particles::Particles;
use crate::solver;
use crate::solver::residual::ResidualSums;
use crate::solver::solve_info::SolveInfo;

/// Contacts with normals, biases and warm impulses, and the velocities before they are solved, as
/// [`Simulation::frozen_solve`](crate::Simulation::frozen_solve) has frozen them.
#[derive(Clone, Debug)]
pub struct FrozenSolve {
    sets: [ContactSet; 2],
    particles: Particles,
    radius: f64,
}

/// What a solver made of a [`FrozenSolve`].
#[derive(Clone, Debug, PartialEq)]
pub struct FrozenSolution {
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

impl FrozenSolve {
    pub(crate) fn new(sets: [ContactSet; 2], particles: Particles, radius: f64) -> Self {
        Self { sets, particles, radius }
    }

    /// Number of contacts.
    pub fn contact_count(&self) -> usize {
        self.sets.iter().map(ContactSet::len).sum()
    }

    /// Solves a copy with the method and the iterations of `settings`.
    ///
    /// # Errors
    /// [`DemError::Scene`] for settings that no simulation would take.
    pub fn solve(&self, settings: &SolverSettings) -> Result<FrozenSolution, DemError> {
        settings.check()?;
        let mut copy = self.clone();
        let work = copy.run(settings);
        let Self { mut sets, mut particles, .. } = copy;
        let residual = ResidualSums::of(&sets.each_mut(), &mut particles.bodies).relative();
        let batches = sets.iter().flat_map(|set| &set.batches);
        let grains = &particles.bodies[..particles.count()];
        Ok(FrozenSolution {
            velocities: (0..particles.count()).map(|grain| particles.velocity(grain)).collect(),
            spins: grains.iter().map(|body| body.spin.vector()).collect(),
            residual,
            normal_impulse: batches.flat_map(|batch| batch.lambda_n.0).sum(),
            closing: work.closing,
            sweeps: work.sweeps,
            guarded: work.guarded,
            unconverged: work.unconverged,
        })
    }

    /// Sums of the squares of the natural-map residual after the warm start and after a solve
    /// `[m^2/s^2]`.
    #[cfg(test)]
    pub(crate) fn merits(&self, settings: &SolverSettings) -> [f64; 2] {
        let mut warm = self.clone();
        let mut warm_sets = warm.sets.each_mut();
        for set in &mut warm_sets {
            solver::nsgs::warm_start(set, &mut warm.particles.bodies, &Threads::default());
        }
        let before = ResidualSums::of(&warm_sets, &mut warm.particles.bodies).squares();
        let mut copy = self.clone();
        copy.run(settings);
        [before, ResidualSums::of(&copy.sets.each_mut(), &mut copy.particles.bodies).squares()]
    }

    /// Solves it where it is.
    fn run(&mut self, settings: &SolverSettings) -> SolveInfo {
        let Self { sets, particles, radius } = self;
        let threads = Threads::default();
        let sets = &mut sets.each_mut();
        solver::solve(sets, &mut particles.bodies, settings, None, *radius, None, &threads)
    }
}
