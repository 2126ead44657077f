//! Numbers that no machine has room for are refused before anything begins, and Ctrl-C ends what has begun.

mod place;

use std::process::Stdio;
use std::time::{Duration, Instant};

use place::{Place, interrupt, text};

/// A pour that is over in milliseconds.
const TINY: [&str; 8] = [
    "--set",
    "start.solid_fraction=0.5",
    "--set",
    "grains.count=30",
    "--set",
    "end.horizon=0.2",
    "--set",
    "camera.downsample=8",
];

#[test]
fn what_has_no_room_is_refused_by_name() {
    let place = Place::new();
    let room = ["GRANULCAL_NO_LIMITS", "memory"];
    place.refused(&["simulate", "drop", "--set", "grains.count=1e8"], &room);
    place.refused(&["render", "drop", "--set", "grains.count=1e8", "-o", "a.png"], &room);
    place.refused(&["generate", "drop", "default", "--set", "grains.count=1e8", "-o", "d"], &room);
    let disk = ["GRANULCAL_NO_LIMITS", "disk"];
    place.refused(&["generate", "drop", "default", "-n", "200000000000000", "-o", "d"], &disk);
    let film = [&["simulate", "drop", "--mcap", "a.mcap", "--fps", "1e12"][..], &TINY].concat();
    place.refused(&film, &disk);
    let wide = "start = { kind = \"cylinder\", from = [0.0, 0.0, 0.0], to = [0.0, 0.0, 1e9], radius = 0.5, \
                spacing = 0.005, jitter = 0.0 }";
    let scene = format!(
        "name = \"tube\"\n{wide}\n[grains]\ncount = 30\ndiameter = 0.004\ndensity = 1300.0\n"
    );
    place.write("tube.toml", scene);
    place.refused(&["simulate", "tube.toml"], &["smaller cylinder", "e"]);
}

#[test]
fn more_threads_than_there_can_be_are_as_many_as_there_can_be() {
    let place = Place::new();
    let one = place.expect(0, &[&["simulate", "drop", "--json"][..], &TINY].concat());
    let many = [&["simulate", "drop", "--json", "--threads", "1000000"][..], &TINY].concat();
    let many = place.expect(0, &many);
    assert_eq!(place::json(&one)["state_hash"], place::json(&many)["state_hash"]);
    let batch = ["generate", "drop", "default", "-n", "3", "--threads", "100000", "-o", "d"];
    let output = place.run(&[&batch[..], &TINY].concat());
    assert!(matches!(output.status.code(), Some(0 | 3)), "{}", text(&output.stderr));
}

/// `ulimit -u` does not bind root, who takes another user's place where that can be done.
#[cfg(target_os = "linux")]
#[test]
fn a_batch_for_which_no_thread_is_started_ends_with_a_message() {
    use std::fs;
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    use std::process::Command;

    let place = Place::new();
    fs::set_permissions(place.at(""), PermissionsExt::from_mode(0o777)).unwrap();
    let is_root = fs::metadata("/proc/self").unwrap().uid() == 0;
    let mut command = if is_root {
        let mut command = Command::new("setpriv");
        command.args(["--reuid=65534", "--clear-groups", "sh"]);
        command
    } else {
        Command::new("sh")
    };
    let args = ["generate", "drop", "default", "-n", "3", "--threads", "2", "-o", "d"];
    // The one shell calls it u, the other p.
    let limited = "ulimit -u 1 2>/dev/null || ulimit -p 1 || exit 127; exec \"$0\" \"$@\"";
    let output = command
        .args(["-c", limited, env!("CARGO_BIN_EXE_granulcal-cli")])
        .args([&args[..], &TINY].concat())
        .current_dir(place.at(""))
        .output();
    let Some(output) = output.ok().filter(|o| !matches!(o.status.code(), Some(126 | 127))) else {
        eprintln!("skipped: the program cannot be run as another user");
        return;
    };
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("no thread can be started") && !said.contains("panicked"), "{said}");
}

/// What goes on for much longer than the test, and does not look at the time: millions of grains are put in place.
#[cfg(unix)]
fn long(place: &Place) -> std::process::Child {
    let count = ["simulate", "drop", "--set", "grains.count=1000000", "--checkpoint", "a.ckpt"];
    let mut command = place.command(&count);
    command.env("GRANULCAL_NO_LIMITS", "1").stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().unwrap()
}

/// Waits for the end, which a command that minds no signal would not come to.
#[cfg(unix)]
fn ended(child: &mut std::process::Child) -> Option<i32> {
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(60) {
        if let Some(status) = child.try_wait().unwrap() {
            return status.code();
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    child.kill().unwrap();
    panic!("still running a minute after Ctrl-C");
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_what_does_not_look_and_twice_at_once() {
    for times in [1, 2] {
        let place = Place::new();
        let mut child = long(&place);
        std::thread::sleep(Duration::from_millis(400));
        for _ in 0..times {
            assert!(interrupt(&child));
            std::thread::sleep(Duration::from_millis(20));
        }
        assert_eq!(ended(&mut child), Some(130));
        let left: Vec<_> = place.listing();
        assert!(left.iter().all(|path| !path.to_string_lossy().ends_with(".tmp")), "{left:?}");
    }
}
