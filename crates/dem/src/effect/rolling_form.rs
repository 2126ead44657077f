//! A rolling resistance that grows with the speed of rolling: `crates/scene/src/effects/rolling_form.rs`.

use std::sync::Arc;

use granulcal_scene::{Effect, RollingForm, Scene};

use super::acts::Acts;
use crate::contact::ContactLaw;

/// The form of a scene, if it is not Coulomb's.
pub(super) fn of(scene: &Scene) -> Option<Arc<dyn Acts>> {
    let form = scene.effects.rolling_form;
    form.is_on().then(|| Arc::new(form) as _)
}

impl Acts for RollingForm {
    fn change_law(&self, law: &mut ContactLaw) {
        law.rolling_speed = self.speed;
    }
}
