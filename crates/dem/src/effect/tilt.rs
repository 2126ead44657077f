//! A table that is not level turns gravity: `crates/scene/src/effects/tilt.rs`.

use std::sync::Arc;

use granulcal_scene::{Effect, Scene, Tilt};
use nalgebra::Vector3;

use super::acts::Acts;

/// The tilt of a scene, if the table is not level.
pub(super) fn of(scene: &Scene) -> Option<Arc<dyn Acts>> {
    let tilt = scene.effects.tilt;
    tilt.is_on().then(|| Arc::new(tilt) as _)
}

impl Acts for Tilt {
    fn gravity(&self, gravity: Vector3<f64>) -> Vector3<f64> {
        self.turn(&gravity)
    }
}
