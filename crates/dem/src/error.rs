//! What can be wrong with a scene, a material or a path.

use granulcal_numbers::General;

/// Everything that this crate refuses. Each variant names the thing, what was found and what is allowed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DemError {
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
    Toml(#[source] Box<toml::de::Error>),
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
    /// Grains start inside a wall.
    #[error(
        "{grains} grain(s) start in {wall}, the deepest by {} of its radius; at most {} is allowed",
        General((depth * 1e3).round() / 1e3),
        General(*allowed)
    )]
    StartInWall {
        /// The wall's path in the scene, `funnel` or the ground.
        wall: String,
        /// How many.
        grains: usize,
        /// How deep the deepest is, in its radii.
        depth: f64,
        /// How deep one may be.
        allowed: f64,
    },
    /// Grains would leave the scene before they have moved.
    #[error(
        "{grains} grain(s) start below outflow.below = {} m, where they would leave at once; at most 0 is allowed",
        General(*below)
    )]
    StartBelowOutflow {
        /// How many.
        grains: usize,
        /// The outflow's height `[m]`.
        below: f64,
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
    /// The operating system gave no threads.
    #[error("cannot start the threads for a simulation")]
    Threads(#[source] rayon::ThreadPoolBuildError),
    /// Bytes that are no checkpoint.
    #[error("a checkpoint begins with \"granulcal checkpoint\", this begins with {found:?}")]
    NotACheckpoint {
        /// The first bytes, as text.
        found: String,
    },
    /// A checkpoint that has lost bytes, or has some too many.
    #[error("the checkpoint is truncated or damaged: {expected} bytes expected, got {got}")]
    CheckpointLength {
        /// The length that it says it has `[bytes]`, or the least that there is.
        expected: u64,
        /// Its length `[bytes]`.
        got: usize,
    },
    /// A checkpoint in which bytes have changed.
    #[error("the checkpoint is damaged: its hash must be {stored:032x}, got {computed:032x}")]
    CheckpointDamaged {
        /// The hash at its end.
        stored: u128,
        /// The hash of what stands before.
        computed: u128,
    },
    /// A checkpoint in a format that this version does not read.
    #[error("the checkpoint must have format {allowed}, got {got}, written by granulcal {version}")]
    CheckpointFormat {
        /// Its format.
        got: u32,
        /// The format of this version.
        allowed: u32,
        /// The version that wrote it.
        version: String,
    },
    /// A checkpoint of another version, which may compute other bits.
    #[error("the checkpoint must be written by granulcal {allowed}, got {got}")]
    CheckpointVersion {
        /// The version that wrote it.
        got: String,
        /// This version.
        allowed: &'static str,
    },
    /// A checkpoint of another law of the solver, which would go on as another pour.
    #[error(
        "the checkpoint must be of law {allowed} of the solver, got law {got}: begin the pour anew"
    )]
    CheckpointLaw {
        /// The law that it was made by.
        got: u32,
        /// The law of this version.
        allowed: u32,
    },
    /// A checkpoint of another scene, seed or settings.
    #[error("the checkpoint is of another pour: {what} is {found} there, but {given} is given")]
    CheckpointDiffers {
        /// What differs.
        what: Box<str>,
        /// What the checkpoint says.
        found: Box<str>,
        /// What was given.
        given: Box<str>,
    },
    /// A checkpoint with a state that no simulation of its scene can have; granulcal has not written it.
    #[error("the checkpoint's state must be one of its scene, got {what}")]
    CheckpointState {
        /// What is wrong.
        what: &'static str,
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
    /// An effect that a contact problem cannot say when it is written by itself.
    #[error("a contact problem cannot be written of a scene with {effect}")]
    NotInContactProblem {
        /// The table of the effect in the scene.
        effect: &'static str,
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
}

impl DemError {
    /// An [`DemError::OutOfRange`] for `name`.
    pub(crate) fn range(name: impl Into<String>, got: f64, allowed: &'static str) -> Self {
        Self::OutOfRange { name: name.into(), got, allowed }
    }
}
