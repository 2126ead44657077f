//! How far the grains reach, how the tail thins out, and how much is in view.
//!
//! r_95 and r_99 are quantiles of the distance from the pour axis, interpolated linearly as the
//! interquartile ranges. Beyond r_95, for radii r₁ … r_k,
//!
//! \\[ \mathrm{tail\_index} = \frac{1}{k} \sum_{i=1}^{k} \ln \frac{r_i}{r_{95}} \\]
//!
//! is Hill's estimate of 1/α where the share of points beyond r falls as r^{-α}; its inverse is the tail's
//! slope on doubly logarithmic paper, and it stays finite where that does not. 0 where nothing lies beyond
//! r_95, or r_95 is 0.
//!
//! Source: Hill 1975, doi:10.1214/aos/1176343247.

use super::survey::{Diagnostic, Survey};
use crate::stats::Behaviour;

/// Radius about the pour axis that holds 95 % of the points.
pub(super) const R_95: Diagnostic = Diagnostic {
    name: "r_95",
    unit: "m",
    doc: "radius about the pour axis that holds 95 % of the points",
    behaviour: Behaviour::LENGTH,
    value: |survey| survey.r_95,
};

/// Radius about the pour axis that holds 99 % of the points.
pub(super) const R_99: Diagnostic = Diagnostic {
    name: "r_99",
    unit: "m",
    doc: "radius about the pour axis that holds 99 % of the points",
    behaviour: Behaviour::LENGTH,
    value: |survey| survey.r_99,
};

/// How heavy the tail is.
pub(super) const TAIL_INDEX: Diagnostic = Diagnostic {
    name: "tail_index",
    unit: "-",
    doc: "Hill's estimate of 1/a for a share of points beyond r that falls as r^-a, from r_95 on",
    behaviour: Behaviour::NUMBER,
    value: tail_index,
};

/// Number of points.
pub(super) const COUNT_IN_VIEW: Diagnostic = Diagnostic {
    name: "count_in_view",
    unit: "-",
    doc: "number of points: pixels of the image that see a grain",
    behaviour: Behaviour::NUMBER,
    value: |survey| survey.r.len() as f64,
};

fn tail_index(survey: &Survey) -> f64 {
    let inner = survey.r_95;
    let (mut total, mut count) = (0.0, 0_u32);
    for r in survey.r.iter().filter(|r| **r > inner) {
        total += r.ln() - inner.ln();
        count += 1;
    }
    if count > 0 && inner > 0.0 { total / f64::from(count) } else { 0.0 }
}
