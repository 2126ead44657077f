//! A disk that is full, a real one of a few pages: what was half written is gone, and what was there stays.
//!
//! It takes the right to mount a file system in memory. Whoever lacks it is told that nothing was tried.

#![cfg(target_os = "linux")]

mod place;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use granulcal_dem::Scene;
use place::{Place, json, text};

/// A file system of so many kilobytes below a folder of its own; taken away at the end.
struct SmallDisk(PathBuf);

impl SmallDisk {
    /// None where it cannot be mounted.
    fn mount(at: PathBuf, kilobytes: u32) -> Option<Self> {
        fs::create_dir(&at).unwrap();
        let size = format!("size={kilobytes}k");
        let mounted =
            Command::new("mount").args(["-t", "tmpfs", "-o", &size, "tmpfs"]).arg(&at).output();
        if mounted.is_ok_and(|output| output.status.success()) {
            return Some(Self(at));
        }
        eprintln!("skipped: this user cannot mount a small disk");
        None
    }

    /// Leaves no byte free.
    fn fill(&self, name: &str) {
        // As many as fit, page by page.
        let mut file = fs::File::create(self.0.join(name)).unwrap();
        while std::io::Write::write_all(&mut file, &[1; 4096]).is_ok() {}
    }

    fn listing(&self) -> Vec<String> {
        let entries = fs::read_dir(&self.0).unwrap();
        let mut names: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        // If it stays, the folder that holds it says so.
        let _ = Command::new("umount").arg(&self.0).status();
    }
}

/// A scene that is over in milliseconds.
fn scene(place: &Place) {
    let mut scene = Scene::drop(0.01);
    scene.set(&[("grains.count", 12.0), ("start.solid_fraction", 0.5)]).unwrap();
    scene.end.horizon = 0.25;
    scene.camera.downsample = 8;
    place.write("scene.toml", scene.to_toml().unwrap());
}

/// Ended with a message, and neither by a panic nor as if all were well.
fn is_refused(output: &Output) -> bool {
    matches!(output.status.code(), Some(1 | 2)) && !text(&output.stderr).contains("panicked")
}

#[test]
fn nothing_half_written_is_left_on_a_full_disk() {
    let place = Place::new();
    scene(&place);
    let Some(disk) = SmallDisk::mount(place.at("disk"), 64) else { return };
    let whole = json(&place.expect(0, &["simulate", "scene.toml", "--json"]));
    disk.fill("full");
    let before = disk.listing();
    for (option, name) in [
        ("--positions", "disk/g.npy"),
        ("--depth", "disk/d.png"),
        ("--mcap", "disk/p.mcap"),
        ("--checkpoint", "disk/c.ckpt"),
    ] {
        let output = place.run(&["simulate", "scene.toml", "--json", option, name]);
        let (out, err) = (text(&output.stdout), text(&output.stderr));
        // A film is refused beforehand, for there is no room for it.
        assert!(is_refused(&output), "{option}: {out}\n{err}");
        assert!(err.contains(name) || err.contains("disk"), "{option}: {err}");
        if !out.is_empty() {
            assert_eq!(json(&out)["state_hash"], whole["state_hash"], "{option}");
        }
        assert_eq!(disk.listing(), before, "{option}: {err}");
    }
    let batch = ["generate", "scene.toml", "default", "-n", "3", "-o", "disk/batch"];
    let output = place.run(&batch);
    assert!(is_refused(&output), "{}", text(&output.stderr));
    let left = names_below(&disk.0);
    assert!(
        left.iter().all(|name| Path::new(name).extension().is_none_or(|e| e != "tmp")),
        "{left:?}"
    );
}

#[test]
fn what_was_there_stays_on_a_full_disk_and_a_batch_goes_on_when_there_is_room() {
    let place = Place::new();
    scene(&place);
    let Some(disk) = SmallDisk::mount(place.at("disk"), 256) else { return };
    let batch = |rows: &'static str| {
        ["generate", "scene.toml", "default", "-n", rows, "--seed", "2", "-o", "disk/batch"]
    };
    let finished = |code: Option<i32>| matches!(code, Some(0 | 3));
    assert!(finished(place.run(&batch("3")).status.code()));
    let part = disk.0.join("batch/part-000000.parquet");
    let before = fs::read(&part).unwrap();
    disk.fill("full");
    // Nothing is left to do.
    let output = place.run(&batch("3"));
    assert!(finished(output.status.code()), "{}", text(&output.stderr));
    assert!(is_refused(&place.run(&batch("6"))));
    assert_eq!(fs::read(&part).unwrap(), before);
    assert!(
        names_below(&disk.0)
            .iter()
            .all(|name| Path::new(name).extension().is_none_or(|e| e != "tmp"))
    );
    fs::remove_file(disk.0.join("full")).unwrap();
    let output = place.run(&batch("6"));
    assert!(finished(output.status.code()), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("6 of 6 rows complete"), "{}", text(&output.stdout));
}

fn names_below(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(names_below(&path));
        } else {
            found.push(path.display().to_string());
        }
    }
    found
}
