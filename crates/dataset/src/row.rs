//! One row of a data set: a pour, its parameters and its statistics.

use std::fmt;

use granulcal_dem::{Health, Status};
use granulcal_features::stats::DIAGNOSTIC_COUNT;

/// How a row ended: as its pour, or with too few grains in view to describe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RowStatus {
    /// The pour ended like this. The statistics are finite unless it is unhealthy or jammed out of view.
    Pour(Status),
    /// Too few grains are in view; the statistics are NaN.
    NoGrainsInView,
}

impl RowStatus {
    /// The word in the Parquet column.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pour(status) => status.name(),
            Self::NoGrainsInView => "no_grains_in_view",
        }
    }

    /// The status of a word, `None` for a word that is none.
    pub fn from_name(name: &str) -> Option<Self> {
        let all = Status::ALL.into_iter().map(Self::Pour).chain([Self::NoGrainsInView]);
        all.into_iter().find(|status| status.name() == name)
    }

    /// Every word, for messages.
    pub(crate) fn names() -> String {
        let pour = Status::ALL.into_iter().map(Status::name);
        let words: Vec<_> = pour.chain([Self::NoGrainsInView.name()]).collect();
        format!("one of {}", words.join(", "))
    }

    /// Whether the simulation can be trusted and shows something.
    pub fn is_healthy(self) -> bool {
        self != Self::Pour(Status::Unhealthy) && self != Self::NoGrainsInView
    }

    /// Whether the flow stopped with grains in the funnel: a healthy row, but not of a whole formation.
    pub fn is_jammed(self) -> bool {
        self == Self::Pour(Status::Jammed)
    }
}

impl fmt::Display for RowStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A pour as a data set keeps it.
#[derive(Clone, Debug)]
pub struct Row {
    /// Index of the row.
    pub row: u64,
    /// Values of the prior's parameters, fixed ones included, in the prior's order.
    pub parameters: Vec<f64>,
    /// Seed of the pour.
    pub seed: u64,
    /// How it ended.
    pub status: RowStatus,
    /// Simulated time `[s]`.
    pub simulated_s: f64,
    /// Whether the pour can be trusted, in numbers.
    pub health: Health,
    /// CPU time of simulation and camera `[s]`; the one number that differs between runs.
    pub cpu_s: f64,
    /// The paper's 16 statistics, NaN where too few grains are in view.
    pub statistics: [f64; 16],
    /// The diagnostic statistics, NaN where the statistics are and in files that were written without.
    pub diagnostics: [f64; DIAGNOSTIC_COUNT],
    /// The statistics that the scene observes, NaN where they could not be seen.
    pub observed: Vec<f64>,
}

impl Row {
    /// Whether two rows hold the same numbers, NaN equal to NaN and CPU time aside.
    pub fn same_as(&self, other: &Self) -> bool {
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        self.row == other.row
            && self.seed == other.seed
            && self.status == other.status
            && self.health == other.health
            && self.simulated_s == other.simulated_s
            && bits(&self.parameters) == bits(&other.parameters)
            && bits(&self.statistics) == bits(&other.statistics)
            && bits(&self.diagnostics) == bits(&other.diagnostics)
            && bits(&self.observed) == bits(&other.observed)
    }
}
