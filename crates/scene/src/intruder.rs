//! One ball of another size among the grains.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::check::{finite, non_negative, positive};
use crate::error::SceneError;
use crate::grains::Grains;

/// Largest diameter over the grains': what is wider is a wall's task.
const WIDEST: f64 = 50.0;

/// A ball of its own size and density, of the grains' material, that enters the scene at a time: what falls into a bed
/// that has come to rest.
///
/// The place where it enters must be free of grains.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Intruder {
    /// Diameter `[m]`.
    pub diameter: f64,
    /// Density `[kg/m^3]`.
    pub density: f64,
    /// Centre when it enters `[m]`.
    pub position: [f64; 3],
    /// Velocity when it enters `[m/s]`.
    #[serde(default)]
    pub velocity: [f64; 3],
    /// When it enters `[s]`. Until then nothing touches it and no camera sees it.
    #[serde(default)]
    pub enters: f64,
}

impl Intruder {
    pub(crate) fn check(&self, grains: &Grains) -> Result<(), SceneError> {
        positive("intruder.diameter", self.diameter)?;
        if self.diameter > WIDEST * grains.diameter {
            let allowed = "at most 50 times grains.diameter";
            return Err(SceneError::range("intruder.diameter", self.diameter, allowed));
        }
        positive("intruder.density", self.density)?;
        for (name, vector) in [("position", self.position), ("velocity", self.velocity)] {
            vector.iter().try_for_each(|&c| finite(&format!("intruder.{name}"), c))?;
        }
        non_negative("intruder.enters", self.enters)
    }

    /// Its mass over that of a grain `[-]`.
    pub fn relative_mass(&self, grains: &Grains) -> f64 {
        self.density / grains.density * (self.diameter / grains.diameter).powi(3)
    }

    /// Radius `[m]`.
    pub fn radius(&self) -> f64 {
        0.5 * self.diameter
    }

    /// Centre when it enters `[m]`.
    pub fn centre(&self) -> Vector3<f64> {
        self.position.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    fn scene() -> Scene {
        let mut scene = Scene::drop(0.1);
        let (position, velocity) = ([0.0, 0.0, 0.3], [0.0, 0.0, -1.0]);
        let intruder =
            Intruder { diameter: 0.02, density: 2500.0, position, velocity, enters: 0.5 };
        scene.intruder = Some(intruder);
        scene
    }

    #[test]
    fn it_survives_toml_and_its_numbers_have_paths() {
        let scene = scene();
        scene.check().unwrap();
        assert_eq!(Scene::from_toml(&scene.to_toml().unwrap()).unwrap(), scene);
        let faster = scene.with("intruder.velocity.2", -2.0).unwrap();
        assert_eq!(faster.intruder.as_ref().unwrap().velocity[2], -2.0);
        // 5 diameters, 2500 / 1300 as dense.
        let ratio = scene.intruder.as_ref().unwrap().relative_mass(&scene.grains);
        assert!((ratio - 125.0 * 2500.0 / 1300.0).abs() < 1e-12);
        assert_eq!(scene.moves_until(), 0.5);
    }

    #[test]
    fn what_cannot_be_is_refused_by_name() {
        for (change, name) in [
            ((|i: &mut Intruder| i.diameter = 1.0) as fn(&mut Intruder), "intruder.diameter"),
            (|i| i.density = 0.0, "intruder.density"),
            (|i| i.position[1] = f64::NAN, "intruder.position"),
            (|i| i.velocity[0] = f64::INFINITY, "intruder.velocity"),
            (|i| i.enters = -1.0, "intruder.enters"),
            // The scene's horizon is 4 s.
            (|i| i.enters = 4.0, "intruder.enters must be less than end.horizon, got 4"),
        ] {
            let mut scene = scene();
            change(scene.intruder.as_mut().unwrap());
            assert!(scene.check().unwrap_err().to_string().contains(name), "{name}");
        }
        let mut draining = scene();
        draining.outflow = Some(crate::Outflow { below: -1.0, until: None });
        let text = draining.check().unwrap_err().to_string();
        assert!(text.contains("intruder") && text.contains("outflow"), "{text}");
    }
}
