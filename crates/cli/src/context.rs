//! What every command gets: how loud to be, and whether the user wants to stop.

use std::borrow::Cow;
use std::io::{self, IsTerminal, Write};

use serde::Serialize;
use tracing_subscriber::filter::LevelFilter;

use crate::args::Global;
use crate::interrupt;

/// Options and state that all commands share.
#[derive(Debug)]
pub struct Context {
    /// No progress, no messages.
    pub quiet: bool,
    /// Whether somebody looks at stderr.
    pub terminal: bool,
}

impl Context {
    /// Sets up logging to stderr and the handler of Ctrl-C.
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
        let _ = ctrlc::set_handler(interrupt::asked);
        Self { quiet: global.quiet, terminal }
    }
}

/// A text in which nothing steers a terminal: names in a stranger's file may hold escapes.
fn plain(text: &str) -> Cow<'_, str> {
    let steers = |c: char| c.is_control() && !matches!(c, '\n' | '\t');
    if !text.contains(steers) {
        return Cow::Borrowed(text);
    }
    let told = |c: char| if steers(c) { c.escape_default().to_string() } else { c.to_string() };
    Cow::Owned(text.chars().map(told).collect())
}

/// Prints a line to stderr. If even that is closed there is no one left to tell.
pub fn note(line: &str) {
    let _ = writeln!(io::stderr(), "{}", plain(line));
}

/// Prints a line of results.
///
/// # Errors
/// What stdout says, a broken pipe above all.
pub fn print_line(line: &str) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    writeln!(out, "{}", plain(line))?;
    Ok(out.flush()?)
}

/// Prints one JSON object.
///
/// # Errors
/// As [`print_line`].
pub fn print_json(value: &impl Serialize) -> anyhow::Result<()> {
    print_line(&serde_json::to_string_pretty(value)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_text_steers_the_terminal() {
        assert_eq!(plain("a\tb\n"), "a\tb\n");
        assert_eq!(plain("\u{1b}[2Jtopic\u{7}"), "\\u{1b}[2Jtopic\\u{7}");
    }
}
