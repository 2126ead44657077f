//! NumPy's .npz archives, and height maps in them.

use std::io::{Cursor, Read, Write};
use std::path::{Path, PathBuf};

use granulcal_features::HeightMap;
use zip::write::SimpleFileOptions;
use zip::{ZipArchive, ZipWriter};

use crate::npy::{self, Array};
use crate::{DatasetError, files};

/// Bytes of one unpacked array beyond which an archive is refused; protects against zip bombs.
const MAX_BYTES: u64 = 1 << 32;

/// An open archive.
pub struct Npz {
    path: PathBuf,
    archive: ZipArchive<Cursor<Vec<u8>>>,
}

impl Npz {
    /// Opens an archive.
    ///
    /// # Errors
    /// [`DatasetError::Io`] or [`DatasetError::Npz`].
    pub fn open(path: &Path) -> Result<Self, DatasetError> {
        let bytes = files::read(path)?;
        let archive = ZipArchive::new(Cursor::new(bytes))
            .map_err(|source| DatasetError::Npz { path: path.to_owned(), source })?;
        Ok(Self { path: path.to_owned(), archive })
    }

    /// Names of the arrays, as NumPy shows them.
    pub fn names(&self) -> Vec<String> {
        let plain = |name: &str| name.strip_suffix(".npy").unwrap_or(name).to_owned();
        // A name that is no text names no array.
        let mut names: Vec<_> = self.archive.file_names().flatten().map(|n| plain(&n)).collect();
        names.sort_unstable();
        names
    }

    fn bytes(&mut self, name: &str) -> Result<Vec<u8>, DatasetError> {
        let names = self.names();
        let broken = |source| DatasetError::Npz { path: self.path.clone(), source };
        let file = match self.archive.by_name(&format!("{name}.npy")) {
            Err(zip::result::ZipError::FileNotFound) => {
                let what = format!("array {name}");
                let found = format!("only {}", names.join(", "));
                return Err(DatasetError::content(&self.path, what, found, "in the archive"));
            }
            other => other.map_err(broken)?,
        };
        let mut bytes = Vec::new();
        file.take(MAX_BYTES).read_to_end(&mut bytes).map_err(|source| DatasetError::Npz {
            path: self.path.clone(),
            source: source.into(),
        })?;
        Ok(bytes)
    }

    /// An array of numbers.
    ///
    /// # Errors
    /// [`DatasetError::Content`] for a name that is not there or an array that is none of numbers.
    pub fn array(&mut self, name: &str) -> Result<Array, DatasetError> {
        let bytes = self.bytes(name)?;
        npy::parse(&self.path, name, &bytes)
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
        let scale = self.bytes("scale")?;
        let unit = match npy::parse_text(&self.path, "scale", &scale)?.as_str() {
            "mm" => 1e-3,
            "m" => 1.0,
            other => {
                let found = format!("{other:?}");
                return Err(DatasetError::content(&self.path, "scale", found, "\"mm\" or \"m\""));
            }
        };
        let (x, y, z) = (self.positive("xres")?, self.positive("yres")?, self.positive("zres")?);
        let heights = array.values.iter().map(|value| value * z * unit).collect();
        HeightMap::new(width, height, x * unit, y * unit, heights)
            .map_err(|source| DatasetError::Recording { path: self.path.clone(), source })
    }
}

/// Writes a height map in metres, in the keys that [`Npz::height_map`] reads.
///
/// # Errors
/// [`DatasetError::Io`] or [`DatasetError::Npz`].
pub fn write_height_map(path: &Path, map: &HeightMap) -> Result<(), DatasetError> {
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
    files::write_file(path, &bytes.into_inner())
}
