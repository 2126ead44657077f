//! How a command ended, and the exit codes.

use granulcal_bayessim::ModelError;
use granulcal_dataset::DatasetError;
use granulcal_dem::DemError;
use granulcal_features::FeatureError;
use granulcal_scene::SceneError;

/// How a command ended that did not fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// As asked.
    Done,
    /// As asked, but some pours cannot be used.
    SomeUnhealthy,
    /// As asked, but the input is cut off or damaged, or does not have all its rows, and a part of it is lost.
    SomeLost,
    /// As asked, but the model cannot explain what was recorded.
    OutsideModel,
    /// The result is printed, but a file beside it could not be written.
    SideFileFailed,
    /// The user stopped it.
    Stopped,
}

impl Outcome {
    /// The exit code of the process.
    pub fn exit_code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::SideFileFailed => 1,
            Self::SomeUnhealthy | Self::SomeLost | Self::OutsideModel => 3,
            // As shells report a process that SIGINT ended.
            Self::Stopped => 130,
        }
    }

    /// Done, or not quite.
    pub fn healthy_if(healthy: bool) -> Self {
        if healthy { Self::Done } else { Self::SomeUnhealthy }
    }

    /// Done, or not with all that there was.
    pub fn whole_if(whole: bool) -> Self {
        if whole { Self::Done } else { Self::SomeLost }
    }
}

/// Arguments that clap cannot refuse by itself.
#[derive(Debug)]
pub struct BadArgument(pub String);

impl std::fmt::Display for BadArgument {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for BadArgument {}

/// The exit code of an error: 2 for bad input, else 1.
pub fn exit_code_of(error: &anyhow::Error) -> u8 {
    for cause in error.chain() {
        if let Some(cause) = cause.downcast_ref::<DatasetError>() {
            return if cause.is_bad_input() { 2 } else { 1 };
        }
        if cause.is::<BadArgument>()
            || cause.is::<ModelError>()
            || cause.is::<DemError>()
            || cause.is::<SceneError>()
            || cause.is::<FeatureError>()
        {
            return 2;
        }
    }
    1
}
