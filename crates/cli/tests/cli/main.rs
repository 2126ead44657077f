//! The process boundary: exit codes, streams, files. What the numbers mean is tested elsewhere. One binary, because
//! every further one is linked by itself.

mod batches;
#[path = "../place/mod.rs"]
mod place;
mod pours;
mod refusals;

use std::process::Stdio;

use granulcal_features::DIAGNOSTICS;
use place::{Place, json, text};

/// A pour that takes milliseconds.
const TINY: [&str; 10] = [
    "--set",
    "start.solid_fraction=0.5",
    "--set",
    "grains.count=30",
    "--set",
    "start.height=0.01",
    "--set",
    "end.horizon=0.3",
    "--set",
    "camera.downsample=8",
];

fn tiny<'a>(head: &[&'a str], tail: &[&'a str]) -> Vec<&'a str> {
    [head, &TINY, tail].concat()
}

#[test]
fn streams_are_kept_apart_and_a_closed_stdout_is_no_failure() {
    let place = Place::new();
    let output =
        place.run(&tiny(&["generate", "drop", "default", "-n", "2", "-o", "d"], &["--json"]));
    assert_eq!(json(&text(&output.stdout))["rows"], 2);
    let quiet = place.run(&tiny(&["generate", "drop", "default", "-n", "3", "-o", "d", "-q"], &[]));
    assert_eq!(text(&quiet.stderr), "");
    assert!(place.expect(0, &["features", "--list"]).lines().count() == 16);
    let diagnostics = place.expect(0, &["features", "--list", "--diagnostics"]);
    assert_eq!(diagnostics.lines().count(), DIAGNOSTICS.len());
    assert!(place.expect(0, &["simulate", "--help"]).contains("Example:"));
    assert!(place.expect(0, &["completions", "bash"]).contains("granulcal-cli"));
    let usage = place.run(&[]);
    assert_eq!((usage.status.code(), usage.stdout.len()), (Some(2), 0));

    let mut child = place.command(&["features", "--list"]).stdout(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    assert_eq!(child.wait().unwrap().code(), Some(0));
}
