//! Files beside a result: one that fails does not take the result with it.

use crate::context::note;
use crate::outcome::Outcome;

/// What went wrong with the files that were asked for beside the result.
#[derive(Debug, Default)]
pub struct SideFiles {
    errors: Vec<anyhow::Error>,
}

impl SideFiles {
    /// Keeps the error of one file for the end.
    pub fn keep<E: Into<anyhow::Error>>(&mut self, written: Result<(), E>) {
        self.errors.extend(written.err().map(Into::into));
    }

    /// Tells the errors, after the result was printed.
    pub fn finish(self, outcome: Outcome) -> Outcome {
        if self.errors.is_empty() {
            return outcome;
        }
        for error in &self.errors {
            note(&format!("error: {error:#}; the result is printed all the same"));
        }
        Outcome::SideFileFailed
    }
}
