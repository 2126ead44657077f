//! When a pour ends, and what is no longer followed before that.

use serde::{Deserialize, Serialize};

use crate::check::positive;
use crate::effects::Effect as _;
use crate::error::SceneError;
use crate::scene::Scene;

/// When a pour ends: at rest, with every moving grain out of view, or at the horizon. [`crate::Outflow::until`] may end
/// it before.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EndRule {
    /// Longest simulated time `[s]`.
    pub horizon: f64,
    /// Mean kinetic energy of a grain per mass below which the pour is at rest `[m^2/s^2]`.
    pub kinetic_energy: f64,
    /// What becomes of grains that have rolled away for good.
    #[serde(skip_serializing_if = "RolledAway::is_default")]
    pub rolled_away: RolledAway,
}

/// What becomes of grains that roll outward on the level ground, out of the camera's view, from where nothing turns
/// them back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RolledAway {
    /// They are followed to the end of the pour and stand in its arrays.
    #[default]
    Stay,
    /// They leave the scene: nothing touches them and they stand in no array of the pour any more.
    Leave,
}

impl RolledAway {
    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
    fn is_default(&self) -> bool {
        *self == Self::Stay
    }
}

impl Default for EndRule {
    fn default() -> Self {
        Self { horizon: 4.0, kinetic_energy: 1e-8, rolled_away: RolledAway::Stay }
    }
}

impl EndRule {
    pub(crate) fn check(&self, scene: &Scene) -> Result<(), SceneError> {
        positive("end.horizon", self.horizon)?;
        positive("end.kinetic_energy", self.kinetic_energy)?;
        if self.rolled_away == RolledAway::Stay {
            return Ok(());
        }
        // What might turn a grain back, what looks at where it is, and bodies that do not roll as balls do.
        let slopes = scene.gravity[0] != 0.0 || scene.gravity[1] != 0.0 || scene.gravity[2] >= 0.0;
        let others = [
            ("walls", !scene.walls.is_empty()),
            ("gravity that is not along -z", slopes),
            ("effects.tilt", scene.effects.tilt.is_on()),
            ("effects.vibration", scene.effects.vibration.is_on()),
            ("effects.clump", scene.effects.clump.is_on()),
            ("grains.shape", scene.grains.shape.is_some()),
            ("observe", scene.observe.is_some()),
            ("views", !scene.views.is_empty()),
            ("outflow", scene.outflow.is_some()),
            ("periodic", scene.periodic.is_some()),
            ("intruder", scene.intruder.is_some()),
        ];
        match others.into_iter().find(|(_, is_there)| *is_there) {
            Some((other, _)) => {
                Err(SceneError::Exclude { one: "end.rolled_away = \"leave\"", other })
            }
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grains_leave_only_where_nothing_turns_them_back() {
        let mut scene = Scene::funnel(0.12);
        assert!(!scene.to_toml().unwrap().contains("rolled_away"));
        scene.end.rolled_away = RolledAway::Leave;
        scene.check().unwrap();
        assert_eq!(Scene::from_toml(&scene.to_toml().unwrap()).unwrap(), scene);
        for (change, name) in [
            ((|s: &mut Scene| s.gravity[0] = 0.1) as fn(&mut Scene), "gravity"),
            (|s| s.outflow = Some(crate::Outflow { below: -1.0, until: None }), "outflow"),
            (|s| s.effects.tilt.x = 0.01, "effects.tilt"),
        ] {
            let mut scene = scene.clone();
            change(&mut scene);
            let text = scene.check().unwrap_err().to_string();
            assert!(text.contains("rolled_away") && text.contains(name), "{text}");
        }
    }
}
