//! `kill -9` at random moments: the rows that were finished are on disk, and the resumed rows are the same.

mod place;

use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use granulcal_dataset::Dataset;
use place::Place;

const ROWS: &str = "40";

/// All rows in one part, which is complete only at the very end.
fn words(out: &str) -> Vec<&str> {
    let changes = [
        "--set",
        "start.solid_fraction=0.5",
        "--set",
        "grains.count=20",
        "--set",
        "start.height=0.01",
        "--set",
        "end.horizon=0.3",
        "--set",
        "camera.downsample=8",
    ];
    let head = ["generate", "drop", "default", "-n", ROWS, "--seed", "5", "--chunk", "1000"];
    [&head[..], &changes, &["--flush-every", "0", "-o", out]].concat()
}

fn rows(path: &Path) -> Dataset {
    Dataset::open(path).unwrap()
}

/// Kills a batch `kills` times and resumes it, as often anew as that takes; returns the kills that met unfinished rows.
fn kill(kills: usize, seed: u64) {
    let place = Place::new();
    let finished = |code: Option<i32>| matches!(code, Some(0 | 3));
    assert!(finished(place.run(&words("whole")).status.code()));
    let whole = rows(&place.at("whole"));
    // A simple generator: the numbers need not be good, only different.
    let mut state = seed;
    let mut below = |count: u64| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) % count
    };
    let (mut killed, mut with_partial) = (0, 0);
    for batch in 0.. {
        let name = format!("killed-{batch}");
        let part = place.at(&name).join("part-000000.parquet");
        let on_disk = || if part.exists() { rows(&part).rows.len() as u64 } else { 0 };
        while killed < kills {
            let before = on_disk();
            let mut child = place
                .command(&words(&name))
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .unwrap();
            // Some rows later, and some moment after that.
            let wanted = before + below(7);
            while child.try_wait().unwrap().is_none() && on_disk() < wanted {
                std::thread::sleep(Duration::from_millis(1));
            }
            std::thread::sleep(Duration::from_micros(below(20_000)));
            // SIGKILL: no handler runs.
            let _ = child.kill();
            if child.wait().unwrap().code().is_some() {
                break;
            }
            killed += 1;
            let now = on_disk();
            assert!(now >= wanted, "{now} rows on disk, {wanted} were seen");
            with_partial += usize::from(now > before);
        }
        assert!(finished(place.run(&words(&name)).status.code()));
        let resumed = rows(&place.at(&name));
        assert_eq!(resumed.rows.len(), whole.rows.len());
        for (a, b) in resumed.rows.iter().zip(&whole.rows) {
            assert!(a.same_as(b), "{a:?}\n{b:?}");
        }
        if killed >= kills {
            break;
        }
    }
    // Without the flush no row would be on disk before the last.
    assert!(with_partial > 0, "{killed} kills met no finished row");
}

#[test]
fn five_kills_lose_no_finished_row() {
    kill(5, 1);
}

#[test]
#[ignore = "minutes"]
fn fifty_kills_lose_no_finished_row() {
    kill(50, 2);
}
