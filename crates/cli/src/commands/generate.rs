//! `generate`: many pours to a folder of Parquet parts.

use cpu_time::ThreadTime;
use granulcal_dataset::{Dataset, GenerateOptions, Observer, Prior, Summary, generate};
use granulcal_scene::Scene;
use serde_json::json;

use crate::args::GenerateArgs;
use crate::context::{Context, print_json, print_line};
use crate::interrupt::keeps_going;
use crate::outcome::Outcome;
use crate::progress::RowProgress;
use crate::scene::{self, Keep};
use crate::sides::SideFiles;

/// Pours that a dry run makes.
const TRIED: u64 = 3;

pub fn run(context: &Context, args: &GenerateArgs) -> anyhow::Result<Outcome> {
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
        return dry_run(context, args, &scene, &prior, &options);
    }
    let mut progress = RowProgress::new(context);
    let summary = generate(&scene, &prior, &options, &args.out, &mut |p| {
        progress.show(p);
        keeps_going()
    });
    progress.finish();
    report(args, &summary?)
}

/// Pours the first rows, keeps nothing and tells what all of them would take.
fn dry_run(
    context: &Context,
    args: &GenerateArgs,
    scene: &Scene,
    prior: &Prior,
    options: &GenerateOptions,
) -> anyhow::Result<Outcome> {
    prior.check(scene)?;
    let tried = options.rows.min(TRIED);
    let mut cpu_s = 0.0;
    for row in 0..tried {
        let scene = prior.apply(scene, &prior.sample(options.seed, row))?;
        let started = ThreadTime::now();
        let simulation = scene::start(&scene, row, 1, None)?;
        let mut observer = Observer::new(&scene);
        // Nothing is kept beside the pour.
        let (keep, mut sides) = (Keep::Nothing, SideFiles::default());
        let pour = scene::pour(context, &scene, row, simulation, &keep, &mut observer, &mut sides)?;
        if pour.is_none() {
            return Ok(Outcome::Stopped);
        }
        cpu_s += started.elapsed().as_secs_f64();
    }
    let there = Dataset::open(&args.out).map_or(0, |data| data.rows.len() as u64);
    let missing = options.rows.saturating_sub(there);
    let pour_s = cpu_s / tried as f64;
    let seconds = pour_s * missing as f64 / options.threads as f64;
    if args.json {
        print_json(&json!({
            "missing": missing,
            "threads": options.threads,
            "pour_cpu_s": pour_s,
            "seconds": seconds,
        }))?;
    } else {
        print_line(&format!(
            "about {:.1} min: {missing} rows are missing, {pour_s:.2} s of a core each (mean of {tried} pours), \
             {} at once",
            seconds / 60.0,
            options.threads
        ))?;
    }
    Ok(Outcome::Done)
}

fn report(args: &GenerateArgs, summary: &Summary) -> anyhow::Result<Outcome> {
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
            "out_of_view": progress.out_of_view,
            "jammed": progress.jammed,
            "stopped": stopped,
        }))?;
    } else {
        let folder = args.out.display();
        print_line(&format!(
            "{folder}: {complete} of {} rows complete, {} made now, {} unhealthy, {} without grains in view, \
             {} jammed",
            progress.total,
            progress.made,
            progress.unhealthy,
            progress.out_of_view,
            progress.jammed
        ))?;
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
    Ok(Outcome::healthy_if(progress.unhealthy + progress.out_of_view == 0))
}
