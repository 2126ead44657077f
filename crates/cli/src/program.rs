//! Whose commands these are: `granulcal-cli` alone, or the wheel's `granulcal` with commands of its own beside them.

use std::ffi::OsString;

use clap::{Arg, ArgAction, Command, CommandFactory};
use serde::Deserialize;

use crate::commands::Cli;

/// What the commands call themselves in their help unless told otherwise.
const NAME: &str = "granulcal-cli";

/// The program that the commands are part of.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Program {
    /// What it is called.
    pub name: String,
    /// What stands at the end of its help.
    pub after_help: String,
    /// Commands that it runs itself; here they are known to help, completions and suggestions.
    pub further: Vec<Further>,
}

/// A command of somebody else.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Further {
    /// The word.
    pub name: String,
    /// What it does, in a line.
    pub about: String,
    /// Its options.
    pub options: Vec<FurtherOption>,
    /// Its own commands.
    pub commands: Vec<Further>,
}

/// An option of a command of somebody else.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FurtherOption {
    /// The word after two dashes.
    pub long: String,
    /// The letter after one dash.
    pub short: Option<char>,
    /// What it does.
    pub help: String,
    /// Whether a value follows.
    pub takes_value: bool,
    /// The values that it may have; any if there is none.
    pub values: Vec<String>,
}

impl Further {
    fn command(self) -> Command {
        let arguments = self.options.into_iter().map(FurtherOption::argument);
        let commands = self.commands.into_iter().map(Further::command);
        // Only the program has a version.
        let command = Command::new(self.name).about(self.about).disable_version_flag(true);
        command.args(arguments).subcommands(commands)
    }
}

impl FurtherOption {
    fn argument(self) -> Arg {
        let action = if self.takes_value { ArgAction::Append } else { ArgAction::SetTrue };
        let mut argument =
            Arg::new(self.long.clone()).long(self.long.clone()).help(self.help).action(action);
        if self.takes_value {
            argument = argument.value_name(self.long.to_uppercase());
        }
        if let Some(short) = self.short {
            argument = argument.short(short);
        }
        if !self.values.is_empty() {
            argument = argument.value_parser(self.values);
        }
        argument
    }
}

impl Program {
    /// The commands of this crate and those of the program, all by its name.
    pub fn command(&self) -> Command {
        if self.name.is_empty() {
            return Cli::command();
        }
        let mut whole = Cli::command().name(self.name.clone());
        for further in self.further.iter().cloned() {
            let name = further.name.clone();
            // A command of both is the program's.
            whole = match whole.find_subcommand(&name) {
                Some(_) => whole.mut_subcommand(name, |_| further.command()),
                None => whole.subcommand(further.command()),
            };
        }
        called(whole, &self.name).after_help(self.after_help.clone())
    }

    /// The name of the binary.
    pub fn binary(&self) -> &str {
        if self.name.is_empty() { NAME } else { &self.name }
    }

    /// Whether the first word is a command of the program's own, which cannot be run here.
    pub fn is_further(&self, args: &[OsString]) -> bool {
        let word = args.get(1).and_then(|word| word.to_str());
        self.further.iter().any(|further| Some(further.name.as_str()) == word)
    }
}

/// A command whose texts name the program `name`.
fn called(mut command: Command, name: &str) -> Command {
    let renamed = |text: Option<&clap::builder::StyledStr>| {
        text.map(|text| text.to_string().replace(NAME, name))
    };
    if let Some(text) = renamed(command.get_long_about()) {
        command = command.long_about(text);
    }
    if let Some(text) = renamed(command.get_about()) {
        command = command.about(text);
    }
    command.mut_subcommands(|inner| called(inner, name))
}
