//! What a command is: arguments that can be run.

use crate::context::Context;
use crate::outcome::Outcome;

/// Where a command runs.
pub struct Setting<'a> {
    pub context: &'a Context,
    /// The parser of all commands, by the name of the program that they are part of.
    pub whole: &'a clap::Command,
    /// The name of the program's binary.
    pub binary: &'a str,
}

/// The arguments of a command.
pub trait Run {
    /// Runs the command.
    ///
    /// # Errors
    /// Whatever went wrong, to be printed once.
    fn run(&self, setting: &Setting<'_>) -> anyhow::Result<Outcome>;
}
