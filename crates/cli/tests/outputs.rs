//! What a command writes: never over what it reads, never where it cannot, and never instead of the result.

mod place;

use std::fs;

use granulcal_scene::Scene;
use place::{Place, json, text};

/// A scene that is over in milliseconds, as a file.
fn scene(place: &Place) -> String {
    let mut scene = Scene::drop(0.01);
    scene.set(&[("grains.count", 12.0), ("start.solid_fraction", 0.5)]).unwrap();
    scene.end.horizon = 0.25;
    scene.camera.downsample = 8;
    let text = scene.to_toml().unwrap();
    place.write("scene.toml", &text);
    text
}

#[test]
fn the_camera_beside_an_image_does_not_eat_the_scene() {
    let place = Place::new();
    let before = scene(&place);
    for words in [
        ["render", "scene.toml", "-o", "scene.png"],
        ["simulate", "scene.toml", "--depth", "scene.png"],
        ["simulate", "scene.toml", "--positions", "scene.toml"],
        ["simulate", "scene.toml", "--checkpoint", "scene.toml"],
        ["simulate", "scene.toml", "--mcap", "./scene.toml"],
    ] {
        place.refused(&words, &["scene.toml", "another name"]);
        assert_eq!(fs::read_to_string(place.at("scene.toml")).unwrap(), before);
    }
    // A camera that nobody has changed is written again, one that somebody changed is not.
    place.expect(0, &["render", "scene.toml", "-o", "pile.png"]);
    place.expect(0, &["render", "scene.toml", "-o", "pile.png", "--set", "camera.pixels=120"]);
    let mut camera = fs::read_to_string(place.at("pile.toml")).unwrap();
    camera.push_str("\n[segmentation]\nborder_px = 4\n");
    place.write("pile.toml", &camera);
    place.refused(&["render", "scene.toml", "-o", "pile.png"], &["pile.toml", "left as it is"]);
    assert_eq!(fs::read_to_string(place.at("pile.toml")).unwrap(), camera);
}

#[test]
fn a_path_that_cannot_be_written_is_named_before_the_pour() {
    let place = Place::new();
    scene(&place);
    for option in ["--positions", "--depth", "--mcap", "--checkpoint"] {
        let words = ["simulate", "scene.toml", option, "no/such/file.png", "--json"];
        place.refused(&words, &[option, "no/such", "make it first"]);
    }
    #[cfg(unix)]
    place.refused(&["simulate", "scene.toml", "--positions", "/dev/null"], &["a device"]);
    place.refused(&["generate", "scene.toml", "default", "-o", "scene.toml"], &["a folder"]);
}

/// A disk that is full while the files are written: `ulimit -f` makes every file that small, and sends a signal.
#[cfg(unix)]
#[test]
fn the_result_is_printed_even_if_a_file_beside_it_fails() {
    let place = Place::new();
    scene(&place);
    let whole = json(&place.expect(0, &["simulate", "scene.toml", "--json"]));
    for (option, name) in [
        ("--positions", "g.npy"),
        ("--mcap", "p.mcap"),
        ("--depth", "d.png"),
        ("--checkpoint", "c"),
    ] {
        let limited = "ulimit -f 0; exec \"$0\" \"$@\"";
        let binary = env!("CARGO_BIN_EXE_granulcal-cli");
        let output = std::process::Command::new("sh")
            .args(["-c", limited, binary, "simulate", "scene.toml", "--json", option, name])
            .current_dir(place.at(""))
            .output()
            .unwrap();
        let (out, err) = (text(&output.stdout), text(&output.stderr));
        assert_eq!(output.status.code(), Some(1), "{option}: {out}\n{err}");
        assert!(err.contains(name), "{option}: {err}");
        if option == "--checkpoint" || option == "--mcap" {
            // What is begun before the pour fails before the pour.
            continue;
        }
        assert!(err.contains("printed all the same"), "{option}: {err}");
        assert_eq!(json(&out)["statistics"], whole["statistics"], "{option}");
        assert_eq!(json(&out)["state_hash"], whole["state_hash"], "{option}");
        assert_eq!(place.listing(), [place.at("scene.toml")], "{option}");
    }
}

#[test]
fn an_image_is_told_as_json_with_what_its_file_holds() {
    let place = Place::new();
    scene(&place);
    let told = json(&place.expect(0, &["render", "scene.toml", "-o", "d.png", "--json"]));
    let seen = json(&place.expect(0, &["inspect", "d.png", "--json"]));
    for key in ["kind", "width", "height"] {
        assert_eq!(told[key], seen[key], "{key}");
    }
    assert_eq!((&told["file"], &told["camera"]), (&"d.png".into(), &"d.toml".into()));
    assert!(place.at("d.toml").exists());
}

#[test]
fn a_scene_is_told_as_json_with_the_numbers_of_its_toml() {
    let place = Place::new();
    let words = ["scene", "funnel", "--set", "material.sliding_friction=0.25"];
    let told = json(&place.expect(0, &[&words[..], &["--json"]].concat()));
    assert_eq!(told["material"]["sliding_friction"], 0.25);
    let text = place.expect(0, &words);
    for (key, value) in told["funnel"].as_object().unwrap() {
        assert!(text.contains(&format!("{key} = {value}")), "{key} = {value}\n{text}");
    }
}

/// A film that grows beyond what there is room for, in the middle of the pour.
#[cfg(unix)]
#[test]
fn a_film_that_fails_on_the_way_does_not_stop_the_pour() {
    let place = Place::new();
    scene(&place);
    let whole = json(&place.expect(0, &["simulate", "scene.toml", "--json"]));
    let limited = "ulimit -f 64; exec \"$0\" \"$@\"";
    let binary = env!("CARGO_BIN_EXE_granulcal-cli");
    let words = ["simulate", "scene.toml", "--json", "--mcap", "p.mcap"];
    let output = std::process::Command::new("sh")
        .args(["-c", limited, binary])
        .args(words)
        .current_dir(place.at(""))
        .output()
        .unwrap();
    let (out, err) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(1), "{out}\n{err}");
    assert!(err.contains("p.mcap") && err.contains("printed all the same"), "{err}");
    assert_eq!(json(&out)["state_hash"], whole["state_hash"]);
    assert_eq!(place.listing(), [place.at("scene.toml")]);
}

/// Processor time that is used up is no reason to leave half a file behind.
#[cfg(unix)]
#[test]
fn a_limit_of_processor_time_stops_as_ctrl_c_does() {
    let place = Place::new();
    let binary = env!("CARGO_BIN_EXE_granulcal-cli");
    let words = ["simulate", "drop", "--mcap", "p.mcap", "--set", "grains.count=20000"];
    let output = std::process::Command::new("sh")
        .args(["-c", "ulimit -S -t 1; exec \"$0\" \"$@\"", binary])
        .args(words)
        .current_dir(place.at(""))
        .output()
        .unwrap();
    let err = text(&output.stderr);
    assert_eq!(output.status.code(), Some(130), "{err}");
    assert!(err.contains("stopped"), "{err}");
    assert!(place.listing().is_empty(), "{:?}", place.listing());
}

/// A recording, a photograph and a height map are not made again by pouring once more.
#[test]
fn a_recording_that_granulcal_did_not_write_stays() {
    let place = Place::new();
    scene(&place);
    for (option, name) in [("--mcap", "p.mcap"), ("--depth", "d.png")] {
        let words = ["simulate", "scene.toml", option, name];
        place.expect(0, &words);
        // What a pour wrote is written again.
        place.expect(0, &words);
        let mut bytes = fs::read(place.at(name)).unwrap();
        // The library in the header of the one, a pixel of the other.
        bytes[26] ^= 1;
        place.write(name, &bytes);
        place.refused(&words, &[name, "left as it is", "move it away"]);
        assert_eq!(fs::read(place.at(name)).unwrap(), bytes, "{name}");
    }
}
