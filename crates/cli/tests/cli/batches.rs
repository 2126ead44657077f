//! Batches of pours: killed, interrupted, in shards, resumed, damaged.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use granulcal_dataset::Dataset;

use crate::place::{Place, interrupt, json, text};
use crate::tiny;

fn rows(path: &Path) -> Dataset {
    Dataset::open(path).unwrap()
}

fn assert_same_rows(a: &Path, b: &Path) {
    let (a, b) = (rows(a), rows(b));
    assert_eq!(a.rows.len(), b.rows.len());
    for (a, b) in a.rows.iter().zip(&b.rows) {
        assert!(a.same_as(b), "{a:?}\n{b:?}");
    }
}

#[test]
fn killed_and_resumed_gives_the_rows_of_an_uninterrupted_run() {
    let place = Place::new();
    let args = |out| {
        let more = ["--set", "grains.count=100", "-o", out];
        tiny(&["generate", "drop", "default", "-n", "24", "--seed", "5", "--chunk", "2"], &more)
    };
    // The prior reaches restitution 1, where a drop may be unhealthy: what counts here are the rows.
    let finished = |code: Option<i32>| matches!(code, Some(0 | 3));
    for out in ["whole", "again"] {
        assert!(finished(place.run(&args(out)).status.code()));
    }
    assert_same_rows(&place.at("whole"), &place.at("again"));

    let mut kills = 0;
    for round in 0.. {
        let mut command = place.command(&args("killed"));
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let part = place.at(&format!("killed/part-{:06}.parquet", 2 * round + 1));
        let start = Instant::now();
        while child.try_wait().unwrap().is_none() && !part.exists() {
            assert!(start.elapsed() < Duration::from_secs(120));
            std::thread::sleep(Duration::from_millis(1));
        }
        // SIGKILL: no handler runs. The exit code is none unless the batch was faster than the test.
        let _ = child.kill();
        match child.wait().unwrap().code() {
            None => kills += 1,
            code => {
                assert!(finished(code), "{code:?}");
                break;
            }
        }
    }
    assert!(kills > 0);
    assert_same_rows(&place.at("whole"), &place.at("killed"));
    let left: Vec<_> =
        fs::read_dir(place.at("killed")).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert!(left.iter().all(|n| !n.to_string_lossy().ends_with(".tmp")), "{left:?}");
}

#[test]
fn an_interrupt_keeps_finished_rows_and_exits_with_130() {
    let place = Place::new();
    let args = |n| tiny(&["generate", "drop", "default", "-n", n, "--chunk", "1"], &["-o", "d"]);
    let mut child = place.command(&args("2000")).stdout(Stdio::piped()).spawn().unwrap();
    while !place.at("d/part-000001.parquet").exists() {
        assert!(child.try_wait().unwrap().is_none());
        std::thread::sleep(Duration::from_millis(2));
    }
    assert!(interrupt(&child));
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let finished = rows(&place.at("d")).rows.len();
    assert!((2..2000).contains(&finished), "{finished}");
}

/// As `nohup` starts a command, and a script one in its background.
#[cfg(unix)]
#[test]
fn signals_that_the_parent_ignores_end_nothing() {
    let place = Place::new();
    let args = tiny(&["generate", "drop", "default", "-n", "200"], &["--chunk", "1", "-o", "d"]);
    let mut child = Command::new("sh")
        .args(["-c", "trap '' HUP INT; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_granulcal-cli")])
        .args(&args)
        .current_dir(place.at(""))
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    while !place.at("d/part-000001.parquet").exists() {
        assert!(child.try_wait().unwrap().is_none());
        std::thread::sleep(Duration::from_millis(2));
    }
    for signal in ["-HUP", "-INT", "-INT"] {
        let pid = child.id().to_string();
        assert!(Command::new("kill").args([signal, &pid]).status().unwrap().success());
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(matches!(child.wait().unwrap().code(), Some(0 | 3)));
    assert_eq!(rows(&place.at("d")).rows.len(), 200);
}

/// What a limit of the shell allows is as a disk that is full.
#[cfg(unix)]
#[test]
fn a_file_that_cannot_be_written_is_no_damaged_input() {
    let place = Place::new();
    place.expect(0, &tiny(&["generate", "drop", "default", "-n", "2", "-o", "d"], &[]));
    let output = Command::new("sh")
        .args(["-c", "ulimit -f 1; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_granulcal-cli")])
        .args(["merge", "d", "-o", "all.parquet"])
        .current_dir(place.at(""))
        .output()
        .unwrap();
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("cannot write all.parquet") && !said.contains("damaged"), "{said}");
    assert_eq!(place.listing(), [place.at("d")]);
}

#[test]
fn a_reader_that_goes_away_hides_no_unusable_rows() {
    let place = Place::new();
    let unseen = ["--set", "camera.height_threshold=0.5", "-o", "d"];
    let args = tiny(&["generate", "drop", "default", "-n", "2"], &unseen);
    let mut child = place.command(&args).stdout(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    assert_eq!(child.wait().unwrap().code(), Some(3));
}

#[test]
fn shards_merge_to_the_whole() {
    let place = Place::new();
    let args = |out, shard| {
        tiny(
            &["generate", "drop", "default", "-n", "7", "--chunk", "2"],
            &["-o", out, "--shard", shard],
        )
    };
    for (out, shard) in [("whole", "0/1"), ("a", "0/2"), ("b", "1/2")] {
        place.expect(0, &args(out, shard));
    }
    let merge = |code, words: &[&'static str]| {
        let told = place.expect(code, &[&["merge", "-o", "all.parquet", "--json"], words].concat());
        let told = json(&told);
        (told["rows"].clone(), told["missing"].clone(), told["complete"].clone())
    };
    // The last row is of the other shard.
    assert_eq!(merge(3, &["a"]), (4.into(), 3.into(), false.into()));
    assert_eq!(merge(3, &["b"]), (3.into(), 4.into(), false.into()));
    assert!(place.expect(0, &["inspect", "a"]).contains("rows missing: 3"));
    assert_eq!(merge(0, &["a", "b"]), (7.into(), 0.into(), true.into()));
    assert_same_rows(&place.at("whole"), &place.at("all.parquet"));
    // Rows that stand in both are the same, and are written once.
    let told = json(&place.expect(0, &["merge", "a", "whole", "-o", "x.parquet", "--json"]));
    assert_eq!((&told["rows"], &told["repeated"]), (&7.into(), &4.into()));
    assert_same_rows(&place.at("whole"), &place.at("x.parquet"));
    // What a dry run tells is of the shard, and of the folder that it is asked of.
    let dry = |seed: &'static str| {
        [&args("a", "0/2")[..], &["--dry-run", "--json", "--seed", seed]].concat()
    };
    assert_eq!(json(&place.expect(0, &dry("0")))["missing"], 0);
    place.refused(&dry("1"), &["the seed is 0, but 1 is given"]);
    let idle = place.run(&args("idle", "5/9"));
    assert!(String::from_utf8_lossy(&idle.stderr).contains("shard 5/9 has no rows"), "{idle:?}");
    let facts = json(&place.expect(0, &["inspect", "all.parquet", "--json"]));
    assert_eq!((&facts["rows"], &facts["seed"]), (&7.into(), &0.into()));
}

#[test]
fn other_or_damaged_data_sets_are_named_and_left_alone() {
    let place = Place::new();
    let args = |more: &[&'static str]| {
        [&["generate", "drop", "default", "-n", "4", "--chunk", "2", "-o", "d"], more].concat()
    };
    place.expect(0, &tiny(&args(&[]), &[]));
    place.refused(&tiny(&args(&["--seed", "9"]), &[]), &["the seed is 0, but 9 is given"]);
    let other = tiny(&args(&["--set", "material.tangential_restitution=0.1"]), &[]);
    place.refused(&other, &["material.tangential_restitution", "0.1"]);
    let part = place.at("d/part-000000.parquet");
    let whole = fs::read(&part).unwrap();
    for length in [0, 4, whole.len() / 2, whole.len() - 1] {
        fs::write(&part, &whole[..length]).unwrap();
        place.refused(&tiny(&args(&[]), &[]), &["part-000000.parquet"]);
        place.refused(&["inspect", "d"], &["part-000000.parquet"]);
        assert_eq!(fs::read(&part).unwrap().len(), length);
    }
    fs::remove_file(&part).unwrap();
    place.expect(0, &tiny(&args(&[]), &[]));
    place.write("foreign.parquet", b"PAR1PAR1");
    place.refused(&["inspect", "foreign.parquet"], &["foreign.parquet"]);
    fs::write(place.at("d/manifest.toml"), "format = 1\n").unwrap();
    place.refused(&["inspect", "d"], &["manifest.toml"]);
}

#[test]
fn rows_of_before_laws_had_numbers_are_told_by_who_looks() {
    let place = Place::new();
    let before = concat!(env!("CARGO_MANIFEST_DIR"), "/../dataset/tests/data/before_laws");
    for words in [&["inspect", before, "--json"][..], &["merge", before, "-o", "all.parquet"]] {
        let output = place.run(words);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{said}");
        assert!(said.contains("before laws had numbers"), "{said}");
        assert_eq!(said.contains("not recorded"), words[0] == "merge", "{said}");
    }
    place.expect(0, &tiny(&["generate", "drop", "default", "-n", "1", "-o", "d"], &[]));
    assert_eq!(text(&place.run(&["inspect", "d", "-q"]).stderr), "");
    assert!(!text(&place.run(&["inspect", "d"]).stderr).contains("law"));
}

#[test]
fn a_longer_horizon_is_advised_where_something_can_come_to_rest() {
    let place = Place::new();
    let short = ["--set", "end.horizon=0.02", "-n", "2", "-o"];
    let warned = |scene: &str, out: &str| {
        let args = [&["generate", scene, "default"][..], &short[..], &[out][..]].concat();
        text(&place.run(&args).stderr)
    };
    assert!(warned("drop", "d").contains("a longer end.horizon"), "{}", warned("drop", "d"));
    // A wall that turns for ever comes to rest at no horizon.
    let turning = place.expect(0, &["scene", "drop"])
        + "\n[[walls]]\nshape = { kind = \"disc\", centre = [0.0, 0.0, 1.0], normal = [0.0, 0.0, 1.0], radius = 0.1 }\n\
           motion = { kind = \"spin\", point = [0.0, 0.0, 1.0], axis = [0.0, 0.0, 1.0], rate = 1.0 }\n";
    place.write("turning.toml", &turning);
    assert!(
        !warned("turning.toml", "t").contains("end.horizon"),
        "{}",
        warned("turning.toml", "t")
    );
}
