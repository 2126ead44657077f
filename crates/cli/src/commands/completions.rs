//! `completions`: a script that completes the commands in a shell.

use crate::args::CompletionsArgs;
use crate::context::print_line;
use crate::outcome::Outcome;
use crate::program::Program;

pub fn run(program: &Program, args: &CompletionsArgs) -> anyhow::Result<Outcome> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut program.command(), program.binary(), &mut script);
    print_line(String::from_utf8_lossy(&script).trim_end())?;
    Ok(Outcome::Done)
}
