//! One file per command; here only the dispatch.

pub mod completions;
mod features;
mod fit_sensor;
mod generate;
mod infer;
mod inspect;
mod merge;
mod pick_colour;
mod render;
mod scene;
mod simulate;

use crate::args::Command;
use crate::context::Context;
use crate::outcome::Outcome;
use crate::program::Program;

/// Runs a command.
///
/// # Errors
/// Whatever went wrong, to be printed once.
pub fn dispatch(context: &Context, program: &Program, command: Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Scene(args) => scene::run(&args),
        Command::Simulate(args) => simulate::run(context, &args),
        Command::Generate(args) => generate::run(context, &args),
        Command::Render(args) => render::run(context, &args),
        Command::Features(args) => features::run(&args),
        Command::Infer(args) => infer::run(&args),
        Command::FitSensor(args) => fit_sensor::run(&args),
        Command::PickColour(args) => pick_colour::run(&args),
        Command::Inspect(args) => inspect::run(&args),
        Command::Merge(args) => merge::run(&args),
        Command::Completions(args) => completions::run(program, &args),
    }
}
