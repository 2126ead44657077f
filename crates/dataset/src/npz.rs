//! NumPy's .npz archives, and height maps in them.

use std::io::{BufReader, Cursor, Read, Write};
use std::path::{Path, PathBuf};

use granulcal_features::HeightMap;
use zip::write::SimpleFileOptions;
use zip::{ZipArchive, ZipWriter};

use crate::input::{Input, ReadSeek};
use crate::npy::{self, Array};
use crate::{DatasetError, Form, files};

/// Arrays beyond which an archive is no recording.
const MAX_ARRAYS: usize = 1 << 12;
/// Bytes of the end record of an archive, and most bytes of the comment behind it.
const END_RECORD: u64 = 22 + (u16::MAX as u64);

/// An open archive.
pub struct Npz<'a> {
    path: PathBuf,
    archive: ZipArchive<BufReader<Box<dyn ReadSeek + 'a>>>,
    /// Most bytes that the numbers of an array may take; protects against zip bombs.
    limit: u64,
}

impl Npz<'static> {
    /// Opens an archive.
    ///
    /// # Errors
    /// [`DatasetError::Io`] or [`DatasetError::Npz`].
    pub fn open(path: &Path) -> Result<Self, DatasetError> {
        Self::take(Input::open(path)?)
    }
}

impl<'a> Npz<'a> {
    pub(crate) fn take(mut input: Input<'a>) -> Result<Self, DatasetError> {
        let (path, limit) = (input.path().to_owned(), npy::array_limit(input.length()));
        let from = input.length().saturating_sub(END_RECORD);
        let entries = claimed_entries(&input.read(from, END_RECORD)?);
        if entries > MAX_ARRAYS {
            let allowed = format!("at most {MAX_ARRAYS}");
            return Err(DatasetError::content(
                &path,
                "the number of arrays",
                entries.to_string(),
                allowed,
            ));
        }
        let archive = ZipArchive::new(input.into_reader()?)
            .map_err(|source| DatasetError::Npz { path: path.clone(), source })?;
        Ok(Self { path, archive, limit })
    }

    /// Names of the arrays, as NumPy shows them.
    pub fn names(&self) -> Vec<String> {
        let plain = |name: &str| name.strip_suffix(".npy").unwrap_or(name).to_owned();
        // A name that is no text names no array.
        let mut names: Vec<_> = self.archive.file_names().flatten().map(|n| plain(&n)).collect();
        names.sort_unstable();
        names
    }

    /// The bytes of an array's .npy file, as they are unpacked.
    fn reader(&mut self, name: &str) -> Result<impl Read, DatasetError> {
        let file_name = format!("{name}.npy");
        if self.archive.index_for_name(&file_name).is_none() {
            let what = format!("array {name}");
            let found = format!("only {}", self.names().join(", "));
            return Err(DatasetError::content(&self.path, what, found, "in the archive"));
        }
        self.archive
            .by_name(&file_name)
            .map_err(|source| DatasetError::Npz { path: self.path.clone(), source })
    }

    /// An array of numbers.
    ///
    /// # Errors
    /// [`DatasetError::Content`] for a name that is not there or an array that is none of numbers.
    pub fn array(&mut self, name: &str) -> Result<Array, DatasetError> {
        let (path, limit) = (self.path.clone(), self.limit);
        npy::parse(&path, name, &mut self.reader(name)?, limit)
    }

    fn text(&mut self, name: &str) -> Result<String, DatasetError> {
        let path = self.path.clone();
        npy::parse_text(&path, name, &mut self.reader(name)?)
    }

    /// One positive number.
    fn positive(&mut self, name: &str) -> Result<f64, DatasetError> {
        let array = self.array(name)?;
        let refuse = |found: String| {
            Err(DatasetError::content(&self.path, name, found, "one positive, finite number"))
        };
        match array.values[..] {
            [value] if value > 0.0 && value.is_finite() => Ok(value),
            [value] => refuse(value.to_string()),
            _ => refuse(format!("an array of shape {:?}", array.shape)),
        }
    }

    /// The height map of an archive with the arrays `depthmap`, `xres`, `yres`, `zres` and `scale`.
    ///
    /// # Errors
    /// [`DatasetError::Content`] names the array, what was found and what is allowed.
    pub fn height_map(&mut self) -> Result<HeightMap, DatasetError> {
        let array = self.array("depthmap")?;
        let [height, width] = array.shape[..] else {
            let found = format!("{:?}", array.shape);
            return Err(DatasetError::content(
                &self.path,
                "the shape of depthmap",
                found,
                "(h, w)",
            ));
        };
        let unit = match self.text("scale")?.as_str() {
            "mm" => 1e-3,
            "m" => 1.0,
            other => {
                let found = format!("{other:?}");
                return Err(DatasetError::content(&self.path, "scale", found, "\"mm\" or \"m\""));
            }
        };
        let (x, y, z) = (self.positive("xres")?, self.positive("yres")?, self.positive("zres")?);
        // In place: a large map stands in memory once.
        let heights = array.values.into_iter().map(|value| value * z * unit).collect();
        HeightMap::new(width, height, x * unit, y * unit, heights)
            .map_err(|source| DatasetError::Recording { path: self.path.clone(), source })
    }
}

/// Most entries that any end record in the last bytes of an archive claims: each costs memory before
/// it is examined.
fn claimed_entries(tail: &[u8]) -> usize {
    let records = tail.windows(12).filter(|bytes| bytes.starts_with(b"PK\x05\x06"));
    records.map(|bytes| usize::from(u16::from_le_bytes([bytes[10], bytes[11]]))).max().unwrap_or(0)
}

/// Writes a height map in metres, in the keys that [`Npz::height_map`] reads.
///
/// # Errors
/// [`DatasetError::Features`] for a map whose heights are not those of its size, or of a resolution that no map has;
/// [`DatasetError::Io`] or [`DatasetError::Npz`].
pub fn write_height_map(path: &Path, map: &HeightMap) -> Result<(), DatasetError> {
    map.require_valid().map_err(DatasetError::Features)?;
    let number = |value| npy::encode(&[], [value]);
    let arrays = [
        ("depthmap", npy::encode(&[map.height, map.width], map.z.iter().copied())),
        ("xres", number(map.resolution_x)),
        ("yres", number(map.resolution_y)),
        ("zres", number(1.0)),
        ("scale", npy::encode_text("m")),
    ];
    write_arrays(path, &arrays)
}

/// Writes arrays, each with its name and the bytes of its .npy file.
pub(crate) fn write_arrays(path: &Path, arrays: &[(&str, Vec<u8>)]) -> Result<(), DatasetError> {
    let pack = || {
        let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
        for (name, bytes) in arrays {
            archive.start_file(format!("{name}.npy"), SimpleFileOptions::default())?;
            archive.write_all(bytes)?;
        }
        archive.finish()
    };
    let bytes = pack().map_err(|source| DatasetError::Npz { path: path.to_owned(), source })?;
    files::write_file(path, Form::Npz, &bytes.into_inner())
}
