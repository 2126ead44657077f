//! How far a batch is, and a chunk of its rows that is not complete.

use granulcal_dem::Status;

use crate::row::{Row, RowStatus};

/// How far a batch is. Rows count for this shard only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Rows asked for.
    pub total: u64,
    /// Rows that were in the folder already.
    pub resumed: u64,
    /// Rows made by this call.
    pub made: u64,
    /// Rows, resumed or made, whose numbers cannot be used.
    pub unhealthy: u64,
    /// Rows, resumed or made, with too few grains in view.
    pub no_grains_in_view: u64,
    /// Rows, resumed or made, in which grains remain in the funnel.
    pub jammed: u64,
    /// Rows, resumed or made, that were still moving at the horizon.
    pub at_horizon: u64,
    /// Rows on disk beyond those asked for, left as they are.
    pub beyond: u64,
    /// Parts that were in the folder already and do not say what their rows hash to.
    pub unverified: u64,
}

impl Progress {
    /// Counts how a row ended, resumed or made.
    pub(super) fn count(&mut self, status: RowStatus) {
        self.unhealthy += u64::from(status == RowStatus::Pour(Status::Unhealthy));
        self.jammed += u64::from(status.is_jammed());
        self.at_horizon += u64::from(status == RowStatus::Pour(Status::Horizon));
        self.no_grains_in_view += u64::from(status == RowStatus::NoGrainsInView);
    }
}

/// A chunk that is not complete: the rows it has and how many it lacks.
#[derive(Debug)]
pub(super) struct OpenChunk {
    pub(super) rows: Vec<Row>,
    pub(super) left: u64,
    pub(super) changed: bool,
}
