//! Solvers of one substep's contact problem: three methods behind one assembly.
//!
//! Each begins with the contacts as assembled (normals, biases) and the impulses that they carry from the substep
//! before, the warm start, and leaves the impulses and velocities of its solution.
//! docs/theory/solvers.md derives and compares them; each file reads as its box there.

use granulcal_scene::{Method, SolverSettings};

use crate::body::Body;
use crate::clumps::Clumps;
use crate::contact_set::ContactSet;
use crate::parallel::Threads;
use crate::solver::solve_info::SolveInfo;

mod components;
pub(crate) mod frozen;
pub(crate) mod newton_pcr;
pub(crate) mod nsgs;
mod pcr;
pub(crate) mod reference;
pub(crate) mod residual;
pub(crate) mod solve_info;
mod velocities;

/// [`solve`], or a method that goes on with it.
pub(crate) type Solve = fn(
    &mut [&mut ContactSet],
    &mut [Body],
    &SolverSettings,
    Option<f64>,
    f64,
    Option<&mut Clumps>,
    &Threads,
) -> SolveInfo;

/// Solves the contacts of `sets` together, from the impulses that they carry and velocities without them;
/// `quiet_tolerance` is the change of an impulse that counts as none in a quiet state, if this is one `[m/s]`, `radius`
/// that of the least grain `[m]`. The spheres of `clumps` move as one.
pub(crate) fn solve(
    sets: &mut [&mut ContactSet],
    bodies: &mut [Body],
    settings: &SolverSettings,
    quiet_tolerance: Option<f64>,
    radius: f64,
    clumps: Option<&mut Clumps>,
    threads: &Threads,
) -> SolveInfo {
    for set in sets.iter_mut() {
        nsgs::warm_start(set, bodies, threads);
    }
    let too_fast = settings.closing * radius / settings.dt;
    match settings.method {
        Method::Nsgs => {
            nsgs::solve(sets, bodies, settings, quiet_tolerance, radius, clumps, threads)
        }
        Method::NewtonPcr => newton_pcr::solve(sets, bodies, &settings.newton, too_fast, threads),
        Method::Reference => reference::solve(sets, bodies, &settings.reference, threads),
    }
}

#[cfg(test)]
mod tests;
