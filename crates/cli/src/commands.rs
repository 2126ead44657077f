//! The commands: a file each, which holds arguments, help and what is done, and a line in the list below.

mod completions;
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

use clap::{Parser, Subcommand};

use crate::args::Global;
use crate::outcome::Outcome;
use crate::run::{Run, Setting};

/// Makes [`Command`] of the one list of all commands.
macro_rules! commands {
    ($($word:ident: $arguments:ty,)*) => {
        /// What can be done.
        #[derive(Debug, Subcommand)]
        pub enum Command {
            $($word($arguments),)*
        }

        impl Run for Command {
            fn run(&self, setting: &Setting<'_>) -> anyhow::Result<Outcome> {
                match self {
                    $(Self::$word(arguments) => arguments.run(setting),)*
                }
            }
        }
    };
}

// In the order of the help.
commands! {
    Scene: scene::PrintSceneArgs,
    Simulate: simulate::SimulateArgs,
    Generate: generate::GenerateArgs,
    Render: render::RenderArgs,
    Features: features::FeaturesArgs,
    Infer: infer::InferArgs,
    FitSensor: fit_sensor::FitSensorArgs,
    PickColour: pick_colour::PickColourArgs,
    Inspect: inspect::InspectArgs,
    Merge: merge::MergeArgs,
    Completions: completions::CompletionsArgs,
}

/// Calibrates a granular simulator from depth images: pours grains, looks at them, describes them.
#[derive(Debug, Parser)]
#[command(name = "granulcal-cli", version, propagate_version = true, arg_required_else_help = true)]
#[command(after_help = "\
Start here:
  granulcal-cli simulate funnel                       one pour, its health and its 16 statistics
  granulcal-cli generate funnel default -n 100 -o d   100 pours with unknown material, as Parquet
  granulcal-cli features pile.bag                     the same statistics of a measured pile
  granulcal-cli infer model pile.bag                  its material, by a model of `granulcal train`

Exit codes: 0 done, 1 failed, 2 bad arguments or input, 3 done but some pours unhealthy or without
grains in view, rows missing in what is merged, some frames of a recording lost, or a recording
outside the model, 130 stopped. Results go to stdout, progress and messages to stderr.")]
pub struct Cli {
    #[command(flatten)]
    pub global: Global,
    #[command(subcommand)]
    pub command: Command,
}

#[cfg(test)]
mod tests {
    use std::any::TypeId;
    use std::ffi::OsString;
    use std::path::PathBuf;

    use clap::CommandFactory;

    use super::*;

    #[test]
    fn arguments_are_consistent() {
        Cli::command().debug_assert();
    }

    /// Commands without an option that the others have, and why.
    const WITHOUT: [(&str, &str, &str); 11] = [
        ("json", "completions", "what it prints is a script"),
        ("dry_run", "scene", "no pour"),
        ("dry_run", "simulate", "one pour, whose line says how far it is"),
        ("dry_run", "render", "one pour, whose line says how far it is"),
        ("dry_run", "features", "reads a recording: seconds"),
        ("dry_run", "infer", "evaluates a trained model: seconds"),
        ("dry_run", "fit-sensor", "reads recordings: seconds"),
        ("dry_run", "pick-colour", "reads an image"),
        ("dry_run", "inspect", "reads a file"),
        ("dry_run", "merge", "reads files"),
        ("dry_run", "completions", "no pour"),
    ];

    #[test]
    fn every_command_takes_json_and_says_how_long_it_would_take() {
        for option in ["json", "dry_run"] {
            for command in Cli::command().get_subcommands() {
                let name = command.get_name();
                let has = command.get_arguments().any(|argument| argument.get_id() == option);
                let is_without = WITHOUT.iter().any(|&(o, word, _)| (o, word) == (option, name));
                assert!(has != is_without, "{name}: {option}");
            }
        }
    }

    /// On a terminal of 80 columns lines that are longer break in the middle of a sentence, or of an example.
    #[test]
    fn descriptions_fit_80_columns() {
        // A path that cannot be broken.
        let is_path = |line: &str| line.contains("bash-completion/completions");
        for command in Cli::command().get_subcommands() {
            let text = command.get_long_about().map(ToString::to_string).unwrap_or_default();
            let long: Vec<_> =
                text.lines().filter(|line| line.chars().count() > 80 && !is_path(line)).collect();
            assert!(long.is_empty(), "{}: {long:?}", command.get_name());
        }
    }

    /// A path that does not say whether it is read or written escapes the check of `args/paths.rs`.
    #[test]
    fn every_path_says_whether_it_is_read_or_written() {
        fn walk(command: &clap::Command, found: &mut Vec<String>) {
            for argument in command.get_arguments() {
                let kind = argument.get_value_parser().type_id();
                if kind == TypeId::of::<PathBuf>() || kind == TypeId::of::<OsString>() {
                    found.push(format!("{} {}", command.get_name(), argument.get_id()));
                }
                // Texts that are no paths are known by name: a new one is to be checked.
                let is_text = kind == TypeId::of::<String>();
                let texts =
                    ["topic", "camera_topic", "colour_topic", "view", "engine", "ray", "ray_store"];
                if is_text && !texts.contains(&argument.get_id().as_str()) {
                    found.push(format!("{} {}", command.get_name(), argument.get_id()));
                }
            }
            command.get_subcommands().for_each(|below| walk(below, found));
        }
        let mut found = Vec::new();
        walk(&Cli::command(), &mut found);
        assert!(found.is_empty(), "neither Reads nor Writes: {found:?}");
    }
}
