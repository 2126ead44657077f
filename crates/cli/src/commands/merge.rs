//! `merge`: shards to one file.

use clap::Args;
use granulcal_dataset::{Form, Merged, Product, merge};
use serde_json::json;

use crate::args::paths::{Reads, Writes, writes};
use crate::context::{print_json, print_line};
use crate::outcome::Outcome;
use crate::rows::warn_of;
use crate::run::{Run, Setting};

/// How many missing rows are named.
const NAMED_GAPS: usize = 5;

/// Join shards of a data set into one Parquet file
#[derive(Debug, Args)]
#[command(long_about = "\
Joins folders and files of one data set (same scene, prior, seed and version)
into one Parquet file, in order of the rows. A row that stands in several is
written once; if it is not the same in all, that is an error. Of folders only
some parts are in memory at a time, so that a million rows need no more.

The file is written, too, where rows are missing of those that `generate` was
asked for: how many is told, and the exit code is 3. Folders of earlier
versions do not say how many were asked for; there only what is missing before
the last row is known.

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

impl Run for MergeArgs {
    fn run(&self, _: &Setting<'_>) -> anyhow::Result<Outcome> {
        run(self)
    }
}

fn run(args: &MergeArgs) -> anyhow::Result<Outcome> {
    let inputs: Vec<_> = args.inputs.iter().map(|input| input.to_path_buf()).collect();
    let merged = merge(&inputs, &args.out, NAMED_GAPS)?;
    let Merged { header, rows, asked, missing, gaps, repeated, unverified } = merged;
    warn_of(&header, &unverified);
    if missing > 0 {
        tracing::warn!(
            "{missing} rows are missing, the first are {gaps:?}; is a shard absent or unfinished?"
        );
    }
    if repeated > 0 {
        tracing::warn!(
            "{repeated} rows stand in several of the inputs, the same in each: they are written once"
        );
    }
    if asked.is_none() {
        tracing::warn!(
            "the rows asked for are not recorded: whether some are missing after the last is not known"
        );
    }
    let out = args.out.display();
    if args.json {
        print_json(&json!({
            "file": out.to_string(),
            "rows": rows,
            "asked": asked,
            "missing": missing,
            "repeated": repeated,
            // Null where nobody knows.
            "complete": (missing > 0 || asked.is_some()).then_some(missing == 0),
        }))?;
    } else if missing > 0 {
        print_line(&format!("{out}: {rows} rows, {missing} missing"))?;
    } else {
        print_line(&format!("{out}: {rows} rows"))?;
    }
    Ok(Outcome::whole_if(missing == 0))
}
