//! The second family of statistics: what shows *where* a simulated formation differs.
//!
//! The paper's 16 numbers count from the centroid and know no direction, so that a tilted table, a bent
//! funnel or a crater's depth hide in them. [`DIAGNOSTICS`] count from the pour axis and keep directions
//! and the profile apart. They never replace the 16: they explain a residual that those have found.
//! `docs/theory/statistics.md` has every equation with its source.

mod bodies;
mod modes;
mod patches;
mod profile;
mod roughness;
mod settings;
mod shoulder;
mod survey;
mod tail;

use nalgebra::Vector3;

use crate::error::FeatureError;
pub use settings::DiagnosticSettings;
pub use survey::{Diagnostic, Survey};

/// Number of statistics of the second family.
pub const DIAGNOSTIC_COUNT: usize = LIST.len();

/// The diagnostic statistics, in the order of every file and table.
pub const DIAGNOSTICS: [Diagnostic; DIAGNOSTIC_COUNT] =
    *LIST.first_chunk().expect("the whole list");

/// A new statistic is a file in `diagnostics/` and a line at the end of this list.
const LIST: &[Diagnostic] = &[
    profile::HEIGHTS[0],
    profile::HEIGHTS[1],
    profile::HEIGHTS[2],
    profile::HEIGHTS[3],
    profile::HEIGHTS[4],
    profile::HEIGHTS[5],
    profile::HEIGHTS[6],
    profile::HEIGHTS[7],
    profile::HEIGHTS[8],
    profile::HEIGHTS[9],
    profile::HEIGHTS[10],
    profile::HEIGHTS[11],
    profile::HEIGHTS[12],
    profile::HEIGHTS[13],
    profile::HEIGHTS[14],
    profile::HEIGHTS[15],
    profile::HEIGHTS[16],
    profile::HEIGHTS[17],
    profile::HEIGHTS[18],
    profile::HEIGHTS[19],
    profile::SLOPE,
    profile::RING_DEPTH,
    modes::MASS[0],
    modes::MASS[1],
    modes::MASS[2],
    modes::MASS[3],
    modes::MASS[4],
    modes::MASS[5],
    modes::RIM[0],
    modes::RIM[1],
    modes::RIM[2],
    modes::RIM[3],
    modes::RIM[4],
    modes::RIM[5],
    tail::R_95,
    tail::R_99,
    tail::TAIL_INDEX,
    bodies::ISOLATED_GRAINS,
    bodies::CLUSTERS,
    tail::COUNT_IN_VIEW,
    patches::PATCHES,
    roughness::ROUGHNESS,
    shoulder::SHOULDER,
];

/// The values of [`DIAGNOSTICS`] for points in metres, ground at z = 0; finite for whatever is accepted.
///
/// # Errors
/// `TooFewPoints` below [`super::MIN_POINTS`], `NonFinite` for NaN and infinities, `OutOfRange` for a
/// setting, a coordinate beyond [`super::MAX_COORDINATE`] or points that reach over 10¹² spacings.
pub fn diagnostics(
    points: &[Vector3<f64>],
    settings: &DiagnosticSettings,
) -> Result<[f64; DIAGNOSTIC_COUNT], FeatureError> {
    let survey = Survey::new(points, settings)?;
    Ok(DIAGNOSTICS.map(|statistic| (statistic.value)(&survey)))
}

#[cfg(test)]
mod tests;
