//! Paths as arguments: each says whether it is read or written, so that one place can check them all.

use std::ffi::OsString;
use std::ops::Deref;
use std::path::{Path, PathBuf};

use clap::builder::{OsStringValueParser, TypedValueParser};
use clap::{ArgMatches, Command};
use granulcal_dataset::{Claims, DatasetError, Input, Product};

/// A path that a command reads.
#[derive(Clone, Debug)]
pub struct Reads {
    path: PathBuf,
    input: Input,
}

/// A path that a command writes.
#[derive(Clone, Debug)]
pub struct Writes {
    path: PathBuf,
    product: Product,
}

impl From<OsString> for Reads {
    fn from(word: OsString) -> Self {
        Self { path: word.into(), input: Input::File }
    }
}

impl Deref for Reads {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.path
    }
}

impl Deref for Writes {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.path
    }
}

/// A recording, of which each frame is read.
pub fn recording() -> impl TypedValueParser<Value = Reads> {
    OsStringValueParser::new().map(|word| Reads { path: word.into(), input: Input::Recording })
}

/// What the command itself writes on.
pub fn kept() -> impl TypedValueParser<Value = Reads> {
    OsStringValueParser::new().map(|word| Reads { path: word.into(), input: Input::Kept })
}

/// An output of this kind.
pub fn writes(product: Product) -> impl TypedValueParser<Value = Writes> {
    OsStringValueParser::new().map(move |word| Writes { path: word.into(), product })
}

/// Checks every path that a command line names: no output is an input, each can be written.
///
/// # Errors
/// [`DatasetError::Output`].
pub fn check(command: &Command, matches: &ArgMatches) -> Result<(), DatasetError> {
    let (mut command, mut matches) = (command, matches);
    let mut claims = Claims::default();
    loop {
        for argument in command.get_arguments() {
            let (id, name) = (argument.get_id().as_str(), shown(argument));
            // The wrong type is no error here: most arguments are no paths.
            for read in matches.try_get_many::<Reads>(id).ok().flatten().into_iter().flatten() {
                claims.read(&name, &read.path, read.input);
            }
            for write in matches.try_get_many::<Writes>(id).ok().flatten().into_iter().flatten() {
                claims.write(&name, &write.path, write.product);
            }
        }
        let Some((name, below)) = matches.subcommand() else { break };
        let Some(found) = command.find_subcommand(name) else { break };
        (command, matches) = (found, below);
    }
    claims.check()
}

/// An argument as the user writes it.
fn shown(argument: &clap::Arg) -> String {
    match argument.get_long() {
        Some(long) => format!("--{long}"),
        None => argument.get_id().as_str().to_uppercase(),
    }
}

#[cfg(test)]
mod tests;
