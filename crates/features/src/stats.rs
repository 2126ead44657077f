//! The registry of statistics: what the depth image of a formation is reduced to.
//!
//! [`PAPER16`] is the vector T(X) of the paper, in its order. x, y, z are the coordinates of the
//! grain points with x and y counted from their centroid, r = √(x² + y²) is the distance from the
//! axis. One family of statistics is one file; `docs/theory/features.md` has the derivations.

pub mod chi;
pub mod distance_correlation;
pub mod iqr;
pub mod kurtosis;
pub mod max;
pub mod mean;
mod prepared;
pub mod sd;

use nalgebra::Vector3;

pub use chi::ChiFit;
pub use prepared::Prepared;

use crate::error::FeatureError;

/// Points below which no statistic is computed: two have no spread in a plane worth the name.
pub const MIN_POINTS: usize = 3;

/// A named number that describes a formation.
#[derive(Debug, Clone, Copy)]
pub struct Statistic {
    /// Its name in every file, table and plot.
    pub name: &'static str,
    /// Its unit, "-" if dimensionless.
    pub unit: &'static str,
    /// What it is, in one line.
    pub doc: &'static str,
    /// How it answers to a change of frame.
    pub behaviour: Behaviour,
    /// Its value; finite for whatever [`Prepared`] accepts.
    pub value: fn(&Prepared) -> f64,
}

/// How a statistic answers to a change of frame. None of them notices a shift along x and y.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Behaviour {
    /// Points scaled by c scale the value by c to this power.
    pub length_power: i32,
    /// Whether a rotation about z leaves the value as it is.
    pub rotation_invariant: bool,
    /// Whether points lifted by h lift the value by h; the value stays as it is otherwise.
    pub rises_with_z: bool,
}

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
/// coordinate beyond 1000 km.
pub fn paper16(points: &[Vector3<f64>]) -> Result<[f64; 16], FeatureError> {
    let prepared = Prepared::new(points)?;
    Ok(PAPER16.map(|statistic| (statistic.value)(&prepared)))
}

impl Behaviour {
    /// A length that no rotation about z and no lift changes.
    const LENGTH: Self = Self { length_power: 1, rotation_invariant: true, rises_with_z: false };
    /// A length along a horizontal axis: it turns with the axes.
    const AXIS_LENGTH: Self = Self { rotation_invariant: false, ..Self::LENGTH };
    /// A height above the ground.
    const HEIGHT: Self = Self { rises_with_z: true, ..Self::LENGTH };
    /// A pure number.
    const NUMBER: Self = Self { length_power: 0, ..Self::LENGTH };
}

#[cfg(test)]
mod conformance;
