//! Straight ways of grains, and what they sweep.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::particles::Particles;

/// What rounding to single precision may hide in a grid of metres `[m]`.
const ROUNDING: f64 = 1e-6;

/// A grain's straight way.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(from = "[[f64; 3]; 2]", into = "[[f64; 3]; 2]")]
pub(crate) struct Path {
    pub from: Vector3<f64>,
    pub velocity: Vector3<f64>,
}

impl From<[[f64; 3]; 2]> for Path {
    fn from([from, velocity]: [[f64; 3]; 2]) -> Self {
        Self { from: from.into(), velocity: velocity.into() }
    }
}

impl From<Path> for [[f64; 3]; 2] {
    fn from(path: Path) -> Self {
        [path.from.into(), path.velocity.into()]
    }
}

impl Path {
    /// The ways of all grains from now on.
    pub fn all_of(particles: &Particles) -> Vec<Self> {
        let path = |i| Self { from: particles.position(i), velocity: particles.velocity(i) };
        (0..particles.count()).map(path).collect()
    }

    #[inline]
    pub fn at(&self, time: f64) -> Vector3<f64> {
        self.from + time * self.velocity
    }

    /// Square of the least distance of two grains' ways in the next `interval` `[s]`, `[m^2]`.
    #[inline]
    pub fn nearest_squared(&self, other: &Self, particles: &Particles, interval: f64) -> f64 {
        let apart = particles.nearest(self.from - other.from);
        let relative = self.velocity - other.velocity;
        let closing = -apart.dot(&relative);
        if closing <= 0.0 {
            return apart.norm_squared();
        }
        let nearest = (closing / relative.norm_squared()).min(interval);
        (apart + nearest * relative).norm_squared()
    }

    /// Whether the way comes within `limit` `[m]` of another in the next `interval` `[s]`.
    #[inline]
    pub fn comes_within(
        &self,
        other: &Self,
        particles: &Particles,
        limit: f64,
        interval: f64,
    ) -> bool {
        self.nearest_squared(other, particles, interval) < limit * limit
    }
}

/// A grain swept over an interval.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ball {
    /// Where the grain is half way `[m]`.
    pub middle: Vector3<f64>,
    /// Radius of the ball that holds the whole way `[m]`.
    pub reach: f64,
}

impl Ball {
    /// What a grain of this radius `[m]` sweeps on `path` in `interval` `[s]`, with its half of the gap `margin` `[m]`.
    #[inline]
    pub fn swept(path: &Path, radius: f64, interval: f64, margin: f64) -> Self {
        let half_way = 0.5 * interval * path.velocity;
        let reach = radius + half_way.norm() + 0.5 * margin + ROUNDING;
        Self { middle: path.from + half_way, reach }
    }
}

/// How near two grains must come, and within which time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    /// `[s]`
    pub interval: f64,
    /// Gap below which they come near `[m]`.
    pub near: f64,
    /// Gap below which they are neighbours, at least `near` `[m]`.
    pub far: f64,
}
