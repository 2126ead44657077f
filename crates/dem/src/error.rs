//! What can be wrong with a simulation and its checkpoint.

use granulcal_scene::SceneError;

use granulcal_numbers::General;

/// Everything that this crate refuses. Each variant names the thing, what was found and what is allowed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DemError {
    /// The scene is wrong, or a number that is asked of it.
    #[error(transparent)]
    Scene(#[from] SceneError),
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
    /// Grains start inside each other.
    #[error(
        "{pairs} pair(s) of grains start in each other, grains {} and {} (from 0) the deepest by {} of a radius; at most \
         {} is allowed",
        deepest.0, deepest.1,
        General((depth * 1e3).round() / 1e3),
        General(*allowed)
    )]
    StartInEachOther {
        /// How many pairs.
        pairs: usize,
        /// Numbers of the grains of the deepest.
        deepest: (usize, usize),
        /// How deep the deepest is, in radii of the smaller.
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
    /// A checkpoint of the same law, worked out in another arithmetic.
    #[error(
        "the checkpoint must be of arithmetic {allowed} of the solver, got arithmetic {got}: begin the pour anew"
    )]
    CheckpointArithmetic {
        /// The arithmetic that it was made in.
        got: u32,
        /// The arithmetic of this version.
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
    /// What cannot be told of a scene with an effect, or with grains of a shape.
    #[error("{what} cannot be told of a scene with {effect}")]
    Untold {
        /// What was asked for.
        what: &'static str,
        /// The table of it in the scene.
        effect: &'static str,
    },
    /// An effect that a contact problem cannot say when it is written by itself.
    #[error("a contact problem cannot be written of a scene with {effect}")]
    NotInContactProblem {
        /// The table of the effect in the scene.
        effect: &'static str,
    },
}

impl DemError {
    /// A [`SceneError::OutOfRange`] for `name`.
    pub(crate) fn range(name: impl Into<String>, got: f64, allowed: &'static str) -> Self {
        Self::Scene(SceneError::range(name, got, allowed))
    }
}
