//! A batch whose parts are made elsewhere and brought here: which chunks lack rows, and what is brought.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::path::Path;

use super::chunk::{OpenChunk, Progress};
use super::folder::Folder;
use super::options::GenerateOptions;
use super::{Remaining, accepted};
use crate::{DatasetError, Form, Room, files, manifest, table};
use granulcal_scene::Prior;

/// An open folder that takes parts; nobody else writes into it while this lives.
///
/// Chunk c is what shard c of as many shards as there are chunks makes: `Shard { index: c, count: chunks }`.
#[derive(Debug)]
pub struct GatheredBatch {
    folder: Folder,
    rows: u64,
    missing: BTreeSet<u64>,
    /// The chunks that have some of their rows.
    open: BTreeMap<u64, OpenChunk>,
    progress: Progress,
}

impl GatheredBatch {
    /// Opens or creates the folder `out` of a batch of our simulator.
    ///
    /// # Errors
    /// As [`crate::generate()`], which makes the same rows in it.
    pub fn open(
        scene: &granulcal_dem::Scene,
        prior: &Prior,
        options: &GenerateOptions,
        out: &Path,
    ) -> Result<Self, DatasetError> {
        let header = accepted(None, scene, prior, options)?;
        let room = |rows, chunk| Room::of_batch(scene, rows, 1, chunk);
        let (folder, remaining) = Folder::begin(out, &header, options, &room)?;
        let Remaining { missing: lacking, open, progress } = remaining;
        let is_complete = |chunk: &u64| lacking.get(chunk).is_some_and(Vec::is_empty);
        let chunks = options.rows.div_ceil(folder.chunk);
        let missing = (0..chunks).filter(|chunk| !is_complete(chunk)).collect();
        Ok(Self { folder, rows: options.rows, missing, open, progress })
    }

    /// Chunks of the batch.
    pub fn chunks(&self) -> u64 {
        self.rows.div_ceil(self.folder.chunk)
    }

    /// Rows of a chunk.
    pub fn chunk_size(&self) -> u64 {
        self.folder.chunk
    }

    /// The chunks that lack rows, in order.
    pub fn missing(&self) -> impl Iterator<Item = u64> + '_ {
        self.missing.iter().copied()
    }

    /// How far the batch is; the rows that were brought are those made.
    pub fn progress(&self) -> Progress {
        self.progress
    }

    /// Takes the bytes of a chunk's part; returns whether it lacked it. Rows that are there stay, also those beyond
    /// what is asked for.
    ///
    /// # Errors
    /// [`DatasetError`] of a part that is damaged, not whole, of another batch or chunk; the folder is as before.
    pub fn put(&mut self, chunk: u64, bytes: &[u8]) -> Result<bool, DatasetError> {
        if !self.missing.contains(&chunk) {
            return Ok(false);
        }
        let path = manifest::part_path(&self.folder.path, chunk);
        let rows = self.folder.parse_part(chunk, bytes.to_vec())?;
        let wanted = self.folder.chunk.min(self.rows - chunk * self.folder.chunk);
        // A part of a larger batch that was stopped may lack rows of these and have others.
        let found = rows.iter().filter(|row| row.row < self.rows).count() as u64;
        if found < wanted {
            let allowed = format!("{wanted}");
            return Err(DatasetError::content(&path, "the rows", found.to_string(), allowed));
        }
        let mut all = self.open.get(&chunk).map_or_else(Vec::new, |open| open.rows.clone());
        if all.is_empty() {
            files::write_file(&path, Form::Parquet, bytes)?;
        }
        let known: HashSet<_> = all.iter().map(|row| row.row).collect();
        let (mut made, begun) = (Vec::new(), !all.is_empty());
        for row in rows.into_iter().filter(|row| !known.contains(&row.row)) {
            made.extend((row.row < self.rows).then_some(row.status));
            all.push(row);
        }
        if begun {
            all.sort_by_key(|row| row.row);
            table::write(&path, &self.folder.header, &all)?;
        }
        self.missing.remove(&chunk);
        self.open.remove(&chunk);
        self.progress.made += made.len() as u64;
        for status in made {
            self.progress.count(status);
        }
        Ok(true)
    }
}
