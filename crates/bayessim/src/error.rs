//! The one error type of the crate.

use std::path::PathBuf;

use granulcal_dataset::DatasetError;
use granulcal_scene::SceneError;

/// Why a model, an observation or a question was refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A file of the model cannot be read.
    #[error(transparent)]
    File(DatasetError),
    /// `model.json` is cut off, or is the document of something else.
    #[error("{} is not the document of a model", path.display())]
    Document {
        /// The file.
        path: PathBuf,
        /// Where and why.
        source: serde_json::Error,
    },
    /// A model of another version.
    #[error("{}: version must be {allowed}, got {found} (made by {made_by}): {advice}", path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// The versions that can be read.
        allowed: &'static str,
        /// What the file says.
        found: String,
        /// Who wrote it.
        made_by: String,
        /// What helps.
        advice: &'static str,
    },
    /// The tensors' file is cut off or no safetensors.
    #[error("{} is truncated or no safetensors: {reason}", path.display())]
    Tensors {
        /// The file.
        path: PathBuf,
        /// What the reader said.
        reason: String,
    },
    /// What stands in a file is not what was written into it.
    #[error("{}: {what} is damaged: its hash is {found}, written was {stated}; take a copy, or train again", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The tensor, or the document.
        what: String,
        /// The hash of what is there.
        found: String,
        /// The hash that was written.
        stated: String,
    },
    /// A tensor or a number is missing, of another shape, or not finite.
    #[error("{}: {what} must be {allowed}, got {found}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// The thing in the file.
        what: String,
        /// What is allowed.
        allowed: String,
        /// What was found.
        found: String,
    },
    /// The prior of the model is none.
    #[error("the prior in {}", path.display())]
    Prior {
        /// The file.
        path: PathBuf,
        /// Why.
        source: Box<SceneError>,
    },
    /// What was asked of a posterior has no answer.
    #[error("{what} must be {allowed}, got {found}")]
    Argument {
        /// The argument.
        what: &'static str,
        /// What is allowed.
        allowed: String,
        /// What was found.
        found: String,
    },
    /// An observation that the model cannot take.
    #[error("the observation must be {allowed}, got {found}")]
    Observation {
        /// What is allowed.
        allowed: String,
        /// What was found.
        found: String,
    },
}
