//! `merge`: shards to one file.

use granulcal_dataset::merge;
use serde_json::json;

use crate::args::MergeArgs;
use crate::context::{print_json, print_line};
use crate::outcome::Outcome;

/// How many missing rows are named.
const NAMED_GAPS: usize = 5;

pub fn run(args: &MergeArgs) -> anyhow::Result<Outcome> {
    let dataset = merge(&args.inputs)?;
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
