//! What can be wrong with a scene, a material or a path.

/// Everything that this crate refuses. Each variant names the thing, what was found and what is allowed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DemError {
    /// A number lies outside its range.
    #[error("{name} must be {allowed}, got {got}")]
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
    /// The operating system gave no threads.
    #[error("cannot start the threads for a simulation")]
    Threads(#[source] rayon::ThreadPoolBuildError),
    /// A solver method that does not exist.
    #[error("method must be one of nsgs, newton_pcr, reference, got {got:?}")]
    UnknownMethod {
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
