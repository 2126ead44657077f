//! The one error type of the crate.

use std::io;
use std::path::{Path, PathBuf};

use granulcal_dem::DemError;
use granulcal_features::FeatureError;
use granulcal_scene::{SceneError, TomlFault};

/// Why a file, a prior or a batch was refused, or could not be written.
///
/// Every variant names the thing, what was found and what is allowed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DatasetError {
    /// The file system refused.
    #[error("cannot {action} {}", path.display())]
    Io {
        /// What was tried: read, write, create, rename, lock, list.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A file of another kind stands where one is to be written.
    #[error(
        "{} is left as it is: it is {found}, and {allowed} would replace it; choose another name, or move it away",
        path.display()
    )]
    Replaces {
        /// The file that is there.
        path: PathBuf,
        /// The kind of file that it is.
        found: String,
        /// The kind of file that was to be written.
        allowed: &'static str,
    },
    /// A path of a command that is to be written cannot be, or must not.
    #[error("{argument}: {reason}")]
    Output {
        /// The argument that names it.
        argument: String,
        /// Why, and what helps.
        reason: String,
    },
    /// What stands in a file is not what must stand there.
    #[error("{}: {what} must be {allowed}, found {found}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// The thing in the file.
        what: String,
        /// What was found.
        found: String,
        /// What is allowed.
        allowed: String,
    },
    /// A file of TOML is not the TOML of this thing.
    #[error("{} is not the TOML of a {what}", path.display())]
    Toml {
        /// The file.
        path: PathBuf,
        /// What it should describe.
        what: &'static str,
        /// Where and why.
        #[source]
        source: Box<TomlFault>,
    },
    /// Another simulator did not give a pour.
    #[error("{name} gave no pour: {reason}")]
    Engine {
        /// What it is called.
        name: String,
        /// What it said.
        reason: String,
    },
    /// Something could not be written as TOML.
    #[error("{what} cannot be written as TOML")]
    TomlWrite {
        /// The thing.
        what: &'static str,
        /// Why.
        #[source]
        source: Box<toml::ser::Error>,
    },
    /// A run needs more than the machine has.
    #[error(
        "this needs about {needed} of {what}, and {available} are free; GRANULCAL_NO_LIMITS=1 in the environment \
         starts it all the same"
    )]
    NoRoom {
        /// Memory or disk.
        what: &'static str,
        /// The estimate.
        needed: String,
        /// What is free.
        available: String,
    },
    /// A number given to a function is out of range.
    #[error("{what} must be {allowed}, got {got}")]
    Argument {
        /// The argument.
        what: &'static str,
        /// What was got.
        got: String,
        /// What is allowed.
        allowed: &'static str,
    },
    /// A scene is wrong.
    #[error("{}: not a scene", path.display())]
    Scene {
        /// Where the scene stands.
        path: PathBuf,
        /// What is wrong with it.
        source: SceneError,
    },
    /// A prior is wrong, or does not fit the scene.
    #[error(transparent)]
    Prior(SceneError),
    /// A file of a sensor holds numbers that no sensor has.
    #[error("{}: not a sensor", path.display())]
    Sensor {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: SceneError,
    },
    /// A simulation was refused.
    #[error("the simulation was refused")]
    Simulation(#[source] DemError),
    /// A checkpoint is damaged, or of something else.
    #[error("{} cannot be used", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// Why.
        source: DemError,
    },
    /// One row of a batch cannot be made.
    #[error("row {row} of the data set cannot be made")]
    Row {
        /// Index of the row.
        row: u64,
        /// Why.
        source: Box<DatasetError>,
    },
    /// An image could not be rendered, segmented or described.
    #[error("the image cannot be used")]
    Features(#[source] FeatureError),
    /// A recording could not be segmented or described.
    #[error("{}: the recording cannot be used", path.display())]
    Recording {
        /// The recording.
        path: PathBuf,
        /// Why.
        source: FeatureError,
    },
    /// A file is no readable Parquet.
    #[error("{} is truncated, damaged or no Parquet file", path.display())]
    Parquet {
        /// The file.
        path: PathBuf,
        /// What the reader or writer said.
        source: parquet::errors::ParquetError,
    },
    /// A part of a batch's folder cannot be used.
    #[error("{} cannot be used; remove it, and its rows are made again", path.display())]
    Part {
        /// The part.
        path: PathBuf,
        /// What is wrong with it.
        source: Box<DatasetError>,
    },
    /// A file is no readable PNG.
    #[error("{} is truncated, damaged or no PNG", path.display())]
    Png {
        /// The file.
        path: PathBuf,
        /// What the decoder or encoder said.
        source: image::ImageError,
    },
    /// A file is no readable npz.
    #[error("{} is truncated, damaged or no npz archive", path.display())]
    Npz {
        /// The file.
        path: PathBuf,
        /// What the archive reader or writer said.
        source: zip::result::ZipError,
    },
    /// An MCAP file could not be written.
    #[error("cannot write {} as MCAP", path.display())]
    Mcap {
        /// The file.
        path: PathBuf,
        /// What the writer said.
        source: mcap::McapError,
    },
    /// The content of a file is not what was written into it.
    #[error(
        "{}: {what} hash to {found}, but {stated} was written: the file is damaged; remove it, or take a copy",
        path.display()
    )]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is damaged.
        what: &'static str,
        /// The hash of what is there.
        found: String,
        /// The hash that the file states.
        stated: String,
    },
    /// Several files cannot be used, each for a reason of its own.
    #[error("{} files cannot be used:{}", all.len(), lines(all))]
    Several {
        /// Why, two at least.
        all: Vec<DatasetError>,
    },
    /// Two things that must be the same differ.
    #[error("{}: {what} is {found}, but {given} is given; use another folder, or {what} of before", path.display())]
    Differs {
        /// The folder or file.
        path: PathBuf,
        /// What differs.
        what: String,
        /// What the file says.
        found: String,
        /// What was given.
        given: String,
    },
    /// The system starts no thread for the pours.
    #[error(
        "no thread can be started for the pours; does a limit of the shell (ulimit -u, -v) allow any?"
    )]
    NoThread(#[source] io::Error),
    /// Another process is writing into the folder.
    #[error("{}: another generate is writing into this folder", path.display())]
    Locked {
        /// The folder.
        path: PathBuf,
    },
    /// One row stands in two data sets that were to be merged, or twice in one, and is not the same.
    #[error("row {row} is one in {} and another in {}", first.display(), second.display())]
    DuplicateRow {
        /// Index of the row.
        row: u64,
        /// The file it stood in first.
        first: PathBuf,
        /// The file it stands in again.
        second: PathBuf,
    },
}

impl DatasetError {
    /// A scene that no simulation takes.
    pub(crate) fn refused(source: SceneError) -> Self {
        Self::Simulation(source.into())
    }

    /// Whether the input is to blame, and not the machine: wrong arguments and wrong or missing files.
    pub fn is_bad_input(&self) -> bool {
        match self {
            Self::Io { action, source, .. } => {
                matches!(*action, "read" | "list")
                    || matches!(
                        source.kind(),
                        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory
                    )
            }
            Self::TomlWrite { .. }
            | Self::Mcap { .. }
            | Self::Locked { .. }
            | Self::NoThread(_)
            | Self::Engine { .. } => false,
            Self::Row { source, .. } | Self::Part { source, .. } => source.is_bad_input(),
            Self::Several { all } => all.iter().all(Self::is_bad_input),
            _ => true,
        }
    }

    /// An [`DatasetError::Io`], to be used in `map_err`.
    pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { action, path: path.to_owned(), source }
    }

    /// A [`DatasetError::Content`].
    pub(crate) fn content(
        path: &Path,
        what: impl Into<String>,
        found: impl Into<String>,
        allowed: impl Into<String>,
    ) -> Self {
        Self::Content {
            path: path.to_owned(),
            what: what.into(),
            found: found.into(),
            allowed: allowed.into(),
        }
    }
}

/// A line for each error, with its causes.
fn lines(all: &[DatasetError]) -> String {
    let line = |error: &DatasetError| {
        let mut text = format!("\n  {error}");
        let mut source = std::error::Error::source(error);
        while let Some(cause) = source {
            text.push_str(": ");
            text.push_str(&cause.to_string());
            source = cause.source();
        }
        text.trim_end().to_owned()
    };
    all.iter().map(line).collect()
}
