//! Effects that the paper's model lacks, as plug-ins: one file each, off by default, and without influence on a single
//! bit when off (docs/theory/effects.md).
//!
//! A number of an effect has a path like any other of a scene, for example `effects.capillary.bond`.

mod adhesion;
mod capillary;
mod fluid;
mod ground;
mod polydispersity;
mod pull;
mod restitution_speed;
mod tilt;
mod vibration;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

pub use adhesion::Adhesion;
pub use capillary::Capillary;
pub use fluid::Fluid;
pub use ground::GroundUnlike;
pub use polydispersity::Polydispersity;
pub(crate) use pull::{Bridges, Pull};
pub use restitution_speed::RestitutionSpeed;
pub use tilt::Tilt;
pub use vibration::Vibration;

use crate::DemError;
use crate::scene::Scene;

/// The effects of a scene. Every default is off.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Effects {
    /// Liquid bridges.
    #[serde(skip_serializing_if = "is_default")]
    pub capillary: Capillary,
    /// Dry adhesion of touching grains.
    #[serde(skip_serializing_if = "is_default")]
    pub adhesion: Adhesion,
    /// Grains of different size.
    #[serde(skip_serializing_if = "is_default")]
    pub polydispersity: Polydispersity,
    /// A ground whose coefficients are not the grains'.
    #[serde(skip_serializing_if = "is_default")]
    pub ground: GroundUnlike,
    /// Restitution that depends on the speed of an impact.
    #[serde(skip_serializing_if = "is_default")]
    pub restitution_speed: RestitutionSpeed,
    /// A fluid at rest around the grains.
    #[serde(skip_serializing_if = "is_default")]
    pub fluid: Fluid,
    /// A table that is not level.
    #[serde(skip_serializing_if = "is_default")]
    pub tilt: Tilt,
    /// A table that shakes.
    #[serde(skip_serializing_if = "is_default")]
    pub vibration: Vibration,
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl Effects {
    /// Whether nothing is said of any effect.
    pub fn is_plain(&self) -> bool {
        is_default(self)
    }

    /// Checks every number.
    ///
    /// # Errors
    /// [`DemError::OutOfRange`].
    pub(crate) fn check(&self) -> Result<(), DemError> {
        self.capillary.check()?;
        self.adhesion.check()?;
        self.polydispersity.check()?;
        self.ground.check()?;
        self.restitution_speed.check()?;
        self.fluid.check()?;
        self.tilt.check()?;
        self.vibration.check()
    }

    /// When the last of them has ended that ends by itself `[s]`.
    pub(crate) fn acts_until(&self) -> f64 {
        self.vibration.end()
    }
}

/// What the effects of a scene do in a substep; what is off is absent.
#[derive(Clone, Debug)]
pub(crate) struct Acting {
    /// Gravity less buoyancy, in the frame of the table `[m/s^2]`.
    pub gravity: Vector3<f64>,
    pub vibration: Option<Vibration>,
    pub drag: Option<fluid::Drag>,
    pub pull: Option<Pull>,
    pub restitution: Option<RestitutionSpeed>,
}

impl Acting {
    pub fn of(scene: &Scene) -> Self {
        let effects = &scene.effects;
        let mut gravity = Vector3::from(scene.gravity);
        if effects.tilt != Tilt::default() {
            gravity = effects.tilt.turn(&gravity);
        }
        let drag = effects.fluid.is_on().then(|| effects.fluid.drag(&scene.grains));
        if let Some(drag) = &drag {
            gravity *= drag.weight;
        }
        Self {
            gravity,
            vibration: effects.vibration.is_on().then_some(effects.vibration),
            pull: Pull::of(scene, drag.as_ref().map_or(1.0, |drag| drag.inverse_inertia)),
            drag,
            restitution: effects.restitution_speed.is_on().then_some(effects.restitution_speed),
        }
    }

    /// Gravity and what a shaking table adds to it at `time` `[m/s^2]`.
    pub fn gravity_at(&self, time: f64) -> Vector3<f64> {
        match &self.vibration {
            Some(vibration) => self.gravity + vibration.acceleration_at(time) * Vector3::z(),
            None => self.gravity,
        }
    }

    /// How far the longest pull reaches `[m]`; 0 without one.
    pub fn reach(&self) -> f64 {
        self.pull.as_ref().map_or(0.0, Pull::reach)
    }

    /// The restitution of an impact at `speed` `[m/s]` that would be `restitution` at the speed of reference.
    pub fn restitution_at(&self, restitution: f64, speed: f64) -> f64 {
        self.restitution.as_ref().map_or(restitution, |law| law.at(restitution, speed))
    }
}
