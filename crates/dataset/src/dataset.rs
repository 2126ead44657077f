//! A data set as a whole, read from a folder of parts or from one file.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use granulcal_features::stats::DIAGNOSTIC_COUNT;
use granulcal_features::{DIAGNOSTICS, PAPER16};

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
    /// file and what is wrong with it; [`DatasetError::Differs`] for parts of different data sets.
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
        for chunk in manifest::parts(path)? {
            let part = manifest::part_path(path, chunk);
            let Table { header, rows, is_verified, .. } = table::read(&part)?;
            dataset.header.require_same(&part, &header)?;
            dataset.rows.extend(rows);
            if !is_verified {
                dataset.unverified.push(part);
            }
        }
        dataset.sort(path)?;
        Ok(dataset)
    }

    fn sort(&mut self, path: &Path) -> Result<(), DatasetError> {
        self.rows.sort_by_key(|row| row.row);
        match self.rows.windows(2).find(|pair| pair[0].row == pair[1].row) {
            None => Ok(()),
            Some(pair) => {
                let (first, second) = (path.to_owned(), path.to_owned());
                Err(DatasetError::DuplicateRow { row: pair[0].row, first, second })
            }
        }
    }

    /// Writes the data set as one Parquet file, which says how many rows were asked for, too.
    ///
    /// # Errors
    /// [`DatasetError::Io`].
    pub fn write(&self, path: &Path) -> Result<(), DatasetError> {
        let mut file = GroupWriter::create(path, &self.header)?;
        self.rows.iter().try_for_each(|row| file.push(row.clone()))?;
        file.commit(self.asked)
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
    /// at most `limit` of them.
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
