//! What is told of the rows of a data set, whoever reads them.

use granulcal_dataset::Dataset;

/// Warns of rows whose damage cannot be found, and of rows of another law.
pub fn warn_of(dataset: &Dataset) {
    if let Some(first) = dataset.unverified.first() {
        tracing::warn!(
            "{} files of an earlier version have no hash of their rows, {} the first: damage in them cannot be found",
            dataset.unverified.len(),
            first.display()
        );
    }
    if let Some(other) = dataset.header.other_law() {
        tracing::warn!("the rows were {other}");
    }
}
