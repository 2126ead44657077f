//! Functions of the command line.

use std::ffi::OsString;
use std::path::PathBuf;

use granulcal_cli::Program;
use granulcal_cli::interrupt::{self, Armed};
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
    // There signals do not come through a pipe.
    #[cfg(windows)]
    interrupt::handle_signals();
    Ok(py.detach(|| granulcal_cli::run_as(&program, args)))
}

/// A command of Python's half that signals end, until it is closed.
#[pyclass(module = "granulcal._native")]
pub(crate) struct Listener(Option<Armed>);

#[pymethods]
impl Listener {
    /// Hears no more.
    fn close(&mut self) {
        self.0 = None;
    }
}

/// Ends the process a second after the first byte of SIGINT or SIGTERM in a pipe, at once after the second.
#[pyfunction]
pub(crate) fn listen_for_signals(pipe: PathBuf) -> PyResult<Listener> {
    let armed = interrupt::listen(&pipe).map_err(|error| PyOSError::new_err(error.to_string()))?;
    Ok(Listener(Some(armed)))
}
