//! Arguments of `simulate`.

use std::time::Duration;

use clap::Args;
use granulcal_dataset::{Form, Product};

use crate::args::SceneArgs;
use crate::args::numbers::{period, positive, seed, whole};
use crate::args::paths::{Reads, Writes, kept, writes};

/// Simulate one pour: status, health and statistics
#[derive(Debug, Args)]
#[command(long_about = "\
Simulates one pour to its end and prints how it ended, whether it can be
trusted and the 16 statistics of its depth image.

The same scene, numbers and seed give the same result on any machine. The row
of a data set is made again by setting its parameters and its seed.

A long pour survives whatever stops it: with --checkpoint its whole state is
kept in a file, at the start, every minute, when you stop it (Ctrl-C or
SIGTERM) and at the end. The same command with --resume goes on from there, and
every bit of the result is that of a pour that was never stopped. A checkpoint
of another scene, seed, preset or version is refused.

Example:
  granulcal-cli simulate funnel --set material.sliding_friction=0.5 --json
  granulcal-cli simulate drop --mcap drop.mcap --positions grains.npy
  granulcal-cli simulate large.toml --checkpoint l.ckpt --resume l.ckpt")]
pub struct SimulateArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Another simulator in place of ours: lammps, liggghts, yade, mujoco, newton, module:function or a
    /// command; `granulcal` of the Python package only
    #[arg(long, value_name = "ENGINE")]
    pub engine: Option<String>,
    /// Seed of the grains' jitter at the start and of the camera's noise
    #[arg(long, default_value_t = 0, value_parser = seed, allow_negative_numbers = true)]
    pub seed: u64,
    /// Cores for the one pour; only very large scenes gain, and none changes by a bit
    #[arg(long, default_value_t = 1, value_parser = whole::<usize>, allow_negative_numbers = true)]
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
    /// Write the final depth image (16-bit PNG, with the camera as OUT.toml beside it), or the height map of an
    /// orthographic camera (.npz)
    #[arg(long, value_name = "OUT.png", value_parser = writes(Product::View))]
    pub depth: Option<Writes>,
    /// Metres per count of the PNG
    #[arg(long, default_value_t = granulcal_dataset::png::DEPTH_UNIT, value_name = "METRES",
        value_parser = positive)]
    pub depth_unit: f64,
    /// Write grains and depth image over time, for Foxglove
    #[arg(long, value_name = "OUT.mcap", value_parser = writes(Product::File(Form::Mcap)))]
    pub mcap: Option<Writes>,
    /// Frames per simulated second in the MCAP
    #[arg(long, default_value_t = 60.0, requires = "mcap", value_parser = positive)]
    pub fps: f64,
    /// Keep the whole state in this file, for --resume
    #[arg(long, value_name = "FILE", conflicts_with = "mcap",
        value_parser = writes(Product::File(Form::Checkpoint)))]
    pub checkpoint: Option<Writes>,
    /// Time between two checkpoints on the clock [s]; 0 for as often as possible
    #[arg(long, value_name = "SECONDS", default_value = "60", requires = "checkpoint",
        value_parser = period)]
    pub checkpoint_every: Duration,
    /// Go on from a checkpoint of the same scene, seed and preset, on any number of threads; where it is the file of
    /// --checkpoint and not there yet, begin
    #[arg(long, value_name = "FILE", conflicts_with = "mcap", value_parser = kept())]
    pub resume: Option<Reads>,
}
