//! How far a batch is, and a chunk of its rows that is not complete.

use crate::row::Row;

/// How far a batch is. Rows count for this shard only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Rows asked for.
    pub total: u64,
    /// Rows that were in the folder already.
    pub resumed: u64,
    /// Rows made by this call.
    pub made: u64,
    /// Rows, resumed or made, whose numbers cannot be used: unhealthy, or no grains in view.
    pub unhealthy: u64,
    /// Rows, resumed or made, in which grains remain in the funnel.
    pub jammed: u64,
    /// Rows on disk beyond those asked for, left as they are.
    pub beyond: u64,
}

/// A chunk that is not complete: the rows it has and how many it lacks.
#[derive(Debug)]
pub(super) struct OpenChunk {
    pub(super) rows: Vec<Row>,
    pub(super) missing: Vec<u64>,
    pub(super) changed: bool,
}
