//! Arguments of `infer`.

use clap::Args;
use granulcal_dataset::{Form, Product};

use super::paths::{Reads, Writes, recording, writes};
use super::read::ReadArgs;

/// Infer the parameters from recordings with a trained model
#[derive(Debug, Args)]
#[command(long_about = "\
Evaluates a model that `granulcal train` made: recordings to statistics to the posterior of the
parameters. Needs neither Python nor torch; a robot runs it after every pour.

RECORDING is what `features` reads. Several recordings are pours of one material and give one
posterior. The images are down-sampled so that a pixel is as wide on the ground as in the scene
that the model was trained on, unless --camera says otherwise.

A model answers under its own assumptions, right or wrong. So the recording's height, extent and
ground are compared with what the model's scene allows, and its statistics with what any parameters
can explain; if either fails, OUTSIDE THE MODEL is said, inside_model in the JSON is false, and the
exit code is 3. A model whose own check failed is told on stderr.

Example:
  granulcal-cli infer model/ pile.bag
  granulcal-cli infer model/ pile.png --camera camera.toml --json
  granulcal-cli infer model/ 1.mcap 2.mcap 3.mcap --samples 1000 --json")]
pub struct InferArgs {
    /// Folder of the model
    pub model: Reads,
    /// Recordings of one material
    #[arg(required = true, value_name = "RECORDING", value_parser = recording())]
    pub recordings: Vec<Reads>,
    #[command(flatten)]
    pub read: ReadArgs,
    /// Ignore a frame of so many pixels
    #[arg(long, value_name = "PIXELS")]
    pub border: Option<usize>,
    /// Print so many draws of the posterior in the JSON
    #[arg(long, value_name = "N", default_value_t = 0, requires = "json")]
    pub samples: usize,
    /// Write the JSON with 1000 draws of the posterior to this file
    #[arg(long = "out", short = 'o', value_name = "OUT.json",
        value_parser = writes(Product::File(Form::Json)))]
    pub out: Option<Writes>,
    /// Refuse a model of another scene than this TOML
    #[arg(long)]
    pub scene: Option<Reads>,
    /// Seed of the draws
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}
