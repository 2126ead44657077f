//! Restitution that depends on the speed of an impact: `crates/scene/src/effects/restitution_speed.rs`.

use std::sync::Arc;

use granulcal_scene::{Effect, RestitutionSpeed, Scene};

use super::acts::Acts;

/// The dependence of a scene, if there is one.
pub(super) fn of(scene: &Scene) -> Option<Arc<dyn Acts>> {
    let law = scene.effects.restitution_speed;
    law.is_on().then(|| Arc::new(law) as _)
}

impl Acts for RestitutionSpeed {
    fn restitution_at(&self, restitution: f64, speed: f64) -> f64 {
        self.at(restitution, speed)
    }
}
