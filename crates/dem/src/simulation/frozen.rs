//! Parts of the coming substep by themselves, for studies; the simulation stays as it is.

use super::Simulation;
use super::substep::Until;
use crate::contacts::Contacts;
use crate::error::DemError;
use crate::frozen_search::FrozenSearch;
use crate::problem::{ContactProblem, SWEEPS_A_LOOK};
use crate::solver::frozen::FrozenSolve;
use crate::solver::nsgs;

impl Simulation {
    /// The contact problem of the next substep, frozen as it is assembled, with its solution after
    /// as many sweeps as its residual needs to be rounding. The simulation itself stays as it is.
    ///
    /// # Errors
    /// [`DemError::NotInContactProblem`] for a scene with an effect that changes what a contact is.
    pub fn contact_problem(&self) -> Result<ContactProblem, DemError> {
        if let Some(effect) = self.beyond_plain_contacts() {
            return Err(DemError::NotInContactProblem { effect });
        }
        let mut twin = self.clone();
        let dt = twin.around.settings.dt;
        twin.substep(Until::Assembled);
        let (particles, contacts) = (&mut twin.particles, &mut twin.contacts);
        let mut problem = ContactProblem::new(particles, contacts, self.time(), dt);
        while !problem.is_solved() {
            problem.put_velocities(&mut particles.bodies);
            let Contacts { pairs, at_walls, .. } = &mut *contacts;
            nsgs::sweep_plainly(&mut [pairs, at_walls], &mut particles.bodies, SWEEPS_A_LOOK);
            problem.take_impulses(contacts, &particles.bodies, SWEEPS_A_LOOK);
        }
        Ok(problem)
    }

    /// The contact problem that the coming substep has to solve, for studies of solvers; the simulation stays as
    /// it is.
    ///
    /// # Errors
    /// [`DemError::Untold`] for grains with a shape, and for an effect that changes what a contact is.
    pub fn frozen_solve(&self) -> Result<FrozenSolve, DemError> {
        if let Some(effect) = self.beyond_plain_contacts() {
            return Err(DemError::Untold { what: "a frozen solve", effect });
        }
        let mut copy = self.clone();
        copy.substep(Until::Assembled);
        let Contacts { pairs, at_walls, .. } = copy.contacts;
        Ok(FrozenSolve::new([pairs, at_walls], copy.particles, self.around.least))
    }

    /// What of the scene makes contacts other than those of balls: a shape, or an effect that changes what a contact
    /// is.
    fn beyond_plain_contacts(&self) -> Option<&'static str> {
        let shape = self.bodies.as_ref().map(|_| "grains.shape");
        shape.or_else(|| self.origin.scene.effects.of_contacts())
    }

    /// The search for pairs of the present state, for studies of its cost; the simulation stays as it is.
    ///
    /// # Errors
    /// [`DemError::Untold`] for grains with a shape, which have a search of their own.
    pub fn frozen_search(&self) -> Result<FrozenSearch, DemError> {
        self.require_balls("a frozen search")?;
        Ok(FrozenSearch::new(self.particles.clone(), &self.around))
    }
}
