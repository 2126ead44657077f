//! One parameter of a prior.

use crate::{DatasetError, Distribution};

/// One parameter of a prior.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Path of the number in the scene, for example `material.sliding_friction`.
    pub path: String,
    /// Its distribution.
    pub distribution: Distribution,
}

/// What is wrong with a parameter, for messages.
pub(super) fn refuse(
    parameter: &str,
    what: &'static str,
    got: String,
    allowed: &'static str,
) -> DatasetError {
    DatasetError::Prior { parameter: parameter.to_owned(), what, got, allowed }
}
