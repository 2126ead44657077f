//! `generate`: many pours to a folder of Parquet parts.

use std::time::{Duration, Instant};

use clap::Args;
use granulcal_dataset::{
    GenerateOptions, Prior, Product, Progress, Shard, Summary, generate, look_at_batch, try_pour,
};
use granulcal_scene::Scene;
use serde_json::json;

use crate::args::SceneArgs;
use crate::args::numbers::{period, seed, whole};
use crate::args::paths::{Reads, Writes, writes};
use crate::context::{Context, print_json, print_line};
use crate::interrupt::keeps_going;
use crate::outcome::Outcome;
use crate::progress::{RowProgress, in_words};
use crate::run::{Run, Setting};
use crate::scene;

/// Pours that a dry run makes, and how long they may take together.
const TRIED: u64 = 3;
const PATIENCE: Duration = Duration::from_secs(45);

/// Simulate many pours with parameters drawn from a prior, to Parquet
#[derive(Debug, Args)]
#[command(long_about = "\
Draws parameters from a prior, simulates a pour for each draw and writes one
row a pour: parameters, seed, status, health, the 16 statistics, the diagnostic
ones and those that the scene observes, as Parquet, whose metadata
`granulcal.units` has their units.

Row i depends on the scene, the prior, the seed and i only. Stop it at any
moment, also by pulling the plug, and start it again with the same arguments:
the rows are the same as without the stop. A larger -n continues the same data
set. Shards of several machines, each in a folder of its own, are joined by
`merge`.

Example:
  granulcal-cli generate scene.toml prior.toml -n 1000 --seed 1 -o data/
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
    #[arg(long = "rows", short = 'n', default_value_t = 1000, value_parser = whole::<u64>, allow_negative_numbers = true)]
    pub rows: u64,
    /// Folder to write into
    #[arg(long = "out", short = 'o', value_name = "DIR", value_parser = writes(Product::DATA_SET))]
    pub out: Writes,
    /// Seed of the data set
    #[arg(long, default_value_t = 0, value_parser = seed, allow_negative_numbers = true)]
    pub seed: u64,
    /// Make the i-th of k parts only, counted from 0
    #[arg(long, value_name = "I/K", default_value = "0/1")]
    pub shard: Shard,
    /// Pours at once [default: all cores]
    #[arg(long, value_parser = whole::<usize>, allow_negative_numbers = true)]
    pub threads: Option<usize>,
    /// Rows in a part
    #[arg(long, default_value_t = 16, value_parser = whole::<u64>, allow_negative_numbers = true)]
    pub chunk: u64,
    /// Longest time that a finished row is in memory only, and a kill can lose it [s]
    #[arg(long, value_name = "SECONDS", default_value = "30", value_parser = period)]
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

impl Run for GenerateArgs {
    fn run(&self, setting: &Setting<'_>) -> anyhow::Result<Outcome> {
        run(setting.context, self)
    }
}

fn run(context: &Context, args: &GenerateArgs) -> anyhow::Result<Outcome> {
    scene::refuse_elsewhere("--engine", args.engine.as_deref())?;
    scene::refuse_elsewhere("--ray", args.ray.as_deref())?;
    scene::refuse_elsewhere("--ray-store", args.ray_store.as_deref())?;
    let scene = scene::load(&args.scene)?;
    let prior = scene::prior(&args.prior)?;
    let defaults = GenerateOptions::default();
    let options = GenerateOptions {
        rows: args.rows,
        seed: args.seed,
        shard: args.shard,
        threads: args.threads.unwrap_or(defaults.threads),
        chunk: args.chunk,
        flush_every: args.flush_every,
        resume: !args.no_resume,
    };
    if args.dry_run {
        return dry_run(args, &scene, &prior, &options);
    }
    let mut progress = RowProgress::new(context);
    let summary = generate(&scene, &prior, &options, &args.out, &mut |p| {
        progress.show(p);
        keeps_going()
    });
    progress.finish();
    report(args, &scene, &summary?)
}

/// Pours the first rows, keeps nothing and tells what all of them would take.
fn dry_run(
    args: &GenerateArgs,
    scene: &Scene,
    prior: &Prior,
    options: &GenerateOptions,
) -> anyhow::Result<Outcome> {
    prior.check(scene)?;
    let Progress { total, resumed, .. } = look_at_batch(scene, prior, options, &args.out)?;
    let missing = total.saturating_sub(resumed);
    let (begun, mut longest) = (Instant::now(), Duration::ZERO);
    let (mut cpu_s, mut tried, mut cut) = (0.0, 0, None);
    for row in 0..options.rows.min(TRIED) {
        let left = PATIENCE.saturating_sub(begun.elapsed());
        // One that is as long as those before would be stopped.
        if tried > 0 && left < longest {
            break;
        }
        let scene = prior.apply(scene, &prior.sample(options.seed, row))?;
        let started = Instant::now();
        let Some(trial) = try_pour(&scene, row, left, &keeps_going)? else {
            return Ok(Outcome::Stopped);
        };
        longest = longest.max(started.elapsed());
        if trial.has_ended || tried == 0 {
            cut = (!trial.has_ended).then_some((trial.reached_s, scene.end.horizon));
            cpu_s += trial.cpu_s;
            tried += 1;
        }
    }
    let pour_s = cpu_s / f64::from(tried);
    let seconds = pour_s * missing as f64 / options.threads as f64;
    if args.json {
        print_json(&json!({
            "missing": missing,
            "threads": options.threads,
            "pour_cpu_s": pour_s,
            "extrapolated": cut.is_some(),
            "seconds": seconds,
        }))?;
    } else {
        let from = match cut {
            Some((reached_s, horizon)) => format!(
                "a rough guess: a pour was stopped after {reached_s:.3} s of it, at whose pace it would go on until \
                 its horizon of {horizon} s"
            ),
            None => format!("mean of {tried} pours"),
        };
        print_line(&format!(
            "about {}: {missing} rows are missing, {pour_s:.2} s of a core each ({from}), {} at once",
            in_words(Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)),
            options.threads
        ))?;
    }
    Ok(Outcome::Done)
}

fn report(args: &GenerateArgs, scene: &Scene, summary: &Summary) -> anyhow::Result<Outcome> {
    let Summary { progress, stopped } = *summary;
    let complete = progress.resumed + progress.made;
    if args.json {
        print_json(&json!({
            "folder": args.out.display().to_string(),
            "rows": complete,
            "total": progress.total,
            "made": progress.made,
            "resumed": progress.resumed,
            "unhealthy": progress.unhealthy,
            "no_grains_in_view": progress.no_grains_in_view,
            "jammed": progress.jammed,
            "at_horizon": progress.at_horizon,
            "stopped": stopped,
        }))?;
    } else {
        let folder = args.out.display();
        print_line(&format!(
            "{folder}: {complete} of {} rows complete, {} made now, {} unhealthy, {} without grains in view, \
             {} jammed, {} still moving at the horizon",
            progress.total,
            progress.made,
            progress.unhealthy,
            progress.no_grains_in_view,
            progress.jammed,
            progress.at_horizon
        ))?;
    }
    if progress.total == 0 {
        let Shard { index, count } = args.shard;
        tracing::warn!(
            "shard {index}/{count} has no rows: {} rows are fewer parts of {} than there are shards; a smaller --chunk, the \
             same in all shards, spreads them",
            args.rows,
            args.chunk
        );
    }
    // What is in motion to its end rests at no horizon.
    let keeps_moving = scene.moves_until() >= scene.end.horizon;
    if 2 * progress.at_horizon > complete && !keeps_moving {
        tracing::warn!(
            "{} of {complete} pours were still moving at the horizon: where grains have not rolled out of view, a longer \
             end.horizon lets them come to rest",
            progress.at_horizon
        );
    }
    if progress.unhealthy > 0 {
        tracing::warn!(
            "{} of {complete} pours are unhealthy: worst_penetration, energy_created and grains_lost of their rows say why; \
             small, thin or fast grains need a finer step, `substep` in the scene (now {} s)",
            progress.unhealthy,
            scene.settings().dt
        );
    }
    if progress.unverified > 0 {
        tracing::warn!(
            "{} parts of an earlier version have no hash of their rows: damage in them cannot be found",
            progress.unverified
        );
    }
    if progress.beyond > 0 {
        tracing::info!("{} further rows of an earlier, larger run are kept", progress.beyond);
    }
    if stopped {
        tracing::warn!("stopped; the same command makes the remaining rows");
        return Ok(Outcome::Stopped);
    }
    Ok(Outcome::healthy_if(progress.unhealthy + progress.no_grains_in_view == 0))
}
