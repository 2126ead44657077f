//! What a statistic is, and how it answers to a change of frame.

use std::fmt;

use super::prepared::Prepared;

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

impl Behaviour {
    /// A length that no rotation about z and no lift changes.
    pub(super) const LENGTH: Self =
        Self { length_power: 1, rotation: Rotation::Invariant, lift: Lift::Invariant };
    /// A length along a horizontal axis.
    pub(super) const AXIS_LENGTH: Self = Self { rotation: Rotation::Axis, ..Self::LENGTH };
    /// A height above the ground.
    pub(super) const HEIGHT: Self = Self { lift: Lift::Rises, ..Self::LENGTH };
    /// A pure number.
    pub(super) const NUMBER: Self = Self { length_power: 0, ..Self::LENGTH };
    /// A length in which heights are weights.
    pub(super) const WEIGHED_LENGTH: Self = Self { lift: Lift::Changes, ..Self::LENGTH };
    /// A pure number in which heights are weights.
    pub(super) const WEIGHED_NUMBER: Self = Self { lift: Lift::Changes, ..Self::NUMBER };
}
