//! Data sets of several machines to one file, of which only as much is in memory as is being joined.
//!
//! A *source* is a Parquet file: a part of a folder, or a file that was given. Sources are opened when the rows have
//! come to their first one, and closed after their last, so that of folders there are some parts in memory, of the file
//! some thousand rows, and of a given file all of it.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};

use crate::DatasetError;
use crate::faults::{Faults, several};
use crate::gaps::Gaps;
use crate::header::Header;
use crate::manifest::{self, Manifest};
use crate::row::Row;
use crate::table::{self, GroupWriter, Table};

/// What has been joined.
#[derive(Clone, Debug)]
pub struct Merged {
    /// Scene, prior, seed and version of all.
    pub header: Header,
    /// Rows in the file.
    pub rows: usize,
    /// The most rows that one of the inputs says the data set was asked to have; `None` if none says.
    pub asked: Option<u64>,
    /// How many of them are missing, or below the highest index where none says.
    pub missing: u64,
    /// The first that are missing, at most as many as were to be named.
    pub gaps: Vec<u64>,
    /// Rows that stand in several inputs, the same in all: of shards that were counted anew, for example.
    pub repeated: u64,
    /// Files that do not say what their rows hash to: see [`crate::Dataset::unverified`].
    pub unverified: Vec<PathBuf>,
}

/// Joins data sets of one scene, prior, seed and version, for example the shards of several machines, into one Parquet
/// file, in order of the rows; names at most `named_gaps` rows that are missing. A row that stands in several of them
/// is written once.
///
/// # Errors
/// [`DatasetError::Differs`] names the first difference, [`DatasetError::DuplicateRow`] a row that is another in two of
/// them, [`DatasetError::Argument`] for no input; else as [`crate::Dataset::open`] and [`crate::Dataset::write`]: all
/// files that cannot be used are named at once. The file is then as it was before.
pub fn merge(inputs: &[PathBuf], out: &Path, named_gaps: usize) -> Result<Merged, DatasetError> {
    let Sources { header, asked, mut waiting } = sources(inputs)?;
    let mut file = GroupWriter::create(out, &header)?;
    let mut gaps = Gaps::new(named_gaps);
    let (rows, missing, repeated) = (0, 0, 0);
    let (gaps_named, unverified) = (Vec::new(), Vec::new());
    let mut merged =
        Merged { header, rows, asked, missing, gaps: gaps_named, repeated, unverified };
    let mut open: Vec<OpenSource> = Vec::new();
    // The row that was written last, and where it stood.
    let mut last: Option<(Row, PathBuf)> = None;
    loop {
        // Open whoever may have the next row.
        let least = loop {
            let least = (0..open.len()).min_by_key(|&source| open[source].next());
            let next = least.map_or(u64::MAX, |source| open[source].next());
            if waiting.front().is_none_or(|source| source.first > next) {
                break least;
            }
            if let Some(source) = waiting.pop_front() {
                match source.open(&mut merged) {
                    Ok(opened) => open.extend(opened),
                    Err(error) => {
                        // Those that were still to be opened may be bad, too.
                        let rest = waiting.into_iter().map(|source| source.open(&mut merged));
                        let others = rest.filter_map(Result::err);
                        return Err(several(std::iter::once(error).chain(others).collect()));
                    }
                }
            }
        };
        let Some(least) = least else { break };
        let source = &mut open[least];
        let Some(row) = source.rows.pop_front() else { break };
        let input = source.input.clone();
        if source.rows.is_empty() {
            open.swap_remove(least);
        }
        match &last {
            Some((last, _)) if row.same_as(last) => {
                merged.repeated += 1;
                continue;
            }
            Some((last, first)) if row.row <= last.row => {
                let (row, first, second) = (row.row, first.clone(), input);
                return Err(DatasetError::DuplicateRow { row, first, second });
            }
            _ => {}
        }
        gaps.pass(row.row);
        merged.rows += 1;
        file.push(row.clone())?;
        last = Some((row, input));
    }
    file.commit(asked)?;
    gaps.end(asked);
    (merged.missing, merged.gaps) = (gaps.count, gaps.first);
    Ok(merged)
}

/// What is to be merged.
#[derive(Debug)]
struct Sources {
    header: Header,
    /// The most rows that an input says were asked for.
    asked: Option<u64>,
    /// The files of all inputs, by their first rows.
    waiting: VecDeque<Source>,
}

/// A file that is still to be opened.
#[derive(Debug)]
struct Source {
    input: PathBuf,
    file: PathBuf,
    /// The lowest row that it may have.
    first: u64,
    /// What it has, where that had to be read to know the first.
    read: Option<Table>,
}

/// A file that was opened, and those of its rows that are still to come: one at least.
#[derive(Debug)]
struct OpenSource {
    input: PathBuf,
    rows: VecDeque<Row>,
}

/// The files of all inputs, and what they are of.
fn sources(inputs: &[PathBuf]) -> Result<Sources, DatasetError> {
    let mut found: Option<Header> = None;
    let (mut asked, mut sources, mut faults) = (None, Vec::new(), Faults::default());
    for input in inputs {
        let Some((header, rows, files)) = faults.keep(sources_of(input)) else { continue };
        match &found {
            Some(found) => _ = faults.keep(header.require_same(input, found)),
            None => found = Some(header),
        }
        asked = asked.max(rows);
        sources.extend(files);
    }
    faults.require_none()?;
    // Where two begin with the same row the one that was named first is first.
    sources.sort_by_key(|source| source.first);
    let header = found.ok_or(DatasetError::Argument {
        what: "the number of data sets to merge",
        got: "0".to_owned(),
        allowed: "at least 1",
    })?;
    Ok(Sources { header, asked, waiting: sources.into() })
}

/// What an input is of, how many rows were asked for, and its files.
fn sources_of(input: &Path) -> Result<(Header, Option<u64>, Vec<Source>), DatasetError> {
    if input.is_dir() {
        let Manifest { header, chunk, rows } = Manifest::of(input)?;
        let source = |number: u64| Source {
            input: input.to_owned(),
            file: manifest::part_path(input, number),
            first: number.saturating_mul(chunk),
            read: None,
        };
        return Ok((header, rows, manifest::parts(input)?.into_iter().map(source).collect()));
    }
    let mut table = table::read(input)?;
    table.rows.sort_by_key(|row| row.row);
    let (header, asked) = (table.header.clone(), table.asked);
    let first = table.rows.first().map_or(0, |row| row.row);
    let (input, file) = (input.to_owned(), input.to_owned());
    Ok((header, asked, vec![Source { input, file, first, read: Some(table) }]))
}

impl Source {
    /// Reads the file; `None` if it has no rows.
    fn open(self, merged: &mut Merged) -> Result<Option<OpenSource>, DatasetError> {
        let mut table = match self.read {
            Some(table) => table,
            None => table::read(&self.file)?,
        };
        merged.header.require_same(&self.file, &table.header)?;
        if !table.is_verified {
            merged.unverified.push(self.file.clone());
        }
        table.rows.sort_by_key(|row| row.row);
        if let Some(row) = table.rows.first()
            && row.row < self.first
        {
            let (found, allowed) = (row.row.to_string(), format!("at least {}", self.first));
            return Err(DatasetError::content(&self.file, "the first row", found, allowed));
        }
        let rows: VecDeque<Row> = table.rows.into();
        Ok((!rows.is_empty()).then_some(OpenSource { input: self.input, rows }))
    }
}

impl OpenSource {
    fn next(&self) -> u64 {
        self.rows.front().map_or(u64::MAX, |row| row.row)
    }
}
