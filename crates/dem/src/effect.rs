//! Effects that the paper's model lacks, as plug-ins: one file each, off by default, and without influence on a single
//! bit when off (docs/theory/effects.md).
//!
//! A number of an effect has a path like any other of a scene, for example `effects.capillary.bond`.

mod adhesion;
mod capillary;
mod clump;
mod fluid;
mod funnel_pose;
mod ground;
mod layer;
mod outlet;
mod polydispersity;
mod pore_surface;
mod pull;
mod restitution_speed;
mod rolling_form;
mod tilt;
mod vibration;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

pub use adhesion::Adhesion;
pub use capillary::Capillary;
pub use clump::Clump;
pub(crate) use clump::ClumpShape;
pub use fluid::Fluid;
pub use funnel_pose::FunnelPose;
pub use ground::GroundUnlike;
pub use layer::Layer;
pub(crate) use layer::Pad;
pub use outlet::Outlet;
pub use polydispersity::Polydispersity;
pub(crate) use pull::{Bridges, Pull};
pub use restitution_speed::RestitutionSpeed;
pub use rolling_form::RollingForm;
pub use tilt::Tilt;
pub use vibration::Vibration;

use crate::DemError;
use crate::preset::Method;
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
    /// Grains that are not round.
    #[serde(skip_serializing_if = "is_default")]
    pub clump: Clump,
    /// Grains of different size.
    #[serde(skip_serializing_if = "is_default")]
    pub polydispersity: Polydispersity,
    /// A ground whose coefficients are not the grains'.
    #[serde(skip_serializing_if = "is_default")]
    pub ground: GroundUnlike,
    /// A soft layer on the ground.
    #[serde(skip_serializing_if = "is_default")]
    pub layer: Layer,
    /// Restitution that depends on the speed of an impact.
    #[serde(skip_serializing_if = "is_default")]
    pub restitution_speed: RestitutionSpeed,
    /// Rolling resistance that grows with the speed of rolling.
    #[serde(skip_serializing_if = "is_default")]
    pub rolling_form: RollingForm,
    /// A fluid at rest around the grains.
    #[serde(skip_serializing_if = "is_default")]
    pub fluid: Fluid,
    /// A table that is not level.
    #[serde(skip_serializing_if = "is_default")]
    pub tilt: Tilt,
    /// A funnel that hangs beside its place, leans, or has a friction of its own.
    #[serde(skip_serializing_if = "is_default")]
    pub funnel: FunnelPose,
    /// A funnel whose outlet is not round.
    #[serde(skip_serializing_if = "is_default")]
    pub outlet: Outlet,
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
        self.clump.check()?;
        self.polydispersity.check()?;
        self.ground.check()?;
        self.layer.check()?;
        self.rolling_form.check()?;
        self.funnel.check()?;
        self.outlet.check()?;
        self.restitution_speed.check()?;
        self.fluid.check()?;
        self.tilt.check()?;
        self.vibration.check()
    }

    /// The first effect that is on and changes what a contact is: one that only the method nsgs knows.
    pub(crate) fn of_contacts(&self) -> Option<&'static str> {
        let on = [
            ("effects.layer", self.layer.is_on()),
            ("effects.rolling_form", self.rolling_form.is_on()),
            ("effects.clump", self.clump.is_on()),
        ];
        on.into_iter().find(|(_, is_on)| *is_on).map(|(effect, _)| effect)
    }

    /// Refuses a method that does not know an effect.
    ///
    /// # Errors
    /// [`DemError::EffectNeedsMethod`].
    pub(crate) fn check_method(&self, got: Method) -> Result<(), DemError> {
        match self.of_contacts() {
            Some(effect) if got != Method::Nsgs => {
                Err(DemError::EffectNeedsMethod { effect, got: got.name() })
            }
            _ => Ok(()),
        }
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
    pub pad: Option<Pad>,
    /// See [`RollingForm::speed`].
    pub rolling_speed: f64,
}

impl Acting {
    pub fn of(scene: &Scene) -> Self {
        let effects = &scene.effects;
        let mut gravity = Vector3::from(scene.gravity);
        if effects.tilt != Tilt::default() {
            gravity = effects.tilt.turn(&gravity);
        }
        let drag = effects
            .fluid
            .is_on()
            .then(|| effects.fluid.drag(&scene.grains, scene.gravity[2].abs()));
        if let Some(drag) = &drag {
            gravity *= drag.weight;
        }
        Self {
            gravity,
            vibration: effects.vibration.is_on().then_some(effects.vibration),
            pull: Pull::of(scene, drag.as_ref().map_or(1.0, |drag| drag.inverse_inertia)),
            drag,
            restitution: effects.restitution_speed.is_on().then_some(effects.restitution_speed),
            pad: effects.layer.is_on().then(|| effects.layer.pad(scene)),
            rolling_speed: effects.rolling_form.speed,
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
