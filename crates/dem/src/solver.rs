//! Solvers of one substep's contact problem.

pub(crate) mod nsgs;
