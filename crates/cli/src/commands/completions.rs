//! `completions`: a script that completes the commands in a shell.

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use crate::args::Cli;
use crate::context::print_line;
use crate::outcome::Outcome;

/// Print a completion script for a shell
#[derive(Debug, Args)]
#[command(long_about = "\
Prints a completion script.

Example:
  granulcal-cli completions bash > ~/.local/share/bash-completion/completions/granulcal-cli")]
pub struct CompletionsArgs {
    /// Shell to write for
    pub shell: Shell,
}

pub fn run(args: &CompletionsArgs) -> anyhow::Result<Outcome> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "granulcal-cli", &mut script);
    print_line(String::from_utf8_lossy(&script).trim_end())?;
    Ok(Outcome::Done)
}
