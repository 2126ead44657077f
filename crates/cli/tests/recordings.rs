//! Recordings of messages at the process boundary: what is printed, and how the process ends.

mod place;

use std::fs;
use std::path::{Path, PathBuf};

use granulcal_dataset::measured_data;
use granulcal_features::PAPER16;
use place::{Place, json, text};

/// Recordings by other people's writers; see crates/dataset/tests/messages.rs.
fn recordings() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../dataset/tests/data/recordings")
}

fn copied(place: &Place, name: &str) -> Vec<u8> {
    let bytes = fs::read(recordings().join(name)).unwrap();
    place.write(name, &bytes);
    bytes
}

const BAG: &str = "realsense_lz4.bag";
const FILM: &str = "ros2_16uc1_zstd.mcap";

#[test]
fn features_takes_a_recording_in_one_command() {
    let place = Place::new();
    for name in [BAG, FILM, "foxglove_png.mcap"] {
        copied(&place, name);
        let found = json(&place.expect(0, &["features", name, "--json"]));
        assert_eq!(found["statistics"].as_object().unwrap().len(), 16, "{name}");
        assert_eq!(
            (&found["counts"]["frames"], &found["counts"]["whole_frames"]),
            (&3.into(), &3.into())
        );
        assert!(found["lost"].is_null() && found["plane"]["tilt_deg"].is_number());
    }
    let lines = place.expect(0, &["features", BAG, "--frames", "2"]);
    for word in ["ground ", "/device_0/sensor_0/Depth_0/image/data", "2 of 3 averaged"] {
        assert!(lines.contains(word), "{word}: {lines}");
    }
    assert!(PAPER16.iter().all(|statistic| lines.contains(statistic.name)));
    let all = json(&place.expect(0, &["features", BAG, "--frames", "all", "--json"]));
    assert_eq!(all["counts"]["frames"], 3);
    place.refused(&["features", BAG, "--frames", "0"], &["--frames", "all"]);
    place.refused(&["features", BAG, "--first-frame", "3"], &[BAG, "first frame", "below 3"]);
    place.refused(&["features", BAG, "--topic", "/d"], &[BAG, "/d", "/device_0/sensor_0/Depth_0"]);
}

#[test]
fn inspect_says_what_is_in_a_recording() {
    let place = Place::new();
    copied(&place, BAG);
    let facts = json(&place.expect(0, &["inspect", BAG, "--json"]));
    assert_eq!(facts["format"], "ROS 1 bag");
    // Of the frames, not of the lens, which is of no time.
    assert_eq!(facts["start_s"], 1e-8);
    let depth = &facts["topics"]["/device_0/sensor_0/Depth_0/image/data"];
    assert_eq!(
        (&depth["messages"], &depth["size"], &depth["pixels"]),
        (&3.into(), &"12x8".into(), &"mono16".into())
    );
    assert_eq!((&facts["depth"]["frames"], &facts["depth"]["unit_m"]), (&3.into(), &0.0005.into()));
    assert_eq!((&facts["lens"]["fx"], &facts["lens"]["cx"]), (&20.0.into(), &5.5.into()));
    copied(&place, FILM);
    let lines = place.expect(0, &["inspect", FILM]);
    for word in ["MCAP", "sensor_msgs/msg/CameraInfo", "12x8", "16UC1", "unit_m: 0.001"] {
        assert!(lines.contains(word), "{word}: {lines}");
    }
    // A folder as ROS 2 records it.
    fs::create_dir(place.at("bag")).unwrap();
    fs::copy(place.at(FILM), place.at("bag/bag_0.mcap")).unwrap();
    assert!(place.expect(0, &["inspect", "bag"]).contains("16UC1"));
}

#[test]
fn a_recording_that_is_cut_off_exits_with_3_and_counts_what_is_lost() {
    let place = Place::new();
    for name in [BAG, FILM] {
        let whole = copied(&place, name);
        let mut frames_seen = Vec::new();
        for tenth in 1..10 {
            place.write("cut", &whole[..whole.len() * tenth / 10]);
            let output = place.run(&["features", "cut", "--json"]);
            let (out, err) = (text(&output.stdout), text(&output.stderr));
            match output.status.code() {
                Some(3) => {
                    let found = json(&out);
                    frames_seen.push(found["counts"]["frames"].as_u64().unwrap());
                    assert!(found["lost"]["frames"].is_number(), "{found}");
                    assert!(err.contains("warning: cut: byte "), "{err}");
                }
                Some(2) => assert!(err.contains("cut") && out.is_empty(), "{err}"),
                other => panic!("{name} {tenth}: {other:?}\n{err}"),
            }
        }
        assert!(frames_seen.is_sorted() && frames_seen.len() >= 3, "{frames_seen:?}");
        let cut = &whole[..whole.len() * 8 / 10];
        let ending = Path::new(name).extension().unwrap().to_str().unwrap();
        let file = format!("cut.{ending}");
        place.write(&file, cut);
        let facts = json(&place.expect(3, &["inspect", &file, "--json"]));
        assert!(facts["damage"][0].as_str().unwrap().starts_with("byte "), "{facts}");
        assert!(facts["lost"].as_str().unwrap().contains("frame"), "{facts}");
    }
    // Nothing is left of the frames.
    let whole = copied(&place, BAG);
    place.write("stub.bag", &whole[..2000]);
    place.refused(&["features", "stub.bag"], &["stub.bag", "byte 2000", "the file ends"]);
    place.write("stub.bag", b"#ROSBAG V2.0\n");
    place.refused(&["features", "stub.bag"], &["stub.bag", "the depth topic"]);
}

/// An MCAP whose one chunk claims to unpack to `size` bytes.
fn bomb(size: u64) -> Vec<u8> {
    let mut chunk = vec![0; 16];
    chunk.extend(size.to_le_bytes());
    chunk.extend([0; 4]);
    chunk.extend(4u32.to_le_bytes());
    chunk.extend(b"zstd");
    let packed = b"\x28\xb5\x2f\xfd\xa0\x00\x00\x00\xff";
    chunk.extend((packed.len() as u64).to_le_bytes());
    chunk.extend(packed);
    let mut file = b"\x89MCAP0\r\n\x06".to_vec();
    file.extend((chunk.len() as u64).to_le_bytes());
    file.extend(chunk);
    file
}

/// In 300 MB of address space, where reserving what a file claims would end the process.
#[cfg(target_os = "linux")]
#[test]
fn a_file_that_claims_much_is_refused_in_little_memory() {
    let place = Place::new();
    place.write("bomb.mcap", bomb(1 << 40));
    place.write("window.mcap", bomb(1 << 20));
    let mut bag = copied(&place, BAG);
    let size = bag.windows(5).position(|window| window == b"size=").unwrap();
    bag[size + 5..size + 9].fill(0xff);
    place.write("bomb.bag", bag);
    for name in ["bomb.mcap", "window.mcap", "bomb.bag"] {
        let binary = env!("CARGO_BIN_EXE_granulcal-cli");
        let line = format!("ulimit -v 300000; exec {binary} features {name}");
        let output = std::process::Command::new("sh")
            .args(["-c", &line])
            .current_dir(place.at(""))
            .output()
            .unwrap();
        let err = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{name}: {err}");
        assert!(err.contains(name) && err.contains("byte"), "{err}");
    }
}

/// The recording of a D435 by the RealSense viewer; the test is empty where the data are not.
#[test]
fn a_recording_of_the_realsense_viewer_needs_one_command() {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let Some(data) = measured_data(&repository) else { return };
    let bag = data.join("realsense-d435-frames/single_depth_color_640x480.bag");
    let place = Place::new();
    let found =
        json(&place.expect(0, &["features", bag.to_str().unwrap(), "--downsample", "4", "--json"]));
    assert_eq!(found["statistics"].as_object().unwrap().len(), 16);
    assert_eq!(found["counts"]["frames"], 2);
    // The camera looks at a wall at 1.8 m, rough by some 27 mm, past a board that it sees edge on.
    let plane = |name: &str| found["plane"][name].as_f64().unwrap();
    assert!(plane("tilt_deg") < 10.0 && (0.01..0.04).contains(&plane("rms_m")), "{found}");
}

#[test]
fn infer_evaluates_a_model_without_python() {
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../bayessim/tests/data");
    let model = models.join("pile").display().to_string();
    let place = Place::new();
    let bytes = copied(&place, BAG);
    place.write("again.bag", bytes);
    // The model is of made-up statistics: no parameters explain a pile.
    let found = json(&place.expect(3, &["infer", &model, BAG, "--json", "--samples", "50"]));
    assert_eq!(found["inside_model"]["is_inside"], false);
    assert_eq!(found["inside_model"]["statistics"].as_object().unwrap().len(), 16);
    assert_eq!(found["identifiability"]["names"].as_array().unwrap().len(), 3);
    let described = json(&place.expect(0, &["features", BAG, "--json"]));
    assert_eq!(found["statistics"][0], described["statistics"]);
    assert_eq!(found["samples"].as_array().unwrap().len(), 50);
    let friction = &found["parameters"]["material.sliding_friction"];
    let (low, high) = (&friction["interval90"][0], &friction["interval90"][1]);
    assert!(0.0 <= low.as_f64().unwrap() && low.as_f64() < high.as_f64());
    assert!(high.as_f64().unwrap() <= 1.0);
    let mode = friction["mode"].as_f64().unwrap();
    assert!((0.0..=1.0).contains(&mode));
    place.refused(&["infer", &model, BAG, BAG], &["given once", BAG]);
    // A copy under another name is the same pour.
    place.refused(&["infer", &model, BAG, "again.bag"], &["recordings 1 and 2 show one formation"]);
    // One whose depths are rounded otherwise stands for another pour.
    let other = "ros2_inverse_depth.mcap";
    copied(&place, other);
    let lines = place.expect(3, &["infer", &model, BAG, other]);
    assert!(lines.contains("OUTSIDE THE MODEL"), "{lines}");
    assert!(lines.contains("material.restitution") && lines.contains("90 % interval"), "{lines}");
    let other = models.join("auto").display().to_string();
    place.refused(&["infer", &other, BAG], &["of statistics that a recording has", "statistic_0"]);
    place.refused(&["infer", "nothing", BAG], &["nothing", "model.json"]);
    place.refused(&["infer", &model, "nothing.bag"], &["nothing.bag"]);
}
