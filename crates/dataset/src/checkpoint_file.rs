//! Checkpoints as files: a simulation that goes on where another was.

use std::path::Path;

use granulcal_dem::{CheckpointHeader, DemError, Simulation};

use crate::{DatasetError, Form, files};

/// Writes the whole state of a simulation; the file that was there before stays until the new one is complete.
///
/// # Errors
/// [`DatasetError::Io`].
pub fn write_checkpoint(path: &Path, simulation: &Simulation) -> Result<(), DatasetError> {
    files::write_file(path, Form::Checkpoint, &simulation.checkpoint())
}

/// Takes `simulation`, just made from a scene and a seed, to where the checkpoint at `path` was written.
///
/// # Errors
/// [`DatasetError::Io`], or [`DatasetError::Checkpoint`] for a file that is no checkpoint, damaged, or of another
/// version, scene, seed or settings.
pub fn resume_checkpoint(path: &Path, simulation: Simulation) -> Result<Simulation, DatasetError> {
    simulation.resume(&files::read(path)?).map_err(refused(path))
}

/// Reads what the checkpoint at `path` is of, and that it is whole.
///
/// # Errors
/// As [`resume_checkpoint`].
pub fn read_checkpoint_header(path: &Path) -> Result<CheckpointHeader, DatasetError> {
    CheckpointHeader::read(&files::read(path)?).map_err(refused(path))
}

fn refused(path: &Path) -> impl FnOnce(DemError) -> DatasetError {
    move |source| DatasetError::Checkpoint { path: path.to_owned(), source }
}
