//! A data set as a whole, read from a folder of parts or from one file.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use granulcal_features::stats::DIAGNOSTIC_COUNT;
use granulcal_features::{DIAGNOSTICS, PAPER16};

use crate::faults::Faults;
use crate::gaps::Gaps;
use crate::header::Header;
use crate::manifest::{self, Manifest};
use crate::row::Row;
use crate::table::{GroupWriter, Table};
use crate::{DatasetError, ObservedStatistic, table};

/// All rows of a data set, in order of their index.
#[derive(Clone, Debug)]
pub struct Dataset {
    /// Scene, prior, seed and version.
    pub header: Header,
    /// The rows; an unfinished data set has gaps in the indices.
    pub rows: Vec<Row>,
    /// Files that do not say what their rows hash to, so that damage in them cannot be found: those of before there
    /// was a hash.
    pub unverified: Vec<PathBuf>,
    /// The most rows that the data set was asked to have over all shards; `None` where that was not written down.
    pub asked: Option<u64>,
}

impl Dataset {
    /// Reads a folder that [`crate::generate`] made, or one Parquet file.
    ///
    /// # Errors
    /// [`DatasetError::Io`], [`DatasetError::Parquet`], [`DatasetError::Damaged`] or [`DatasetError::Content`] name the
    /// file and what is wrong with it; [`DatasetError::Differs`] for parts of different data sets,
    /// [`DatasetError::Several`] for parts that are wrong.
    pub fn open(path: &Path) -> Result<Self, DatasetError> {
        if !path.is_dir() {
            let Table { header, rows, is_verified, asked } = table::read(path)?;
            let unverified = if is_verified { Vec::new() } else { vec![path.to_owned()] };
            let mut dataset = Self { header, rows, unverified, asked };
            dataset.sort(path)?;
            return Ok(dataset);
        }
        let Manifest { header, rows: asked, .. } = Manifest::of(path)?;
        let mut dataset = Self { header, rows: Vec::new(), unverified: Vec::new(), asked };
        let mut faults = Faults::default();
        for chunk in manifest::parts(path)? {
            let part = manifest::part_path(path, chunk);
            let checked = table::read(&part).and_then(|table| {
                dataset.header.require_same(&part, &table.header)?;
                Ok(table)
            });
            let Some(Table { rows, is_verified, .. }) = faults.keep(checked) else { continue };
            dataset.rows.extend(rows);
            if !is_verified {
                dataset.unverified.push(part);
            }
        }
        faults.require_none()?;
        dataset.sort(path)?;
        Ok(dataset)
    }

    fn sort(&mut self, path: &Path) -> Result<(), DatasetError> {
        self.rows.sort_by_key(|row| row.row);
        require_once(self.rows.iter().map(|row| row.row), path)
    }

    /// Writes the data set as one Parquet file, which says how many rows were asked for, too.
    ///
    /// # Errors
    /// [`DatasetError::Argument`] or [`DatasetError::DuplicateRow`] for a header or rows that were changed so that
    /// nobody could read the file, [`DatasetError::Io`].
    pub fn write(&self, path: &Path) -> Result<(), DatasetError> {
        self.check(path)?;
        let mut file = GroupWriter::create(path, &self.header)?;
        self.rows.iter().try_for_each(|row| file.push(row.clone()))?;
        file.commit(self.asked)
    }

    /// Refuses what no file can hold: the fields are public.
    fn check(&self, path: &Path) -> Result<(), DatasetError> {
        self.header.require_unchanged()?;
        let refuse = |what, (found, needed): (usize, usize), row: &Row, allowed| {
            let got = format!("{found} for {needed} in row {}", row.row);
            Err(DatasetError::Argument { what, got, allowed })
        };
        let (parameters, observed) =
            (self.header.prior.parameters().len(), self.header.observed().len());
        for row in &self.rows {
            let (given, seen) = (row.parameters.len(), row.observed.len());
            if given != parameters {
                let allowed = "one for each parameter of the prior";
                return refuse("the parameters of a row", (given, parameters), row, allowed);
            }
            if seen != observed {
                let allowed = "one for each statistic that the scene observes";
                return refuse("the observed statistics of a row", (seen, observed), row, allowed);
            }
        }
        let mut indices: Vec<u64> = self.rows.iter().map(|row| row.row).collect();
        indices.sort_unstable();
        require_once(indices.into_iter(), path)
    }

    /// Paths of the parameters that vary, the columns of [`Dataset::theta`].
    pub fn theta_names(&self) -> Vec<&str> {
        let names = self.header.prior.names();
        self.header.prior.free().into_iter().map(|i| names[i]).collect()
    }

    /// Values of the parameters that vary, row by row, shape `[n, p]`.
    pub fn theta(&self) -> Vec<f64> {
        let free = self.header.prior.free();
        self.rows.iter().flat_map(|row| free.iter().map(|&i| row.parameters[i])).collect()
    }

    /// Names of the statistics, the columns of [`Dataset::x`].
    pub fn x_names() -> [&'static str; 16] {
        PAPER16.map(|statistic| statistic.name)
    }

    /// The statistics, row by row, shape `[n, 16]`; NaN where no grains were in view.
    pub fn x(&self) -> Vec<f64> {
        self.rows.iter().flat_map(|row| row.statistics).collect()
    }

    /// Names of the diagnostic statistics, the columns of [`Dataset::diagnostics`].
    pub fn diagnostic_names() -> [&'static str; DIAGNOSTIC_COUNT] {
        DIAGNOSTICS.map(|statistic| statistic.name)
    }

    /// The diagnostic statistics, row by row, shape `[n, d]`; NaN where the others are, and in data sets
    /// that were made without them.
    pub fn diagnostics(&self) -> Vec<f64> {
        self.rows.iter().flat_map(|row| row.diagnostics).collect()
    }

    /// The statistics that the scene observes, the columns of [`Dataset::observed`].
    pub fn observed_statistics(&self) -> Vec<ObservedStatistic> {
        self.header.observed()
    }

    /// The statistics that the scene observes, row by row; NaN where they could not be seen.
    pub fn observed(&self) -> Vec<f64> {
        self.rows.iter().flat_map(|row| row.observed.iter().copied()).collect()
    }

    /// How many rows ended in each status, by its word.
    pub fn status_counts(&self) -> BTreeMap<&'static str, usize> {
        let mut counts = BTreeMap::new();
        for row in &self.rows {
            *counts.entry(row.status.name()).or_insert(0) += 1;
        }
        counts
    }

    /// The first rows that are missing of those asked for, or below the highest index where that was not written down,
    /// at most `limit` of them, and a million.
    pub fn gaps(&self, limit: usize) -> Vec<u64> {
        self.all_gaps(limit).first
    }

    /// How many rows are missing, counted as [`Dataset::gaps`] names them.
    pub fn missing(&self) -> u64 {
        self.all_gaps(0).count
    }

    fn all_gaps(&self, limit: usize) -> Gaps {
        let mut gaps = Gaps::new(limit);
        self.rows.iter().for_each(|row| gaps.pass(row.row));
        gaps.end(self.asked);
        gaps
    }
}

/// Refuses a row that is there twice; the rows are in order.
fn require_once(rows: impl Iterator<Item = u64> + Clone, path: &Path) -> Result<(), DatasetError> {
    match rows.clone().zip(rows.skip(1)).find(|(row, next)| row == next) {
        None => Ok(()),
        Some((row, _)) => {
            let (first, second) = (path.to_owned(), path.to_owned());
            Err(DatasetError::DuplicateRow { row, first, second })
        }
    }
}

#[cfg(test)]
mod tests {
    use granulcal_scene::{Prior, Scene};

    use super::*;

    #[test]
    fn what_was_changed_so_that_nobody_could_read_it_is_not_written() {
        let header = Header::new(&Scene::drop(0.1), &Prior::default(), 7).unwrap();
        let row = table::blank(header.prior.parameters().len(), 0);
        let rows: Vec<_> = [3, 1].map(|index| Row { row: index, ..row.clone() }).into();
        let sound = Dataset { header, rows, unverified: Vec::new(), asked: Some(5) };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rows.parquet");
        let one = "[[parameter]]\npath = \"material.restitution\"\ndistribution = \"fixed\"\nvalue = 0.5\n";
        let one = Prior::from_toml(one).unwrap();
        for (change, named) in [
            (
                (&|d: &mut Dataset| d.header.scene.name = "mine".into()) as &dyn Fn(&mut Dataset),
                "the scene of the data set must be as it was read",
            ),
            (&|d| d.header.prior = one.clone(), "the prior of the data set must be as it was"),
            (
                &|d| d.rows[0].parameters.clear(),
                "the parameters of a row must be one for each parameter of the prior, got 0 for",
            ),
            (&|d| d.rows[1].observed.push(1.0), "got 1 for 0 in row 1"),
            (&|d| d.rows[1].row = 3, "row 3 is one in"),
        ] {
            let mut changed = sound.clone();
            change(&mut changed);
            let error = changed.write(&path).unwrap_err().to_string();
            assert!(error.contains(named), "{error}");
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);

        // What says no more than who wrote it can be changed, and rows in any order are put in theirs.
        let mut mine = sound;
        (mine.header.version, mine.header.law, mine.header.seed) = ("mine".into(), None, u64::MAX);
        mine.write(&path).unwrap();
        let read = Dataset::open(&path).unwrap();
        assert_eq!((&read.header, read.asked), (&mine.header, Some(5)));
        assert_eq!(read.rows.iter().map(|row| row.row).collect::<Vec<_>>(), [1, 3]);
        read.write(&path).unwrap();
    }
}
