//! Every command from the parser itself: whatever it writes, it replaces no input and no file of another kind.

use std::any::TypeId;
use std::fs;

use clap::{Arg, CommandFactory};

use super::*;
use crate::commands::Cli;

const TEXT: &str = "name = \"mine\"\n[grains]\ncount = 3\n";

fn is<T: 'static>(argument: &Arg) -> bool {
    argument.get_value_parser().type_id() == TypeId::of::<T>()
}

/// What an argument needs beside it.
fn needed(argument: &Arg) -> &'static [&'static str] {
    match argument.get_id().as_str() {
        "contact_problem" => &["--time", "0.1"],
        _ => &[],
    }
}

/// A command line: what must be given, and these arguments with these values.
fn line(command: &Command, given: &[(&Arg, &Path)], other: &Path) -> Vec<OsString> {
    let mut words = vec![OsString::from("granulcal-cli"), command.get_name().into()];
    let value_of = |argument: &Arg| {
        given.iter().find(|(one, _)| one.get_id() == argument.get_id()).map(|(_, path)| *path)
    };
    for argument in command.get_arguments().filter(|argument| !argument.is_positional()) {
        if let Some(value) = value_of(argument).or(argument.is_required_set().then_some(other)) {
            words.push(format!("--{}", argument.get_long().unwrap()).into());
            words.push(value.into());
            words.extend(needed(argument).iter().map(Into::into));
        }
    }
    for argument in command.get_positionals() {
        words.push(value_of(argument).unwrap_or(other).into());
    }
    words
}

/// Where an output of this kind puts its first file if that is to be `name`, and the output itself.
fn output_at(command: &Command, argument: &Arg, folder: &Path) -> (PathBuf, PathBuf) {
    // The product is in the value: parse one.
    let some = folder.join("some.npz");
    let words = line(command, &[(argument, &some)], Path::new("other"));
    let matches = Cli::command().try_get_matches_from(words).unwrap();
    let (_, matches) = matches.subcommand().unwrap();
    let product = matches.get_one::<Writes>(argument.get_id().as_str()).unwrap().product;
    match product {
        Product::Folder(files) => (folder.to_owned(), folder.join(files[0].0)),
        Product::View => (folder.join("mine.png"), folder.join("mine.toml")),
        Product::Ending(endings) => {
            let file = folder.join("mine").with_extension(endings[0].0);
            (file.clone(), file)
        }
        Product::File(_) | Product::Figure | Product::Export => {
            (folder.join("mine.toml"), folder.join("mine.toml"))
        }
    }
}

#[test]
fn no_command_replaces_an_input_or_a_toml_of_another_kind() {
    let place = tempfile::tempdir().unwrap();
    let other = place.path().join("other");
    let (mut outputs, mut pairs) = (0, 0);
    for command in Cli::command().get_subcommands() {
        let arguments: Vec<_> = command.get_arguments().collect();
        for (i, output) in arguments.iter().filter(|one| is::<Writes>(one)).enumerate() {
            outputs += 1;
            let folder = place.path().join(format!("{}-{i}", command.get_name()));
            fs::create_dir(&folder).unwrap();
            let (path, victim) = output_at(command, output, &folder);
            fs::write(&victim, TEXT).unwrap();
            let mut lines = vec![line(command, &[(output, &path)], &other)];
            for input in arguments.iter().filter(|one| is::<Reads>(one)) {
                if input.get_id() != "resume" {
                    lines.push(line(command, &[(output, &path), (input, &victim)], &other));
                    pairs += 1;
                }
            }
            for words in lines {
                assert_eq!(crate::run(words.clone()), 2, "{words:?}");
                assert_eq!(fs::read_to_string(&victim).unwrap(), TEXT, "{words:?}");
                assert_eq!(fs::read_dir(&folder).unwrap().count(), 1, "{words:?}");
            }
        }
    }
    assert!(outputs >= 12 && pairs >= 30, "{outputs} outputs, {pairs} pairs");
}

#[test]
fn a_checkpoint_may_be_gone_on_from_and_written_again() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("a.ckpt");
    fs::write(&path, "granulcal checkpoint\n").unwrap();
    let words = ["granulcal-cli", "simulate", "drop", "--checkpoint", path.to_str().unwrap()];
    let words = [&words[..], &["--resume", path.to_str().unwrap()]].concat();
    let mut parser = Cli::command();
    let matches = parser.try_get_matches_from_mut(words).unwrap();
    check(&parser, &matches).unwrap();
}
