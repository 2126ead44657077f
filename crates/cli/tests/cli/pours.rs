//! One pour: what `simulate`, `render` and `inspect --contact-problem` say and write.

use std::fs;
use std::path::Path;

use granulcal_features::{DIAGNOSTICS, PAPER16};
use serde_json::Value;

use crate::place::{Place, json, text};
use crate::tiny;

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
fn a_pour_does_not_begin_anew_over_its_checkpoint() {
    let place = Place::new();
    let args = |seed, more: &[&'static str]| {
        tiny(&["simulate", "drop", "--seed", seed, "--checkpoint", "a.ckpt"], more)
    };
    place.expect(0, &args("1", &[]));
    let kept = fs::read(place.at("a.ckpt")).unwrap();
    place.refused(&args("1", &[]), &["--checkpoint", "--resume a.ckpt", "delete it"]);
    assert_eq!(fs::read(place.at("a.ckpt")).unwrap(), kept);
    place.expect(0, &args("1", &["--resume", "a.ckpt"]));
    assert_eq!(fs::read(place.at("a.ckpt")).unwrap(), kept);
    // Of another pour, and damaged.
    place.expect(0, &args("2", &[]));
    let mut damaged = fs::read(place.at("a.ckpt")).unwrap();
    let last = damaged.len() - 1;
    damaged[last] ^= 1;
    fs::write(place.at("a.ckpt"), damaged).unwrap();
    place.expect(0, &args("2", &[]));
    fs::remove_file(place.at("a.ckpt")).unwrap();
    // One line begins and goes on; another file must be there.
    place.expect(0, &args("2", &["--resume", "a.ckpt"]));
    place.expect(0, &args("2", &["--resume", "a.ckpt"]));
    place.refused(&args("2", &["--resume", "b.ckpt"]), &["b.ckpt"]);
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
fn positions_are_drawn_as_large_as_the_pour_left_them() {
    let place = Place::new();
    for (kind, table, n, other) in [
        ("sizes", "[effects.polydispersity]\ncv = 0.3\n", "30", Some("must be 30")),
        ("clumps", "[effects.clump]\nspheres = 3\naspect = 2.0\n", "90", None),
        ("intruder", INTRUDER, "31", Some("30 or 31")),
    ] {
        let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
        let scene = fs::read_to_string(examples.join("drop.toml")).unwrap();
        place.write("s.toml", format!("{scene}\n{table}"));
        let pour = ["simulate", "s.toml", "--seed", "5", "--positions", "g.npy"];
        place.run(&tiny(&pour, &["--depth", "simulated.png"]));
        let draw = ["render", "s.toml", "--seed", "5", "--positions", "g.npy"];
        place.expect(0, &tiny(&draw, &["-o", "drawn.png"]));
        let bytes = |name| fs::read(place.at(name)).unwrap();
        assert!(bytes("simulated.png") == bytes("drawn.png"), "{kind}");
        let facts = json(&place.expect(0, &["inspect", "g.npy", "--json"]));
        assert_eq!(facts["shape"][0].to_string(), n, "{kind}");
        if let Some(allowed) = other {
            granulcal_dataset::npy::write_points(&place.at("few.npy"), &[[0.0, 0.0, 0.1].into()])
                .unwrap();
            let few = tiny(&["render", "s.toml", "-o", "f.png", "--positions", "few.npy"], &[]);
            place.refused(&few, &["--positions", allowed, "got 1"]);
        }
    }
}

const INTRUDER: &str =
    "[intruder]\ndiameter = 0.02\ndensity = 2500.0\nposition = [0.0, 0.0, 0.1]\n";

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
fn an_unhealthy_pour_says_which_bound_it_broke_and_what_helps() {
    let place = Place::new();
    // Thin plates of 1 mm that land without friction turn by more than half a radian in a substep.
    let plates = "name = \"plates\"\n[material]\nsliding_friction = 0.0\nrolling_friction = 0.0\nrestitution = 0.95\n\
                  [grains]\ncount = 60\ndiameter = 0.001\ndensity = 1300.0\n\
                  shape = { kind = \"box\", aspect = [1, 2, 0.3] }\n\
                  [start]\nkind = \"grid\"\ncounts = [4, 4, 4]\nspacing = 0.0025\njitter = 5e-5\nbase = 0.1\n\
                  [end]\nhorizon = 0.6\n";
    place.write("plates.toml", plates);
    let output = place.run(&["simulate", "plates.toml", "--seed", "1"]);
    let (out, err) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(3), "{out}\n{err}");
    assert!(out.contains("unhealthy"), "{out}");
    for words in
        ["an overlap of ", "at most 0.2 are allowed", "`substep = 0.00025`", "now 0.0005 s"]
    {
        assert!(err.contains(words), "{words}: {err}");
    }
    place.write("finer.toml", format!("substep = 1.25e-4\n{plates}"));
    let finer =
        json(&text(&place.run(&["simulate", "finer.toml", "--seed", "1", "--json"]).stdout));
    assert_ne!(finer["status"], "unhealthy", "{finer}");
    assert!(finer["health"]["worst_penetration"].as_f64().unwrap() < 0.1, "{finer}");
}
