//! Inputs and outputs of every shape, in a folder of their own.

use std::fs;
use std::path::Path;

use super::*;
use crate::Form;

fn refusal(reads: &[(&Path, Input)], writes: &[(&Path, Product)]) -> Option<String> {
    let mut claims = Claims::default();
    for (path, input) in reads {
        claims.read("INPUT", path, *input);
    }
    for (i, (path, product)) in writes.iter().enumerate() {
        claims.write(&format!("--out-{i}"), path, *product);
    }
    claims.check().err().map(|error| {
        assert!(error.is_bad_input());
        error.to_string()
    })
}

#[test]
fn an_output_is_no_input_by_whatever_name() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    fs::create_dir(at("sub")).unwrap();
    own_png(&at("image.png"));
    fs::hard_link(at("image.png"), at("twin.png")).unwrap();
    let png = Product::File(Form::Png);
    let read = [(&*at("image.png"), Input::File)];
    for name in ["image.png", "sub/../image.png", "twin.png"] {
        let message = refusal(&read, &[(&at(name), png)]).unwrap_err_text();
        assert!(message.contains("INPUT") && message.contains("another name"), "{message}");
    }
    assert_eq!(refusal(&read, &[(&at("other.png"), png)]), None);
    // What a command writes on is both.
    assert_eq!(refusal(&[(&at("image.png"), Input::Kept)], &[(&at("image.png"), png)]), None);
}

#[test]
fn what_a_document_names_is_read_too() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    fs::write(at("loop.toml"), "scene = \"scene.toml\"\n").unwrap();
    fs::write(at("scene.toml"), "[[walls]]\nshape = { file = \"m.npy\" }\n").unwrap();
    fs::write(at("m.npy"), b"\x93NUMPY").unwrap();
    let message =
        refusal(&[(&at("loop.toml"), Input::File)], &[(&at("m.npy"), Product::File(Form::Npy))]);
    let message = message.unwrap_err_text();
    assert!(message.contains("names scene.toml") && message.contains("names m.npy"), "{message}");
}

#[test]
fn the_camera_beside_an_image_is_an_output() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    fs::write(at("scene.toml"), "name = \"a\"\n").unwrap();
    let scene = [(&*at("scene.toml"), Input::File)];
    let message = refusal(&scene, &[(&at("scene.png"), Product::View)]).unwrap_err_text();
    assert!(message.contains("scene.toml is read"), "{message}");
    // Another scene's TOML stays as well.
    let message = refusal(&[], &[(&at("scene.png"), Product::View)]).unwrap_err_text();
    assert!(message.contains("left as it is"), "{message}");
    assert_eq!(refusal(&scene, &[(&at("scene.npz"), Product::View)]), None);
}

#[test]
fn a_recording_gets_no_frame_and_loses_none() {
    let place = tempfile::tempdir().unwrap();
    let frames = place.path().join("frames");
    fs::create_dir(&frames).unwrap();
    fs::write(frames.join("mask.png"), b"\x89PNG").unwrap();
    let read = [(&*frames, Input::Recording)];
    let message = refusal(&read, &[(&frames, Product::PICTURES)]).unwrap_err_text();
    assert!(message.contains("would become a frame"), "{message}");
    let message =
        refusal(&read, &[(&frames.join("mask.png"), Product::File(Form::Png))]).unwrap_err_text();
    assert!(message.contains("is read"), "{message}");
    assert_eq!(refusal(&read, &[(&frames.join("steps"), Product::PICTURES)]), None);
    // A model's folder is no recording: its plots may lie in it, again and again.
    own_png(&frames.join("coverage.png"));
    assert_eq!(refusal(&[(&frames, Input::File)], &[(&frames, Product::PLOTS)]), None);
}

#[test]
fn pictures_get_into_no_folder_of_depth_images() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("frames");
    fs::create_dir(&folder).unwrap();
    // Pictures of an earlier run are replaced, those of somebody else are not.
    for name in ["residual.png", "mask.png", "height.png"] {
        own_png(&folder.join(name));
    }
    assert_eq!(refusal(&[], &[(&folder, Product::PICTURES)]), None);
    let depth = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(1, 1, vec![7u16]).unwrap();
    depth.save(folder.join("0001.png")).unwrap();
    let message = refusal(&[], &[(&folder, Product::PICTURES)]).unwrap_err_text();
    assert!(message.contains("0001.png") && message.contains("further frames"), "{message}");
    fs::remove_file(folder.join("0001.png")).unwrap();
    image::RgbImage::new(1, 1).save(folder.join("mask.png")).unwrap();
    let message = refusal(&[], &[(&folder, Product::PICTURES)]).unwrap_err_text();
    assert!(message.contains("mask.png") && message.contains("did not write"), "{message}");
}

#[test]
fn two_outputs_are_two_files() {
    let place = tempfile::tempdir().unwrap();
    let a = place.path().join("a.npy");
    let b = place.path().join("./a.npy");
    let npy = Product::File(Form::Npy);
    let message = refusal(&[], &[(&a, npy), (&b, npy)]).unwrap_err_text();
    assert!(message.contains("--out-0, too"), "{message}");
}

#[test]
fn a_place_that_cannot_be_written_is_named() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    fs::write(at("file"), b"").unwrap();
    let npy = Product::File(Form::Npy);
    for (name, product, said) in [
        ("no/a.npy", npy, "does not exist; make it first"),
        ("file/a.npy", npy, "is no folder"),
        ("", npy, "a folder"),
        ("file", Product::DATA_SET, "must be a folder, found a file"),
        ("file/deep/er", Product::DATA_SET, "is no folder"),
    ] {
        let message = refusal(&[], &[(&at(name), product)]).unwrap_err_text();
        assert!(message.contains(said), "{name}: {message}");
    }
    assert_eq!(refusal(&[], &[(&at("new/and/deep"), Product::DATA_SET)]), None);
    assert_eq!(fs::read_dir(place.path()).unwrap().count(), 1);
    let message = refusal(&[], &[(Path::new("/proc/a.npy"), npy)]);
    assert!(message.unwrap_err_text().contains("/proc"));
}

#[test]
fn what_is_there_and_what_is_allowed_is_said() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    fs::write(at("scene.toml"), "name = \"a\"\n").unwrap();
    fs::write(at("pour.gif"), "{\"a\": 1}").unwrap();
    fs::write(at("couscous.bag"), b"#ROSBAG V2.0\n").unwrap();
    for (name, product, said) in [
        ("scene.toml", Product::FILM, "must end in .gif or .mp4"),
        ("scene.toml", Product::MESSAGES, "must end in .bag or .mcap"),
        (
            "scene.toml",
            Product::File(Form::Npy),
            "it is TOML, and an array (.npy) would replace it",
        ),
        ("scene.toml", Product::Figure, "it is TOML, and a PNG would replace it"),
        ("pour.gif", Product::FILM, "it is JSON, and a GIF would replace it"),
        ("couscous.bag", Product::MESSAGES, "may not be had again"),
    ] {
        let message = refusal(&[], &[(&at(name), product)]).unwrap_err_text();
        assert!(message.contains(said), "{name}: {message}");
    }
    assert_eq!(refusal(&[], &[(&at("new.MP4"), Product::FILM)]), None);
    fs::write(at("empty.bag"), b"").unwrap();
    assert_eq!(refusal(&[], &[(&at("empty.bag"), Product::MESSAGES)]), None);
}

#[test]
fn a_name_does_not_end_as_a_file_of_another_kind() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    let table = Product::File(Form::Parquet);
    let message = refusal(&[], &[(&at("rows.csv"), table)]).unwrap_err_text();
    assert!(message.contains("rows.csv") && message.contains("a Parquet table"), "{message}");
    for name in ["rows.parquet", "rows.PARQUET", "rows", "rows.v1"] {
        assert_eq!(refusal(&[], &[(&at(name), table)]), None);
    }
}

/// A PNG that granulcal wrote.
fn own_png(path: &Path) {
    files::write_file(path, Form::Png, b"\x89PNG\0\0\0\0IEND\xaeB`\x82").unwrap();
}

/// The refusal that must be there.
trait Refused {
    fn unwrap_err_text(self) -> String;
}

impl Refused for Option<String> {
    fn unwrap_err_text(self) -> String {
        self.expect("a refusal")
    }
}
