//! `infer`: recordings to the posterior of a trained model, and whether the model can say anything of them.

mod report;
mod seen;

use std::path::Path;

use anyhow::Context as _;
use clap::Args;
use granulcal_bayessim::Model;
use granulcal_dataset::{Form, Limits, Product, Room, scene_from_text, write_file};
use granulcal_dem::{LAW, law_of};
use granulcal_features::PAPER16;
use granulcal_scene::Scene;
use serde_json::json;

use crate::args::ReadArgs;
use crate::args::numbers::{seed, whole};
use crate::args::paths::{Reads, Writes, recording, writes};
use crate::context::{note, print_json};
use crate::outcome::{BadArgument, Outcome};
use crate::run::{Run, Setting};
use crate::scene;
use crate::sides::SideFiles;
use report::Report;
use seen::{Reading, Seen};

/// Draws in the file of `--out`.
const KEPT_DRAWS: usize = 1000;

/// Infer the parameters from recordings with a trained model
#[derive(Debug, Args)]
#[command(long_about = "\
Evaluates a model that `granulcal train` made: recordings to statistics to the
posterior of the parameters. Needs neither Python nor torch; a robot runs it
after every pour.

RECORDING is what `features` reads. Several recordings are pours of one
material and give one posterior. The images are down-sampled so that a pixel is
as wide on the ground as in the scene that the model was trained on, and where
they show more of the ground than it does, its square about the formation is
cut out.

A model answers under its own assumptions, right or wrong. So the recording's
height, extent and ground are compared with what the model's scene allows, and
its statistics with what any parameters can explain; if either fails, OUTSIDE
THE MODEL is said, inside_model in the JSON is false, and the exit code is 3. A
model whose own check failed is told on stderr.

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
    #[arg(long, value_name = "PIXELS", value_parser = whole::<usize>, allow_negative_numbers = true)]
    pub border: Option<usize>,
    /// Print so many draws of the posterior in the JSON
    #[arg(long, value_name = "N", default_value_t = 0, requires = "json", value_parser = whole::<usize>, allow_negative_numbers = true)]
    pub samples: usize,
    /// Write the JSON with 1000 draws of the posterior to this file
    #[arg(long = "out", short = 'o', value_name = "OUT.json",
        value_parser = writes(Product::File(Form::Json)))]
    pub out: Option<Writes>,
    /// Refuse a model of another scene than this TOML
    #[arg(long)]
    pub scene: Option<Reads>,
    /// Seed of the draws
    #[arg(long, default_value_t = 0, value_parser = seed, allow_negative_numbers = true)]
    pub seed: u64,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}

impl Run for InferArgs {
    fn run(&self, _: &Setting<'_>) -> anyhow::Result<Outcome> {
        run(self)
    }
}

fn run(args: &InferArgs) -> anyhow::Result<Outcome> {
    let model = Model::load(&args.model)?;
    if !model.is_verified {
        note(
            "note: the model is of an earlier version without hashes: damage in it cannot be found",
        );
    }
    Room::of_draws(args.samples, model.prior.names().len()).require(None)?;
    let chosen = places(&model.x_names)?;
    // The scene may name meshes that are not here; the camera does not need them.
    let trained =
        model.scene_toml.as_deref().and_then(|text| scene_from_text(text, Path::new("")).ok());
    let today = trained.as_ref().map_or(LAW, law_of);
    if let Some(law) = model.law.other_than(today, model.scene_toml.is_some()) {
        note(&format!(
            "warning: the model was trained on pours of another law of the solver, {law}; today's is {today}: pours at its \
             posterior are not those that it knows; train again"
        ));
    }
    if let Some(name) = &args.scene {
        require_same(trained.as_ref(), &scene::named(name)?)?;
    }
    let limits = match &trained {
        Some(scene) => Limits::of(scene, &model.prior)?,
        None => None,
    };
    let camera = trained.map(|scene| scene.camera);
    let reading = Reading {
        options: args.read.options(),
        border: args.border,
        camera: camera.as_ref(),
        limits: limits.as_ref(),
        chosen: &chosen,
    };
    let Seen { observed, impossible, doubts, is_whole } = Seen::of(&args.recordings, &reading)?;
    let paths: Vec<_> = args.recordings.iter().map(|path| path.display().to_string()).collect();
    for doubt in &doubts {
        note(&format!("warning: {doubt}"));
    }
    let report = if impossible.is_empty() {
        Report::of(&model, &paths, &observed, args.seed)?
    } else {
        Report::impossible(&model, &paths, &observed, impossible)
    };
    let report = report.with_doubts(doubts);
    let mut sides = SideFiles::default();
    if let Some(path) = &args.out {
        let mut document = report.document();
        document["samples"] = json!(report.samples(KEPT_DRAWS, args.seed));
        let text = serde_json::to_string_pretty(&document)? + "\n";
        sides.keep(write_file(path, Form::Json, text.as_bytes()).context("writing --out"));
    }
    if args.json {
        let mut document = report.document();
        if args.samples > 0 {
            document["samples"] = json!(report.samples(args.samples, args.seed));
        }
        print_json(&document)?;
    } else {
        report.print()?;
    }
    if model.is_calibrated != Some(true) {
        note("note: the model has not passed a check of its own: see `granulcal check`");
    }
    let outcome =
        if report.is_inside() { Outcome::whole_if(is_whole) } else { Outcome::OutsideModel };
    Ok(sides.finish(outcome))
}

/// Where the statistics of a model stand among those of a recording.
fn places(names: &[String]) -> Result<Vec<usize>, BadArgument> {
    let place = |name: &String| PAPER16.iter().position(|statistic| statistic.name == *name);
    let unknown: Vec<_> =
        names.iter().filter(|name| place(name).is_none()).map(String::as_str).collect();
    if unknown.is_empty() {
        return Ok(names.iter().filter_map(place).collect());
    }
    let known = PAPER16.map(|statistic| statistic.name).join(", ");
    let refusal = format!(
        "the model must be of statistics that a recording has ({known}); it is of {}, too: what a scene observes is \
         measured by other means, which `infer` of the Python package takes",
        unknown.join(", ")
    );
    Err(BadArgument(refusal))
}

/// Refuses a model of another scene.
fn require_same(trained: Option<&Scene>, asked: &Scene) -> anyhow::Result<()> {
    let Some(trained) = trained else {
        let unknown = "the model does not say which scene it was trained on";
        return Err(BadArgument(unknown.to_owned()).into());
    };
    if let Some((key, there, here)) = trained.first_difference(asked)? {
        let found = format!("scene.{key} is {there} there, {here} is asked for");
        return Err(BadArgument(format!("the model was trained on another scene: {found}")).into());
    }
    Ok(())
}
