//! Function `run_cli`.

use std::ffi::OsString;

use pyo3::prelude::*;

/// Runs a command line of granulcal-cli, the name of the program first; returns its exit code.
#[pyfunction]
pub(crate) fn run_cli(py: Python<'_>, args: Vec<OsString>) -> u8 {
    py.detach(|| granulcal_cli::run(args))
}
