//! The outcome of one simulation: grains, how it ended and how healthy it was.

use std::fmt;

use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::health::Health;
use granulcal_scene::Solid;

/// How a pour ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// The mean kinetic energy fell below the end rule's threshold.
    AtRest,
    /// Every grain that still moves is out of the camera's view.
    OutOfView,
    /// As much of the grains as the scene's outflow waits for has left.
    RanOut,
    /// The flow has stopped, but grains remain in the funnel.
    Jammed,
    /// The end rule's horizon was reached first.
    Horizon,
    /// A bound of [`Health`] was broken; the numbers are not to be trusted.
    Unhealthy,
}

impl Status {
    /// Every status.
    pub const ALL: [Self; 6] =
        [Self::AtRest, Self::OutOfView, Self::RanOut, Self::Jammed, Self::Horizon, Self::Unhealthy];

    /// The word used in Parquet, on the command line and in Python.
    pub fn name(self) -> &'static str {
        match self {
            Self::AtRest => "at_rest",
            Self::OutOfView => "out_of_view",
            Self::RanOut => "ran_out",
            Self::Jammed => "jammed",
            Self::Horizon => "horizon",
            Self::Unhealthy => "unhealthy",
        }
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Grains at the end of a pour: those that have not left the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Pour {
    /// Centres `[m]`, ground at z = 0; of grains that are several spheres those of all spheres, of one grain after the
    /// other.
    pub positions: Vec<Vector3<f64>>,
    /// Velocities `[m/s]`.
    pub velocities: Vec<Vector3<f64>>,
    /// Angular velocities `[rad/s]`.
    pub angular_velocities: Vec<Vector3<f64>>,
    /// Radii `[m]`.
    pub radii: Vec<f64>,
    /// Radii of the grains that have left through the scene's outflow `[m]`.
    pub radii_out: Vec<f64>,
    /// How it ended.
    pub status: Status,
    /// Whether it can be trusted, in numbers.
    pub health: Health,
    /// Grains whose centre, of several spheres that of one, is in the funnel ([`crate::Scene::is_in_funnel`]); 0 where
    /// there is none.
    pub grains_in_funnel: usize,
    /// Simulated time `[s]`.
    pub simulated_s: f64,
    /// Shape and orientations of the grains, if they are convex bodies; `radii` are then half of the scene's diameter.
    pub convex: Option<ConvexGrains>,
    /// The scene's bed as it was when the ball was let go, if it has one and the pour got so far.
    pub bed: Option<BedAtRest>,
    /// [`crate::Simulation::state_hash`] at the end: equal hashes are equal pours, to the last bit.
    pub state_hash: u128,
}

/// A bed before anything has fallen on it.
#[derive(Clone, Debug, PartialEq)]
pub struct BedAtRest {
    /// Centres of its grains `[m]`.
    pub positions: Vec<Vector3<f64>>,
    /// Their radii `[m]`.
    pub radii: Vec<f64>,
}

/// Grains that are convex bodies of one shape: an intersection of half spaces, and of a cylinder about the y axis if it
/// is round. The axes of a box are along its edges, in the order in which the scene states them; of a superquadric and
/// a hull they are the principal ones, which [`Solid::axes`] has in the shape as it is stated.
#[derive(Clone, Debug, PartialEq)]
pub struct ConvexGrains {
    /// Outward unit normals and distances from the centre of mass of the flat faces, in the body's axes `[m]`.
    pub faces: Vec<(Vector3<f64>, f64)>,
    /// Corners in the body's axes `[m]`; of a cylinder none.
    pub corners: Vec<Vector3<f64>>,
    /// Radius of the cylinder, if one bounds it `[m]`.
    pub round: Option<f64>,
    /// Radius of the ball about the centre that holds it `[m]`.
    pub reach: f64,
    /// Turn of each grain, from its axes to the scene's.
    pub orientations: Vec<UnitQuaternion<f64>>,
}

impl ConvexGrains {
    pub(crate) fn new(solid: &Solid, orientations: Vec<UnitQuaternion<f64>>) -> Self {
        Self {
            faces: solid.faces.clone(),
            corners: solid.corners.clone(),
            round: solid.round.map(|(radius, _)| radius),
            reach: solid.reach,
            orientations,
        }
    }
}
