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
mod sum;

use std::fmt;

use nalgebra::Vector3;

pub use chi::ChiFit;
pub use diagnostics::{
    DIAGNOSTIC_COUNT, DIAGNOSTICS, Diagnostic, DiagnosticSettings, Survey, diagnostics,
};
pub use prepared::{MAX_COORDINATE, Prepared};

use crate::error::FeatureError;

/// Points below which no statistic is computed: two have no spread in a plane worth the name.
pub const MIN_POINTS: usize = 3;

/// A named number that describes a formation, from points that were prepared for its family.
pub struct Statistic<P = Prepared> {
    /// Its name in every file, table and plot.
    pub name: &'static str,
    /// Its unit, "-" if dimensionless.
    pub unit: &'static str,
    /// What it is, in one line.
    pub doc: &'static str,
    /// How it answers to a change of frame.
    pub behaviour: Behaviour,
    /// Its value; finite for whatever `P` accepts.
    pub value: fn(&P) -> f64,
}

// Derived, these would ask the same of the points.
impl<P> Clone for Statistic<P> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<P> Copy for Statistic<P> {}

impl<P> fmt::Debug for Statistic<P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Statistic({} [{}])", self.name, self.unit)
    }
}

/// How a statistic answers to a change of frame. None of them notices a shift along x and y of
/// everything, or the order of the points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Behaviour {
    /// Lengths scaled by c scale the value by c to this power.
    pub length_power: i32,
    /// What a rotation about the vertical does.
    pub rotation: Rotation,
    /// What a lift of all points does.
    pub lift: Lift,
}

/// What a rotation of the points about the vertical does to a statistic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rotation {
    /// Nothing.
    Invariant,
    /// It belongs to a horizontal axis, which does not turn with the points: the value changes.
    Axis,
    /// It is the cosine or the sine part of an azimuthal mode: the pair, as a complex number, is
    /// multiplied by e^(i order α).
    Mode {
        /// Periods around the circle.
        order: u8,
    },
}

/// What it does to a statistic to lift all points by h.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lift {
    /// Nothing.
    Invariant,
    /// The value rises by h.
    Rises,
    /// The value changes: heights are weights in it.
    Changes,
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
/// coordinate beyond [`MAX_COORDINATE`].
pub fn paper16(points: &[Vector3<f64>]) -> Result<[f64; 16], FeatureError> {
    let prepared = Prepared::new(points)?;
    Ok(PAPER16.map(|statistic| (statistic.value)(&prepared)))
}

impl Behaviour {
    /// A length that no rotation about z and no lift changes.
    const LENGTH: Self =
        Self { length_power: 1, rotation: Rotation::Invariant, lift: Lift::Invariant };
    /// A length along a horizontal axis.
    const AXIS_LENGTH: Self = Self { rotation: Rotation::Axis, ..Self::LENGTH };
    /// A height above the ground.
    const HEIGHT: Self = Self { lift: Lift::Rises, ..Self::LENGTH };
    /// A pure number.
    const NUMBER: Self = Self { length_power: 0, ..Self::LENGTH };
    /// A length in which heights are weights.
    const WEIGHED_LENGTH: Self = Self { lift: Lift::Changes, ..Self::LENGTH };
    /// A pure number in which heights are weights.
    const WEIGHED_NUMBER: Self = Self { lift: Lift::Changes, ..Self::NUMBER };
}

#[cfg(test)]
mod conformance;
