//! Ctrl-C and termination signals: asked once, a command ends by itself, or the process is ended after a second; asked
//! twice, at once. A file that is just being written is finished first, or removed where it is only half there.

use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;

/// How long a command has to end by itself.
const GRACE: Duration = Duration::from_millis(800);
/// Time between two looks whether a file is written.
const PATIENCE: Duration = Duration::from_millis(10);
/// As shells report a process that SIGINT ended.
const CODE: i32 = 130;

/// One of each for the process, as the signals are.
static STOP: AtomicBool = AtomicBool::new(false);
static ASKED: AtomicUsize = AtomicUsize::new(0);
/// Number of the command that runs; 0 while there is none.
static RUNNING: AtomicU64 = AtomicU64::new(0);
static STARTED: AtomicU64 = AtomicU64::new(0);

/// A command that runs; when it is dropped nothing ends the process any more.
pub struct Armed {
    /// The command that it runs inside of.
    outer: u64,
}

/// Begins a command.
pub fn arm() -> Armed {
    STOP.store(false, Ordering::SeqCst);
    ASKED.store(0, Ordering::SeqCst);
    let outer = RUNNING.swap(STARTED.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
    Armed { outer }
}

impl Drop for Armed {
    fn drop(&mut self) {
        RUNNING.store(self.outer, Ordering::SeqCst);
    }
}

/// Whether the user has not asked to stop.
pub fn keeps_going() -> bool {
    !STOP.load(Ordering::Relaxed)
}

/// What a signal does.
pub fn asked() {
    STOP.store(true, Ordering::SeqCst);
    let running = RUNNING.load(Ordering::SeqCst);
    if ASKED.fetch_add(1, Ordering::SeqCst) > 0 {
        end();
    }
    if running == 0 {
        return;
    }
    std::thread::spawn(move || {
        std::thread::sleep(GRACE);
        while RUNNING.load(Ordering::SeqCst) == running {
            if !granulcal_dataset::is_writing() {
                // If even stderr is closed there is no one to tell.
                let _ = writeln!(std::io::stderr(), "stopped");
                end();
            }
            std::thread::sleep(PATIENCE);
        }
    });
}

/// Does the same for every byte SIGINT that is read from a pipe, until it is closed: Python writes the numbers of
/// signals into one as soon as they come, whatever the interpreter is busy with.
///
/// # Errors
/// If there is no such pipe.
pub fn listen(pipe: &Path) -> std::io::Result<()> {
    let mut pipe = File::open(pipe)?;
    let armed = arm();
    std::thread::spawn(move || {
        let _armed = armed;
        let mut signal = [0];
        while pipe.read_exact(&mut signal).is_ok() {
            // SIGINT and SIGTERM, which have these numbers everywhere.
            if matches!(signal[0], 2 | 15) {
                asked();
            }
        }
    });
    Ok(())
}

fn end() -> ! {
    granulcal_dataset::remove_temporaries();
    std::process::exit(CODE);
}
