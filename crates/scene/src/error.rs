//! What can be wrong with a scene, a material, a prior or a path.

use granulcal_numbers::General;

use crate::toml_fault::TomlFault;

/// Everything that this crate refuses. Each variant names the thing, what was found and what is allowed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A number lies outside its range.
    #[error("{name} must be {allowed}, got {}", General(*got))]
    OutOfRange {
        /// Path of the number in the scene, for example `material.restitution`.
        name: String,
        /// The value found.
        got: f64,
        /// The allowed range in words.
        allowed: &'static str,
    },
    /// The scene's TOML could not be read.
    #[error("scene is not valid TOML of a scene")]
    Toml(#[source] Box<TomlFault>),
    /// The scene could not be written as TOML.
    #[error("scene cannot be written as TOML")]
    TomlWrite(#[source] Box<toml::ser::Error>),
    /// A path such as `material.sliding_friction` does not name a number of the scene.
    #[error("path {path:?} does not name a number of this scene: {reason}")]
    Path {
        /// The path asked for.
        path: String,
        /// Why it does not fit, with what is allowed there.
        reason: String,
    },
    /// A value that the number at a path cannot have.
    #[error("{path} {reason}")]
    Value {
        /// The path of the number.
        path: String,
        /// What it must be, and what was found.
        reason: String,
    },
    /// A whole number of the scene that would not be one.
    #[error("{path} must be a whole number, got {}", General(*got))]
    NotWhole {
        /// The path of the number.
        path: String,
        /// The value found.
        got: f64,
    },
    /// Places of a lattice that are so near that grains would begin in each other.
    #[error(
        "{name} must be {bound} {} m, got {}: a grain needs {} m, however it is turned",
        General(*limit),
        General(*got),
        General(*needs)
    )]
    Lattice {
        /// Path of the number, a spacing or a jitter.
        name: String,
        /// The value found `[m]`.
        got: f64,
        /// `at least` or `at most`.
        bound: &'static str,
        /// What it may be `[m]`.
        limit: f64,
        /// Diameter of the ball that holds a grain `[m]`.
        needs: f64,
    },
    /// A count of grains does not fit the start that should hold it.
    #[error("start {kind} holds {capacity} grains, but grains.count is {count}")]
    StartTooSmall {
        /// The kind of start.
        kind: &'static str,
        /// How many grains it can hold.
        capacity: usize,
        /// How many are asked for.
        count: usize,
    },
    /// Arrays of a state differ in length.
    #[error("{name} has {got} entries, expected one for each of the {expected} grains")]
    Length {
        /// Name of the array.
        name: &'static str,
        /// Its length.
        got: usize,
        /// The length it must have.
        expected: usize,
    },
    /// A mesh that cannot be a wall.
    #[error("mesh {file} {reason}")]
    Mesh {
        /// The file that it stands in.
        file: String,
        /// What is wrong with it, and what is allowed.
        reason: String,
    },
    /// A solver method that does not exist.
    #[error("method must be one of nsgs, newton_pcr, reference, got {got:?}")]
    UnknownMethod {
        /// The name found.
        got: String,
    },
    /// Points or a mesh that are no convex body.
    #[error("grains.shape is no body: {what}")]
    BadShape {
        /// What is wrong.
        what: &'static str,
    },
    /// Two things that cannot be in one scene.
    #[error("{one} and {other} cannot be in one scene")]
    Exclude {
        /// Table of the one.
        one: &'static str,
        /// Table of the other.
        other: &'static str,
    },
    /// What says something of a thing that the scene lacks.
    #[error("{one} needs {needs}, which the scene lacks")]
    Needs {
        /// Table of the one.
        one: &'static str,
        /// What is not there.
        needs: &'static str,
    },
    /// A number of round grains' impacts that grains of another shape do not read.
    #[error(
        "{name} must be {} with {body}, whose impacts do not read it, got {}",
        General(*allowed),
        General(*got)
    )]
    OfRoundGrains {
        /// Path of the number.
        name: String,
        /// The value found.
        got: f64,
        /// Its default, the one value that such a scene may state.
        allowed: f64,
        /// What makes the grains another shape: `effects.clump` or `grains.shape`.
        body: &'static str,
    },
    /// An effect that the solver's method does not know.
    #[error("{effect} needs the method nsgs (every preset but paper), got {got}")]
    EffectNeedsMethod {
        /// The table of the effect in the scene.
        effect: &'static str,
        /// The method found.
        got: &'static str,
    },
    /// A view without a name of its own.
    #[error("{path} must be of letters, digits, - and _, and no other view's, got {got:?}")]
    ViewName {
        /// Where it stands in the scene.
        path: String,
        /// The name found.
        got: String,
    },
    /// A preset that does not exist.
    #[error("preset must be one of fast, default, accurate, paper, got {got:?}")]
    UnknownPreset {
        /// The name found.
        got: String,
    },
    /// The text of a prior is not the TOML of a prior.
    #[error("not the TOML of a prior")]
    PriorToml(#[source] Box<TomlFault>),
    /// The prior could not be written as TOML.
    #[error("the prior cannot be written as TOML")]
    PriorTomlWrite(#[source] Box<toml::ser::Error>),
    /// Another number of values than a prior has parameters, fixed ones included.
    #[error("a prior of {expected} parameters needs a value for each, got {got}")]
    Values {
        /// How many are given.
        got: usize,
        /// How many it needs.
        expected: usize,
    },
    /// A parameter of a prior is wrong.
    #[error("prior of {parameter:?}: {what} must be {allowed}, got {got}")]
    Prior {
        /// Path of the parameter in the scene.
        parameter: String,
        /// The key that is wrong.
        what: &'static str,
        /// What was got.
        got: String,
        /// What is allowed.
        allowed: &'static str,
    },
    /// A parameter that is drawn, of a whole number of the scene.
    #[error(
        "prior of {parameter:?}: its draws are no whole numbers, and that number of the scene is one; fix it{hint}"
    )]
    PriorOfWhole {
        /// Path of the parameter in the scene.
        parameter: String,
        /// What may be drawn in its place, if something may.
        hint: &'static str,
    },
    /// A value that the prior can draw has no place in the scene.
    #[error("prior of {parameter:?} does not fit the scene at the value {}", General(*value))]
    PriorDoesNotFit {
        /// Path of the parameter in the scene.
        parameter: String,
        /// The value tried.
        value: f64,
        /// What the scene says.
        source: Box<SceneError>,
    },
    /// Values that the prior draws together have no place in the scene.
    #[error(
        "row {row} of the prior's draws does not fit the scene: its values, each allowed by itself, do not go together"
    )]
    DrawDoesNotFit {
        /// Index of the row.
        row: u64,
        /// What the scene says.
        source: Box<SceneError>,
    },
    /// A sensor that the camera cannot have.
    #[error(
        "camera.sensor of kind stereo needs camera.projection = \"pinhole\", got \"orthographic\""
    )]
    SensorNeedsPinhole,
}

impl SceneError {
    /// A [`SceneError::OutOfRange`] for `name`.
    pub fn range(name: impl Into<String>, got: f64, allowed: &'static str) -> Self {
        Self::OutOfRange { name: name.into(), got, allowed }
    }
}
