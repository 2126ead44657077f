//! The process boundary of the commands about the camera: `fit-sensor`, `pick-colour`, and what
//! `features` shows of its steps.

mod place;

use std::path::Path;

use granulcal_dataset::{measured_data, png, write_height_map};
use granulcal_features::{
    Camera, DepthSensor, HeightMap, NoiseField, Observe, StereoSensor, TimeOfFlightSensor, render,
};
use place::{Place, json, text};

/// Runs, expects the exit code, returns stdout and stderr.
fn expect(place: &Place, code: i32, args: &[&str]) -> (String, String) {
    let output = place.run(args);
    let (out, err) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(code), "{args:?}\nstdout: {out}\nstderr: {err}");
    (out, err)
}

/// Writes `count` maps of a flat bed as `bed_0.npz` and so on.
fn flat_maps(place: &Place, count: u64) {
    let noise = NoiseField {
        correlated: 2e-4,
        correlation_x: 2.0,
        correlation_y: 2.0,
        ..NoiseField::default()
    };
    let sensor =
        DepthSensor::TimeOfFlight(TimeOfFlightSensor { noise, ..TimeOfFlightSensor::new(3e-3) });
    let bed = HeightMap::new(60, 60, 3e-3, 3e-3, vec![0.0; 3600]).unwrap();
    for seed in 0..count {
        let map = sensor.observe_height_map(&bed, seed).unwrap();
        write_height_map(&place.at(&format!("bed_{seed}.npz")), &map).unwrap();
    }
}

#[test]
fn a_sensor_is_fitted_written_and_used() {
    let place = Place::new();
    flat_maps(&place, 5);
    let fit = [
        "fit-sensor",
        "bed_0.npz",
        "bed_1.npz",
        "bed_2.npz",
        "--check",
        "bed_3.npz",
        "bed_4.npz",
        "--max-lag",
        "8",
        "--sessions",
        "6",
        "-o",
        "sensor.toml",
    ];
    let (out, _) = expect(&place, 0, &[&fit[..], &["--report", "r.json", "--json"]].concat());
    let report = json(&out);
    assert_eq!(json(&std::fs::read_to_string(place.at("r.json")).unwrap()), report);
    assert_eq!(report["sensor"]["kind"], "time_of_flight");
    for part in ["fit", "check"] {
        let ratio = report[part]["sd_model"].as_f64().unwrap()
            / report[part]["sd_measured"].as_f64().unwrap();
        assert!((ratio - 1.0).abs() < 0.15, "{part}: {ratio}");
        assert!(report[part]["worst_correlation"].as_f64().unwrap() < 0.2, "{part}");
    }
    assert_eq!(report["check"]["covariances"]["frames"], 2);
    let (table, _) = expect(&place, 0, &fit);
    assert!(
        table.contains("checked on 2 frame(s)") && table.contains("largest difference"),
        "{table}"
    );

    // The sensor as it was written disturbs an image, and an unknown key in it is named.
    let pour = [
        "drop",
        "--seed",
        "1",
        "--set",
        "grains.count=30",
        "--set",
        "start.height=0.01",
        "--set",
        "start.solid_fraction=0.5",
        "--set",
        "end.horizon=0.3",
        "--set",
        "camera.downsample=8",
    ];
    expect(&place, 0, &[&["render"], &pour[..], &["-o", "clean.png"]].concat());
    let noisy = [&["render"], &pour[..], &["--sensor", "sensor.toml", "-o", "noisy.png"]].concat();
    expect(&place, 0, &noisy);
    let read = |name: &str| png::read_depth(&place.at(name), 1e-4).unwrap();
    assert_ne!(read("clean.png"), read("noisy.png"));
    let text = std::fs::read_to_string(place.at("sensor.toml")).unwrap();
    std::fs::write(place.at("wrong.toml"), text.replace("dropout", "drop_out")).unwrap();
    let wrong = [&["render"], &pour[..], &["--sensor", "wrong.toml", "-o", "x.png"]].concat();
    let (_, err) = expect(&place, 2, &wrong);
    assert!(err.contains("wrong.toml") && err.contains("drop_out"), "{err}");
}

#[test]
fn a_stereo_camera_is_fitted_to_a_folder_of_frames() {
    let place = Place::new();
    let camera = Camera::overhead(0.6, 0.6, 120).unwrap();
    let noise = NoiseField { white: 0.1, ..NoiseField::default() };
    let sensor = StereoSensor { noise, ..StereoSensor::new(camera.intrinsics.fx, 0.05) };
    let image = render(&camera, &[], &[]).unwrap();
    std::fs::create_dir(place.at("wall")).unwrap();
    for seed in 0..3 {
        let shot = DepthSensor::Stereo(sensor).observe(&camera, &image, seed).unwrap();
        png::write_depth(&place.at(&format!("wall/{seed}.png")), &shot, 1e-4).unwrap();
    }
    granulcal_dataset::CameraFile::of(&camera, 1e-4).save(&place.at("camera.toml")).unwrap();
    let words = [
        "fit-sensor",
        "wall",
        "--camera",
        "camera.toml",
        "--baseline",
        "0.05",
        "--region",
        "20,0,100,120",
        "--max-lag",
        "6",
        "--sessions",
        "4",
        "--json",
    ];
    let (out, _) = expect(&place, 0, &words);
    let sensor = &json(&out)["sensor"];
    assert_eq!(sensor["kind"], "stereo");
    let white = sensor["noise"]["white"].as_f64().unwrap();
    assert!((white / 0.1 - 1.0).abs() < 0.05, "{white}");
    // Without a baseline the same frames are a time-of-flight camera's, in metres.
    let (out, _) = expect(
        &place,
        0,
        &[
            "fit-sensor",
            "wall",
            "--camera",
            "camera.toml",
            "--max-lag",
            "6",
            "--sessions",
            "4",
            "--json",
        ],
    );
    assert_eq!(json(&out)["sensor"]["kind"], "time_of_flight");
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let place = Place::new();
    flat_maps(&place, 1);
    for (words, said) in [
        (vec!["fit-sensor", "missing.npz"], "missing.npz"),
        (vec!["fit-sensor", "bed_0.npz", "--region", "50,0,20,20"], "right edge of a region"),
        (vec!["fit-sensor", "bed_0.npz", "--region", "5,5"], "X,Y,WIDTH,HEIGHT"),
        (vec!["fit-sensor", "bed_0.npz", "--trend", "9"], "trend_degree"),
        (vec!["fit-sensor", "bed_0.npz", "--baseline", "0.05"], "--baseline is of depth images"),
    ] {
        let (_, err) = expect(&place, 2, &words);
        assert!(err.contains(said), "{words:?}: {err}");
    }
    let (_, err) =
        expect(&place, 0, &["fit-sensor", "bed_0.npz", "--max-lag", "5", "--sessions", "3"]);
    assert!(err.contains("one frame"), "{err}");
}

#[test]
fn a_colour_is_picked_from_an_image() {
    let place = Place::new();
    let mut rgb = vec![0_u8; 0];
    for i in 0..60 * 40 {
        let is_grain = (20..40).contains(&(i % 60)) && i / 60 > 10;
        let spread = (i % 7) as u8;
        rgb.extend(if is_grain { [200 + spread, 180, 120] } else { [20 + spread, 20, 24] });
    }
    image::RgbImage::from_raw(60, 40, rgb).unwrap().save(place.at("c.png")).unwrap();
    let words = ["pick-colour", "c.png", "--grains", "22,15,10,10", "--ground", "0,0,15,15"];
    let (out, _) = expect(&place, 0, &[&words[..], &["--mask", "m.png"]].concat());
    assert!(out.starts_with("[segmentation.colour]\n") && out.contains("value_min = "), "{out}");
    assert!(place.at("m.png").exists());
    // What is printed is TOML that a camera's file can hold.
    let camera = format!(
        "width = 60\nheight = 40\nfx = 60.0\nfy = 60.0\ncx = 29.5\ncy = 19.5\ndepth_unit = 0.001\n{out}"
    );
    std::fs::write(place.at("camera.toml"), camera).unwrap();
    expect(&place, 0, &["inspect", "camera.toml"]);
    let (out, _) = expect(&place, 0, &[&words[..], &["--json"]].concat());
    let picked = json(&out);
    assert_eq!(picked["ground_inside"], 0.0);
    let share = picked["image_inside"].as_f64().unwrap();
    assert!((share - 29.0 * 20.0 / 2400.0).abs() < 0.02, "{share}");
    let (_, err) = expect(&place, 2, &["pick-colour", "c.png", "--grains", "55,0,10,10"]);
    assert!(err.contains("region"), "{err}");
    let same = ["pick-colour", "c.png", "--grains", "0,0,9,9", "--ground", "0,0,9,9"];
    let (_, err) = expect(&place, 0, &same);
    assert!(err.contains("does not tell the two apart"), "{err}");
}

#[test]
fn the_steps_of_a_segmentation_can_be_looked_at() {
    let place = Place::new();
    flat_maps(&place, 1);
    let z = (0..10_000).map(|i| {
        let (u, v) = ((i % 100) as f64 - 50.0, (i / 100) as f64 - 50.0);
        (0.02 - 1e-3 * u.hypot(v)).max(0.0)
    });
    let map = HeightMap::new(100, 100, 2e-3, 2e-3, z.collect()).unwrap();
    write_height_map(&place.at("pile.npz"), &map).unwrap();
    let words = ["features", "pile.npz", "--debug-images", "steps", "--json"];
    let (out, err) = expect(&place, 0, &words);
    assert!(err.contains("residual.png") && err.contains("mm"), "{err}");
    for name in ["residual.png", "height.png", "mask.png"] {
        assert!(place.at("steps").join(name).exists(), "{name}");
    }
    let report = json(&out);
    assert_eq!(report["formation"]["kind"], "pile");
    let cone = std::f64::consts::PI * 0.04_f64.powi(2) * 0.02 / 3.0;
    let volume = report["formation"]["volume_m3"].as_f64().unwrap();
    assert!((volume / cone - 1.0).abs() < 0.02, "{volume} {cone}");
    assert_eq!(report["pixel"]["downsample"], 1);
    // As wide on the ground as the paper's simulated images: 6 mm.
    assert_eq!(report["doubts"], serde_json::Value::Null);
    let (out, err) = expect(&place, 0, &["features", "pile.npz", "--scene", "funnel", "--json"]);
    assert_eq!(json(&out)["pixel"]["downsample"], 3);
    // A cone of 33 ml has not the room of 2000 grains of 4 mm.
    assert!(err.contains("warning: the formation's volume, all of it in view, is 0.033"), "{err}");
    assert!(json(&out)["doubts"][0].as_str().unwrap().contains("as many grains"));
    // Where there is no grain, the pictures say why.
    let (_, err) = expect(&place, 2, &["features", "bed_0.npz", "--debug-images", "bare"]);
    assert!(err.contains("none of 3600 valid pixels belongs to a grain"), "{err}");
    assert!(place.at("bare/residual.png").exists());
}

/// The recording of a D435 by the RealSense viewer, a wall and a board; the test is empty where the
/// data are not.
#[test]
fn a_sensor_is_fitted_to_a_recording_of_the_realsense_viewer() {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let Some(data) = measured_data(&repository) else { return };
    let bag = data.join("realsense-d435-frames/single_depth_color_640x480.bag");
    let place = Place::new();
    let words = [
        "fit-sensor",
        bag.to_str().unwrap(),
        "--baseline",
        "0.05017",
        "--region",
        "530,245,76,57",
        "--max-lag",
        "6",
        "--sessions",
        "3",
        "--json",
    ];
    let fitted = json(&expect(&place, 0, &words).0);
    assert_eq!(fitted["sensor"]["kind"], "stereo");
    assert_eq!(fitted["fit"]["covariances"]["frames"], 2);
    // The lens, the unit and the steps of the disparity are those of the D400's own processor.
    let number = |name: &str| fitted["sensor"][name].as_f64().unwrap();
    assert!((number("focal_length") - 390.43).abs() < 0.01, "{fitted}");
    assert_eq!((number("depth_unit"), number("quantisation")), (0.001, 1.0 / 32.0));
    let (_, err) = expect(&place, 2, &["fit-sensor", bag.to_str().unwrap(), "--topic", "/none"]);
    assert!(err.contains("no topic /none"), "{err}");
}
