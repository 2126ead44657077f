//! `generate`: many pours to a folder of Parquet parts.

use granulcal_dataset::{GenerateOptions, Summary, generate};
use serde_json::json;

use crate::args::GenerateArgs;
use crate::context::{Context, keeps_going, print_json, print_line};
use crate::outcome::Outcome;
use crate::progress::RowProgress;
use crate::scene;

pub fn run(context: &Context, args: &GenerateArgs) -> anyhow::Result<Outcome> {
    scene::refuse_engine(args.engine.as_deref())?;
    let scene = scene::load(&args.scene)?;
    let prior = scene::prior(&args.prior)?;
    let defaults = GenerateOptions::default();
    let options = GenerateOptions {
        rows: args.rows,
        seed: args.seed,
        shard: args.shard,
        threads: args.threads.unwrap_or(defaults.threads),
        chunk: args.chunk,
        resume: !args.no_resume,
    };
    let mut progress = RowProgress::new(context);
    let summary = generate(&scene, &prior, &options, &args.out, &mut |p| {
        progress.show(p.resumed + p.made, p.resumed, p.total, p.unhealthy);
        keeps_going()
    });
    progress.finish();
    report(args, &summary?)
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
            "jammed": progress.jammed,
            "stopped": stopped,
        }))?;
    } else {
        let folder = args.out.display();
        print_line(&format!(
            "{folder}: {complete} of {} rows complete, {} made now, {} unhealthy or without grains, \
             {} jammed",
            progress.total, progress.made, progress.unhealthy, progress.jammed
        ))?;
    }
    if progress.beyond > 0 {
        tracing::info!("{} further rows of an earlier, larger run are kept", progress.beyond);
    }
    if stopped {
        tracing::warn!("stopped; the same command makes the remaining rows");
        return Ok(Outcome::Stopped);
    }
    Ok(Outcome::healthy_if(progress.unhealthy == 0))
}
