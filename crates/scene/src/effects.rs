//! Effects that the paper's model lacks, as numbers: one file each, off by default (docs/theory/effects.md). What they
//! do in a substep is in `effect.rs`.
//!
//! A number of an effect has a path like any other of a scene, for example `effects.capillary.bond`. Ranges
//! to try are in the same page, "Ranges and dimensional screens".

mod adhesion;
mod bonds;
mod capillary;
mod clump;
mod effect;
mod fluid;
mod funnel_pose;
mod ground;
mod layer;
mod liquid;
mod lubrication;
mod outlet;
mod polydispersity;
mod restitution_speed;
mod rolling_form;
mod tension;
mod tilt;
mod vibration;

use serde::{Deserialize, Serialize};

pub use clump::ClumpShape;
pub use effect::Effect;
pub use outlet::OutletMesh;

use crate::error::SceneError;
use crate::preset::Method;

/// Makes [`Effects`] of the one list of all effects.
macro_rules! effects {
    ($($(#[$doc:meta])* $table:ident: $module:ident::$kind:ident,)*) => {
        $(pub use $module::$kind;)*

        /// The effects of a scene. Every default is off.
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct Effects {
            $(
                $(#[$doc])*
                #[serde(skip_serializing_if = "is_default")]
                pub $table: $kind,
            )*
        }

        impl Effects {
            /// Every effect, on or off.
            pub fn all(&self) -> Vec<&dyn Effect> {
                vec![$(&self.$table),*]
            }

            /// The numbers of every effect, on or off, by its name.
            ///
            /// # Errors
            /// [`SceneError::TomlWrite`] if a number cannot be written.
            pub(crate) fn tables(&self) -> Result<toml::Table, SceneError> {
                let mut tables = toml::Table::new();
                $(tables.insert(stringify!($table).to_owned(), table_of(&self.$table)?.into());)*
                Ok(tables)
            }

            /// The path of every number of every effect, for example `effects.capillary.bond`; lists have none.
            ///
            /// # Errors
            /// [`SceneError::TomlWrite`] if a default cannot be written.
            pub fn paths() -> Result<Vec<String>, SceneError> {
                let (effects, mut paths) = (Self::default(), Vec::new());
                $(paths.extend(paths_of(&effects.$table)?);)*
                Ok(paths)
            }
        }
    };
}

effects! {
    /// Liquid bridges.
    capillary: capillary::Capillary,
    /// Dry adhesion of touching grains.
    adhesion: adhesion::Adhesion,
    /// Bonds of grains that break.
    bonds: bonds::Bonds,
    /// Grains that are not round.
    clump: clump::Clump,
    /// Grains of different size.
    polydispersity: polydispersity::Polydispersity,
    /// A ground whose coefficients are not the grains'.
    ground: ground::GroundUnlike,
    /// A soft layer on the ground.
    layer: layer::Layer,
    /// Restitution that depends on the speed of an impact.
    restitution_speed: restitution_speed::RestitutionSpeed,
    /// Rolling resistance that grows with the speed of rolling.
    rolling_form: rolling_form::RollingForm,
    /// A fluid at rest around the grains.
    fluid: fluid::Fluid,
    /// A liquid with a flow of its own.
    liquid: liquid::Liquid,
    /// A fluid film between surfaces.
    lubrication: lubrication::Lubrication,
    /// A table that is not level.
    tilt: tilt::Tilt,
    /// A funnel that hangs beside its place, leans, or has a friction of its own.
    funnel: funnel_pose::FunnelPose,
    /// A funnel whose outlet is not round.
    outlet: outlet::Outlet,
    /// A table that shakes.
    vibration: vibration::Vibration,
}

fn table_of<T: Serialize>(effect: &T) -> Result<toml::Table, SceneError> {
    toml::Table::try_from(effect).map_err(|e| SceneError::TomlWrite(Box::new(e)))
}

fn paths_of<T: Effect + Serialize>(effect: &T) -> Result<Vec<String>, SceneError> {
    Ok(table_of(effect)?.keys().map(|number| format!("{}.{number}", effect.path())).collect())
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
    /// [`SceneError::OutOfRange`].
    pub(crate) fn check(&self) -> Result<(), SceneError> {
        self.all().into_iter().try_for_each(Effect::check)
    }

    /// The first effect that is on and changes what a contact is: one that only the method nsgs knows.
    pub fn of_contacts(&self) -> Option<&'static str> {
        let mut all = self.all().into_iter();
        all.find(|effect| effect.is_on() && effect.changes_contacts()).map(Effect::path)
    }

    /// Refuses a method that does not know an effect.
    ///
    /// # Errors
    /// [`SceneError::EffectNeedsMethod`].
    pub fn check_method(&self, got: Method) -> Result<(), SceneError> {
        match self.of_contacts() {
            Some(effect) if got != Method::Nsgs => {
                Err(SceneError::EffectNeedsMethod { effect, got: got.name() })
            }
            _ => Ok(()),
        }
    }

    /// When the last of them has ended that ends by itself, and the last has begun that begins later `[s]`.
    pub(crate) fn acts_until(&self) -> f64 {
        let liquid = if self.liquid.is_on() { self.liquid.begin } else { 0.0 };
        self.vibration.end().max(liquid)
    }
}

#[cfg(test)]
mod tests;
