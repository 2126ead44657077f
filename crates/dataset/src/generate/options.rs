//! What a batch is asked for.

use std::str::FromStr;
use std::time::Duration;

use crate::DatasetError;

/// Which part of the rows one machine of several makes: chunk c belongs to shard c mod count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// From 0 to count - 1.
    pub index: u64,
    /// How many shards there are.
    pub count: u64,
}

impl Shard {
    /// Everything.
    pub const WHOLE: Self = Self { index: 0, count: 1 };
}

impl FromStr for Shard {
    type Err = DatasetError;

    fn from_str(text: &str) -> Result<Self, DatasetError> {
        let parse = || {
            let (index, count) = text.split_once('/')?;
            let shard = Self { index: index.parse().ok()?, count: count.parse().ok()? };
            (shard.index < shard.count).then_some(shard)
        };
        let allowed = "i/k with whole numbers 0 <= i < k";
        parse().ok_or(DatasetError::Argument { what: "shard", got: format!("{text:?}"), allowed })
    }
}

/// What [`generate`](fn@crate::generate) is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GenerateOptions {
    /// Rows of the whole data set, over all shards.
    pub rows: u64,
    /// Seed of the data set, below 2^63.
    pub seed: u64,
    /// Which rows are made here.
    pub shard: Shard,
    /// Pours at once.
    pub threads: usize,
    /// Rows in a part; a folder keeps the number that it began with.
    pub chunk: u64,
    /// Longest time that a finished row is in memory only.
    pub flush_every: Duration,
    /// Whether rows that are in the folder already are kept; else a folder with rows is refused.
    pub resume: bool,
}

impl Default for GenerateOptions {
    /// 1000 rows on all cores, in parts of 16, on disk within 30 s.
    fn default() -> Self {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let (shard, flush_every) = (Shard::WHOLE, Duration::from_secs(30));
        Self { rows: 1000, seed: 0, shard, threads, chunk: 16, flush_every, resume: true }
    }
}
