//! Arguments of `infer`.

use std::path::PathBuf;

use clap::Args;

use super::read::ReadArgs;

/// Infer the parameters from recordings with a trained model, without Python
#[derive(Debug, Args)]
#[command(long_about = "\
Evaluates a model that `granulcal train` made: recordings to statistics to the posterior of the
parameters. Needs neither Python nor torch; a robot runs it after every pour.

RECORDING is what `features` reads. Several recordings are pours of one material and give one
posterior. The images are down-sampled so that a pixel is as wide on the ground as in the scene
that the model was trained on, unless --camera says otherwise.

The test whether the observation is inside the model at all, the identifiability and plots are
those of `granulcal infer`, in Python. A model whose own check failed is told on stderr.

Example:
  granulcal-cli infer model/ pile.bag
  granulcal-cli infer model/ pile.png --camera camera.toml --json
  granulcal-cli infer model/ 1.mcap 2.mcap 3.mcap --samples 1000 --json")]
pub struct InferArgs {
    /// Folder of the model
    pub model: PathBuf,
    /// Recordings of one material
    #[arg(required = true, value_name = "RECORDING")]
    pub recordings: Vec<PathBuf>,
    #[command(flatten)]
    pub read: ReadArgs,
    /// Print so many draws of the posterior in the JSON
    #[arg(long, value_name = "N", default_value_t = 0, requires = "json")]
    pub samples: usize,
    /// Seed of the draws
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}
