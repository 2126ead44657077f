//! What every command gets: how loud to be.

use std::io::{self, IsTerminal, Write};

use granulcal_dataset::{plain, readable};
use serde::Serialize;
use tracing_subscriber::filter::LevelFilter;

use crate::args::Global;

/// Options and state that all commands share.
#[derive(Debug)]
pub struct Context {
    /// No progress, no messages.
    pub quiet: bool,
    /// Whether somebody looks at stderr.
    pub terminal: bool,
}

impl Context {
    /// Sets up logging to stderr.
    pub fn new(global: &Global) -> Self {
        let level = match (global.quiet, global.verbose) {
            (true, _) => LevelFilter::ERROR,
            (false, 0) => LevelFilter::INFO,
            (false, 1) => LevelFilter::DEBUG,
            (false, _) => LevelFilter::TRACE,
        };
        let terminal = io::stderr().is_terminal();
        // A second call in one process (the wheel's) keeps what the first set up.
        let _ = tracing_subscriber::fmt()
            .with_max_level(level)
            .with_writer(io::stderr)
            .with_ansi(terminal)
            .without_time()
            .with_target(false)
            .try_init();
        Self { quiet: global.quiet, terminal }
    }
}

/// Prints a line to stderr, shortened where it quotes what is endless. If even that is closed there is no one left to
/// tell.
pub fn note(line: &str) {
    let _ = writeln!(io::stderr(), "{}", readable(line));
}

/// Prints a line of results. A reader that has gone away had enough: how the command ended is not changed by it.
///
/// # Errors
/// What stdout says otherwise, a disk that is full above all.
pub fn print_line(line: &str) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    match writeln!(out, "{}", plain(line)).and_then(|()| out.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => Ok(other?),
    }
}

/// Prints one JSON object.
///
/// # Errors
/// As [`print_line`].
pub fn print_json(value: &impl Serialize) -> anyhow::Result<()> {
    print_line(&serde_json::to_string_pretty(value)?)
}
