//! What kind of file is written, and what it may replace: nothing but a file of its own kind, and of the kinds that
//! cameras and people make, too, nothing but what granulcal wrote.

use std::borrow::Cow;

use crate::signature::{self, Signature};

/// What a camera's file begins with that stands beside an image; the hash of the rest follows.
const MARK: &str = "# Written by granulcal beside an image; once changed it is not replaced. Hash ";

/// A kind of file that granulcal writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Form {
    /// One array.
    Npy,
    /// An archive of arrays.
    Npz,
    /// A picture or a depth image.
    Png,
    /// A pour over time.
    Mcap,
    /// The state of a pour.
    Checkpoint,
    /// A table.
    Parquet,
    /// Arrays of a model.
    Safetensors,
    /// The manifest of a data set.
    ManifestToml,
    /// The camera beside an image: one that granulcal wrote and nobody has changed since.
    CameraToml,
    /// What `fit-sensor` writes.
    SensorToml,
    /// JSON.
    Json,
    /// A report.
    Html,
    /// A table as text.
    Csv,
    /// A figure.
    Pdf,
    /// A figure.
    Svg,
    /// A film of pictures.
    Gif,
    /// A film.
    Mp4,
    /// A ROS 1 recording.
    Bag,
    /// Input of another simulator, of many kinds: anything but TOML, which people write by hand.
    Export,
}

impl Form {
    /// What a file of this kind is called in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Npy => "an array (.npy)",
            Self::Npz => "an archive of arrays (.npz)",
            Self::Png => "a PNG",
            Self::Mcap => "an MCAP recording",
            Self::Checkpoint => "a checkpoint",
            Self::Parquet => "a Parquet table",
            Self::Safetensors => "a file of tensors",
            Self::ManifestToml => "the manifest of a data set",
            Self::CameraToml => "a camera's TOML that granulcal wrote and nobody changed",
            Self::SensorToml => "a sensor's TOML",
            Self::Json => "JSON",
            Self::Html => "an HTML page",
            Self::Csv => "a table of values with commas",
            Self::Pdf => "a PDF",
            Self::Svg => "an SVG",
            Self::Gif => "a GIF",
            Self::Mp4 => "an MP4",
            Self::Bag => "a ROS 1 recording",
            Self::Export => "a file of an export",
        }
    }

    /// What a file of this kind is called that is not replaced all the same.
    fn kept(self) -> String {
        let name = self.name();
        match self {
            Self::Bag => format!("{name}, which may not be had again"),
            Self::Mcap => format!("{name} and no film of a pour"),
            _ => format!("{name} that granulcal did not write, or that was changed"),
        }
    }

    /// Whether an existing file of these bytes, or of these first ones, is of this kind and may be replaced.
    pub(crate) fn fits(self, bytes: &[u8]) -> bool {
        match self {
            Self::Bag => false,
            Self::Mcap => signature::is_film(bytes),
            Self::Html => self.begins(bytes) && signature::is_page(bytes),
            Self::CameraToml => str::from_utf8(bytes).is_ok_and(is_marked),
            Self::SensorToml => str::from_utf8(bytes).is_ok_and(is_sensor),
            Self::Export => !str::from_utf8(bytes).is_ok_and(is_toml),
            other => match other.signature() {
                Some(signature) => signature.is_on(bytes),
                None => other.begins(bytes),
            },
        }
    }

    /// A file as it is written: with the signature, where its kind has one.
    pub(crate) fn signed(self, bytes: &[u8]) -> Cow<'_, [u8]> {
        match self.signature() {
            Some(signature) => signature.put(bytes).into(),
            None => bytes.into(),
        }
    }

    /// What marks a file of this kind that granulcal wrote.
    fn signature(self) -> Option<Signature> {
        Some(match self {
            Self::Png => Signature::Png,
            Self::Gif => Signature::Gif,
            Self::Npz => Signature::Npz,
            Self::Mp4 => Signature::Mp4,
            Self::Pdf => Signature::Pdf,
            Self::Svg => Signature::Svg,
            _ => return None,
        })
    }

    /// Whether a large file is none that granulcal wrote: people's films and figures are read in part alone.
    pub(crate) fn may_be_foreign(self) -> bool {
        self == Self::Html || self.signature().is_some()
    }

    /// What a file of these bytes, which this kind must not replace, is called in messages.
    pub(crate) fn found_by(self, bytes: &[u8]) -> String {
        let found = Self::found(bytes);
        if found == self.name() { self.kept() } else { found.to_owned() }
    }

    /// What a file of these bytes is called in messages, as far as they tell it.
    fn found(bytes: &[u8]) -> &'static str {
        const TOLD_BY_BYTES: [Form; 13] = [
            Form::Npy,
            Form::Npz,
            Form::Png,
            Form::Mcap,
            Form::Checkpoint,
            Form::Parquet,
            Form::Pdf,
            Form::Gif,
            Form::Mp4,
            Form::Bag,
            Form::Json,
            Form::Html,
            Form::Svg,
        ];
        if let Some(form) = TOLD_BY_BYTES.iter().find(|form| form.begins(bytes)) {
            return form.name();
        }
        match str::from_utf8(bytes) {
            Ok(text) if is_marked(text) => Form::CameraToml.name(),
            Ok(text) if is_toml(text) => "TOML",
            Ok(_) => "text of another kind",
            Err(_) => "a file of another kind",
        }
    }

    /// Whether all of a file tells its kind, and not its first bytes.
    pub(crate) fn needs_all(self) -> bool {
        matches!(self, Self::CameraToml | Self::SensorToml | Self::Export) || self.may_be_foreign()
    }

    /// Whether a file of this kind may begin like this.
    fn begins(self, head: &[u8]) -> bool {
        let text = String::from_utf8_lossy(head);
        let text = text.trim_start();
        match self {
            Self::Npy => head.starts_with(b"\x93NUMPY"),
            Self::Npz => head.starts_with(b"PK"),
            Self::Png => head.starts_with(b"\x89PNG"),
            Self::Mcap => head.starts_with(b"\x89MCAP"),
            Self::Checkpoint => head.starts_with(b"granulcal checkpoint"),
            Self::Parquet => head.starts_with(b"PAR1"),
            // The length of the header, eight bytes, then the header as JSON.
            Self::Safetensors => head.get(8) == Some(&b'{'),
            Self::ManifestToml => text.starts_with("format = "),
            Self::Json => text.starts_with(['{', '[']) && !text.starts_with("[["),
            Self::Html => text.get(..5).is_some_and(|start| {
                start.eq_ignore_ascii_case("<!doc") || start.eq_ignore_ascii_case("<html")
            }),
            Self::Csv => text.lines().next().is_some_and(|line| {
                line.contains(',') && !line.contains(['=', '{', '<', '\u{fffd}'])
            }),
            Self::Pdf => head.starts_with(b"%PDF"),
            Self::Svg => text.starts_with("<?xml") || text.starts_with("<svg"),
            Self::Gif => head.starts_with(b"GIF8"),
            // The length of the first box, four bytes, then its name.
            Self::Mp4 => head.get(4..8) == Some(b"ftyp"),
            Self::Bag => head.starts_with(b"#ROSBAG"),
            Self::CameraToml | Self::SensorToml | Self::Export => false,
        }
    }

    /// The kind of a file with this ending, of those that have one.
    pub fn of_ending(ending: &str) -> Option<Self> {
        Some(match ending.to_ascii_lowercase().as_str() {
            "npy" => Self::Npy,
            "npz" => Self::Npz,
            "png" => Self::Png,
            "parquet" => Self::Parquet,
            "safetensors" => Self::Safetensors,
            "json" => Self::Json,
            "html" => Self::Html,
            "csv" => Self::Csv,
            "pdf" => Self::Pdf,
            "svg" => Self::Svg,
            "gif" => Self::Gif,
            "mp4" => Self::Mp4,
            "bag" => Self::Bag,
            "mcap" => Self::Mcap,
            _ => return None,
        })
    }
}

/// The text of a camera with the mark before it: granulcal wrote it, and this is its hash.
pub(crate) fn marked(text: &str) -> String {
    format!("{MARK}{}\n{text}", hash(text))
}

/// Whether a text is as [`marked`] gave it.
fn is_marked(text: &str) -> bool {
    let parts = text.strip_prefix(MARK).and_then(|rest| rest.split_once('\n'));
    parts.is_some_and(|(stated, rest)| stated == hash(rest))
}

/// Whether a text is a table `camera` with a `sensor` and nothing else.
fn is_sensor(text: &str) -> bool {
    let only = |table: &toml::Table, key: &str| {
        let inner = if table.len() == 1 { table.get(key) } else { None };
        inner.and_then(toml::Value::as_table).cloned()
    };
    let document = text.parse::<toml::Table>().ok();
    document
        .and_then(|table| only(&table, "camera"))
        .is_some_and(|camera| only(&camera, "sensor").is_some())
}

/// Whether a text is TOML that says something.
fn is_toml(text: &str) -> bool {
    text.parse::<toml::Table>().is_ok_and(|table| !table.is_empty())
}

fn hash(text: &str) -> String {
    format!("{:016x}", xxhash_rust::xxh3::xxh3_64(text.as_bytes()))
}
