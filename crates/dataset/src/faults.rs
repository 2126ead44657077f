//! What is wrong with several files, told at once.

use crate::DatasetError;

/// Errors of files that were looked at one after another, those after a bad one, too.
#[derive(Debug, Default)]
pub(crate) struct Faults(Vec<DatasetError>);

impl Faults {
    /// The value of a file; none, and the error is kept, of a bad one.
    pub fn keep<T>(&mut self, found: Result<T, DatasetError>) -> Option<T> {
        found.map_err(|error| self.0.push(error)).ok()
    }

    /// # Errors
    /// The one error that was kept, or [`DatasetError::Several`].
    pub fn require_none(self) -> Result<(), DatasetError> {
        if self.0.is_empty() { Ok(()) } else { Err(several(self.0)) }
    }
}

/// One error of those of several files, at least one.
pub(crate) fn several(mut all: Vec<DatasetError>) -> DatasetError {
    if all.len() == 1 { all.remove(0) } else { DatasetError::Several { all } }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bad(path: &str) -> Result<(), DatasetError> {
        Err(DatasetError::content(std::path::Path::new(path), "the text", "x", "y"))
    }

    #[test]
    fn one_is_itself_and_several_are_all_named() {
        let mut faults = Faults::default();
        assert_eq!(faults.keep(Ok(3)), Some(3));
        Faults::default().require_none().unwrap();
        assert!(faults.keep(bad("a")).is_none());
        let only = std::mem::take(&mut faults).require_none().unwrap_err();
        assert_eq!(only.to_string(), bad("a").unwrap_err().to_string());
        faults.keep(bad("a"));
        faults.keep(bad("b"));
        let both = faults.require_none().unwrap_err();
        assert!(both.is_bad_input());
        let told = both.to_string();
        assert_eq!(told.lines().next(), Some("2 files cannot be used:"));
        assert!(told.contains("\n  a: the text") && told.contains("\n  b: the text"), "{told}");
    }
}
