//! `completions`: a script that completes the commands in a shell.

use std::any::TypeId;

use clap::{Arg, Args, Command, ValueHint};
use clap_complete::Shell;

use crate::args::paths::{Reads, Writes};
use crate::context::print_line;
use crate::outcome::Outcome;
use crate::run::{Run, Setting};

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

impl Run for CompletionsArgs {
    fn run(&self, setting: &Setting<'_>) -> anyhow::Result<Outcome> {
        let mut script = Vec::new();
        clap_complete::generate(
            self.shell,
            &mut with_path_hints(setting.whole.clone()),
            setting.binary,
            &mut script,
        );
        print_line(String::from_utf8_lossy(&script).trim_end())?;
        Ok(Outcome::Done)
    }
}

/// The parser whose paths are completed as paths.
fn with_path_hints(command: Command) -> Command {
    let is_path = |argument: &Arg| {
        let kind = argument.get_value_parser().type_id();
        kind == TypeId::of::<Reads>() || kind == TypeId::of::<Writes>()
    };
    command.mut_subcommands(|below| {
        below.mut_args(|argument| {
            if is_path(&argument) { argument.value_hint(ValueHint::AnyPath) } else { argument }
        })
    })
}
