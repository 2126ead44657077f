//! A scene: grains, how they start, walls, ground, gravity, camera, solver preset and end rule.
//!
//! The same words stand in Rust, in TOML and in Python. Lengths are metres, angles radians, the
//! ground is the plane z = 0 and gravity points down unless the scene says otherwise.

use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::bed::Bed;
use crate::camera::CameraSpec;
use crate::check::finite;
use crate::effects::{Effect as _, Effects};
use crate::end::EndRule;
use crate::error::SceneError;
use crate::grains::Grains;
use crate::gravity::standard_gravity;
use crate::intruder::Intruder;
use crate::material::Material;
use crate::mesh::MeshFile;
use crate::motion::Motion;
use crate::observe::Observe;
use crate::outflow::Outflow;
use crate::periodic::Periodic;
use crate::preset::{Preset, SolverSettings};
use crate::start::Start;
use crate::view::{ViewSpec, check_views};
use crate::walls::{Funnel, Ground, Shape, Wall};

/// A whole experiment but for its seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// What the scene is called in data sets and reports.
    pub name: String,
    /// Solver settings by name.
    #[serde(default)]
    pub preset: Preset,
    /// Substep `[s]`, where the preset's is too coarse: small grains, or a strong gravity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub substep: Option<f64>,
    /// Gravity `[m/s^2]`.
    #[serde(default = "standard_gravity")]
    pub gravity: [f64; 3],
    /// The grains' material, and every wall's that states none.
    #[serde(default)]
    pub material: Material,
    /// What is poured.
    pub grains: Grains,
    /// Where the grains are when the pour begins.
    pub start: Start,
    /// A bed of grains that the pour falls on, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bed: Option<Bed>,
    /// A ball of another size, if one falls among the grains.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intruder: Option<Intruder>,
    /// The plane z = 0.
    #[serde(default, skip_serializing_if = "Ground::is_plain")]
    pub ground: Ground,
    /// A conical funnel about the z axis, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub funnel: Option<Funnel>,
    /// Further walls.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub walls: Vec<Wall>,
    /// Space that repeats along an axis, if it does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub periodic: Option<Periodic>,
    /// Where grains leave the scene, if they do.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outflow: Option<Outflow>,
    /// What the plain model lacks, each off unless stated.
    #[serde(default, skip_serializing_if = "Effects::is_plain")]
    pub effects: Effects,
    /// When the pour ends.
    #[serde(default)]
    pub end: EndRule,
    /// The depth camera above the ground.
    #[serde(default)]
    pub camera: CameraSpec,
    /// Further cameras, whose images are examined and not inferred from.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub views: Vec<ViewSpec>,
    /// What is observed while the pour goes on, and at its end beside the image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub observe: Option<Observe>,
}

impl Scene {
    /// The paper's pour: 2000 grains of 4 mm through a funnel whose tip is `height` `[m]` above the ground.
    pub fn funnel(height: f64) -> Self {
        Self {
            name: "funnel".to_owned(),
            preset: Preset::Default,
            substep: None,
            gravity: standard_gravity(),
            material: Material::default(),
            grains: Grains::balls(2000, 4e-3, 1300.0),
            start: Start::Grid { counts: [10, 10, 20], spacing: 8e-3, jitter: 1e-4, base: -4e-3 },
            bed: None,
            intruder: None,
            ground: Ground::default(),
            funnel: Some(Funnel { height, ..Funnel::default() }),
            walls: Vec::new(),
            periodic: None,
            outflow: None,
            effects: Effects::default(),
            end: EndRule::default(),
            camera: CameraSpec::default(),
            views: Vec::new(),
            observe: None,
        }
    }

    /// A ball of 2000 grains of 4 mm let go with its lowest point `height` `[m]` above the ground.
    pub fn drop(height: f64) -> Self {
        Self {
            name: "drop".to_owned(),
            start: Start::Ball { height, solid_fraction: 0.6, jitter: 5e-5, turned: false },
            funnel: None,
            ..Self::funnel(0.0)
        }
    }

    /// Reads and checks a scene.
    ///
    /// # Errors
    /// [`SceneError::Toml`] for what is not TOML of a scene (unknown keys included),
    /// [`SceneError::OutOfRange`] for numbers that no scene can have.
    pub fn from_toml(text: &str) -> Result<Self, SceneError> {
        let scene = Self::parse(text)?;
        scene.check()?;
        Ok(scene)
    }

    /// Reads a scene whose files are still to be read, and checks nothing else.
    ///
    /// # Errors
    /// [`SceneError::Toml`] for what is not TOML of a scene.
    pub fn parse(text: &str) -> Result<Self, SceneError> {
        toml::from_str(text).map_err(|e| SceneError::Toml(Box::new(e.into())))
    }

    /// The scene as TOML; [`Scene::from_toml`] reads it back unchanged.
    ///
    /// # Errors
    /// [`SceneError::TomlWrite`] if a number cannot be written.
    pub fn to_toml(&self) -> Result<String, SceneError> {
        toml::to_string(self).map_err(|e| SceneError::TomlWrite(Box::new(e)))
    }

    /// The mesh files that walls name.
    pub fn mesh_files(&mut self) -> impl Iterator<Item = &mut MeshFile> {
        self.walls.iter_mut().filter_map(|wall| match &mut wall.shape {
            Shape::Mesh(file) => Some(file),
            _ => None,
        })
    }

    /// How the funnel and the walls move.
    pub fn motions(&mut self) -> impl Iterator<Item = &mut Motion> {
        let walls = self.walls.iter_mut().map(|wall| &mut wall.motion);
        walls.chain(self.funnel.iter_mut().map(|funnel| &mut funnel.motion))
    }

    /// Takes over the meshes that another scene has read from the same files.
    pub fn take_meshes(&mut self, other: &Self) {
        for (mine, theirs) in self.walls.iter_mut().zip(&other.walls) {
            if let (Shape::Mesh(mine), Shape::Mesh(theirs)) = (&mut mine.shape, &theirs.shape)
                && mine.file == theirs.file
            {
                mine.mesh.clone_from(&theirs.mesh);
            }
        }
    }

    /// When the last wall has come to rest, the last effect that ends has, the bed has settled and the intruder has
    /// entered, or the horizon if one never does `[s]`.
    pub fn moves_until(&self) -> f64 {
        let entry = self.intruder.as_ref().map_or(0.0, |intruder| intruder.enters);
        let entry = self.bed.map_or(entry, |bed| bed.settle.max(entry));
        let walls = self.walls.iter().map(|wall| &wall.motion);
        let motions = walls.chain(self.funnel.iter().map(|funnel| &funnel.motion));
        let last = motions.map(Motion::end).fold(self.effects.acts_until().max(entry), f64::max);
        last.min(self.end.horizon)
    }

    /// Whether a place `[m]` is at `time` `[s]` in the funnel where it hangs then, if there is one.
    pub fn is_in_funnel(&self, place: &Vector3<f64>, time: f64) -> bool {
        self.funnel.as_ref().is_some_and(|funnel| {
            // It is hung aside and leant first, and moves from there.
            let hung = funnel.motion.pose(time).inverse_transform_point(&(*place).into());
            let pose = self.effects.funnel.of(funnel);
            funnel.holds(&pose.map_or(hung, |pose| pose.inverse_transform_point(&hung)).coords)
        })
    }

    /// The balls that hold the grains, whichever way they are turned: the grains themselves if they are round.
    ///
    /// # Panics
    /// For a shape that a checked scene cannot have.
    pub fn held_grains(&self) -> Grains {
        let diameter = match self.grains.solid() {
            Some(solid) => 2.0 * solid.reach,
            None => self.effects.clump.envelope(&self.grains),
        };
        Grains { diameter, shape: None, ..self.grains }
    }

    /// Diameter of the widest grain that the scene can have `[m]`.
    fn widest_grain(&self) -> f64 {
        self.effects.polydispersity.widest(self.held_grains().diameter)
    }

    /// Whether grains of different size may overlap where they start: on a lattice that is not as wide as the widest.
    pub fn starts_crowded(&self) -> bool {
        let closest = self.start.closest(&self.held_grains());
        self.effects.polydispersity.is_on() && closest.is_some_and(|d| d < self.widest_grain())
    }

    /// Centres of the grains at time zero `[m]`, one each; of a checked scene.
    ///
    /// # Panics
    /// For a shape that a checked scene cannot have.
    pub fn starting_positions(&self, seed: u64) -> Vec<Vector3<f64>> {
        let pose = self.funnel.as_ref().and_then(|funnel| self.effects.funnel.of(funnel));
        self.start.positions(&self.held_grains(), self.funnel.as_ref(), pose.as_ref(), seed)
    }

    /// Turns of the grains at time zero from their own axes to the scene's, if the scene states them.
    pub fn starting_orientations(&self) -> Option<Vec<UnitQuaternion<f64>>> {
        let pose = self.funnel.as_ref().and_then(|funnel| self.effects.funnel.of(funnel));
        self.start.orientations(pose.as_ref())
    }

    /// The preset's settings, at the substep that the scene states, if it does.
    pub fn settings(&self) -> SolverSettings {
        let own = self.preset.settings();
        SolverSettings { dt: self.substep.unwrap_or(own.dt), ..own }
    }

    /// A substep may be finer than the preset's, whose other settings a coarser one would not fit.
    fn check_substep(&self) -> Result<(), SceneError> {
        let Some(substep) = self.substep else { return Ok(()) };
        if substep > 0.0 && substep <= self.preset.settings().dt {
            return Ok(());
        }
        let allowed = "positive and at most the preset's: 1/900 s of fast, 1/2000 of default, 1/6000 of accurate, 1/600 of \
                       paper";
        Err(SceneError::range("substep", substep, allowed))
    }

    /// Checks every number of the scene.
    ///
    /// # Errors
    /// [`SceneError::OutOfRange`] or [`SceneError::StartTooSmall`].
    pub fn check(&self) -> Result<(), SceneError> {
        self.material.check("material")?;
        self.grains.check()?;
        self.end.check()?;
        self.check_substep()?;
        for (axis, value) in ["x", "y", "z"].iter().zip(self.gravity) {
            finite(&format!("gravity.{axis}"), value)?;
        }
        self.ground.check(&self.material)?;
        self.effects.check()?;
        self.check_together()?;
        self.start.check(&self.held_grains())?;
        self.effects.check_method(self.settings().method)?;
        if let Some(funnel) = &self.funnel {
            funnel.check(&self.material, self.grains.radius())?;
        }
        for (index, wall) in self.walls.iter().enumerate() {
            wall.check(&format!("walls.{index}"), &self.material, &self.grains)?;
        }
        let (dt, diameter) = (self.settings().dt, self.grains.diameter);
        for (index, wall) in self.walls.iter().enumerate() {
            wall.check_jumps(&format!("walls.{index}"), dt, diameter)?;
        }
        for shell in self.funnel.iter().flat_map(Funnel::walls) {
            shell.check_jumps("funnel", dt, diameter)?;
        }
        if let Some(periodic) = &self.periodic {
            periodic.check(self.widest_grain())?;
        }
        if let Some(outflow) = &self.outflow {
            outflow.check()?;
        }
        if let Some(observe) = &self.observe {
            observe.check(self.end.horizon, self.grains.diameter)?;
        }
        self.check_entries()?;
        check_views(&self.views)?;
        self.camera.check()
    }

    /// What is let in later has to come before the pour ends.
    fn check_entries(&self) -> Result<(), SceneError> {
        let enters = self.intruder.as_ref().map(|intruder| ("intruder.enters", intruder.enters));
        let settles = self.bed.map(|bed| ("bed.settle", bed.settle));
        for (name, at) in enters.into_iter().chain(settles) {
            if at >= self.end.horizon {
                return Err(SceneError::range(name, at, "less than end.horizon"));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_scenes_are_valid_and_survive_toml() {
        for scene in [Scene::funnel(0.12), Scene::drop(0.2)] {
            scene.check().unwrap();
            assert_eq!(Scene::from_toml(&scene.to_toml().unwrap()).unwrap(), scene);
        }
    }

    #[test]
    fn unknown_keys_are_named() {
        let text = Scene::drop(0.1).to_toml().unwrap().replace("diameter", "diametre");
        let error = Scene::from_toml(&text).unwrap_err();
        let source = std::error::Error::source(&error).unwrap().to_string();
        assert!(source.contains("diametre") && source.contains("diameter"), "{source}");
    }

    #[test]
    fn bad_numbers_are_named() {
        for (change, name) in [
            ((|s: &mut Scene| s.grains.diameter = -1.0) as fn(&mut Scene), "grains.diameter"),
            (|s| s.gravity[2] = f64::NAN, "gravity.z"),
            (|s| s.end.horizon = 0.0, "end.horizon"),
            (|s| s.material.restitution = 2.0, "material.restitution"),
        ] {
            let mut scene = Scene::funnel(0.12);
            change(&mut scene);
            assert!(scene.check().unwrap_err().to_string().contains(name), "{name}");
        }
    }

    #[test]
    fn a_funnel_that_hangs_aside_and_turns_holds_what_is_in_it_there() {
        let mut scene = Scene::funnel(0.12);
        let funnel = scene.funnel.as_mut().unwrap();
        let half_a_turn = 1.0;
        funnel.motion = Motion::Spin {
            point: [0.0; 3],
            axis: [0.0, 0.0, 1.0],
            rate: std::f64::consts::PI,
            begin: 0.0,
            end: Some(half_a_turn),
        };
        let above_tip = funnel.height + 0.5 * funnel.stem_length;
        scene.effects.funnel.x = 0.05;
        let is_in = |x: f64, time| scene.is_in_funnel(&Vector3::new(x, 0.0, above_tip), time);
        assert!(is_in(0.05, 0.0) && !is_in(-0.05, 0.0));
        assert!(is_in(-0.05, half_a_turn) && !is_in(0.05, half_a_turn));
    }
}
