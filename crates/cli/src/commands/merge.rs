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
Joins folders and files of one data set (same scene, prior, seed and version) into one
Parquet file, in order of the rows. A row that stands in two of them is an error. Of
folders only some parts are in memory at a time, so that a million rows need no more.

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
    let Merged { header, rows, gaps, unverified } = merge(&inputs, &args.out, NAMED_GAPS)?;
    warn_of(&header, &unverified);
    if !gaps.is_empty() {
        tracing::warn!(
            "rows are missing, the first are {gaps:?}; is a shard absent or unfinished?"
        );
    }
    let out = args.out.display();
    if args.json {
        print_json(&json!({ "file": out.to_string(), "rows": rows, "complete": gaps.is_empty() }))?;
    } else {
        print_line(&format!("{out}: {rows} rows"))?;
    }
    Ok(Outcome::Done)
}
