//! The header of a .npy file, and reading on behind it.

use std::io::{self, Read};
use std::path::Path;

use crate::DatasetError;

/// What a file begins with.
pub(super) const MAGIC: &[u8; 6] = b"\x93NUMPY";

/// Bytes of a header beyond which it is none: NumPy's own limit is 10 000.
const MAX_HEADER: usize = 1 << 16;
/// Values beyond this in one array are a slip or a damaged header, not a recording.
const MAX_VALUES: usize = 1 << 30;

/// What a .npy header says.
pub(super) struct Header {
    pub(super) descr: String,
    pub(super) fortran_order: bool,
    pub(super) shape: Vec<usize>,
    /// Values of the array.
    pub(super) count: usize,
}

/// Names a fault of an array; `file` and `array` say where.
pub(super) struct Place<'a> {
    file: &'a Path,
    array: &'a str,
}

impl Place<'_> {
    pub(super) fn error(
        &self,
        what: &str,
        found: impl Into<String>,
        allowed: impl Into<String>,
    ) -> DatasetError {
        let what = if self.array.is_empty() {
            what.to_owned()
        } else {
            format!("{what} of {}", self.array)
        };
        DatasetError::content(self.file, what, found, allowed)
    }
}

/// A .npy file being read from front to back.
pub(super) struct Source<'a> {
    pub(super) place: Place<'a>,
    reader: &'a mut dyn Read,
    /// Bytes read so far.
    at: usize,
}

impl<'a> Source<'a> {
    pub(super) fn new(file: &'a Path, array: &'a str, reader: &'a mut dyn Read) -> Self {
        Self { place: Place { file, array }, reader, at: 0 }
    }

    fn damaged(&self, error: &io::Error) -> DatasetError {
        let found = format!("{error} behind byte {}", self.at);
        self.place.error("the array", found, "whole")
    }

    /// Reads until the buffer is full or the file ends; returns how much there was.
    pub(super) fn fill(&mut self, buffer: &mut [u8]) -> Result<usize, DatasetError> {
        let mut there = 0;
        while there < buffer.len() {
            match self.reader.read(&mut buffer[there..]) {
                Ok(0) => break,
                Ok(count) => there += count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(self.damaged(&error)),
            }
        }
        self.at += there;
        Ok(there)
    }

    /// Looks behind the array: an archive checks its sum there.
    pub(super) fn end(&mut self) -> Result<(), DatasetError> {
        self.fill(&mut [0]).map(|_| ())
    }

    pub(super) fn truncated_data(&self, found: usize, needed: usize) -> DatasetError {
        let found = format!("{found} bytes, it is truncated");
        self.place.error("the data", found, format!("{needed} bytes"))
    }

    fn exact<const N: usize>(&mut self) -> Result<[u8; N], DatasetError> {
        let mut bytes = [0; N];
        if self.fill(&mut bytes)? < N {
            return Err(self.truncated_header());
        }
        Ok(bytes)
    }

    fn truncated_header(&self) -> DatasetError {
        let found = format!("truncated after {} bytes", self.at);
        self.place.error("the .npy header", found, "complete")
    }

    pub(super) fn header(&mut self) -> Result<Header, DatasetError> {
        if self.exact()? != *MAGIC {
            return Err(self.place.error("the array", "other bytes", "in .npy format"));
        }
        let [version, _] = self.exact()?;
        let length = match version {
            1 => usize::from(u16::from_le_bytes(self.exact()?)),
            2 | 3 => u32::from_le_bytes(self.exact()?) as usize,
            other => {
                return Err(self.place.error("the .npy version", other.to_string(), "1, 2 or 3"));
            }
        };
        if length > MAX_HEADER {
            let (found, allowed) =
                (format!("{length} bytes"), format!("at most {MAX_HEADER} bytes"));
            return Err(self.place.error("the .npy header", found, allowed));
        }
        let mut text = vec![0; length];
        if self.fill(&mut text)? < length {
            return Err(self.truncated_header());
        }
        let text = String::from_utf8_lossy(&text);
        let parsed = (|| {
            let descr = text_of(after_key(&text, "descr")?)?;
            let fortran_order = match after_key(&text, "fortran_order")? {
                order if order.starts_with("True") => true,
                order if order.starts_with("False") => false,
                _ => return None,
            };
            Some((descr, fortran_order, shape_of(after_key(&text, "shape")?)?))
        })();
        let allowed = "a dict of descr (one type), fortran_order and shape";
        let (descr, fortran_order, shape) = parsed
            .ok_or_else(|| self.place.error("the .npy header", text.trim().to_owned(), allowed))?;
        let count = shape.iter().try_fold(1usize, |product, &n| product.checked_mul(n));
        let Some(count) = count.filter(|&count| count <= MAX_VALUES) else {
            let allowed = format!("at most {MAX_VALUES} values");
            return Err(self.place.error("the shape", format!("{shape:?}"), allowed));
        };
        Ok(Header { descr, fortran_order, shape, count })
    }
}

/// The text behind `'key':` in a Python dict.
fn after_key<'a>(dict: &'a str, key: &str) -> Option<&'a str> {
    let quoted = [format!("'{key}'"), format!("\"{key}\"")];
    let at = quoted.iter().find_map(|q| dict.find(q.as_str()).map(|i| i + q.len()))?;
    Some(dict[at..].trim_start().strip_prefix(':')?.trim_start())
}

fn text_of(value: &str) -> Option<String> {
    let quote = value.chars().next().filter(|c| matches!(c, '\'' | '"'))?;
    value[1..].split_once(quote).map(|(text, _)| text.to_owned())
}

fn shape_of(value: &str) -> Option<Vec<usize>> {
    let (inner, _) = value.strip_prefix('(')?.split_once(')')?;
    let entries = inner.split(',').map(str::trim).filter(|entry| !entry.is_empty());
    entries.map(|entry| entry.parse().ok()).collect()
}
