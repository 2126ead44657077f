//! What a file says of its rows beside them, by key: the header, units, hashes, and how many rows were asked for.

use std::collections::BTreeMap;
use std::path::Path;
use std::str::FromStr;

use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::reader::{FileReader, SerializedFileReader};

use super::columns::Column;
use crate::DatasetError;
use crate::header::{FIRST_ARITHMETIC, Header};

const SCENE_KEY: &str = "granulcal.scene";
const PRIOR_KEY: &str = "granulcal.prior";
const VERSION_KEY: &str = "granulcal.version";
const LAW_KEY: &str = "granulcal.law";
const ARITHMETIC_KEY: &str = "granulcal.arithmetic";
const SEED_KEY: &str = "granulcal.seed";
/// Units of the columns, for who reads the file by other means: TOML, a unit a column. Files of before it have none.
const UNITS_KEY: &str = "granulcal.units";
const HASH_KEY: &str = "granulcal.hash";
/// Of a file of several row groups: the hash of each, as if it were a file of its own, separated by spaces.
const HASHES_KEY: &str = "granulcal.hashes";
/// Of the same: the rows that the data set was asked to have, where that is known.
const ROWS_KEY: &str = "granulcal.rows";

/// The entries that a file begins with; `hash` is that of its rows, where all of them are at hand.
pub(super) fn entries(
    header: &Header,
    columns: &[Column],
    hash: Option<String>,
) -> Result<Vec<KeyValue>, ParquetError> {
    let always = [
        (SCENE_KEY, header.scene_toml.clone()),
        (PRIOR_KEY, header.prior_toml.clone()),
        (VERSION_KEY, header.version.clone()),
        (ARITHMETIC_KEY, header.arithmetic.to_string()),
        (SEED_KEY, header.seed.to_string()),
    ];
    let units: BTreeMap<&str, &str> =
        columns.iter().filter_map(|column| Some((column.name.as_str(), column.unit?))).collect();
    let text = toml::to_string(&units).map_err(|error| ParquetError::External(error.into()))?;
    let units = (!units.is_empty()).then_some((UNITS_KEY, text));
    let hash = hash.map(|hash| (HASH_KEY, hash));
    let law = header.law.map(|law| (LAW_KEY, law.to_string()));
    Ok(always.into_iter().chain(units).chain(hash).chain(law).map(entry).collect())
}

/// The entries that a file of several row groups ends with: the hash of each, and the rows that were asked for if that
/// is known.
pub(super) fn last_entries(hashes: &[String], asked: Option<u64>) -> Vec<KeyValue> {
    let hashes = (HASHES_KEY, hashes.join(" "));
    let asked = asked.map(|rows| (ROWS_KEY, rows.to_string()));
    [hashes].into_iter().chain(asked).map(entry).collect()
}

fn entry((key, value): (&str, String)) -> KeyValue {
    KeyValue::new(key.to_owned(), value)
}

/// The metadata of a file that is read; `path` names it in errors.
pub(super) struct Metadata<'a> {
    path: &'a Path,
    entries: &'a [KeyValue],
}

impl<'a> Metadata<'a> {
    pub(super) fn of(path: &'a Path, file: &'a SerializedFileReader<bytes::Bytes>) -> Self {
        let entries = file.metadata().file_metadata().key_value_metadata();
        Self { path, entries: entries.map_or(&[], Vec::as_slice) }
    }

    pub(super) fn header(&self) -> Result<Header, DatasetError> {
        let seed = self.number(SEED_KEY)?.ok_or_else(|| self.missing(SEED_KEY))?;
        let law = self.number(LAW_KEY)?;
        let arithmetic = self.number(ARITHMETIC_KEY)?.unwrap_or(FIRST_ARITHMETIC);
        let given = |key| self.text(key).ok_or_else(|| self.missing(key));
        let (scene, prior, version) = (given(SCENE_KEY)?, given(PRIOR_KEY)?, given(VERSION_KEY)?);
        Header::parse(self.path, scene, prior, version.to_owned(), (law, arithmetic), seed)
    }

    /// The rows that the data set was asked to have, if the file says.
    pub(super) fn asked(&self) -> Result<Option<u64>, DatasetError> {
        self.number(ROWS_KEY)
    }

    /// What the rows hash to, group by group; files of before there was a hash do not say.
    pub(super) fn hashes(&self) -> Option<&'a str> {
        self.text(HASH_KEY).or_else(|| self.text(HASHES_KEY))
    }

    fn text(&self, key: &str) -> Option<&'a str> {
        self.entries.iter().find(|entry| entry.key == key)?.value.as_deref()
    }

    fn number<T: FromStr>(&self, key: &str) -> Result<Option<T>, DatasetError> {
        let parse = |text: &str| {
            text.parse().map_err(|_| {
                let (what, found) = (format!("metadata {key}"), format!("{text:?}"));
                DatasetError::content(self.path, what, found, "a whole number")
            })
        };
        self.text(key).map(parse).transpose()
    }

    fn missing(&self, key: &str) -> DatasetError {
        let allowed = "given, as granulcal-cli generate writes it";
        DatasetError::content(self.path, format!("metadata {key}"), "none", allowed)
    }
}
