//! Solvers of one substep's contact problem: three methods behind one assembly.
//!
//! Each begins with the contacts as assembled (normals, biases) and the impulses that they carry from the substep
//! before, the warm start, and leaves the impulses and velocities of its solution.
//! docs/theory/solvers.md derives and compares them; each file reads as its box there.

use std::fmt;
use std::str::FromStr;

use crate::parallel::Threads;
use serde::{Deserialize, Serialize};

use crate::DemError;
use crate::bed::Body;
use crate::clumps::Clumps;
use crate::contact_set::ContactSet;
use crate::preset::SolverSettings;

mod components;
pub(crate) mod frozen;
pub(crate) mod newton_pcr;
pub(crate) mod nsgs;
mod pcr;
pub(crate) mod reference;

/// How the contact problem of a substep is solved. All methods solve the same problem.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Non-smooth Gauss-Seidel: fast, and what every preset but `paper` uses.
    #[default]
    Nsgs,
    /// Non-smooth Newton on a matrix-free conjugate residual solver (Macklin et al. 2019), guarded.
    NewtonPcr,
    /// Non-smooth Gauss-Seidel with conjugate directions, iterated to a stated residual.
    Reference,
}

impl Method {
    /// Every method.
    pub const ALL: [Self; 3] = [Self::Nsgs, Self::NewtonPcr, Self::Reference];

    /// The word for it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nsgs => "nsgs",
            Self::NewtonPcr => "newton_pcr",
            Self::Reference => "reference",
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Method {
    type Err = DemError;

    fn from_str(word: &str) -> Result<Self, DemError> {
        Self::ALL
            .into_iter()
            .find(|method| method.name() == word)
            .ok_or_else(|| DemError::UnknownMethod { got: word.to_owned() })
    }
}

/// What a solve took and what it left.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Work {
    /// Passes over all contacts: Gauss-Seidel sweeps and iterations of the linear solver.
    pub sweeps: usize,
    /// Fastest closing `-(w_n + b)` of a contact at the last look `[m/s]`.
    pub closing: f64,
    /// Newton steps that the guard has damped or replaced.
    pub guarded: usize,
    /// Whether the method's own measure of success was missed when its iterations were used up.
    pub unconverged: bool,
}

/// Solves the contacts of `sets` together, from the impulses that they carry and velocities without them;
/// `still` is the change of an impulse that counts as none in a quiet state, if this is one `[m/s]`, `radius` that of a
/// typical grain `[m]`. The spheres of `clumps` move as one.
pub(crate) fn solve(
    sets: &mut [&mut ContactSet],
    bodies: &mut [Body],
    settings: &SolverSettings,
    still: Option<f64>,
    radius: f64,
    clumps: Option<&mut Clumps>,
    threads: &Threads,
) -> Work {
    for set in sets.iter_mut() {
        nsgs::warm_start(set, bodies, threads);
    }
    let too_fast = settings.closing * radius / settings.dt;
    match settings.method {
        Method::Nsgs => nsgs::solve(sets, bodies, settings, still, radius, clumps, threads),
        Method::NewtonPcr => newton_pcr::solve(sets, bodies, &settings.newton, too_fast, threads),
        Method::Reference => reference::solve(sets, bodies, &settings.reference, threads),
    }
}

#[cfg(test)]
mod tests;
