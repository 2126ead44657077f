//! Reading whole files, and writing them so that a file is complete or absent.
//!
//! What is read may come from a stranger: only plain files are read, up to a size, so that a name like `/dev/zero`
//! is refused and does not fill the memory.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::{DatasetError, Form};

#[cfg(target_os = "linux")]
mod leftovers;

/// End of the name of a file that is being written.
pub(crate) const TEMPORARY: &str = ".tmp";
/// Most bytes of a file that is read as a whole: 4 GiB, which is a data set of four million rows.
pub(crate) const LARGEST_FILE: u64 = 4 << 30;
/// Most bytes of a mesh, a trajectory or a picture: 256 MiB.
pub(crate) const LARGEST_PART: u64 = 256 << 20;
/// Most bytes of a file of text: 16 MiB.
pub(crate) const LARGEST_TEXT: u64 = 16 << 20;
/// Temporary files of this process, to be removed by whoever ends it at once.
static TEMPORARIES: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());
/// Whole files that are being written at this moment.
static WRITING: AtomicUsize = AtomicUsize::new(0);
/// Bytes of an existing file that tell its kind.
const HEAD: u64 = 512;
/// Characters of a file's name in that of its temporary file.
const LONGEST_NAME: usize = 40;
/// Names that are tried for a temporary file.
const TRIES: u32 = 100;

/// Opens a plain file to be read; links are followed, devices, pipes and folders are refused.
pub(crate) fn open(path: &Path) -> Result<File, DatasetError> {
    let metadata = fs::metadata(path).map_err(DatasetError::io("read", path))?;
    if !metadata.is_file() {
        let found = if metadata.is_dir() { "a folder" } else { "a device or pipe" };
        return Err(DatasetError::content(path, "the file", found, "a plain file"));
    }
    File::open(path).map_err(DatasetError::io("read", path))
}

/// The bytes of a file of at most [`LARGEST_FILE`].
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, DatasetError> {
    read_at_most(path, LARGEST_FILE)
}

/// The bytes of a plain file of at most 4 GiB.
///
/// # Errors
/// [`DatasetError::Io`], or [`DatasetError::Content`] for a device, a pipe, a folder or a larger file.
pub fn read_file(path: &Path) -> Result<Vec<u8>, DatasetError> {
    read(path)
}

/// The text of a plain file of at most 16 MiB.
///
/// # Errors
/// As [`read_file`], and [`DatasetError::Content`] for what is not UTF-8.
pub fn read_text(path: &Path) -> Result<String, DatasetError> {
    String::from_utf8(read_at_most(path, LARGEST_TEXT)?)
        .map_err(|_| DatasetError::content(path, "the text", "other bytes", "UTF-8"))
}

/// The bytes of a plain file that has no more than `limit`.
pub(crate) fn read_at_most(path: &Path, limit: u64) -> Result<Vec<u8>, DatasetError> {
    let mut bytes = Vec::new();
    // The size that the system states may be out of date, and is 0 for files of the kernel.
    open(path)?.take(limit + 1).read_to_end(&mut bytes).map_err(DatasetError::io("read", path))?;
    if bytes.len() as u64 > limit {
        let (found, allowed) =
            (format!("more than {limit} bytes"), format!("at most {limit} bytes"));
        return Err(DatasetError::content(path, "the size", found, allowed));
    }
    Ok(bytes)
}

/// Writes a file of some form beside its place and renames it: whoever looks sees the old file or the whole new one.
///
/// # Errors
/// [`DatasetError::Replaces`] where a file of another kind stands, [`DatasetError::Io`].
pub fn write_file(path: &Path, form: Form, bytes: &[u8]) -> Result<(), DatasetError> {
    WRITING.fetch_add(1, Ordering::SeqCst);
    let write = || {
        let mut file = PendingFile::create(path, form)?;
        file.write_all(&form.signed(bytes)).map_err(DatasetError::io("write", path))?;
        file.commit()
    };
    let written = write();
    WRITING.fetch_sub(1, Ordering::SeqCst);
    written
}

/// Whether a whole file is being written at this moment: whoever ends the process waits for it.
pub fn is_writing() -> bool {
    WRITING.load(Ordering::SeqCst) > 0
}

/// Removes what this process has half written; for whoever ends it at once: whoever begins another file waits for ever.
pub fn remove_temporaries() {
    let mut paths = temporaries();
    for path in paths.drain(..) {
        let _ = fs::remove_file(path);
    }
    std::mem::forget(paths);
}

/// The list is held while a file of it comes or goes, so that none is missed.
fn temporaries() -> MutexGuard<'static, Vec<PathBuf>> {
    TEMPORARIES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Refuses to replace what stands at `place`, unless it is nothing, empty, or one of this form that granulcal
/// wrote; `target` is its name.
pub(crate) fn require_replaceable(
    place: &Path,
    form: Form,
    target: &Path,
) -> Result<(), DatasetError> {
    // Where nothing is, a folder on the way that is missing is told when the file is made.
    let Ok(metadata) = fs::metadata(place) else { return Ok(()) };
    if metadata.permissions().readonly() {
        return Err(DatasetError::content(
            target,
            "a file to replace",
            "read-only",
            "one that may be changed",
        ));
    }
    if metadata.is_file() && metadata.len() == 0 {
        return Ok(());
    }
    // What is larger was not written by granulcal.
    let most = if form.may_be_foreign() { LARGEST_PART } else { LARGEST_TEXT };
    let is_too_large = form.may_be_foreign() && metadata.len() > most;
    let bytes =
        if form.needs_all() && !is_too_large { read_at_most(place, most)? } else { head(place)? };
    if form.fits(&bytes) {
        return Ok(());
    }
    let found = form.found_by(&read_at_most(place, LARGEST_TEXT).unwrap_or(bytes));
    Err(DatasetError::Replaces { path: target.to_owned(), found, allowed: form.name() })
}

/// The first bytes of a file, which tell its kind.
pub(crate) fn head(path: &Path) -> Result<Vec<u8>, DatasetError> {
    let mut bytes = Vec::with_capacity(HEAD as usize);
    open(path)?.take(HEAD).read_to_end(&mut bytes).map_err(DatasetError::io("read", path))?;
    Ok(bytes)
}

/// A file on its way: written beside its place, renamed by [`PendingFile::commit`], removed when dropped before.
#[derive(Debug)]
pub(crate) struct PendingFile {
    writer: Option<BufWriter<File>>,
    temporary: PathBuf,
    /// Where the file goes, links resolved.
    place: PathBuf,
    /// The same as it was named.
    target: PathBuf,
    is_committed: bool,
}

impl PendingFile {
    /// Opens the temporary file of `target`.
    pub(crate) fn create(target: &Path, form: Form) -> Result<Self, DatasetError> {
        let place = place_of(target)?;
        require_replaceable(&place, form, target)?;
        let mut all = temporaries();
        let (temporary, file) =
            create_beside(&place).map_err(DatasetError::io("create", target))?;
        all.push(temporary.clone());
        drop(all);
        Ok(Self {
            writer: Some(BufWriter::new(file)),
            temporary,
            place,
            target: target.to_owned(),
            is_committed: false,
        })
    }

    /// Brings the file to the disk and to its place.
    pub(crate) fn commit(mut self) -> Result<(), DatasetError> {
        let written = self.writer.take().map_or(Ok(()), |mut writer| {
            writer.flush()?;
            writer.get_ref().sync_all()
        });
        written.map_err(DatasetError::io("write", &self.target))?;
        fs::rename(&self.temporary, &self.place)
            .map_err(DatasetError::io("rename", &self.target))?;
        self.is_committed = true;
        Ok(())
    }

    fn writer(&mut self) -> io::Result<&mut BufWriter<File>> {
        self.writer.as_mut().ok_or_else(|| io::Error::other("file is closed"))
    }
}

/// Where a file of this name goes: where links lead, so that a link stays a link; refuses folders and devices.
pub(crate) fn place_of(target: &Path) -> Result<PathBuf, DatasetError> {
    let refuse = |found: &str, allowed: &str| {
        Err(DatasetError::content(target, "a file to write", found, allowed))
    };
    if target.file_name().is_none() {
        let found = format!("{:?}", target.display().to_string());
        return Err(DatasetError::content(
            target,
            "the name of a file to write",
            found,
            "a file name",
        ));
    }
    match fs::symlink_metadata(target) {
        Err(_) => Ok(target.to_owned()),
        Ok(metadata) if metadata.is_symlink() => match fs::canonicalize(target) {
            Ok(place) if place.is_file() => Ok(place),
            Ok(place) if place.is_dir() => refuse("a folder", "a file name"),
            Ok(_) => refuse("a link to a device or pipe", "a plain file"),
            Err(_) => refuse("a link that leads nowhere", "a plain file"),
        },
        Ok(metadata) if metadata.is_dir() => refuse("a folder", "a file name"),
        Ok(metadata) if metadata.is_file() => Ok(target.to_owned()),
        Ok(_) => refuse("a device or pipe", "a plain file"),
    }
}

/// A new file beside `place`, which nobody else has: an existing file or link of that name is never opened.
pub(crate) fn create_beside(place: &Path) -> io::Result<(PathBuf, File)> {
    // A name may be as long as the system allows, and this one is longer.
    let name = place.file_name().unwrap_or_default().to_string_lossy();
    let name: String = name.chars().take(LONGEST_NAME).collect();
    for attempt in 0..TRIES {
        let hidden = format!(".{name}.{}-{attempt}{TEMPORARY}", std::process::id());
        let temporary = place.with_file_name(hidden);
        match OpenOptions::new().write(true).create_new(true).open(&temporary) {
            Ok(file) => {
                #[cfg(target_os = "linux")]
                leftovers::remove(place, (&name, TEMPORARY), &file);
                return Ok((temporary, file));
            }
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
        }
    }
    Err(io::Error::new(io::ErrorKind::AlreadyExists, "every name for a temporary file is taken"))
}

impl Write for PendingFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.writer()?.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer()?.flush()
    }
}

impl Seek for PendingFile {
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        self.writer()?.seek(position)
    }
}

impl Drop for PendingFile {
    fn drop(&mut self) {
        if let Some(writer) = self.writer.take() {
            // What is buffered is not wanted any more.
            drop(writer.into_parts().0);
        }
        let mut all = temporaries();
        all.retain(|path| *path != self.temporary);
        if !self.is_committed {
            // There is no one to tell if it fails.
            let _ = fs::remove_file(&self.temporary);
        }
    }
}

#[cfg(test)]
mod tests;
