//! What a command reads and what it writes, checked in one place before anything runs: no output is an input, none
//! replaces a file of another kind, and each can be written.

mod product;

use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};

use crate::{DatasetError, Form, MANIFEST, files};
pub use product::Product;

/// Endings of the files that a folder that is a recording is read from.
const FRAMES: [&str; 4] = ["png", "npz", "mcap", "bag"];
/// Files that a folder that is no recording is read from, besides its parts.
const READ_FROM_FOLDERS: [&str; 5] =
    [MANIFEST, "model.json", "weights.safetensors", "training.parquet", "loop.toml"];
/// Documents that name documents that name files: a task, its scene, the scene's mesh.
const DEPTH: usize = 3;
/// Entries of a folder that are examined.
const MOST_ENTRIES: usize = 100_000;

/// How a path is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Input {
    /// A file with what it names, or a folder of a data set or a model.
    #[default]
    File,
    /// A recording: of a folder, every frame.
    Recording,
    /// What the command itself writes on: an archive of pours, a checkpoint.
    Kept,
}

/// The inputs and outputs of one command, each with the argument that names it.
#[derive(Clone, Debug, Default)]
pub struct Claims {
    inputs: Vec<(String, PathBuf, Input)>,
    outputs: Vec<(String, PathBuf, Product)>,
}

/// A file that is read, by what the system knows it as.
type Identity = (u64, u64);

impl Claims {
    /// Adds a path that is read; a word that is no file does no harm.
    pub fn read(&mut self, argument: &str, path: &Path, input: Input) {
        self.inputs.push((argument.to_owned(), path.to_owned(), input));
    }

    /// Adds a path that is written.
    pub fn write(&mut self, argument: &str, path: &Path, product: Product) {
        self.outputs.push((argument.to_owned(), path.to_owned(), product));
    }

    /// Checks all of it; nothing is changed on the disk.
    ///
    /// # Errors
    /// [`DatasetError::Output`] names the argument, what is wrong and what helps.
    pub fn check(&self) -> Result<(), DatasetError> {
        let mut read = Vec::new();
        for (argument, path, input) in &self.inputs {
            collect(path, *input, argument, DEPTH, &mut read);
        }
        let mut taken: Vec<(PathBuf, &str)> = Vec::new();
        for (argument, path, product) in &self.outputs {
            let refuse =
                |reason: String| Err(DatasetError::Output { argument: argument.clone(), reason });
            if let Some(reason) = product.unfit_place(path) {
                return refuse(reason);
            }
            if *product == Product::PICTURES
                && let Some(frame) = foreign_frame(path)
            {
                return refuse(format!(
                    "{} is a depth image that granulcal did not write, and pictures beside it would be read as further \
                     frames of its recording; choose another folder",
                    frame.display()
                ));
            }
            for (file, form) in product.files(path) {
                let shown = file.display();
                let is_read =
                    |(identity, _): &&(Identity, String)| Some(*identity) == identity_of(&file);
                if let Some((_, reader)) = read.iter().find(is_read) {
                    return refuse(format!(
                        "{shown} is read by this command ({reader}) and would be replaced; choose another name"
                    ));
                }
                if let Some(reason) = self.among_frames(&file) {
                    return refuse(reason);
                }
                let place = whole(&file);
                if let Some((_, other)) = taken.iter().find(|(path, _)| *path == place) {
                    return refuse(format!(
                        "{shown} is written by {other}, too; choose another name"
                    ));
                }
                taken.push((place, argument));
                let replaceable = files::place_of(&file)
                    .and_then(|at| files::require_replaceable(&at, form, &file));
                if let Err(error) = replaceable {
                    return refuse(told(&error));
                }
            }
        }
        Ok(())
    }

    /// Why a new image would be read as one of a recording's frames, if it would.
    fn among_frames(&self, file: &Path) -> Option<String> {
        let is_frame =
            file.extension().is_some_and(|end| FRAMES.iter().any(|e| end.eq_ignore_ascii_case(e)));
        let folder = file.parent().and_then(identity_of)?;
        let holds = |(_, path, input): &&(String, PathBuf, Input)| {
            *input == Input::Recording && path.is_dir() && identity_of(path) == Some(folder)
        };
        let (_, recording, _) = self.inputs.iter().filter(|_| is_frame).find(holds)?;
        let (file, recording) = (file.display(), recording.display());
        Some(format!(
            "{file} would become a frame of the recording {recording}; choose another folder"
        ))
    }
}

/// A depth image in a folder that is no work of granulcal.
fn foreign_frame(folder: &Path) -> Option<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().take(MOST_ENTRIES);
    let mut pngs = entries
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|end| end.eq_ignore_ascii_case("png")));
    pngs.find(|path| {
        // 16 bits of grey, as the first chunk says.
        let is_depth = files::head(path).is_ok_and(|head| head.get(24..26) == Some(&[16, 0]));
        is_depth && files::require_replaceable(path, Form::Png, path).is_err()
    })
}

/// Adds the files that are read with `path`, each with who reads it.
fn collect(
    path: &Path,
    input: Input,
    reader: &str,
    depth: usize,
    read: &mut Vec<(Identity, String)>,
) {
    if input == Input::Kept {
        return;
    }
    if path.is_dir() {
        let entries = fs::read_dir(path).into_iter().flatten().flatten().take(MOST_ENTRIES);
        for entry in entries {
            let (file, name) = (entry.path(), entry.file_name());
            let name = name.to_string_lossy();
            let is_frame = || {
                file.extension()
                    .is_some_and(|end| FRAMES.iter().any(|e| end.eq_ignore_ascii_case(e)))
            };
            let is_part = || name.starts_with("part-") && name.ends_with(".parquet");
            let is_read = match input {
                Input::Recording => is_frame(),
                _ => is_part() || READ_FROM_FOLDERS.contains(&&*name),
            };
            if is_read {
                collect(&file, Input::File, reader, depth, read);
            }
        }
        return;
    }
    let Some(identity) = identity_of(path) else { return };
    read.push((identity, reader.to_owned()));
    let is_document = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("toml"));
    if depth > 0 && is_document {
        let folder = path.parent().unwrap_or(Path::new(""));
        for name in names_in(path) {
            let named = folder.join(&name);
            let who = format!("{reader}, which names {name}");
            let input = if named.is_dir() { Input::Recording } else { Input::File };
            collect(&named, input, &who, depth - 1, read);
        }
    }
}

/// Every text in a document that may be the name of a file.
fn names_in(document: &Path) -> HashSet<String> {
    let mut names = HashSet::new();
    let table = files::read_text(document).ok().and_then(|text| text.parse::<toml::Table>().ok());
    let mut left: Vec<_> = table.into_iter().map(toml::Value::Table).collect();
    while let Some(value) = left.pop() {
        match value {
            toml::Value::String(text) if !text.is_empty() && !text.contains('\n') => {
                names.insert(text);
            }
            toml::Value::Array(values) => left.extend(values),
            toml::Value::Table(table) => left.extend(table.into_iter().map(|(_, value)| value)),
            _ => {}
        }
    }
    names
}

/// Device and number of a file, links followed.
#[cfg(unix)]
fn identity_of(path: &Path) -> Option<Identity> {
    use std::os::unix::fs::MetadataExt;
    // A folder without a name is the one that one is in.
    let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
    fs::metadata(path).ok().map(|metadata| (metadata.dev(), metadata.ino()))
}

/// A hash of the whole path, where files have no numbers.
#[cfg(not(unix))]
fn identity_of(path: &Path) -> Option<Identity> {
    let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
    let path = fs::canonicalize(path).ok()?;
    Some((0, xxhash_rust::xxh3::xxh3_64(path.as_os_str().as_encoded_bytes())))
}

/// The path without links and dots, also of a file that does not exist yet.
fn whole(path: &Path) -> PathBuf {
    if let Ok(whole) = fs::canonicalize(path) {
        return whole;
    }
    let folder =
        path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match (fs::canonicalize(folder), path.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => path.to_owned(),
    }
}

/// An error with its cause, in one line.
fn told(error: &DatasetError) -> String {
    match std::error::Error::source(error) {
        Some(cause) => format!("{error}: {cause}"),
        None => error.to_string(),
    }
}

#[cfg(test)]
mod tests;
