//! The process boundary: exit codes, streams, files. What the numbers mean is tested elsewhere. One file, because every
//! test of it is one more binary to link.

mod place;

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use granulcal_dataset::{Dataset, png};
use granulcal_features::{DIAGNOSTICS, DepthImage, PAPER16};
use place::{Place, json, text};
use serde_json::Value;

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
fn simulate_prints_one_json_object_and_writes_what_is_asked() {
    let place = Place::new();
    let args = tiny(
        &["simulate", "drop", "--seed", "1", "--json", "--threads", "1"],
        &[
            "--set",
            "material.sliding_friction=0.7",
            "--preset",
            "default",
            "--positions",
            "grains.npy",
            "--depth",
            "depth.png",
            "--mcap",
            "pour.mcap",
        ],
    );
    let output = place.run(&args);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let report = json(&text(&output.stdout));
    assert!(report["status"].is_string() && report["health"]["worst_penetration"].is_number());
    for key in ["cpu_s", "wall_s", "simulated_s"] {
        assert!(report[key].as_f64().unwrap() > 0.0, "{key}");
    }
    let names: Vec<_> = report["statistics"].as_object().unwrap().keys().cloned().collect();
    assert_eq!(names, PAPER16.map(|s| s.name));
    let grains = json(&place.expect(0, &["inspect", "grains.npy", "--json"]));
    assert_eq!(grains["shape"], serde_json::json!([30, 3]));
    let film = json(&place.expect(0, &["inspect", "pour.mcap", "--json"]));
    assert_eq!(film["topics"]["/grains"]["schema"], "foxglove.PointCloud");
    assert_eq!(film["topics"]["/depth"]["messages"], film["topics"]["/grains"]["messages"]);
    assert!(place.at("depth.toml").exists());
    // Without a film the pour is the same, to the last bit.
    let plain = tiny(
        &["simulate", "drop", "--seed", "1", "--json"],
        &["--set", "material.sliding_friction=0.7"],
    );
    let again = json(&place.expect(0, &plain));
    assert_eq!(again["statistics"], report["statistics"]);
    assert_eq!(again["health"], report["health"]);
}

#[test]
fn a_substep_is_frozen_and_what_cannot_be_is_named() {
    let place = Place::new();
    let frozen = |out, time, more: &[&'static str]| {
        let scene = ["inspect", "drop", "--set", "grains.count=20", "--set", "start.height=0.005"];
        [&scene[..], &["--contact-problem", out, "--time", time, "--json"], more].concat()
    };
    let facts = json(&place.expect(0, &frozen("frozen.npz", "0.04", &["--seed", "1"])));
    assert_eq!((&facts["kind"], &facts["grains"]), (&"contact problem".into(), &20.into()));
    assert!(facts["residual_m_per_s"].as_f64().unwrap() < 1e-13, "{facts}");
    let arrays = json(&place.expect(0, &["inspect", "frozen.npz", "--json"]));
    let names = arrays["names"].as_array().unwrap();
    assert!(names.contains(&"delassus".into()) && names.contains(&"impulse".into()));

    place.refused(&frozen("frozen.npy", "0.04", &[]), &["--contact-problem", ".npz", "frozen.npy"]);
    place.refused(&frozen("frozen.npz", "30", &[]), &["--time", "30", "before the pour's end"]);
    place.refused(&frozen("frozen.npz", "nan", &[]), &["--time", "NaN"]);
    place.refused(&["inspect", "drop", "--time", "1"], &["--time", "--contact-problem"]);
    place.refused(&["inspect", "frozen.npz", "--set", "x=1"], &["--set", "--contact-problem"]);
    place.refused(&["inspect", "drop", "--contact-problem", "frozen.npz"], &["--time"]);
}

#[test]
fn an_unusable_pour_exits_with_3() {
    let place = Place::new();
    let args = tiny(&["simulate", "drop", "--json"], &["--set", "camera.height_threshold=0.5"]);
    let report = json(&place.expect(3, &args));
    assert_eq!(report["status"], "no_grains_in_view");
    assert!(report["statistics"].is_null());
}

#[test]
fn a_rendered_image_is_described_like_its_pour() {
    let place = Place::new();
    let pour = tiny(&["simulate", "drop", "--json"], &["--depth", "pile.png"]);
    let simulated = json(&place.expect(0, &pour));
    let args = ["features", "pile.png", "--camera", "pile.toml", "--threshold", "0.001", "--json"];
    let measured = json(&place.expect(0, &args));
    assert!(measured["plane"]["tilt_deg"].as_f64().unwrap() < 0.2, "{measured}");
    let close = |name: &str, tolerance: f64| {
        let of = |value: &Value| value["statistics"][name].as_f64().unwrap();
        let (a, b) = (of(&simulated), of(&measured));
        assert!((a - b).abs() <= tolerance, "{name}: {a} {b}");
    };
    close("max_z", 3e-4);
    close("mean_r", 3e-3);
    assert!(measured.get("diagnostics").is_none());
    place.expect(0, &tiny(&["simulate", "drop"], &["--positions", "g.npy"]));
    place.expect(0, &tiny(&["render", "drop", "-o", "b.png"], &["--positions", "g.npy"]));
    assert_eq!(fs::read(place.at("pile.png")).unwrap(), fs::read(place.at("b.png")).unwrap());
    let map = tiny(&["render", "drop", "-o", "m.npz"], &[]);
    place.refused(&map, &["m.npz", "pinhole", ".png"]);
}

#[test]
fn a_view_shows_the_pour_from_where_it_stands() {
    let place = Place::new();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    let scene = fs::read_to_string(examples.join("drop.toml")).unwrap();
    let view = "\n[[views]]\nname = \"side\"\neye = [0.0, -0.5, 0.02]\ntarget = [0.0, 0.0, 0.02]\n\
                field_width = 0.2\npixels = [100, 60]\n";
    place.write("side.toml", scene + view);
    // One grain, 40 mm to the right of the middle and 10 mm above it.
    granulcal_dataset::npy::write_points(&place.at("g.npy"), &[[0.04, 0.0, 0.03].into()]).unwrap();
    let render = ["render", "side.toml", "--positions", "g.npy", "-o", "s.png", "--view"];
    place.expect(0, &[&render[..], &["side"]].concat());
    let counts = image::open(place.at("s.png")).unwrap().into_luma16();
    assert_eq!(counts.dimensions(), (100, 60));
    // 2 mm a pixel: column 70, row 25; the front of the grain is one radius nearer than 0.5 m.
    let depth = f64::from(counts[(70, 25)].0[0]) * 1e-4;
    assert!((depth - 0.498).abs() < 1.1e-3, "{depth}");
    assert!(f64::from(counts[(30, 25)].0[0]) * 1e-4 > 0.6 || counts[(30, 25)].0[0] == 0);
    place.refused(&[&render[..], &["top"]].concat(), &["--view", "side", "top"]);
    let named = ["render", "side.toml", "-o", "s.npz", "--view", "side"];
    place.refused(&named, &["s.npz", "a view", ".png"]);
}

#[test]
fn diagnostic_statistics_are_printed_when_asked_for() {
    let place = Place::new();
    let more = ["--diagnostics", "--depth", "pile.png", "--set", "camera.downsample=4"];
    let simulated = json(&place.expect(0, &tiny(&["simulate", "drop", "--json"], &more)));
    let names: Vec<_> = simulated["diagnostics"].as_object().unwrap().keys().cloned().collect();
    assert_eq!(names, DIAGNOSTICS.map(|s| s.name));
    let recording =
        ["features", "pile.png", "--camera", "pile.toml", "--threshold", "0.001", "--json"];
    let with = |more: &[&'static str]| [&recording[..], &["--diagnostics"], more].concat();
    let at = ["--grain-diameter", "0.004", "--pour-axis", "0", "-0.001"];
    let measured = json(&place.expect(0, &with(&at)));
    let of = |report: &Value, name: &str| report["diagnostics"][name].as_f64().unwrap();
    let (seen, pour) = (of(&measured, "r_95"), of(&simulated, "r_95"));
    assert!((seen - pour).abs() < 0.1 * pour, "{seen} {pour}");
    assert!(of(&measured, "mass_cos_1") != of(&simulated, "mass_cos_1"));
    place.refused(&with(&[]), &["--diagnostics", "--grain-diameter"]);
    place.refused(&with(&["--grain-diameter=-1"]), &["grain diameter", "-1"]);
    let alone = [&recording[..], &["--grain-diameter", "0.004"]].concat();
    place.refused(&alone, &["--diagnostics"]);
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

#[cfg(unix)]
#[test]
fn an_interrupt_keeps_finished_rows_and_exits_with_130() {
    let place = Place::new();
    let args = |n| tiny(&["generate", "drop", "default", "-n", n, "--chunk", "1"], &["-o", "d"]);
    let mut child = place.command(&args("2000")).stdout(Stdio::piped()).spawn().unwrap();
    while !place.at("d/part-000001.parquet").exists() {
        assert!(child.try_wait().unwrap().is_none());
        std::thread::sleep(Duration::from_millis(2));
    }
    let pid = child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let finished = rows(&place.at("d")).rows.len();
    assert!((2..2000).contains(&finished), "{finished}");
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
    place.expect(0, &["merge", "a", "b", "-o", "all.parquet"]);
    assert_same_rows(&place.at("whole"), &place.at("all.parquet"));
    place.refused(&["merge", "a", "whole", "-o", "x.parquet"], &["row 0", "stands in"]);
    let facts = json(&place.expect(0, &["inspect", "all.parquet", "--json"]));
    assert_eq!((&facts["rows"], &facts["seed"]), (&7.into(), &0.into()));
}

#[test]
fn bad_scenes_priors_and_options_are_named() {
    let place = Place::new();
    let scene = granulcal_dem::Scene::drop(0.1).with("start.solid_fraction", 0.5).unwrap();
    let scene = scene.to_toml().unwrap();
    place.write("scene.toml", &scene);
    place.write("typo.toml", scene.replace("diameter", "diametre"));
    place.write("negative.toml", scene.replace("diameter = 0.004", "diameter = -0.004"));
    place.write("truncated.toml", &scene[..scene.len() / 2]);
    place.write("binary.toml", [0xff, 0xfe, 0x00]);
    let prior = "[[parameter]]\npath = \"material.restitution\"\ndistribution = \"uniform\"\nlow = 0.1\nhigh = 0.9\n";
    place.write("ok-prior.toml", prior);
    place.write("unknown-key.toml", prior.replace("high", "hgih"));
    place.write("crossed.toml", prior.replace("0.9", "0.05"));
    place.write("wide.toml", prior.replace("0.9", "1.9"));
    place.write("no-path.toml", prior.replace("restitution", "bounciness"));

    place.refused(&["simulate", "missing.toml"], &["missing.toml"]);
    place.refused(&["simulate", "typo.toml"], &["typo.toml", "diametre", "diameter"]);
    place.refused(&["simulate", "negative.toml"], &["grains.diameter", "-0.004", "positive"]);
    place.refused(&["simulate", "truncated.toml"], &["truncated.toml"]);
    place.refused(&["simulate", "binary.toml"], &["binary.toml", "UTF-8"]);
    place.refused(&["simulate", "drop", "--set", "material.friction=1"], &["material.friction"]);
    place.refused(&["simulate", "drop", "--set", "material.restitution=2"], &["[0, 1]", "2"]);
    place.refused(&["simulate", "drop", "--set", "material.restitution"], &["PATH=VALUE"]);
    place.refused(&["simulate", "drop", "--set", "gravity=nan"], &["gravity"]);
    place.refused(&["simulate", "drop", "--preset", "turbo"], &["turbo", "fast", "accurate"]);
    place.refused(&tiny(&["simulate", "drop", "--threads", "0"], &[]), &["threads", "at least 1"]);
    place.refused(&["simulate", "drop", "--sead", "1"], &["--sead", "--seed"]);
    place.refused(&tiny(&["simulate", "drop", "--depth", "d.jpg"], &[]), &["d.jpg", ".png"]);
    let no_folder = tiny(&["simulate", "drop"], &["--positions", "no/such/folder/g.npy"]);
    let output = place.run(&no_folder);
    assert_eq!(output.status.code(), Some(2), "{}", text(&output.stderr));

    let generate = |prior, more: &[&'static str]| {
        [&["generate", "scene.toml", prior, "-n", "4", "-o", "out"], more].concat()
    };
    place.refused(&generate("missing.toml", &[]), &["missing.toml"]);
    place.refused(&generate("unknown-key.toml", &[]), &["unknown-key.toml", "hgih"]);
    place.refused(
        &generate("crossed.toml", &[]),
        &["crossed.toml", "material.restitution", "above low", "0.05"],
    );
    place.refused(&generate("wide.toml", &[]), &["material.restitution", "1.9", "[0, 1]"]);
    place.refused(&generate("no-path.toml", &[]), &["bounciness"]);
    place.refused(&generate("ok-prior.toml", &["--shard", "2/2"]), &["2/2", "i/k"]);
    place.refused(&generate("ok-prior.toml", &["--threads", "0"]), &["threads", "at least 1"]);
    place.write("taken", "a file");
    place.refused(
        &["generate", "scene.toml", "ok-prior.toml", "-n", "1", "-o", "taken"],
        &["taken", "a folder"],
    );
    place.refused(
        &["generate", "scene.toml", "ok-prior.toml", "-n", "0", "-o", "out"],
        &["rows", "at least 1"],
    );
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

const CAMERA: &str =
    "width = 8\nheight = 6\nfx = 10.0\nfy = 10.0\ncx = 3.5\ncy = 2.5\ndepth_unit = 0.001\n";

#[test]
fn bad_recordings_are_named() {
    let place = Place::new();
    place.write("camera.toml", CAMERA);
    place.write("unknown.toml", format!("{CAMERA}tilt = 3\n"));
    place.write("negative.toml", CAMERA.replace("fx = 10.0", "fx = -10.0"));
    place.write("unit.toml", CAMERA.replace("0.001", "0.0"));
    place.write("small.toml", CAMERA.replace("width = 8", "width = 4"));
    let image = |depth| DepthImage::new(8, 6, vec![depth; 48]).unwrap();
    png::write_depth(&place.at("flat.png"), &image(0.5), 1e-3).unwrap();
    png::write_depth(&place.at("empty.png"), &image(0.0), 1e-3).unwrap();
    let whole = fs::read(place.at("flat.png")).unwrap();
    place.write("cut.png", &whole[..whole.len() / 2]);
    place.write("text.png", "not an image");
    fs::create_dir(place.at("nothing")).unwrap();

    let features = |recording, camera| ["features", recording, "--camera", camera];
    place.refused(&["features", "flat.png"], &["flat.png", "camera"]);
    place.refused(&features("missing.png", "camera.toml"), &["missing.png"]);
    place.refused(&features("flat.png", "missing.toml"), &["missing.toml"]);
    place.refused(&features("flat.png", "unknown.toml"), &["unknown.toml", "tilt"]);
    place.refused(&features("flat.png", "negative.toml"), &["fx", "-10"]);
    place.refused(&features("flat.png", "unit.toml"), &["depth_unit", "positive"]);
    place.refused(&features("flat.png", "small.toml"), &["flat.png", "8x6", "4x6"]);
    place.refused(&features("cut.png", "camera.toml"), &["cut.png"]);
    place.refused(&features("text.png", "camera.toml"), &["text.png"]);
    // All on the plane: nothing stands above it.
    place.refused(&features("flat.png", "camera.toml"), &["flat.png", "none of 48 valid pixels"]);
    place.refused(
        &features("empty.png", "camera.toml"),
        &["empty.png", "must carry depth", "got 0"],
    );
    place.refused(&features("nothing", "camera.toml"), &["nothing", "no .png"]);
    place.write("map.npz", "PK\u{3}\u{4} but not really");
    place.refused(&["features", "map.npz"], &["map.npz"]);
    place.refused(&["features", "camera.toml"], &["camera.toml", ".npz", "ROS 1 bag", "width ="]);
    place.write("bad.npy", b"\x93NUMPY\x01\x00");
    let render = tiny(&["render", "drop", "-o", "o.png", "--positions", "bad.npy"], &[]);
    place.refused(&render, &["bad.npy", "truncated"]);
    place.write("flat.npy", b"\x93NUMPY\x01\x00\x38\x00{'descr': '<f4', 'fortran_order': False, 'shape': (2,)}\n\0\0\0\0\0\0\0\0");
    let render = tiny(&["render", "drop", "-o", "o.png", "--positions", "flat.npy"], &[]);
    place.refused(&render, &["flat.npy", "shape", "[2]", "(n, 3)"]);
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
