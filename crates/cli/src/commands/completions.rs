//! `completions`: a script that completes the commands in a shell.

use clap::CommandFactory;

use crate::args::{Cli, CompletionsArgs};
use crate::context::print_line;
use crate::outcome::Outcome;

pub fn run(args: &CompletionsArgs) -> anyhow::Result<Outcome> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "granulcal-cli", &mut script);
    print_line(String::from_utf8_lossy(&script).trim_end())?;
    Ok(Outcome::Done)
}
