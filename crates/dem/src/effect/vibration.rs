//! A table that shakes adds to gravity: `crates/scene/src/effects/vibration.rs`.

use std::sync::Arc;

use granulcal_scene::{Effect, Scene, Vibration};
use nalgebra::Vector3;

use super::acts::Acts;

/// The vibration of a scene, if the table ever shakes.
pub(super) fn of(scene: &Scene) -> Option<Arc<dyn Acts>> {
    let vibration = scene.effects.vibration;
    vibration.is_on().then(|| Arc::new(vibration) as _)
}

impl Acts for Vibration {
    fn added_gravity(&self, time: f64) -> Option<Vector3<f64>> {
        Some(self.acceleration_at(time) * Vector3::z())
    }
}
