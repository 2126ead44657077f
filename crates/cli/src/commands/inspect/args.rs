//! Arguments of `inspect`.

use clap::Args;
use granulcal_dataset::{Form, Product};

use crate::args::SceneChanges;
use crate::args::numbers::{number, whole};
use crate::args::paths::{Reads, Writes, writes};

/// Say what is in a scene, prior, data set, recording or MCAP file, or in one substep of a scene
#[derive(Debug, Args)]
#[command(long_about = "\
Says what is in a file or folder: a scene, prior or camera (.toml), a data set
(folder or .parquet), an array or height map (.npy, .npz), an image (.png), a
folder of frames, a checkpoint (.ckpt), or a recording over time (.bag, .mcap):
its topics with types, counts and sizes, which of them `features` reads, with
which lens and depth unit. The whole file is read, so a damaged one is found:
it is said where, and how many frames are lost (exit code 3). `granulcal` of the
Python package says of a model and a posterior (.json) what they are of, too.

With --contact-problem PATH is a scene, or one of the words `funnel` and
`drop`: it is simulated until --time, and the contact problem of the next
substep is written with its solution, as arrays that
docs/theory/contact-problem.md describes.

Example:
  granulcal-cli inspect data/
  granulcal-cli inspect pile.bag
  granulcal-cli inspect drop.mcap --json
  granulcal-cli inspect drop --contact-problem frozen.npz --time 0.2")]
pub struct InspectArgs {
    /// File or folder
    pub path: Reads,
    /// Write the contact problem of a scene's next substep after --time
    #[arg(long, value_name = "OUT.npz", requires = "time",
        value_parser = writes(Product::File(Form::Npz)))]
    pub contact_problem: Option<Writes>,
    #[command(flatten)]
    pub substep: SubstepArgs,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}

/// Which substep of which pour.
#[derive(Clone, Debug, Args)]
pub struct SubstepArgs {
    /// Simulated time at which the substep begins [s]
    #[arg(long, value_name = "SECONDS", value_parser = number, allow_negative_numbers = true)]
    pub time: Option<f64>,
    /// Seed of the grains' jitter at the start [default: 0]
    #[arg(long, value_parser = whole::<u64>, allow_negative_numbers = true)]
    pub seed: Option<u64>,
    #[command(flatten)]
    pub with: SceneChanges,
}
