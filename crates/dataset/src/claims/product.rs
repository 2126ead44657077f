//! What an output of a command is: one file, a file with others beside it, or a folder.

use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use crate::{DatasetError, Form, MANIFEST, files};

/// What a command writes under one name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Product {
    /// One file.
    File(Form),
    /// A depth image with its camera's TOML beside it, or a height map: the ending says which.
    View,
    /// A figure; the ending says what kind, PNG if none.
    Figure,
    /// A file whose ending, one of these, says what kind it is.
    Ending(&'static [(&'static str, Form)]),
    /// A file or a folder for another simulator.
    Export,
    /// A folder in which these files are written, and others that nobody else has.
    Folder(&'static [(&'static str, Form)]),
}

impl Product {
    /// The data set of `generate`.
    pub const DATA_SET: Self = Self::Folder(&[(MANIFEST, Form::ManifestToml)]);
    /// The pictures of a segmentation.
    pub const PICTURES: Self = Self::Folder(&[
        ("residual.png", Form::Png),
        ("height.png", Form::Png),
        ("mask.png", Form::Png),
    ]);
    /// The model of `train`.
    pub const MODEL: Self = Self::Folder(&[
        ("model.json", Form::Json),
        ("weights.safetensors", Form::Safetensors),
        ("training.parquet", Form::Parquet),
    ]);
    /// The plots of `check`.
    pub const PLOTS: Self = Self::Folder(&[
        ("coverage.png", Form::Png),
        ("sbc.png", Form::Png),
        ("training.png", Form::Png),
    ]);
    /// The run of `calibrate`.
    pub const CALIBRATION: Self =
        Self::Folder(&[("pours.json", Form::Json), ("posterior.json", Form::Json)]);
    /// The run of `close-loop`.
    pub const LOOP: Self = Self::Folder(&[
        ("preregistration.json", Form::Json),
        ("verdict.json", Form::Json),
        ("report.html", Form::Html),
        ("conditions.parquet", Form::Parquet),
        ("candidates.parquet", Form::Parquet),
        ("residuals.parquet", Form::Parquet),
    ]);
    /// The plan of `design rings`.
    pub const RINGS: Self = Self::Folder(&[
        ("plan.csv", Form::Csv),
        ("plan.json", Form::Json),
        ("plan.png", Form::Png),
    ]);
    /// The run of `design spill`.
    pub const SPILL: Self = Self::Folder(&[
        ("pours.json", Form::Json),
        ("spill.csv", Form::Csv),
        ("spill.json", Form::Json),
        ("spill.png", Form::Png),
    ]);
    /// A recording that is simulated.
    pub const RECORDING: Self =
        Self::Folder(&[("depth.png", Form::Png), ("camera.toml", Form::CameraToml)]);
    /// A folder with a report.
    pub const REPORT: Self = Self::Folder(&[("report.html", Form::Html)]);

    /// A pour as pictures.
    pub const FILM: Self = Self::Ending(&[("gif", Form::Gif), ("mp4", Form::Mp4)]);
    /// What a camera at this computer records.
    pub const MESSAGES: Self = Self::Ending(&[("bag", Form::Bag), ("mcap", Form::Mcap)]);

    /// A folder of which nothing is known.
    pub const FOLDER: Self = Self::Folder(&[]);

    const WORDS: [(&'static str, Self); 17] = [
        ("json", Self::File(Form::Json)),
        ("html", Self::File(Form::Html)),
        ("figure", Self::Figure),
        ("film", Self::FILM),
        ("messages", Self::MESSAGES),
        ("folder", Self::FOLDER),
        ("array", Self::File(Form::Npy)),
        ("export", Self::Export),
        ("model", Self::MODEL),
        ("plots", Self::PLOTS),
        ("calibration", Self::CALIBRATION),
        ("loop", Self::LOOP),
        ("rings", Self::RINGS),
        ("spill", Self::SPILL),
        ("recording", Self::RECORDING),
        ("report", Self::REPORT),
        ("data_set", Self::DATA_SET),
    ];

    /// The files that are written, as far as their names are known.
    pub(super) fn files(self, path: &Path) -> Vec<(PathBuf, Form)> {
        match self {
            Self::File(form) => vec![(path.to_owned(), form)],
            Self::View if path.extension().is_some_and(|end| end.eq_ignore_ascii_case("npz")) => {
                vec![(path.to_owned(), Form::Npz)]
            }
            Self::View => {
                vec![(path.to_owned(), Form::Png), (path.with_extension("toml"), Form::CameraToml)]
            }
            Self::Figure => {
                let ending = path.extension().map(|end| end.to_string_lossy());
                let form = ending.and_then(|end| Form::of_ending(&end)).unwrap_or(Form::Png);
                vec![(path.to_owned(), form)]
            }
            Self::Ending(endings) => {
                let form = ending_of(path, endings).into_iter();
                form.map(|form| (path.to_owned(), form)).collect()
            }
            Self::Export if path.is_dir() => Vec::new(),
            Self::Export => vec![(path.to_owned(), Form::Export)],
            Self::Folder(names) => {
                names.iter().map(|(name, form)| (path.join(name), *form)).collect()
            }
        }
    }

    /// Why nothing can be written there, if so: tried by making a file and removing it.
    pub(super) fn unfit_place(self, path: &Path) -> Option<String> {
        if let Self::Folder(_) = self {
            if path.exists() && !path.is_dir() {
                return Some(format!("{} must be a folder, found a file", path.display()));
            }
        } else if self == Self::Export && path.is_dir() {
            // Its files are made in it.
        } else if let Err(error) = files::place_of(path) {
            return Some(error.to_string());
        }
        if let Self::Ending(endings) = self
            && ending_of(path, endings).is_none()
        {
            let allowed: Vec<_> = endings.iter().map(|(word, _)| format!(".{word}")).collect();
            return Some(format!("{} must end in {}", path.display(), allowed.join(" or ")));
        }
        if self == Self::MESSAGES && fs::metadata(path).is_ok_and(|there| there.len() > 0) {
            return Some(format!(
                "{} is left as it is: what it records may not be had again; choose another name, or move it away",
                path.display()
            ));
        }
        let there = |above: &&Path| above.exists() || above.as_os_str().is_empty();
        // Some are made with the folders above them: the lowest one that is there counts.
        let folder = match self {
            Self::Folder(_) | Self::Export => path
                .ancestors()
                .skip(usize::from(!path.is_dir() && self == Self::Export))
                .find(there),
            Self::Figure | Self::Ending(_) | Self::File(Form::Html) => {
                path.ancestors().skip(1).find(there)
            }
            _ => path.parent(),
        };
        let folder =
            folder.filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let (shown, wanted) = (folder.display(), path.display());
        if !folder.exists() {
            return Some(format!("the folder {shown} of {wanted} does not exist; make it first"));
        }
        if !folder.is_dir() {
            return Some(format!("{shown}, in which {wanted} is to be, is no folder"));
        }
        let ending = path.extension().and_then(|end| Form::of_ending(&end.to_string_lossy()));
        if let (Self::File(form), Some(other)) = (self, ending)
            && other != form
        {
            return Some(format!(
                "{} ends as {} does, and {} is written",
                path.display(),
                other.name(),
                form.name()
            ));
        }
        match files::create_beside(&folder.join("granulcal")) {
            Ok((temporary, file)) => {
                drop(file);
                fs::remove_file(&temporary).err().map(|error| format!("{shown}: {error}"))
            }
            Err(error) => Some(format!("nothing can be written into the folder {shown}: {error}")),
        }
    }
}

/// The kind of file that the ending of a path says, if it is one of these.
fn ending_of(path: &Path, endings: &[(&str, Form)]) -> Option<Form> {
    let ending = path.extension()?;
    endings.iter().find(|(word, _)| ending.eq_ignore_ascii_case(word)).map(|(_, form)| *form)
}

impl FromStr for Product {
    type Err = DatasetError;

    /// The product of a word, as the Python side names it.
    fn from_str(word: &str) -> Result<Self, DatasetError> {
        let known = Self::WORDS.iter().find(|(name, _)| *name == word);
        known.map(|(_, product)| *product).ok_or_else(|| DatasetError::Argument {
            what: "the kind of an output",
            got: format!("{word:?}"),
            allowed: "json, html, figure, film, messages, folder, export, model, plots, calibration, loop, rings, spill, recording, report \
                      or data_set",
        })
    }
}
