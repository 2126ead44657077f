//! Functions about files: what a command reads and writes, and files that are whole or absent.

use std::path::PathBuf;

use granulcal_dataset::{Claims, Form, Input, Product};
use pyo3::prelude::*;

use crate::error;

/// Refuses outputs that are inputs, that would replace a file of another kind, or that cannot be written.
///
/// `reads` are (argument, path, "file", "recording" or "kept"); `writes` are (argument, path, kind of the output).
#[pyfunction]
pub(crate) fn check_paths(
    py: Python<'_>,
    reads: Vec<(String, PathBuf, String)>,
    writes: Vec<(String, PathBuf, String)>,
) -> PyResult<()> {
    let mut claims = Claims::default();
    for (argument, path, kind) in &reads {
        let input = match kind.as_str() {
            "recording" => Input::Recording,
            "kept" => Input::Kept,
            _ => Input::File,
        };
        claims.read(argument, path, input);
    }
    for (argument, path, kind) in &writes {
        claims.write(argument, path, kind.parse::<Product>().map_err(error::dataset)?);
    }
    py.detach(|| claims.check()).map_err(error::dataset)
}

/// The TOML of the camera by which images without one of their own are read; None of other recordings.
#[pyfunction]
pub(crate) fn camera_beside(path: PathBuf) -> Option<PathBuf> {
    granulcal_dataset::camera_beside(&path)
}

/// Writes a whole file or none; it may replace a file of its own kind, which `ending` names; one of another ending,
/// anything but TOML.
#[pyfunction]
pub(crate) fn write_file(
    py: Python<'_>,
    path: PathBuf,
    ending: &str,
    bytes: &[u8],
) -> PyResult<()> {
    // Input of other programs has many endings; no TOML that stands there is replaced by it.
    let form = Form::of_ending(ending).unwrap_or(Form::Export);
    py.detach(|| granulcal_dataset::write_file(&path, form, bytes)).map_err(error::dataset)
}

/// A message of at most 60 lines of 1000 letters in which nothing steers a terminal.
#[pyfunction]
pub(crate) fn readable(text: &str) -> String {
    granulcal_dataset::readable(text).into_owned()
}

/// XXH3 of 128 bits, as 32 hexadecimal digits.
#[pyfunction]
pub(crate) fn hash_bytes(py: Python<'_>, bytes: &[u8]) -> String {
    py.detach(|| format!("{:032x}", xxhash_rust::xxh3::xxh3_128(bytes)))
}
