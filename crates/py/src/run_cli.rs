//! Functions of the command line.

use std::ffi::OsString;
use std::path::PathBuf;

use granulcal_cli::Program;
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;

/// Runs a command line, the name of the program first; returns its exit code.
///
/// `program` is JSON: name, `after_help` and the further commands of the program that the command is part of; without
/// it that is granulcal-cli.
#[pyfunction]
#[pyo3(signature = (args, program = None))]
pub(crate) fn run_cli(py: Python<'_>, args: Vec<OsString>, program: Option<&str>) -> PyResult<u8> {
    let program = match program {
        Some(text) => serde_json::from_str(text).map_err(|error| {
            PyValueError::new_err(format!("the program is no JSON of one: {error}"))
        })?,
        None => Program::default(),
    };
    Ok(py.detach(|| granulcal_cli::run_as(&program, args)))
}

/// Ends the process a second after the first byte of SIGINT in a pipe, at once after the second; until it is closed.
#[pyfunction]
pub(crate) fn listen_for_signals(pipe: PathBuf) -> PyResult<()> {
    granulcal_cli::interrupt::listen(&pipe).map_err(|error| PyOSError::new_err(error.to_string()))
}
