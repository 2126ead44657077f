//! A folder of frames, or of what a ROS 2 recorder writes.

use std::cmp::Ordering;
use std::path::{Path, PathBuf};

use granulcal_features::{DepthImage, Intrinsics};

use crate::DatasetError;
use crate::image_file::{self, Unreadable};
use crate::input::unpack_limit;
use crate::mean::Mean;
use crate::png::unreadable;

/// How the other storage of ROS 2 is told.
pub(super) const OTHER_STORAGE: &str =
    "an SQLite recording (.db3), which `ros2 bag convert` turns into .mcap";

/// A PNG frame: its name and its bytes, or why it cannot be read.
pub type Frame = Result<(PathBuf, Vec<u8>), DatasetError>;

/// A folder that is a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Folder {
    /// Depth frames, in order of their names, numbers in these by their value: 9.png comes before 10.png.
    Frames(Vec<PathBuf>),
    /// One recording of messages.
    Messages(PathBuf),
}

impl Folder {
    /// Looks what a folder holds.
    ///
    /// # Errors
    /// [`DatasetError::Io`], or [`DatasetError::Content`] for a folder with none or several of them.
    pub fn open(folder: &Path) -> Result<Self, DatasetError> {
        let list = || DatasetError::io("list", folder);
        let entries = std::fs::read_dir(folder).map_err(list())?;
        let entries = entries.collect::<Result<Vec<_>, _>>().map_err(list())?;
        let mut files: Vec<_> = entries.iter().map(std::fs::DirEntry::path).collect();
        files.sort_by(|a, b| by_numbers(a, b));
        let of = |ending: &str| -> Vec<PathBuf> {
            let fits = |path: &&PathBuf| {
                path.extension().is_some_and(|found| found.eq_ignore_ascii_case(ending))
            };
            files.iter().filter(fits).cloned().collect()
        };
        let frames = of("png");
        if !frames.is_empty() {
            return Ok(Self::Frames(frames));
        }
        let messages = [of("mcap"), of("bag")].concat();
        if let [one] = &messages[..] {
            return Ok(Self::Messages(one.clone()));
        }
        let found = match (messages.len(), of("db3").len()) {
            (0, 0) => "no .png, .mcap or .bag".to_owned(),
            (0, _) => OTHER_STORAGE.to_owned(),
            (count, _) => format!("{count} recordings of messages; give one of them"),
        };
        let allowed = "depth frames as .png, or one .mcap or .bag";
        Err(DatasetError::content(folder, "the folder", found, allowed))
    }
}

/// Compares names as people do: runs of digits as numbers, the rest, and what is equal so far, as text.
fn by_numbers(a: &Path, b: &Path) -> Ordering {
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let (left, right) = (name(a), name(b));
    let (mut ours, mut theirs) = (&left[..], &right[..]);
    while !ours.is_empty() && !theirs.is_empty() {
        let ((part, rest), (other, other_rest)) = (first_part(ours), first_part(theirs));
        let both_are_numbers =
            [part, other].iter().all(|part| part.starts_with(|c: char| c.is_ascii_digit()));
        let order = if both_are_numbers {
            // Of any length: by the number of digits, then by these.
            let [n, m] = [part, other].map(|digits| digits.trim_start_matches('0'));
            n.len().cmp(&m.len()).then_with(|| n.cmp(m))
        } else {
            part.cmp(other)
        };
        if order != Ordering::Equal {
            return order;
        }
        (ours, theirs) = (rest, other_rest);
    }
    ours.len().cmp(&theirs.len()).then_with(|| a.cmp(b))
}

/// The digits, or the text without any, that a name begins with, and what follows.
fn first_part(name: &str) -> (&str, &str) {
    let is_number = name.starts_with(|c: char| c.is_ascii_digit());
    let end = name.find(|c: char| c.is_ascii_digit() != is_number).unwrap_or(name.len());
    name.split_at(end)
}

/// The mean of PNG frames, and what could not be read of them.
pub(super) struct Average {
    pub(super) image: DepthImage,
    /// Frames that were averaged.
    pub(super) frames: usize,
    /// Why others were not, a line each.
    pub(super) damage: Vec<String>,
    /// That they are not of one view, if they do not look so.
    pub(super) unlike: Option<String>,
}

/// Averages frames that a camera took: its lens, its unit and the name of its file.
pub(super) fn average(
    folder: &Path,
    frames: impl IntoIterator<Item = Frame>,
    (lens, unit, camera_path): (Intrinsics, f64, &Path),
) -> Result<Average, DatasetError> {
    let mut mean: Option<Mean> = None;
    let (mut damage, mut first_error) = (Vec::new(), None);
    for frame in frames {
        let (path, bytes) = frame?;
        let frame = match image_file::depth(&bytes, unpack_limit(bytes.len() as u64)) {
            Ok(frame) => frame,
            Err(Unreadable::Damaged(source)) => {
                damage.push(format!("{}: {source}", path.display()));
                first_error.get_or_insert(DatasetError::Png { path, source });
                continue;
            }
            Err(unfit) => return Err(unreadable(&path, unfit)),
        };
        if (frame.width, frame.height) != (lens.width, lens.height) {
            let found = format!("{}x{}", frame.width, frame.height);
            let allowed = format!("{}x{} as in {}", lens.width, lens.height, camera_path.display());
            return Err(DatasetError::content(&path, "the size", found, allowed));
        }
        match &mut mean {
            None => mean = Some(Mean::new(frame, unit)),
            Some(mean) => mean.add(&frame).map_err(|fault| fault.in_file(&path))?,
        }
    }
    let Some(mean) = mean else {
        let nothing = || DatasetError::content(folder, "the frames", "none", "at least one");
        return Err(first_error.unwrap_or_else(nothing));
    };
    let (frames, unlike) = (mean.frames(), mean.doubt());
    let image = mean.finish().map_err(|fault| fault.in_file(folder))?;
    Ok(Average { image, frames, damage, unlike })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_in_the_order_of_their_numbers() {
        let mut names = [
            "b_2.png",
            "depth_10.png",
            "depth_9.png",
            "depth_9b.png",
            "depth_009.png",
            "depth_1.png",
            "a.png",
            "depth_9_10.png",
            "depth_9_2.png",
            "depth.png",
        ]
        .map(|name| Path::new("frames").join(name));
        names.sort_by(|a, b| by_numbers(a, b));
        let found: Vec<_> =
            names.iter().map(|path| path.file_stem().unwrap().to_str().unwrap()).collect();
        let wanted = [
            "a",
            "b_2",
            "depth",
            "depth_1",
            "depth_009",
            "depth_9",
            "depth_9_2",
            "depth_9_10",
            "depth_9b",
            "depth_10",
        ];
        assert_eq!(found, wanted);
    }
}
