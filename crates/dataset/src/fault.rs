//! What is wrong inside a record or message, before it is known in which file it stands.

use std::fmt;
use std::path::Path;

use crate::DatasetError;

/// A thing, what was found and what is allowed; becomes a [`DatasetError::Content`] of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Fault {
    what: String,
    found: String,
    allowed: String,
}

impl Fault {
    pub(crate) fn new(
        what: impl Into<String>,
        found: impl Into<String>,
        allowed: impl Into<String>,
    ) -> Self {
        Self { what: what.into(), found: found.into(), allowed: allowed.into() }
    }

    /// The same fault, with the place where the thing stands.
    #[must_use]
    pub(crate) fn of(self, place: impl fmt::Display) -> Self {
        Self { what: format!("{} of {place}", self.what), ..self }
    }

    pub(crate) fn in_file(self, path: &Path) -> DatasetError {
        DatasetError::content(path, self.what, self.found, self.allowed)
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} must be {}, found {}", self.what, self.allowed, self.found)
    }
}
