//! `merge`: shards to one file.

use granulcal_dataset::merge;
use serde_json::json;

use crate::args::MergeArgs;
use crate::context::{print_json, print_line};
use crate::outcome::Outcome;

/// How many missing rows are named.
const NAMED_GAPS: usize = 5;

pub fn run(args: &MergeArgs) -> anyhow::Result<Outcome> {
    let dataset = merge(&args.inputs.iter().map(|input| input.to_path_buf()).collect::<Vec<_>>())?;
    if !dataset.unverified.is_empty() {
        tracing::warn!(
            "{} files of an earlier version have no hash of their rows, {} the first: damage in them cannot be found",
            dataset.unverified.len(),
            dataset.unverified[0].display()
        );
    }
    if let Some(other) = dataset.header.other_law() {
        tracing::warn!("the rows were {other}");
    }
    dataset.write(&args.out)?;
    let gaps = dataset.gaps(NAMED_GAPS);
    if !gaps.is_empty() {
        tracing::warn!(
            "rows are missing, the first are {gaps:?}; is a shard absent or unfinished?"
        );
    }
    let (rows, out) = (dataset.rows.len(), args.out.display());
    if args.json {
        print_json(&json!({ "file": out.to_string(), "rows": rows, "complete": gaps.is_empty() }))?;
    } else {
        print_line(&format!("{out}: {rows} rows"))?;
    }
    Ok(Outcome::Done)
}
