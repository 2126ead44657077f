//! The rows that are left to make, one after the other and never all at once: there may be billions of them.

use std::collections::{BTreeMap, VecDeque};

use super::options::{GenerateOptions, Shard};

/// The rows of a shard that no part has.
pub(super) struct Queue {
    /// Rows that the chunks with a part lack.
    missing: BTreeMap<u64, Vec<u64>>,
    rows: u64,
    size: u64,
    step: u64,
    chunk: u64,
    /// What is left of the chunk before.
    left: VecDeque<u64>,
}

impl Queue {
    /// All rows but those that the chunks in `missing` do not lack; `size` rows are a chunk.
    pub(super) fn new(
        missing: BTreeMap<u64, Vec<u64>>,
        options: &GenerateOptions,
        size: u64,
    ) -> Self {
        let Shard { index, count } = options.shard;
        let (rows, left) = (options.rows, VecDeque::new());
        Self { missing, rows, size, step: count, chunk: index, left }
    }
}

impl Iterator for Queue {
    type Item = u64;

    fn next(&mut self) -> Option<u64> {
        while self.left.is_empty() {
            let first = self.chunk.checked_mul(self.size).filter(|&first| first < self.rows)?;
            let end = first.saturating_add(self.size).min(self.rows);
            self.left = match self.missing.remove(&self.chunk) {
                Some(missing) => missing.into(),
                None => (first..end).collect(),
            };
            self.chunk = self.chunk.checked_add(self.step)?;
        }
        self.left.pop_front()
    }
}
