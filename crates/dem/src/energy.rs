//! Mechanical energy per typical mass, at the end of a substep.
//!
//! Velocities are those of the middle of the substep before, so that the kinetic energy at the time of the places is
//! that of `v + g dt / 2`: a free flight then changes nothing, nor does a bounce that gives all back.

use nalgebra::Vector3;

/// Mechanical energy of all grains of a simulation, over [`crate::Simulation::unit_mass`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Of translation and rotation, at the time of the positions `[m^2/s^2]`.
    pub kinetic: f64,
    /// Above the scene's origin, and of what bonds and layers hold, not of attractions or a liquid `[m^2/s^2]`.
    pub potential: f64,
}

impl Energy {
    /// Both `[m^2/s^2]`.
    pub fn total(&self) -> f64 {
        self.kinetic + self.potential
    }
}

impl std::iter::Sum for Energy {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |sum, one| Self {
            kinetic: sum.kinetic + one.kinetic,
            potential: sum.potential + one.potential,
        })
    }
}

/// What acts on all grains, and for how long it acts in half a substep.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Falling {
    /// `[m/s^2]`
    pub gravity: Vector3<f64>,
    /// Length of the substep `[s]`.
    pub dt: f64,
}

impl Falling {
    /// What it adds to a velocity in half a substep `[m/s]`.
    pub fn half(&self) -> Vector3<f64> {
        0.5 * self.dt * self.gravity
    }

    /// Potential energy at a place, per mass `[m^2/s^2]`.
    pub fn potential(&self, place: &Vector3<f64>) -> f64 {
        -self.gravity.dot(place)
    }
}

/// What grains' heights hold, per typical mass `[m^2/s^2]`: along z alone, so that how far they are aside says nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Heights {
    /// Of all of them above the scene's origin.
    pub sum: f64,
    /// That sum if all were as low as the lowest point of one of them.
    pub lowest: f64,
}
