//! How far a body goes in a substep: by its velocities, and by the impacts within it.

use nalgebra::Vector3;

use super::body::Moving;

/// How a body moves.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    /// `[m/s]`
    pub velocity: Vector3<f64>,
    /// How fast it turns its farthest points `[m/s]`.
    pub turning: f64,
}

impl Motion {
    /// Of a body of this reach `[m]`.
    pub fn of(body: &Moving, reach: f64) -> Self {
        Self { velocity: body.velocity, turning: reach * body.omega.norm() }
    }

    /// How fast its points move at most `[m/s]`.
    pub fn fastest(&self) -> f64 {
        self.velocity.norm() + self.turning
    }

    /// How fast its points move beside those of another at most `[m/s]`.
    pub fn beside(&self, other: &Self) -> f64 {
        (self.velocity - other.velocity).norm() + self.turning + other.turning
    }
}

/// Where a body is at the end of a substep, seen from its begin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Way {
    /// `[m]`
    goes: Vector3<f64>,
    /// `[rad]`
    turns: Vector3<f64>,
    /// How far it turns its farthest points, at most `[m]`.
    swings: f64,
    /// How far its points go, at most `[m]`.
    pub length: f64,
}

impl Way {
    /// Of a body of this reach `[m]` in this time `[s]`.
    pub fn of(body: &Moving, reach: f64, dt: f64) -> Self {
        let (goes, turns) = body.way(dt);
        let swings = reach * turns.norm();
        Self { goes, turns, swings, length: goes.norm() + swings }
    }

    /// How far its points go beside those of another, at most `[m]`.
    pub fn beside(&self, other: &Self) -> f64 {
        (self.goes - other.goes).norm() + self.swings + other.swings
    }

    /// How far from each other two ways of a body of this reach lead, at most `[m]`.
    pub fn differs(&self, other: &Self, reach: f64) -> f64 {
        (self.goes - other.goes).norm() + reach * (self.turns - other.turns).norm()
    }
}
