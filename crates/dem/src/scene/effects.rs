//! Effects that the paper's model lacks, as numbers: one file each, off by default (docs/theory/effects.md). What they do in
//! a substep is in `effect.rs`.
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
mod restitution_speed;
mod rolling_form;
mod tilt;
mod vibration;

use serde::{Deserialize, Serialize};

pub use adhesion::Adhesion;
pub use capillary::Capillary;
pub use clump::Clump;
pub(crate) use clump::ClumpShape;
pub use fluid::Fluid;
pub use funnel_pose::FunnelPose;
pub use ground::GroundUnlike;
pub use layer::Layer;
pub use outlet::Outlet;
pub use polydispersity::Polydispersity;
pub use restitution_speed::RestitutionSpeed;
pub use rolling_form::RollingForm;
pub use tilt::Tilt;
pub use vibration::Vibration;

use crate::error::DemError;
use crate::preset::Method;

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
