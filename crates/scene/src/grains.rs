//! What is poured.

use std::f64::consts::PI;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::check::positive;
use crate::error::SceneError;
use crate::grain_shape::{GrainShape, Solid};

/// Grains that a volume may stand for; no machine holds as many.
const MOST: f64 = 1e12;

/// Grains of a scene at most: the state of as many takes some 100 GB.
const MOST_GRAINS: usize = 100_000_000;

/// What is poured: equal spheres, or equal convex bodies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stated", into = "Stated")]
pub struct Grains {
    /// How many.
    pub count: usize,
    /// Volume of all grains together, without the pores `[m^3]`, where the scene states it in place of how many:
    /// then their number follows their diameter.
    pub volume: Option<f64>,
    /// Diameter `[m]`.
    pub diameter: f64,
    /// Density `[kg/m^3]`; it drops out of dry pours of equal grains and only sets the unit of energy.
    pub density: f64,
    /// What shape they have; spheres if it is not stated. docs/theory/bodies.md.
    pub shape: Option<GrainShape>,
}

/// The table `[grains]` of a scene.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stated {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    count: Option<usize>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    volume: Option<f64>,
    diameter: f64,
    density: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    shape: Option<GrainShape>,
}

impl TryFrom<Stated> for Grains {
    type Error = String;

    fn try_from(stated: Stated) -> Result<Self, String> {
        let Stated { count, volume, diameter, density, shape } = stated;
        let count = match (count, volume) {
            (Some(count), None) => count,
            (None, Some(_)) if shape.is_some() => {
                return Err(
                    "`volume` is that of round grains: state `count` with `shape`".to_owned()
                );
            }
            (None, Some(volume)) => count_of(volume, diameter)?,
            (None, None) => {
                return Err("missing field `count` of grains, or their `volume`".to_owned());
            }
            (Some(_), Some(_)) => {
                return Err(
                    "grains state `count` and `volume`: one follows from the other".to_owned()
                );
            }
        };
        Ok(Self { count, volume, diameter, density, shape })
    }
}

impl From<Grains> for Stated {
    fn from(grains: Grains) -> Self {
        let Grains { count, volume, diameter, density, shape } = grains;
        Self { count: volume.is_none().then_some(count), volume, diameter, density, shape }
    }
}

/// The number of round grains that is nearest to a volume `[m^3]`.
fn count_of(volume: f64, diameter: f64) -> Result<usize, String> {
    let each = PI / 6.0 * diameter.powi(3);
    let count = (volume / each).round();
    if (1.0..=MOST).contains(&count) {
        Ok(count as usize)
    } else {
        Err(format!(
            "volume of grains must be that of 1 to {MOST:e} of {each:.3e} m^3 each, got {volume:e} m^3"
        ))
    }
}

impl Grains {
    /// So many equal balls.
    pub const fn balls(count: usize, diameter: f64, density: f64) -> Self {
        Self { count, volume: None, diameter, density, shape: None }
    }

    /// Whether there can be such grains, and as many as their volume says where one is stated.
    ///
    /// # Errors
    /// [`SceneError::OutOfRange`]; [`SceneError::Exclude`] for a volume of grains that have a shape.
    pub(crate) fn check(&self) -> Result<(), SceneError> {
        positive("grains.diameter", self.diameter)?;
        positive("grains.density", self.density)?;
        if self.count > MOST_GRAINS {
            return Err(SceneError::range("grains.count", self.count as f64, "at most 1e8"));
        }
        let Some(volume) = self.volume else { return Ok(()) };
        if self.shape.is_some() {
            return Err(SceneError::Exclude { one: "grains.volume", other: "grains.shape" });
        }
        let Ok(count) = count_of(volume, self.diameter) else {
            return Err(SceneError::range("grains.volume", volume, "that of 1 to 1e12 grains"));
        };
        if count == self.count {
            return Ok(());
        }
        let allowed = "the number of grains whose volume is grains.volume, where that is stated";
        Err(SceneError::range("grains.count", self.count as f64, allowed))
    }

    /// Radius of a grain `[m]`.
    pub fn radius(&self) -> f64 {
        0.5 * self.diameter
    }

    /// Mass of a grain `[kg]`: of a ball of the diameter, or of the body that it is; of a checked scene.
    pub fn mass(&self) -> f64 {
        let ball = PI / 6.0 * self.diameter.powi(3);
        self.density * self.solid().map_or(ball, |solid| solid.volume)
    }

    /// Mass of a grain that is as large as `radius` says `[kg]`.
    pub fn mass_of(&self, radius: f64) -> f64 {
        self.mass() * (radius / self.radius()).powi(3)
    }

    /// The body that every grain is, if it has a shape; of a checked scene.
    ///
    /// # Panics
    /// For a shape that a checked scene cannot have.
    pub fn solid(&self) -> Option<Arc<Solid>> {
        let solid = |shape| Solid::new(shape, self.diameter).expect("a checked shape");
        self.shape.as_ref().map(solid)
    }
}

#[cfg(test)]
mod tests {
    use std::error::Error;

    use super::*;
    use crate::scene::Scene;

    fn of_volume(volume: &str) -> Result<Scene, String> {
        let text = Scene::drop(0.1).to_toml().unwrap();
        let count = text.lines().find(|line| line.starts_with("count = ")).unwrap();
        Scene::from_toml(&text.replacen(count, volume, 1))
            .map_err(|error| error.source().map_or_else(|| error.to_string(), ToString::to_string))
    }

    #[test]
    fn the_number_of_grains_follows_their_diameter_where_a_volume_is_stated() {
        // 1,000 grains of 4 mm.
        let each = PI / 6.0 * 4e-3_f64.powi(3);
        let scene = of_volume(&format!("volume = {:e}", 1000.2 * each)).unwrap();
        assert_eq!(scene.grains.count, 1000);
        assert_eq!(scene.get("grains.count").unwrap(), 1000.0);
        assert_eq!(Scene::from_toml(&scene.to_toml().unwrap()).unwrap(), scene);
        let coarse = scene.with("grains.diameter", 8e-3).unwrap();
        assert_eq!(coarse.grains.count, 125);
        let more = scene.with("grains.volume", 1500.0 * each).unwrap();
        assert_eq!(more.grains.count, 1500);
        assert!(!more.to_toml().unwrap().contains("count"));
    }

    #[test]
    fn a_count_that_is_not_its_volumes_is_refused() {
        let each = PI / 6.0 * 4e-3_f64.powi(3);
        let good = of_volume(&format!("volume = {:e}", 1000.0 * each)).unwrap();
        for (change, reason) in [
            (
                (|g: &mut Grains| g.count = 999) as fn(&mut Grains),
                "grains.count must be the number",
            ),
            (|g| g.diameter = 3e-3, "got 1000"),
            (|g| g.volume = Some(f64::NAN), "grains.volume must be"),
            (
                |g| {
                    let aspect = [1.0, 1.0, 2.0];
                    g.shape = Some(GrainShape::Box { aspect });
                },
                "grains.volume and grains.shape",
            ),
        ] {
            let mut scene = good.clone();
            change(&mut scene.grains);
            let error = scene.check().unwrap_err().to_string();
            assert!(error.contains(reason), "{error}");
        }
    }

    #[test]
    fn either_a_count_or_a_volume_is_stated() {
        for (stated, reason) in [
            ("count = 10\nvolume = 1e-6", "`count` and `volume`"),
            ("", "missing field `count`"),
            ("volume = 1e-12", "must be that of 1 to 1e12"),
            ("volume = nan", "got NaN"),
            ("volume = -1.0", "must be that of 1"),
            ("volume = 1e-6\nshape = { kind = \"box\", aspect = [1.0, 1.0, 2.0] }", "round grains"),
        ] {
            let error = of_volume(stated).unwrap_err();
            assert!(error.contains(reason), "{stated}: {error}");
        }
        let error = Scene::drop(0.1).with("grains.volume", 1e-6).unwrap_err();
        assert!(error.to_string().contains("one follows from the other"), "{error}");
    }
}
