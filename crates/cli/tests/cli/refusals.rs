//! What is wrong in a scene, a prior, an option or a recording is named.

use std::fs;

use granulcal_dataset::png;
use granulcal_features::DepthImage;

use crate::place::{Place, text};
use crate::tiny;

const CAMERA: &str =
    "width = 8\nheight = 6\nfx = 10.0\nfy = 10.0\ncx = 3.5\ncy = 2.5\ndepth_unit = 0.001\n";

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
    place.refused(&["inspect", "missing.json"], &["cannot read missing.json", "No such file"]);
    for words in [
        &["simulate", "funel"][..],
        &["render", "funel", "-o", "x.png"],
        &["generate", "funel", "default", "-o", "d"],
        &["scene", "funel"],
        &["inspect", "funel", "--contact-problem", "x.npz", "--time", "0.1"],
    ] {
        place.refused(words, &["\"funel\"", "did you mean funnel?"]);
    }
    place.refused(&["generate", "drop", "default2", "-o", "d"], &["did you mean default?"]);
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
    fs::create_dir_all(place.at("far/away")).unwrap();
    place.write("far/away/flat.png", &whole);
    place.refused(&["features", "far/away/flat.png"], &["flat.png", "camera must be given"]);
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
    place
        .refused(&["features", "camera.toml"], &["camera.toml", ".npz", "ROS 1 bag", "found text"]);
    place.write("bad.npy", b"\x93NUMPY\x01\x00");
    let render = tiny(&["render", "drop", "-o", "o.png", "--positions", "bad.npy"], &[]);
    place.refused(&render, &["bad.npy", "truncated"]);
    place.write("flat.npy", b"\x93NUMPY\x01\x00\x38\x00{'descr': '<f4', 'fortran_order': False, 'shape': (2,)}\n\0\0\0\0\0\0\0\0");
    let render = tiny(&["render", "drop", "-o", "o.png", "--positions", "flat.npy"], &[]);
    place.refused(&render, &["flat.npy", "shape", "[2]", "(n, 3)"]);
}

#[test]
fn numbers_on_the_command_line_are_refused_in_plain_words() {
    let place = Place::new();
    let rows = |n| ["generate", "drop", "default", "-o", "d", "-n", n];
    for n in ["1e3", "-1", "all"] {
        place.refused(&rows(n), &["--rows", "must be a whole number, 0 or more", n]);
    }
    let border = ["features", "a.bag", "--border", "-1"];
    place.refused(&border, &["--border", "must be a whole number, 0 or more", "-1"]);
    let baseline = ["fit-sensor", "a.bag", "-o", "s.toml", "--baseline", "wide"];
    place.refused(&baseline, &["--baseline", "must be a number", "wide"]);
}

#[test]
fn numbers_of_a_scene_that_cannot_be_are_told_from_paths_that_are_none() {
    let place = Place::new();
    let set = |change| ["simulate", "drop", "--set", change];
    place.refused(&set("grains.count=17.4"), &["grains.count must be a whole number, got 17.4"]);
    place.refused(&set("grains.count=-1"), &["grains.count must be a whole number from 0", "-1"]);
    place.refused(&set("grains.number=3"), &["does not name a number", "grains.number"]);
    for command in [&["simulate", "drop"][..], &["render", "drop", "-o", "a.png"]] {
        let seed = ["--seed", "-1"];
        place.refused(&[command, &seed].concat(), &["--seed", "whole number from 0 to", "-1"]);
    }
    place.write(
        "prior.toml",
        "[[parameter]]\npath = \"grains.count\"\ndistribution = \"uniform\"\nlow = 10\nhigh = 20\n",
    );
    let batch = |prior, more: &[&'static str]| {
        let command = ["generate", "drop", prior, "-n", "2", "-o", "d"];
        [&command[..], more].concat()
    };
    place.refused(&batch("prior.toml", &[]), &["grains.count", "whole number", "grains.volume"]);
    let none = batch("default", &["--set", "grains.count=0"]);
    place.refused(&none, &["grains.count", "at least 1", "got 0"]);
}

#[test]
fn inspect_says_what_reads_the_task_of_a_loop() {
    let place = Place::new();
    place.write("loop.toml", "scene = \"scene.toml\"\n[[conditions]]\nname = \"low\"\n");
    place.refused(&["inspect", "loop.toml"], &["loop.toml", "close-loop", "--dry-run"]);
    place.write("other.toml", "scene = \"scene.toml\"\n");
    place.refused(&["inspect", "other.toml"], &["as a scene", "as a prior", "as a camera"]);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("/dev/zero", place.at("endless.toml")).unwrap();
        place.refused(&["inspect", "endless.toml"], &["endless.toml", "a device or pipe"]);
    }
}
