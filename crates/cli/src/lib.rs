//! The command line of granulcal.
//!
//! Results go to stdout, progress and messages to stderr. Exit codes are a contract:
//!
//! | code | meaning |
//! |---|---|
//! | 0 | done; a reader of stdout that goes away changes no code |
//! | 1 | failed: a disk that is full, a folder in use; the result is printed even if a file beside it failed |
//! | 2 | bad arguments or bad input |
//! | 3 | done, but pours unhealthy or without grains in view, rows missing, a recording damaged or outside the model |
//! | 130 | stopped by Ctrl-C or a termination signal; finished rows are kept |

mod args;
mod commands;
mod context;
mod edge;
pub mod interrupt;
mod outcome;
mod program;
mod progress;
mod rows;
mod run;
mod scene;
mod sides;

use std::ffi::OsString;

use clap::FromArgMatches;

use commands::Cli;
use context::Context;
pub use program::{Further, FurtherOption, Program};
use run::{Run, Setting};

/// Runs one command line, the name of the program first, and returns its exit code.
///
/// ```
/// let args = ["granulcal-cli", "features", "--list"].map(Into::into);
/// assert_eq!(granulcal_cli::run(args), 0);
/// ```
pub fn run(args: impl IntoIterator<Item = OsString>) -> u8 {
    run_as(&Program::default(), args)
}

/// Runs one command line as a part of `program`, which has parsed none of it.
///
/// ```
/// let program = granulcal_cli::Program { name: "granulcal".to_owned(), ..Default::default() };
/// let args = ["granulcal", "features", "--list"].map(Into::into);
/// assert_eq!(granulcal_cli::run_as(&program, args), 0);
/// ```
pub fn run_as(program: &Program, args: impl IntoIterator<Item = OsString>) -> u8 {
    let args: Vec<_> = args.into_iter().collect();
    let mut command = program.command();
    let found = command.try_get_matches_from_mut(args.clone());
    let parsed = found.and_then(|found| {
        // The words of the program's own commands are known for help and completions alone.
        if program.is_further(&args) {
            let text = format!("{} runs this command itself", program.binary());
            return Err(command.error(clap::error::ErrorKind::InvalidSubcommand, text));
        }
        let cli = Cli::from_arg_matches(&found).map_err(|refusal| refusal.format(&mut command))?;
        Ok((cli, found))
    });
    let (cli, matches) = match parsed {
        Ok(parsed) => parsed,
        Err(refusal) => {
            // Help and version are no failures; if even stderr is closed there is no one to tell.
            let _ = refusal.print();
            return refusal.exit_code() as u8;
        }
    };
    let context = Context::new(&cli.global);
    let _armed = interrupt::arm();
    let checked = args::paths::check(&command, &matches).map_err(anyhow::Error::from);
    // Not the one that has parsed: its command `help` is closed.
    let whole = program.command();
    let setting = Setting { context: &context, whole: &whole, binary: program.binary() };
    match checked.and_then(|()| cli.command.run(&setting)) {
        Ok(outcome) => outcome.exit_code(),
        Err(error) => {
            context::note(&format!("error: {error:#}"));
            outcome::exit_code_of(&error)
        }
    }
}
