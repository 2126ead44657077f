//! The manifest of a folder of parts: written first, it says what every part was made from.

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::header::{FIRST_ARITHMETIC, Header};
use crate::{DatasetError, Form, files};

/// Name of the document of a data set's folder, which says what its rows are of.
pub const NAME: &str = "manifest.toml";
/// The layout of folder and columns that this version writes.
const FORMAT: u64 = 1;

/// What stands in `manifest.toml`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Contents {
    format: u64,
    version: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    law: Option<u32>,
    #[serde(default = "first_arithmetic")]
    arithmetic: u32,
    seed: u64,
    chunk: u64,
    // Folders of before it was written have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    rows: Option<u64>,
    scene: String,
    prior: String,
}

/// Manifests of before it was written.
fn first_arithmetic() -> u32 {
    FIRST_ARITHMETIC
}

/// The header of a folder, the rows in each of its parts and of the whole data set.
#[derive(Clone, Debug)]
pub(crate) struct Manifest {
    pub(crate) header: Header,
    pub(crate) chunk: u64,
    /// The most rows that the data set was asked to have over all shards; `None` where it was not written down.
    pub(crate) rows: Option<u64>,
}

impl Manifest {
    /// Reads the manifest of a folder; `None` where there is none.
    pub(crate) fn read(folder: &Path) -> Result<Option<Self>, DatasetError> {
        let path = folder.join(NAME);
        if !path.exists() {
            return Ok(None);
        }
        let contents: Contents =
            toml::from_str(&files::read_text(&path)?).map_err(|source| DatasetError::Toml {
                path: path.clone(),
                what: "manifest",
                source: Box::new(source.into()),
            })?;
        let refuse = |what: &str, found: u64, allowed: &str| {
            Err(DatasetError::content(&path, what, found.to_string(), allowed))
        };
        if contents.format != FORMAT {
            return refuse("format", contents.format, &FORMAT.to_string());
        }
        if contents.chunk == 0 {
            return refuse("chunk", 0, "at least 1");
        }
        let Contents { version, law, arithmetic, seed, chunk, rows, scene, prior, .. } = contents;
        let header = Header::parse(&path, &scene, &prior, version, (law, arithmetic), seed)?;
        Ok(Some(Self { header, chunk, rows }))
    }

    /// Reads the manifest of a folder that must have one.
    pub(crate) fn of(folder: &Path) -> Result<Self, DatasetError> {
        let allowed = "present in the folder of a data set";
        Self::read(folder)?.ok_or_else(|| DatasetError::content(folder, NAME, "none", allowed))
    }

    /// Writes the manifest into its folder.
    pub(crate) fn write(&self, folder: &Path) -> Result<(), DatasetError> {
        let contents = Contents {
            format: FORMAT,
            version: self.header.version.clone(),
            law: self.header.law,
            arithmetic: self.header.arithmetic,
            seed: self.header.seed,
            chunk: self.chunk,
            rows: self.rows,
            scene: self.header.scene_toml.clone(),
            prior: self.header.prior_toml.clone(),
        };
        let text = toml::to_string_pretty(&contents)
            .map_err(|e| DatasetError::TomlWrite { what: "the manifest", source: Box::new(e) })?;
        files::write_file(&folder.join(NAME), Form::ManifestToml, text.as_bytes())
    }
}

/// The file of a chunk.
pub(crate) fn part_path(folder: &Path, chunk: u64) -> PathBuf {
    folder.join(part_name(chunk))
}

fn part_name(chunk: u64) -> String {
    format!("part-{chunk:06}.parquet")
}

/// The chunks whose parts lie in a folder, in order. `part-1.parquet` is none: the part of chunk 1 has another name.
pub(crate) fn parts(folder: &Path) -> Result<Vec<u64>, DatasetError> {
    let chunk_of = |name: &String| {
        let chunk = name.strip_prefix("part-")?.strip_suffix(".parquet")?.parse().ok()?;
        (part_name(chunk) == *name).then_some(chunk)
    };
    let mut chunks: Vec<u64> = names(folder)?.iter().filter_map(chunk_of).collect();
    chunks.sort_unstable();
    Ok(chunks)
}

/// Removes what a killed run left half written. The caller holds the folder's lock.
pub(crate) fn remove_leftovers(folder: &Path) -> Result<(), DatasetError> {
    for name in names(folder)? {
        let ours = name.starts_with(".part-") || name.starts_with(&format!(".{NAME}"));
        if ours && name.ends_with(files::TEMPORARY) {
            let path = folder.join(name);
            fs::remove_file(&path).map_err(DatasetError::io("remove", &path))?;
        }
    }
    Ok(())
}

fn names(folder: &Path) -> Result<Vec<String>, DatasetError> {
    let list = || DatasetError::io("list", folder);
    let entries = fs::read_dir(folder).map_err(list())?;
    let entries = entries.collect::<Result<Vec<_>, _>>().map_err(list())?;
    Ok(entries.iter().filter_map(|entry| entry.file_name().into_string().ok()).collect())
}
