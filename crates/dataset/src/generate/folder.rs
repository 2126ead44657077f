//! The folder of a batch: its lock, its manifest, and what it already holds.

use std::collections::{BTreeMap, HashSet};
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

use super::chunk::{OpenChunk, Progress};
use super::options::GenerateOptions;
use crate::faults::Faults;
use crate::header::Header;
use crate::manifest::{self, Manifest};
use crate::random::pour_seed;
use crate::row::Row;
use crate::table::Table;
use crate::{DatasetError, Room, table};

/// The file in which `calibrate` keeps the pours that it makes for recordings.
const KEPT_POURS: &str = "pours.json";

/// An open folder; nobody else writes into it while this lives.
#[derive(Debug)]
pub(super) struct Folder {
    pub(super) path: PathBuf,
    pub(super) header: Header,
    pub(super) chunk: u64,
    /// The rows that the folder says were asked for.
    asked: Option<u64>,
    /// What is said if rows are missing of a batch of another arithmetic.
    other_arithmetic: Option<DatasetError>,
    /// The system drops the lock with the file, also when the process is killed. None for who only looks.
    _lock: Option<File>,
}

/// What is left to do.
#[derive(Debug, Default)]
pub(super) struct Remaining {
    /// Rows that the chunks with a part lack.
    pub(super) missing: BTreeMap<u64, Vec<u64>>,
    /// The chunks with a part that lacks rows.
    pub(super) open: BTreeMap<u64, OpenChunk>,
    pub(super) progress: Progress,
}

/// How many rows a shard has.
fn rows_of_shard(options: &GenerateOptions, chunk: u64) -> u64 {
    let (chunks, shard) = (options.rows.div_ceil(chunk), options.shard);
    if shard.index >= chunks {
        return 0;
    }
    let own = (chunks - shard.index).div_ceil(shard.count);
    let has_last = (chunks - 1) % shard.count == shard.index;
    // The last chunk may be a short one.
    let short = if has_last { chunks * chunk - options.rows } else { 0 };
    own * chunk - short
}

impl Folder {
    /// Opens or creates the folder and finds what is left to do; refuses what there is no `room` for, which is of the
    /// rows that are missing and the rows in a part.
    pub(super) fn begin(
        path: &Path,
        header: &Header,
        options: &GenerateOptions,
        room: &dyn Fn(u64, u64) -> Room,
    ) -> Result<(Self, Remaining), DatasetError> {
        // No folder is made for what has no room.
        if !path.join(manifest::NAME).exists() {
            let rows = rows_of_shard(options, options.chunk);
            room(rows, options.chunk).require(Some(path))?;
        }
        let mut folder = Self::open(path, header, options)?;
        let remaining = folder.left(options)?;
        let Progress { total, resumed, .. } = remaining.progress;
        let left = total.saturating_sub(resumed);
        // What is complete needs none.
        if left > 0 {
            room(left, folder.chunk).require(Some(path))?;
        }
        folder.record(options.rows)?;
        Ok((folder, remaining))
    }

    /// Writes down how many rows were asked for, if that is more than ever: whoever merges knows what is missing.
    fn record(&self, rows: u64) -> Result<(), DatasetError> {
        if self.asked.is_some_and(|asked| asked >= rows) {
            return Ok(());
        }
        let (header, chunk) = (self.header.clone(), self.chunk);
        Manifest { header, chunk, rows: Some(rows) }.write(&self.path)
    }

    /// Opens or creates the folder, refuses one that was made from something else.
    fn open(path: &Path, header: &Header, options: &GenerateOptions) -> Result<Self, DatasetError> {
        if path.exists() && !path.is_dir() {
            return Err(DatasetError::content(path, "the output", "a file", "a folder"));
        }
        if path.join(KEPT_POURS).exists() && !path.join(manifest::NAME).exists() {
            let allowed = "a folder without one, for it holds the pours of `calibrate`";
            return Err(DatasetError::content(path, "the output", KEPT_POURS, allowed));
        }
        fs::create_dir_all(path).map_err(DatasetError::io("create", path))?;
        let lock = lock(path)?;
        manifest::remove_leftovers(path)?;
        let parts = manifest::parts(path)?;
        if !options.resume && !parts.is_empty() {
            let found = format!("{} parts of a data set", parts.len());
            return Err(DatasetError::content(path, "the output", found, "empty unless resumed"));
        }
        let folder = match Manifest::read(path)? {
            Some(manifest) => Self::there(path, manifest, header)?,
            None if parts.is_empty() => {
                let manifest = Manifest {
                    header: header.clone(),
                    chunk: options.chunk,
                    rows: Some(options.rows),
                };
                manifest.write(path)?;
                Self::there(path, manifest, header)?
            }
            None => {
                let found = format!("{} parts without one", parts.len());
                return Err(DatasetError::content(path, manifest::NAME, found, "present"));
            }
        };
        Ok(Self { _lock: Some(lock), ..folder })
    }

    /// The folder of a manifest, refused if that was made from something else; another arithmetic does not matter to
    /// who adds no row.
    fn there(path: &Path, manifest: Manifest, header: &Header) -> Result<Self, DatasetError> {
        let Manifest { header: found, chunk, rows: asked } = manifest;
        let of_found = Header { arithmetic: found.arithmetic, ..header.clone() };
        found.require_same(path, &of_found)?;
        let other_arithmetic = found.require_same(path, header).err();
        let path = path.to_owned();
        Ok(Self { path, header: of_found, chunk, asked, other_arithmetic, _lock: None })
    }

    /// How far the batch of the folder is, which is left as it is, and may not be there yet.
    pub(super) fn look(
        path: &Path,
        header: &Header,
        options: &GenerateOptions,
    ) -> Result<Progress, DatasetError> {
        let Some(manifest) = Manifest::read(path)? else {
            let total = rows_of_shard(options, options.chunk);
            return Ok(Progress { total, ..Progress::default() });
        };
        Ok(Self::there(path, manifest, header)?.left(options)?.progress)
    }

    /// What is left to do; refused if that is something and rows are there of another arithmetic.
    fn left(&mut self, options: &GenerateOptions) -> Result<Remaining, DatasetError> {
        let remaining = self.remaining(options)?;
        let is_complete = remaining.progress.resumed >= remaining.progress.total;
        match self.other_arithmetic.take() {
            Some(error) if !is_complete => Err(error),
            _ => Ok(remaining),
        }
    }

    /// Reads and checks the parts that are there; what they lack is left to do. The rows of other chunks are not
    /// listed: there may be billions of them.
    fn remaining(&self, options: &GenerateOptions) -> Result<Remaining, DatasetError> {
        let mut remaining = Remaining::default();
        let chunks = options.rows.div_ceil(self.chunk);
        remaining.progress.total = rows_of_shard(options, self.chunk);
        let is_wanted =
            |chunk: &u64| *chunk < chunks && chunk % options.shard.count == options.shard.index;
        let mut faults = Faults::default();
        for chunk in manifest::parts(&self.path)?.into_iter().filter(is_wanted) {
            let (first, end) = (chunk * self.chunk, ((chunk + 1) * self.chunk).min(options.rows));
            let Some((rows, is_verified)) = faults.keep(self.read_part(chunk)) else { continue };
            remaining.progress.unverified += u64::from(!is_verified);
            let (kept, beyond): (Vec<_>, Vec<_>) = rows.iter().partition(|row| row.row < end);
            remaining.progress.resumed += kept.len() as u64;
            remaining.progress.beyond += beyond.len() as u64;
            for row in &kept {
                remaining.progress.count(row.status);
            }
            // A folder may have parts of any size, and more rows are asked for than it began with.
            Room::of_list((end - first).saturating_sub(kept.len() as u64)).require(None)?;
            let there: HashSet<_> = kept.iter().map(|row| row.row).collect();
            let missing: Vec<_> = (first..end).filter(|row| !there.contains(row)).collect();
            let left = missing.len() as u64;
            remaining.missing.insert(chunk, missing);
            if left > 0 {
                remaining.open.insert(chunk, OpenChunk { rows, left, changed: false });
            }
        }
        faults.require_none()?;
        Ok(remaining)
    }

    /// The rows of a part, each checked against what it must have been made from, and whether the part has a hash.
    fn read_part(&self, chunk: u64) -> Result<(Vec<Row>, bool), DatasetError> {
        let path = manifest::part_path(&self.path, chunk);
        let read = table::read(&path).and_then(|table| self.check_part(&path, chunk, table));
        read.map_err(|error| match error {
            DatasetError::Parquet { .. } | DatasetError::Content { .. } => {
                DatasetError::Part { path, source: Box::new(error) }
            }
            other => other,
        })
    }

    /// The rows of a part that is not of this folder yet, checked as if it were.
    pub(super) fn parse_part(&self, chunk: u64, bytes: Vec<u8>) -> Result<Vec<Row>, DatasetError> {
        let path = manifest::part_path(&self.path, chunk);
        Ok(self.check_part(&path, chunk, table::parse(&path, bytes)?)?.0)
    }

    fn check_part(
        &self,
        path: &Path,
        chunk: u64,
        table: Table,
    ) -> Result<(Vec<Row>, bool), DatasetError> {
        let Table { header, rows, is_verified, .. } = table;
        header.require_same(path, &self.header)?;
        let range = chunk * self.chunk..(chunk + 1) * self.chunk;
        let allowed = format!("rising within {}..{}", range.start, range.end);
        let mut last = None;
        for row in &rows {
            let index = row.row;
            if !range.contains(&index) || last.is_some_and(|last| last >= index) {
                let found = format!("row {index} after {last:?}");
                return Err(DatasetError::content(path, "column row", found, allowed));
            }
            last = Some(index);
            let expected = self.header.prior.sample(self.header.seed, index);
            if row.parameters != expected || row.seed != pour_seed(self.header.seed, index) {
                let found = format!("{:?}", row.parameters);
                let what = format!("the parameters of row {index}");
                return Err(DatasetError::content(path, what, found, format!("{expected:?}")));
            }
        }
        Ok((rows, is_verified))
    }
}

/// Takes the lock of the folder. What its file holds is left as it is: it may be somebody's.
fn lock(folder: &Path) -> Result<File, DatasetError> {
    let path = folder.join(".lock");
    let found = match fs::symlink_metadata(&path) {
        Ok(there) if there.is_symlink() => Some("a link"),
        Ok(there) if there.is_dir() => Some("a folder"),
        Ok(there) if !there.is_file() => Some("a device or pipe"),
        _ => None,
    };
    if let Some(found) = found {
        return Err(DatasetError::content(&path, "the lock of the folder", found, "a plain file"));
    }
    let mut options = File::options();
    options.write(true).create(true).truncate(false);
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        // What has become a link since is not followed either.
        options.custom_flags(rustix::fs::OFlags::NOFOLLOW.bits() as i32);
    }
    let file = options.open(&path).map_err(DatasetError::io("create", &path))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(DatasetError::Locked { path: folder.to_owned() }),
        Err(TryLockError::Error(source)) => Err(DatasetError::Io { action: "lock", path, source }),
    }
}

#[cfg(test)]
mod tests {
    use granulcal_scene::{Prior, Scene};

    use super::*;
    use crate::{Dataset, generate};

    #[test]
    fn what_a_part_lacks_is_not_listed_beyond_the_memory() {
        let place = tempfile::tempdir().unwrap();
        let (scene, prior) =
            (Scene::funnel(0.12).with("grains.count", 8.0).unwrap(), Prior::default());
        let one =
            GenerateOptions { rows: 1, chunk: 1 << 60, threads: 1, ..GenerateOptions::default() };
        generate(&scene, &prior, &one, place.path(), &mut |_| true).unwrap();
        let many = GenerateOptions { rows: 1 << 60, ..one };
        let looked = crate::look_at_batch(&scene, &prior, &many, place.path()).unwrap_err();
        let begun = generate(&scene, &prior, &many, place.path(), &mut |_| true).unwrap_err();
        for error in [looked, begun] {
            assert!(error.to_string().contains("of memory"), "{error}");
        }
        assert_eq!(Dataset::open(place.path()).unwrap().asked, Some(1));
    }

    #[test]
    fn a_complete_batch_of_another_arithmetic_is_taken_as_it_is() {
        let place = tempfile::tempdir().unwrap();
        let (scene, prior) =
            (Scene::funnel(0.12).with("grains.count", 8.0).unwrap(), Prior::default());
        let options = GenerateOptions { rows: 3, threads: 1, ..GenerateOptions::default() };
        generate(&scene, &prior, &options, place.path(), &mut |_| true).unwrap();
        let made = Dataset::open(place.path()).unwrap();
        // The same rows as those of a program with another arithmetic.
        let mut other = made.header.clone();
        other.arithmetic = 99;
        let manifest = Manifest::read(place.path()).unwrap().unwrap();
        Manifest { header: other.clone(), ..manifest }.write(place.path()).unwrap();
        table::write(&manifest::part_path(place.path(), 0), &other, &made.rows).unwrap();

        let taken = generate(&scene, &prior, &options, place.path(), &mut |_| true).unwrap();
        assert_eq!((taken.progress.resumed, taken.progress.total), (3, 3));
        assert_eq!(Dataset::open(place.path()).unwrap().header.arithmetic, 99);
        let more = GenerateOptions { rows: 4, ..options };
        let error = generate(&scene, &prior, &more, place.path(), &mut |_| true).unwrap_err();
        let said = error.to_string();
        assert!(said.contains("the arithmetic of the solver is 99, but 2 is given"), "{said}");
        assert_eq!(Dataset::open(place.path()).unwrap().rows.len(), 3);
    }
}
