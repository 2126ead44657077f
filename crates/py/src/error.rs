//! Errors of the crates as the exceptions that Python programmers expect.

use std::error::Error;
use std::io;

use granulcal_bayessim::ModelError;
use granulcal_dataset::{DatasetError, readable};
use granulcal_dem::DemError;
use granulcal_features::FeatureError;
use pyo3::PyErr;
use pyo3::exceptions::{PyBlockingIOError, PyOSError, PyRuntimeError, PyValueError};

/// A refused scene or simulation: ValueError.
pub(crate) fn dem(error: impl Into<DemError>) -> PyErr {
    PyValueError::new_err(chain(&error.into()))
}

/// A refused part of a model: ValueError.
pub(crate) fn model(error: ModelError) -> PyErr {
    PyValueError::new_err(chain(&error))
}

/// A refused image or cloud of points: ValueError.
pub(crate) fn features(error: FeatureError) -> PyErr {
    PyValueError::new_err(chain(&error))
}

/// Files: the matching OSError; what stands in them and arguments: ValueError.
pub(crate) fn dataset(error: DatasetError) -> PyErr {
    match &error {
        DatasetError::Io { action, path, source } => {
            os_error(action, &path.display().to_string(), source)
        }
        DatasetError::Row { source, .. } if matches!(**source, DatasetError::Io { .. }) => {
            PyOSError::new_err(chain(&error))
        }
        DatasetError::Locked { .. } => PyBlockingIOError::new_err(chain(&error)),
        other if other.is_bad_input() => PyValueError::new_err(chain(&error)),
        _ => PyRuntimeError::new_err(chain(&error)),
    }
}

/// OSError of the subclass that belongs to the number, with its file name.
fn os_error(action: &str, path: &str, source: &io::Error) -> PyErr {
    match source.raw_os_error() {
        // Python turns (number, text, file) into FileNotFoundError, PermissionError and their kin.
        Some(number) => {
            let text = source.to_string();
            let text = text.strip_suffix(&format!(" (os error {number})")).unwrap_or(&text);
            PyOSError::new_err((number, format!("cannot {action}: {text}"), path.to_owned()))
        }
        None => PyOSError::new_err(format!("cannot {action} {path}: {source}")),
    }
}

/// The message with its causes, joined as one line each, nothing endless in it.
fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text.push_str(": ");
        text.push_str(cause.to_string().trim_end());
        source = cause.source();
    }
    readable(&text).into_owned()
}
