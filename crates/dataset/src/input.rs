//! The bytes of a recording: a file, or anything else that can be read and sought.

use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use crate::{DatasetError, files};

/// Least size `[B]` that unpacked data may have, however small the file is.
const UNPACK_FLOOR: u64 = 32 << 20;
/// Unpacked bytes per byte of the file beyond the floor.
const UNPACK_RATIO: u64 = 2;
/// Room for reading ahead `[B]`.
const READ_AHEAD: usize = 64 << 10;

/// What a recording can be read from.
pub trait ReadSeek: Read + Seek + Send {}

impl<T: Read + Seek + Send> ReadSeek for T {}

/// An open recording. Nothing of it is held but what was asked for last.
pub(crate) struct Input<'a> {
    path: PathBuf,
    reader: BufReader<Box<dyn ReadSeek + 'a>>,
    length: u64,
}

impl<'a> Input<'a> {
    /// Opens a file.
    pub(crate) fn open(path: &Path) -> Result<Self, DatasetError> {
        Self::new(path, files::open(path)?)
    }

    /// Reads from `reader`; `path` is its name in messages.
    pub(crate) fn new(path: &Path, reader: impl ReadSeek + 'a) -> Result<Self, DatasetError> {
        let mut reader = BufReader::with_capacity(READ_AHEAD, Box::new(reader) as Box<_>);
        let length = reader.seek(SeekFrom::End(0)).map_err(DatasetError::io("read", path))?;
        Ok(Self { path: path.to_owned(), reader, length })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Bytes of the whole file.
    pub(crate) fn length(&self) -> u64 {
        self.length
    }

    /// Bytes at `offset`, `count` of them or what there is until the end of the file.
    pub(crate) fn read(&mut self, offset: u64, count: u64) -> Result<Vec<u8>, DatasetError> {
        let count = count.min(self.length.saturating_sub(offset));
        if count == 0 {
            // An offset of a damaged file may be nowhere.
            return Ok(Vec::new());
        }
        let mut bytes = Vec::with_capacity(count as usize);
        let mut fill = || {
            self.seek_to(offset)?;
            (&mut self.reader).take(count).read_to_end(&mut bytes)
        };
        fill().map_err(DatasetError::io("read", &self.path))?;
        Ok(bytes)
    }

    /// Exactly `N` bytes at `offset`, or none where the file ends before.
    pub(crate) fn array<const N: usize>(
        &mut self,
        offset: u64,
    ) -> Result<Option<[u8; N]>, DatasetError> {
        Ok(self.read(offset, N as u64)?.try_into().ok())
    }

    /// Most bytes that data of this file may unpack to; protects against compression bombs.
    pub(crate) fn unpack_limit(&self) -> u64 {
        unpack_limit(self.length)
    }

    /// The whole file.
    pub(crate) fn read_all(&mut self) -> Result<Vec<u8>, DatasetError> {
        self.read(0, self.length)
    }

    /// The reader itself, at the start of the file.
    pub(crate) fn into_reader(mut self) -> Result<BufReader<Box<dyn ReadSeek + 'a>>, DatasetError> {
        self.reader.rewind().map_err(DatasetError::io("read", &self.path))?;
        Ok(self.reader)
    }

    /// Moves without throwing away what was read ahead.
    fn seek_to(&mut self, offset: u64) -> io::Result<()> {
        let now = self.reader.stream_position()?;
        self.reader.seek_relative(offset.wrapping_sub(now).cast_signed())
    }
}

/// Most bytes that data of a file of `length` bytes may unpack to: twice the file, or 32 MiB where
/// that is more. A chunk, its images and their mean then stay below four times the file, or 128 MiB.
pub(crate) fn unpack_limit(length: u64) -> u64 {
    length.saturating_mul(UNPACK_RATIO).max(UNPACK_FLOOR)
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    #[test]
    fn reads_stop_at_the_end_of_the_file() {
        let mut input = Input::new(Path::new("a"), Cursor::new(b"0123456789".to_vec())).unwrap();
        assert_eq!(input.read(8, u64::MAX).unwrap(), b"89");
        assert_eq!(input.read(2, 3).unwrap(), b"234");
        assert_eq!(input.read(11, 1).unwrap(), b"");
        assert_eq!(input.array(6).unwrap(), Some(*b"6789"));
        assert_eq!(input.array::<4>(7).unwrap(), None);
        assert_eq!(unpack_limit(10), 32 << 20);
        assert_eq!(unpack_limit(1 << 30), 2 << 30);
    }
}
