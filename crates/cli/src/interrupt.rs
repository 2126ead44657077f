//! Ctrl-C, termination signals and limits of the shell: asked once, a command ends by itself, or the process is ended
//! after a second; asked twice, at once. A file that is just being written is finished first, or removed where it is
//! only half there.

use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// How long a command has to end by itself.
const GRACE: Duration = Duration::from_millis(800);
/// Time between two checks whether a file is written.
const PATIENCE: Duration = Duration::from_millis(10);
/// As shells report a process that SIGINT ended.
const CODE: i32 = 130;

/// One of each for the process, as the signals are.
static STOP: AtomicBool = AtomicBool::new(false);
static ASKED: AtomicUsize = AtomicUsize::new(0);
/// Number of the command that runs; 0 while there is none.
static RUNNING: AtomicU64 = AtomicU64::new(0);
static STARTED: AtomicU64 = AtomicU64::new(0);
/// Commands that run inside of each other.
static DEPTH: Mutex<usize> = Mutex::new(0);

/// A command that runs; when the outermost is dropped nothing ends the process any more.
pub struct Armed(());

/// Begins a command. One that runs inside of another is stopped with it: what was asked of the outer stands.
pub fn arm() -> Armed {
    let mut depth = DEPTH.lock().unwrap_or_else(PoisonError::into_inner);
    if *depth == 0 {
        STOP.store(false, Ordering::SeqCst);
        ASKED.store(0, Ordering::SeqCst);
        RUNNING.store(STARTED.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
    }
    *depth += 1;
    Armed(())
}

impl Drop for Armed {
    fn drop(&mut self) {
        let mut depth = DEPTH.lock().unwrap_or_else(PoisonError::into_inner);
        *depth -= 1;
        if *depth == 0 {
            RUNNING.store(0, Ordering::SeqCst);
        }
    }
}

/// Takes the signals of the process. A program that has handlers of its own calls [`listen`] instead.
pub fn handle_signals() {
    // It fails only where a handler is set already, which does the same.
    let _ = ctrlc::set_handler(|| {
        if RUNNING.load(Ordering::SeqCst) == 0 {
            end();
        }
        asked();
    });
    #[cfg(unix)]
    outlive_limits();
}

/// What a limit of the shell does: a file that is as long as `ulimit -f` allows is one that cannot be written, and
/// processor time that is used up (`ulimit -t`) stops the command as Ctrl-C does.
#[cfg(unix)]
fn outlive_limits() {
    use signal_hook::consts::{SIGXCPU, SIGXFSZ};

    // A system that does not let them be taken ends the process, as before.
    let Ok(mut signals) = signal_hook::iterator::Signals::new([SIGXCPU, SIGXFSZ]) else { return };
    std::thread::spawn(move || {
        for signal in signals.forever() {
            if signal == SIGXCPU {
                asked();
            }
        }
    });
}

/// Whether the user has not asked to stop.
pub fn keeps_going() -> bool {
    !STOP.load(Ordering::Relaxed)
}

/// What a signal does.
fn asked() {
    let running = RUNNING.load(Ordering::SeqCst);
    if running == 0 {
        return;
    }
    STOP.store(true, Ordering::SeqCst);
    if ASKED.fetch_add(1, Ordering::SeqCst) > 0 {
        end();
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

/// Does the same for every byte of such a signal that is read from a pipe, until it is closed: Python writes the numbers
/// of signals into one as soon as they come, whatever the interpreter is busy with.
///
/// What comes after the returned command is dropped is not heard.
///
/// # Errors
/// If there is no such pipe.
pub fn listen(pipe: &Path) -> std::io::Result<Armed> {
    let mut pipe = File::open(pipe)?;
    let armed = arm();
    std::thread::spawn(move || {
        let mut signal = [0];
        while pipe.read_exact(&mut signal).is_ok() {
            // SIGHUP, SIGINT and SIGTERM, which have these numbers everywhere, and SIGXCPU of Linux and macOS.
            if matches!(signal[0], 1 | 2 | 15 | 24) {
                asked();
            }
        }
    });
    Ok(armed)
}

fn end() -> ! {
    granulcal_dataset::remove_temporaries();
    std::process::exit(CODE);
}
