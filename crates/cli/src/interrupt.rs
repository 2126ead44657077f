//! Ctrl-C, termination signals and limits of the shell: asked once, a command ends by itself, or the process is ended
//! after a second; asked twice, at once. A file that is just being written is finished first, or removed where it is
//! only half there.

use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use crate::context::note;

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

/// Takes the signals of the process, but for those that its parent ignores: `nohup` is to outlive its terminal, and a
/// job in a script's background the script's Ctrl-C. A program that has handlers of its own calls [`listen`] instead.
pub fn handle_signals() {
    #[cfg(not(target_os = "linux"))]
    if let Err(error) = take_asking() {
        unheard(&error);
    }
    #[cfg(unix)]
    if let Err(error) = take_by_number() {
        unheard(&error);
    }
}

/// A command is of use without this, too: a signal ends the process then as the system does.
fn unheard(error: &dyn std::fmt::Display) {
    note(&format!("warning: Ctrl-C and the like end a command without its last rows: {error}"));
}

/// Takes what asks to end where one cannot look up what the parent ignores: all of it, or nothing if any of it is
/// ignored.
#[cfg(not(target_os = "linux"))]
fn take_asking() -> Result<(), ctrlc::Error> {
    let taken = ctrlc::try_set_handler(|| {
        if RUNNING.load(Ordering::SeqCst) == 0 {
            end();
        }
        asked();
    });
    match taken {
        // Taken already, which does the same.
        Err(ctrlc::Error::MultipleHandlers) => Ok(()),
        // What is not the system's own handling stays, and the system does the rest.
        Err(ctrlc::Error::System(error)) if error.kind() == std::io::ErrorKind::AlreadyExists => {
            Ok(())
        }
        other => other,
    }
}

/// Takes what asks to end, and what a limit of the shell does: a file that is as long as `ulimit -f` allows is one that
/// cannot be written, and processor time that is used up (`ulimit -t`) stops the command as Ctrl-C does.
#[cfg(unix)]
fn take_by_number() -> std::io::Result<()> {
    use signal_hook::consts::{SIGXCPU, SIGXFSZ};

    #[cfg(target_os = "linux")]
    let numbers = {
        use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
        let ignored = ignored_by_parent();
        [SIGHUP, SIGINT, SIGTERM, SIGXCPU, SIGXFSZ]
            .into_iter()
            .filter(move |number| (ignored >> (number - 1)) & 1 == 0)
    };
    #[cfg(not(target_os = "linux"))]
    let numbers = [SIGXCPU, SIGXFSZ].into_iter();

    let (taken, is_taken) = std::sync::mpsc::sync_channel(1);
    // Before the first handler: what is taken and not heard would not end the process at all.
    std::thread::Builder::new().name("signals".to_owned()).spawn(move || {
        let mut signals = match signal_hook::iterator::Signals::new(numbers) {
            Ok(signals) => signals,
            Err(error) => return drop(taken.send(Err(error))),
        };
        let _ = taken.send(Ok(()));
        for signal in signals.forever() {
            match signal {
                SIGXFSZ => {}
                _ if RUNNING.load(Ordering::SeqCst) > 0 => asked(),
                // What a limit of time does between two commands is the system's to do, and it asks again.
                SIGXCPU => {}
                _ => end(),
            }
        }
    })?;
    is_taken.recv().unwrap_or(Ok(()))
}

/// A bit for each signal that the process was started to ignore, that of number 1 first; none where the system does not
/// say.
#[cfg(target_os = "linux")]
fn ignored_by_parent() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
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
    let wait = move || {
        std::thread::sleep(GRACE);
        while RUNNING.load(Ordering::SeqCst) == running {
            if !granulcal_dataset::is_writing() {
                note("stopped");
                end();
            }
            std::thread::sleep(PATIENCE);
        }
    };
    if std::thread::Builder::new().spawn(wait).is_err() {
        // There is no further thread: this one waits, and does not hear whoever asks twice.
        wait();
    }
}

/// Does the same for every byte of such a signal that is read from a pipe, until it is closed: Python writes the
/// numbers of signals into one as soon as they come, whatever the interpreter is busy with.
///
/// What comes after the returned command is dropped is not heard.
///
/// # Errors
/// If there is no such pipe, or no thread to read it.
pub fn listen(pipe: &Path) -> std::io::Result<Armed> {
    let mut pipe = File::open(pipe)?;
    let armed = arm();
    std::thread::Builder::new().spawn(move || {
        let mut signal = [0];
        while pipe.read_exact(&mut signal).is_ok() {
            // SIGHUP, SIGINT and SIGTERM, which have these numbers everywhere, and SIGXCPU of Linux and macOS.
            if matches!(signal[0], 1 | 2 | 15 | 24) {
                asked();
            }
        }
    })?;
    Ok(armed)
}

fn end() -> ! {
    granulcal_dataset::remove_temporaries();
    std::process::exit(CODE);
}
