//! The registry of statistics: what the depth image of a formation is reduced to.
//!
//! [`PAPER16`] is the vector T(X) of the paper, in its order. x, y, z are the coordinates of the
//! grain points with x and y counted from their centroid, r = √(x² + y²) is the distance from the
//! axis. [`DIAGNOSTICS`] is a second family that says where two formations differ. One kind of
//! statistic is one file; `docs/theory/statistics.md` has the derivations.

pub mod chi;
pub mod diagnostics;
pub mod distance_correlation;
pub mod iqr;
pub mod kurtosis;
pub mod max;
pub mod mean;
mod prepared;
pub mod sd;
mod statistic;
mod sum;

use nalgebra::Vector3;

pub use chi::ChiFit;
pub use diagnostics::{
    DIAGNOSTIC_COUNT, DIAGNOSTICS, Diagnostic, DiagnosticSettings, Survey, diagnostics,
};
pub use prepared::{MAX_COORDINATE, MIN_POINTS, Prepared};
pub use statistic::{Behaviour, Lift, Rotation, Statistic};

use crate::error::FeatureError;

/// The 16 summary statistics of the paper, in the paper's order.
pub const PAPER16: [Statistic; 16] = [
    max::MAX_Z,
    mean::MEAN_Z,
    sd::SD_Z,
    max::MAX_R,
    mean::MEAN_R,
    sd::SD_X,
    sd::SD_Y,
    sd::SD_R,
    iqr::IQR_X,
    iqr::IQR_Y,
    iqr::IQR_R,
    kurtosis::KURTOSIS_R,
    distance_correlation::DCOR_R_Z,
    chi::CHI_DF,
    chi::CHI_SHIFT,
    chi::CHI_SCALE,
];

/// The values of [`PAPER16`] for points in metres, ground at z = 0; x and y are centred at the
/// points' centroid first.
///
/// # Errors
/// `TooFewPoints` below [`MIN_POINTS`], `NonFinite` for NaN and infinities, `OutOfRange` for a
/// coordinate beyond [`MAX_COORDINATE`].
pub fn paper16(points: &[Vector3<f64>]) -> Result<[f64; 16], FeatureError> {
    let prepared = Prepared::new(points)?;
    Ok(PAPER16.map(|statistic| (statistic.value)(&prepared)))
}

#[cfg(test)]
mod conformance;
