//! Reading whole files, and writing them so that a file is complete or absent.

use std::fs::{self, File};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use crate::DatasetError;

/// End of the name of a file that is being written.
pub(crate) const TEMPORARY: &str = ".tmp";

/// The bytes of a file.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, DatasetError> {
    fs::read(path).map_err(DatasetError::io("read", path))
}

/// The text of a file.
pub(crate) fn read_text(path: &Path) -> Result<String, DatasetError> {
    fs::read_to_string(path).map_err(DatasetError::io("read", path))
}

/// Writes a file beside its place and renames it: whoever looks sees the old file or the whole new one.
///
/// # Errors
/// [`DatasetError::Io`].
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), DatasetError> {
    let mut file = PendingFile::create(path)?;
    file.write_all(bytes).map_err(DatasetError::io("write", path))?;
    file.commit()
}

/// A file on its way: written beside its place, renamed by [`PendingFile::commit`], removed when dropped before.
#[derive(Debug)]
pub(crate) struct PendingFile {
    writer: Option<BufWriter<File>>,
    temporary: PathBuf,
    target: PathBuf,
}

impl PendingFile {
    /// Opens the temporary file of `target`.
    pub(crate) fn create(target: &Path) -> Result<Self, DatasetError> {
        let name = target.file_name().ok_or_else(|| {
            let found = format!("{:?}", target.display().to_string());
            DatasetError::content(target, "the name of a file to write", found, "a file name")
        })?;
        if target.is_dir() {
            return Err(DatasetError::content(
                target,
                "a file to write",
                "a folder",
                "a file name",
            ));
        }
        let mut hidden = std::ffi::OsString::from(".");
        hidden.push(name);
        hidden.push(format!(".{}{TEMPORARY}", std::process::id()));
        let temporary = target.with_file_name(hidden);
        let file = File::create(&temporary).map_err(DatasetError::io("create", target))?;
        Ok(Self { writer: Some(BufWriter::new(file)), temporary, target: target.to_owned() })
    }

    /// Brings the file to the disk and to its place.
    pub(crate) fn commit(mut self) -> Result<(), DatasetError> {
        let written = self.writer.take().map_or(Ok(()), |mut writer| {
            writer.flush()?;
            writer.get_ref().sync_all()
        });
        written.map_err(DatasetError::io("write", &self.target))?;
        fs::rename(&self.temporary, &self.target)
            .map_err(DatasetError::io("rename", &self.target))?;
        // Nothing is left under this name; the drop's removal then finds nothing.
        Ok(())
    }

    fn writer(&mut self) -> io::Result<&mut BufWriter<File>> {
        self.writer.as_mut().ok_or_else(|| io::Error::other("file is closed"))
    }
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
        self.writer = None;
        // After a commit there is nothing to remove, and no one to tell if it fails.
        let _ = fs::remove_file(&self.temporary);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_complete_or_absent() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        let mut pending = PendingFile::create(&path).unwrap();
        pending.write_all(b"half").unwrap();
        assert!(!path.exists());
        drop(pending);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        write_file(&path, b"whole").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"whole");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_folder_is_no_file_to_write() {
        let folder = tempfile::tempdir().unwrap();
        assert!(write_file(folder.path(), b"").unwrap_err().to_string().contains("a folder"));
        let missing = folder.path().join("no/such/file");
        assert!(write_file(&missing, b"").unwrap_err().is_bad_input());
    }
}
