//! The arguments: clap types and nothing else.
//!
//! Longer than other files because the help of every command stands in it; groups that several commands share are in
//! `args/`.

mod completions;
mod global;
mod infer;
pub mod paths;
mod read;
mod sensor;

use std::time::Duration;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand};
use granulcal_dataset::{Form, Product, Shard};
use granulcal_scene::Preset;

pub use completions::CompletionsArgs;
pub use global::Global;
pub use infer::InferArgs;
use paths::{Reads, Writes, kept, recording, writes};
pub use read::ReadArgs;
pub use sensor::{FitSensorArgs, PickColourArgs};

/// Calibrates a granular simulator from depth images: pours grains, looks at them, describes them.
#[derive(Debug, Parser)]
#[command(name = "granulcal-cli", version, propagate_version = true, arg_required_else_help = true)]
#[command(after_help = "\
Start here:
  granulcal-cli simulate funnel                       one pour, its health and its 16 statistics
  granulcal-cli generate funnel default -n 100 -o d   100 pours with unknown material, as Parquet
  granulcal-cli features pile.bag                     the same statistics of a measured pile
  granulcal-cli infer model pile.bag                  its material, by a model of `granulcal train`

Exit codes: 0 done, 1 failed, 2 bad arguments or input, 3 done but some pours unhealthy or without
grains in view, some frames of a recording lost, or a recording outside the model, 130 stopped. Results go to stdout, progress and messages to stderr.")]
pub struct Cli {
    #[command(flatten)]
    pub global: Global,
    #[command(subcommand)]
    pub command: Command,
}

/// What can be done.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Print a scene as TOML, every number of it: a built-in one, or a file with changes
    #[command(long_about = "\
Prints a scene as TOML with every number that it has, those that its file leaves out too. The
result is a scene file.

Example:
  granulcal-cli scene funnel > scene.toml
  granulcal-cli scene examples/drum.toml --set walls.0.motion.rate=4")]
    Scene(SceneArgs),
    Simulate(SimulateArgs),
    Generate(GenerateArgs),
    Render(RenderArgs),
    Features(FeaturesArgs),
    Infer(InferArgs),
    FitSensor(FitSensorArgs),
    PickColour(PickColourArgs),
    Inspect(InspectArgs),
    Merge(MergeArgs),
    Completions(CompletionsArgs),
}

/// Which scene, with which changes.
#[derive(Clone, Debug, Args)]
pub struct SceneArgs {
    /// Scene as TOML, or one of the words `funnel` and `drop` for the scenes that are built in
    pub scene: Reads,
    #[command(flatten)]
    pub with: SceneChanges,
}

/// Changes of a scene.
#[derive(Clone, Debug, Args)]
pub struct SceneChanges {
    /// Set a number of the scene by its path, for example material.sliding_friction=0.5; repeat as needed
    #[arg(long = "set", value_name = "PATH=VALUE", value_parser = parse_change)]
    pub changes: Vec<(String, f64)>,
    /// Sensor of the camera as `fit-sensor` wrote it, instead of the scene's
    #[arg(long, value_name = "SENSOR.toml")]
    pub sensor: Option<Reads>,
    /// Solver preset instead of the scene's
    #[arg(long, value_parser = PossibleValuesParser::new(Preset::ALL.map(Preset::name))
        .try_map(|word| word.parse::<Preset>()))]
    pub preset: Option<Preset>,
}

fn parse_change(text: &str) -> Result<(String, f64), String> {
    let (path, value) = text.split_once('=').ok_or("must be PATH=VALUE")?;
    let value =
        value.trim().parse().map_err(|_| format!("value must be a number, got {value:?}"))?;
    Ok((path.trim().to_owned(), value))
}

/// Simulate one pour: status, health and statistics
#[derive(Debug, Args)]
#[command(long_about = "\
Simulates one pour to its end and prints how it ended, whether it can be trusted and the 16
statistics of its depth image.

The same scene, numbers and seed give the same result on any machine. The row of a data set
is made again by setting its parameters and its seed.

A long pour survives whatever stops it: with --checkpoint its whole state is kept in a file,
at the start, every minute, when you stop it (Ctrl-C or SIGTERM) and at the end. The same
command with --resume goes on from there, and every bit of the result is that of a pour that
was never stopped. A checkpoint of another scene, seed, preset or version is refused.

Example:
  granulcal-cli simulate funnel --set material.sliding_friction=0.5 --seed 1 --json
  granulcal-cli simulate examples/drop.toml --mcap drop.mcap --positions grains.npy
  granulcal-cli simulate large.toml --checkpoint large.ckpt
  granulcal-cli simulate large.toml --checkpoint large.ckpt --resume large.ckpt")]
pub struct SimulateArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Another simulator in place of ours: lammps, liggghts, yade, mujoco, newton, module:function or a
    /// command; `granulcal` of the Python package only
    #[arg(long, value_name = "ENGINE")]
    pub engine: Option<String>,
    /// Seed of the grains' jitter at the start and of the camera's noise
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Cores for the one pour; only very large scenes gain, and none changes by a bit
    #[arg(long, default_value_t = 1)]
    pub threads: usize,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
    /// Print the diagnostic statistics too: profile, azimuthal modes, tail, bodies
    #[arg(long)]
    pub diagnostics: bool,
    /// Write the final centres [m] as an array (n, 3)
    #[arg(long, value_name = "OUT.npy", value_parser = writes(Product::File(Form::Npy)))]
    pub positions: Option<Writes>,
    /// Write the final depth image (16-bit PNG), or the height map of an orthographic camera (.npz)
    #[arg(long, value_name = "OUT.png", value_parser = writes(Product::View))]
    pub depth: Option<Writes>,
    /// Metres per count of the PNG
    #[arg(long, default_value_t = granulcal_dataset::png::DEPTH_UNIT, value_name = "METRES",
        value_parser = parse_positive)]
    pub depth_unit: f64,
    /// Write grains and depth image over time, for Foxglove
    #[arg(long, value_name = "OUT.mcap", value_parser = writes(Product::File(Form::Mcap)))]
    pub mcap: Option<Writes>,
    /// Frames per simulated second in the MCAP
    #[arg(long, default_value_t = 60.0, requires = "mcap", value_parser = parse_positive)]
    pub fps: f64,
    /// Keep the whole state in this file, for --resume
    #[arg(long, value_name = "FILE", conflicts_with = "mcap",
        value_parser = writes(Product::File(Form::Checkpoint)))]
    pub checkpoint: Option<Writes>,
    /// Time between two checkpoints on the clock [s]; 0 for as often as possible
    #[arg(long, value_name = "SECONDS", default_value = "60", requires = "checkpoint",
        value_parser = parse_period)]
    pub checkpoint_every: Duration,
    /// Go on from a checkpoint of the same scene, seed and preset, on any number of threads
    #[arg(long, value_name = "FILE", conflicts_with = "mcap", value_parser = kept())]
    pub resume: Option<Reads>,
}

fn parse_positive(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|&number: &f64| number > 0.0 && number.is_finite());
    number.ok_or_else(|| format!("must be a positive number, got {text:?}"))
}

fn parse_period(text: &str) -> Result<Duration, String> {
    let period = text.parse().ok().and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    period.ok_or_else(|| format!("must be a number of seconds, 0 or more, got {text:?}"))
}

/// Simulate many pours with parameters drawn from a prior, to Parquet
#[derive(Debug, Args)]
#[command(long_about = "\
Draws parameters from a prior, simulates a pour for each draw and writes one row a pour:
parameters, seed, status, health and the 16 statistics, as Parquet.

Row i depends on the scene, the prior, the seed and i only. Stop it at any moment, also by
pulling the plug, and start it again with the same arguments: the rows are the same as
without the stop. A larger -n continues the same data set. Shards of several machines, each
in a folder of its own, are joined by `merge`.

Example:
  granulcal-cli generate examples/funnel.toml examples/prior.toml -n 1000 --seed 1 -o data/
  granulcal-cli generate funnel default -n 1000 --shard 0/4 -o shard-0/")]
pub struct GenerateArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Prior as TOML, or the word `default` for the friction, rolling friction and restitution of a dry grain
    pub prior: Reads,
    /// Another simulator in place of ours: lammps, liggghts, yade, mujoco, newton, module:function or a
    /// command; `granulcal` of the Python package only
    #[arg(long, value_name = "ENGINE")]
    pub engine: Option<String>,
    /// Pour on a Ray cluster: auto, local, HOST:PORT or ray://HOST:PORT; `granulcal` of the Python package only
    #[arg(long, value_name = "ADDRESS")]
    pub ray: Option<String>,
    /// Folder that the workers of --ray write their parts to, for example s3://bucket/run
    #[arg(long, value_name = "URL")]
    pub ray_store: Option<String>,
    /// Rows of the whole data set
    #[arg(long = "rows", short = 'n', default_value_t = 1000)]
    pub rows: u64,
    /// Folder to write into
    #[arg(long = "out", short = 'o', value_name = "DIR", value_parser = writes(Product::DATA_SET))]
    pub out: Writes,
    /// Seed of the data set
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Make the i-th of k parts only, counted from 0
    #[arg(long, value_name = "I/K", default_value = "0/1")]
    pub shard: Shard,
    /// Pours at once [default: all cores]
    #[arg(long)]
    pub threads: Option<usize>,
    /// Rows in a part
    #[arg(long, default_value_t = 16)]
    pub chunk: u64,
    /// Longest time that a finished row is in memory only, and a kill can lose it [s]
    #[arg(long, value_name = "SECONDS", default_value = "30", value_parser = parse_period)]
    pub flush_every: Duration,
    /// Refuse a folder that holds rows already
    #[arg(long)]
    pub no_resume: bool,
    /// Say how long it would take, from three pours, and make nothing
    #[arg(long)]
    pub dry_run: bool,
    /// Print the summary as one JSON object
    #[arg(long)]
    pub json: bool,
}

/// Simulate or take grains and write the depth image that the scene's camera sees
#[derive(Debug, Args)]
#[command(long_about = "\
Writes the image that the scene's camera delivers, down-sampled and with the scene's noise:
a 16-bit PNG of depth with the camera's TOML beside it, or an .npz height map for an
orthographic camera. Both can be read back by `features`.

Example:
  granulcal-cli render funnel --seed 1 -o pile.png && granulcal-cli features pile.png --camera pile.toml
  granulcal-cli render funnel --positions grains.npy -o pile.png")]
pub struct RenderArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Image to write: .png for a pinhole camera, .npz for an orthographic one
    #[arg(long = "out", short = 'o', value_parser = writes(Product::View))]
    pub out: Writes,
    /// What this one of the scene's views sees, a depth image without noise, instead of the scene's camera
    #[arg(long, value_name = "NAME")]
    pub view: Option<String>,
    /// Render these centres [m], an array (n, 3), with the scene's grain diameter, instead of a pour
    #[arg(long, value_name = "IN.npy")]
    pub positions: Option<Reads>,
    /// Seed of the pour and of the camera's noise
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Metres per count of the PNG
    #[arg(long, default_value_t = granulcal_dataset::png::DEPTH_UNIT, value_name = "METRES",
        value_parser = parse_positive)]
    pub depth_unit: f64,
}

/// Segment and describe a measured recording
#[derive(Debug, Args)]
#[command(long_about = "\
Finds the ground plane of a measured recording, levels it, takes the points above it and
prints the same 16 statistics that simulated pours have.

RECORDING is one of, as its content says:
  .bag    ROS 1, as the RealSense viewer saves it: depth, lens and depth unit are in the file
  .mcap   sensor_msgs/Image (16UC1, 32FC1), CompressedImage (PNG) and CameraInfo of ROS 2,
          or RawImage, CompressedImage and CameraCalibration of Foxglove
  .png    16-bit depth, or a folder of such frames; needs --camera, the TOML of lens and unit
  .npz    height map: arrays depthmap, xres, yres, zres, scale

Topics are found by type. Where several fit, the message lists them, and --topic, --camera-topic
or --colour-topic picks one; `inspect` shows them all. Of the last ten frames (--frames,
--first-frame) the mean of each pixel is taken over those that have data there. A file that is
cut off or damaged gives the frames that are whole; the others are counted, exit code 3.

Example:
  granulcal-cli features pile.bag
  granulcal-cli features pile.bag --debug-images steps/
  granulcal-cli features pile.mcap --topic /camera/depth/image_rect_raw --frames 30 --json
  granulcal-cli features frames/ --camera examples/camera.toml --threshold 0.002
  granulcal-cli features pile.npz --diagnostics --grain-diameter 0.002
  granulcal-cli features --list")]
pub struct FeaturesArgs {
    /// Recording to describe
    #[arg(required_unless_present = "list", value_parser = recording())]
    pub recording: Option<Reads>,
    #[command(flatten)]
    pub read: ReadArgs,
    /// Height above the ground from which a pixel counts as grain [m]
    #[arg(long, value_name = "METRES")]
    pub threshold: Option<f64>,
    /// Ignore a frame of so many pixels
    #[arg(long, value_name = "PIXELS")]
    pub border: Option<usize>,
    /// Keep the middle pixel of every n x n block
    #[arg(long, value_name = "N")]
    pub downsample: Option<usize>,
    /// Down-sample so that a pixel is as wide on the ground as in this scene's images: a TOML, or `funnel`
    /// or `drop`
    #[arg(long, value_name = "SCENE", conflicts_with = "downsample")]
    pub scene: Option<Reads>,
    /// Height above which a pixel is a fault and no data [m]
    #[arg(long, value_name = "METRES")]
    pub max_height: Option<f64>,
    /// Grains must form patches of at least so many pixels
    #[arg(long, value_name = "PIXELS")]
    pub min_component: Option<usize>,
    /// Write the points of the formation [m] as an array (n, 3)
    #[arg(long, value_name = "OUT.npy", value_parser = writes(Product::File(Form::Npy)))]
    pub points: Option<Writes>,
    /// Write pictures of the steps into this folder: residual.png (distance from the fitted plane),
    /// height.png, mask.png
    #[arg(long, value_name = "DIR", value_parser = writes(Product::PICTURES))]
    pub debug_images: Option<Writes>,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
    /// Print (or list) the diagnostic statistics too: profile, azimuthal modes, tail, bodies
    #[arg(long)]
    pub diagnostics: bool,
    /// Diameter of a grain [m], which the diagnostic statistics need
    #[arg(long, value_name = "METRES", requires = "diagnostics")]
    pub grain_diameter: Option<f64>,
    /// Where the axis of the pour meets the levelled ground [m], in the frame of the centroid that is
    /// printed [default: the centroid]
    #[arg(long, num_args = 2, value_names = ["X", "Y"], requires = "diagnostics",
        allow_negative_numbers = true)]
    pub pour_axis: Option<Vec<f64>>,
    /// List the statistics with unit and meaning
    #[arg(long, conflicts_with_all = ["recording", "camera"])]
    pub list: bool,
}

/// Say what is in a scene, prior, data set, recording or MCAP file, or in one substep of a scene
#[derive(Debug, Args)]
#[command(long_about = "\
Says what is in a file or folder: a scene, prior or camera (.toml), a data set (folder or
.parquet), an array or height map (.npy, .npz), an image (.png), a folder of frames, a checkpoint
(.ckpt), or a recording over time (.bag, .mcap): its topics with types, counts and sizes, which of
them `features` reads, with which lens and depth unit. The whole file is read, so a damaged one is
found: it is said where, and how many frames are lost (exit code 3).

With --contact-problem PATH is a scene, or one of the words `funnel` and `drop`: it is simulated
until --time, and the contact problem of the next substep is written with its solution, as arrays
that docs/theory/contact-problem.md describes.

Example:
  granulcal-cli inspect data/
  granulcal-cli inspect pile.bag
  granulcal-cli inspect drop.mcap --json
  granulcal-cli inspect drop --set grains.count=60 --contact-problem frozen.npz --time 0.2")]
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
    #[arg(long, value_name = "SECONDS")]
    pub time: Option<f64>,
    /// Seed of the grains' jitter at the start [default: 0]
    #[arg(long)]
    pub seed: Option<u64>,
    #[command(flatten)]
    pub with: SceneChanges,
}

/// Join shards of a data set into one Parquet file
#[derive(Debug, Args)]
#[command(long_about = "\
Joins folders and files of one data set (same scene, prior, seed and version) into one
Parquet file, in order of the rows. A row that stands in two of them is an error.

Example:
  granulcal-cli merge shard-0/ shard-1/ -o data.parquet")]
pub struct MergeArgs {
    /// Folders of `generate`, or Parquet files
    #[arg(required = true)]
    pub inputs: Vec<Reads>,
    /// File to write
    #[arg(long = "out", short = 'o', value_name = "OUT.parquet",
        value_parser = writes(Product::File(Form::Parquet)))]
    pub out: Writes,
    /// Print the summary as one JSON object
    #[arg(long)]
    pub json: bool,
}

#[cfg(test)]
mod tests {
    use std::any::TypeId;
    use std::ffi::OsString;
    use std::path::PathBuf;

    use clap::CommandFactory;

    use super::*;

    #[test]
    fn arguments_are_consistent() {
        Cli::command().debug_assert();
    }

    /// A path that does not say whether it is read or written escapes the check of [`paths`].
    #[test]
    fn every_path_says_whether_it_is_read_or_written() {
        fn walk(command: &clap::Command, found: &mut Vec<String>) {
            for argument in command.get_arguments() {
                let kind = argument.get_value_parser().type_id();
                if kind == TypeId::of::<PathBuf>() || kind == TypeId::of::<OsString>() {
                    found.push(format!("{} {}", command.get_name(), argument.get_id()));
                }
                // Texts that are no paths are known by name: a new one is to be looked at.
                let is_text = kind == TypeId::of::<String>();
                let texts =
                    ["topic", "camera_topic", "colour_topic", "view", "engine", "ray", "ray_store"];
                if is_text && !texts.contains(&argument.get_id().as_str()) {
                    found.push(format!("{} {}", command.get_name(), argument.get_id()));
                }
            }
            command.get_subcommands().for_each(|below| walk(below, found));
        }
        let mut found = Vec::new();
        walk(&Cli::command(), &mut found);
        assert!(found.is_empty(), "neither Reads nor Writes: {found:?}");
    }

    #[test]
    fn changes_are_read_from_text() {
        assert_eq!(parse_change("a.b = 0.5"), Ok(("a.b".to_owned(), 0.5)));
        assert!(parse_change("a.b").is_err() && parse_change("a=b").is_err());
    }
}
