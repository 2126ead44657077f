//! What is told of the rows of a data set, whoever reads them.

use std::path::PathBuf;

use granulcal_dataset::Header;

/// Warns of rows whose damage cannot be found, and of rows of another law.
pub fn warn_of(header: &Header, unverified: &[PathBuf]) {
    if let Some(first) = unverified.first() {
        tracing::warn!(
            "{} files of an earlier version have no hash of their rows, {} the first: damage in them cannot be found",
            unverified.len(),
            first.display()
        );
    }
    if let Some(other) = header.other_law() {
        tracing::warn!("the rows were {other}");
    }
}
