//! Measured height maps and depth images, described by the same code as simulated ones.

mod depth_array;
mod folder;
mod messages;
mod options;

use std::ops::Range;
use std::path::{Path, PathBuf};

use granulcal_features::{
    Camera, ColourImage, DepthImage, Formation, HeightMap, Intrinsics, Levelled, Segmentation,
    level_depth, level_height_map, paper16,
};

pub use folder::{Folder, Frame};
pub use options::{FRAMES, ReadOptions, camera_beside};

use crate::camera_file::{camera_of, require_pixels};
use crate::depth_frame::{DepthFrame, Values};
use crate::fault::Fault;
use crate::input::{Input, ReadSeek};
use crate::mean::Mean;
use crate::message_file::MessageFormat;
use crate::{CameraFile, DatasetError, Lost, Npz, files, npy};

/// Largest depth that an image in memory may have `[m]`: beyond it are other units.
const DEEPEST: f32 = 100.0;

/// What was measured.
#[derive(Clone, Debug)]
pub enum Source {
    /// A height map.
    Heights(HeightMap),
    /// A depth image, perhaps the mean of many frames, with its camera and perhaps a colour image.
    Depth {
        /// The camera, at the origin.
        camera: Camera,
        /// Depth `[m]`; 0 is no data.
        image: DepthImage,
        /// Colour of the same pixels.
        colour: Option<ColourImage>,
    },
}

/// One measured formation.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The file or folder.
    pub path: PathBuf,
    /// What was measured.
    pub source: Source,
    /// Topic of the depth images, if it has topics.
    pub topic: Option<String>,
    /// Frames that were averaged.
    pub frames: usize,
    /// Indices of the frames that were read to be averaged, damaged ones among them.
    pub window: Range<u64>,
    /// Whole frames that there are.
    pub whole_frames: u64,
    /// Frames that are lost, if the recording is cut off or damaged.
    pub lost: Option<Lost>,
    /// What is damaged, a line each.
    pub damage: Vec<String>,
    /// That its frames are not of one formation at rest, if they do not look so, and what of its own lens and unit the
    /// camera's file contradicts.
    pub unlike: Option<String>,
    /// Metres per count of a depth image.
    pub depth_unit: Option<f64>,
    /// How it is segmented: from the camera's file, else the default.
    pub segmentation: Segmentation,
}

impl Recording {
    /// Opens a recording: a ROS 1 .bag, an .mcap, an .npz height map, depth images as a 16-bit PNG or an .npy array, or
    /// a folder of such PNGs of one formation or of one .bag or .mcap. What a file is says its content.
    ///
    /// Of several frames the mean is taken, pixel by pixel over those that have data there. A file
    /// that is cut off or damaged gives the frames that are whole; [`Recording::lost`] counts the
    /// others.
    ///
    /// # Errors
    /// [`DatasetError`] names the file, what was found and what is allowed.
    pub fn open(path: &Path, options: &ReadOptions) -> Result<Self, DatasetError> {
        if !path.is_dir() {
            return Self::take(Input::open(path)?, options);
        }
        match Folder::open(path)? {
            Folder::Messages(file) => Self::take(Input::open(&file)?, options),
            Folder::Frames(frames) => {
                let window = options.window(path, frames.len() as u64)?;
                let chosen = &frames[window.start as usize..window.end as usize];
                let open = |frame: &PathBuf| {
                    Ok((frame.clone(), files::read_at_most(frame, files::LARGEST_PART)?))
                };
                let recording = Self::take_frames(path, chosen.iter().map(open), options)?;
                let whole_frames = frames.len() as u64 - recording.damage.len() as u64;
                Ok(Self { window, whole_frames, ..recording })
            }
        }
    }

    /// The frames that [`Recording::open`] would average, each by itself. The first tells what is
    /// damaged and lost; a damaged frame is not among them.
    ///
    /// # Errors
    /// As [`Recording::open`].
    pub fn open_each(path: &Path, options: &ReadOptions) -> Result<Vec<Self>, DatasetError> {
        let all = Self::open(path, options)?;
        if all.frames == 1 {
            return Ok(vec![all]);
        }
        let mut each = Vec::with_capacity(all.frames);
        for index in all.window.clone() {
            let one = ReadOptions { frames: 1, first_frame: Some(index), ..options.clone() };
            match Self::open(path, &one) {
                Ok(frame) => each.push(Self { damage: Vec::new(), lost: None, ..frame }),
                // What is damaged is told already; all other misfits failed with all frames.
                Err(_) if !all.damage.is_empty() => {}
                Err(error) => return Err(error),
            }
        }
        if let Some(first) = each.first_mut() {
            (first.damage, first.lost) = (all.damage, all.lost);
        }
        Ok(each)
    }

    /// As [`Recording::open`], from anything that can be read and sought; `path` is its name in
    /// messages.
    ///
    /// # Errors
    /// As [`Recording::open`].
    pub fn read(
        path: &Path,
        reader: impl ReadSeek,
        options: &ReadOptions,
    ) -> Result<Self, DatasetError> {
        Self::take(Input::new(path, reader)?, options)
    }

    fn take(mut input: Input<'_>, options: &ReadOptions) -> Result<Self, DatasetError> {
        let first = input.read(0, 16)?;
        if MessageFormat::of(&first).is_some() {
            return Self::take_messages(input, options);
        }
        let path = input.path().to_owned();
        match &first[..] {
            [b'P', b'K', 3 | 5, _, ..] => Self::take_npz(input, options),
            [0x89, b'P', b'N', b'G', ..] => {
                let frame = input.read_all()?;
                options.window(&path, 1)?;
                Self::take_frames(&path, [Ok((path.clone(), frame))], options)
            }
            first if npy::is_npy(first) => Self::take_array(input, options),
            _ => Err(other_content(&path, &first)),
        }
    }

    fn take_npz(input: Input<'_>, options: &ReadOptions) -> Result<Self, DatasetError> {
        let path = input.path().to_owned();
        if let Some(camera) = &options.camera {
            let (found, allowed) = (camera.display().to_string(), "absent: a height map has none");
            return Err(DatasetError::content(&path, "the camera", found, allowed));
        }
        options.refuse_topics(&path)?;
        options.window(&path, 1)?;
        let source = Source::Heights(Npz::take(input)?.height_map()?);
        Ok(Self::of_one(path, source, Segmentation::default()))
    }

    fn take_array(input: Input<'_>, options: &ReadOptions) -> Result<Self, DatasetError> {
        let path = input.path().to_owned();
        let depth_array::Depths { camera, lens, images, window, count } =
            depth_array::read(input, options)?;
        let mut mean = Self::of_depths(&path, lens, images)?;
        if let Source::Depth { colour, .. } = &mut mean.source {
            *colour = camera.read_colour(&lens)?;
        }
        // Of depths in metres the unit is what the camera rounded them to, if its file says so.
        let (depth_unit, segmentation) = (camera.depth_unit, camera.segmentation);
        Ok(Self { window, whole_frames: count, depth_unit, segmentation, ..mean })
    }

    /// A recording of one frame.
    pub(crate) fn of_one(path: PathBuf, source: Source, segmentation: Segmentation) -> Self {
        Self {
            path,
            source,
            topic: None,
            frames: 1,
            window: 0..1,
            whole_frames: 1,
            lost: None,
            damage: Vec::new(),
            unlike: None,
            depth_unit: None,
            segmentation,
        }
    }

    fn take_frames(
        path: &Path,
        frames: impl IntoIterator<Item = Frame>,
        options: &ReadOptions,
    ) -> Result<Self, DatasetError> {
        options.refuse_topics(path)?;
        let camera = options.camera_of_images(path)?;
        Self::of_frames(path, frames, &CameraFile::load(&camera)?, &camera)
    }

    /// The mean of PNG frames, each with its name, that the camera of the file at `camera_path` took.
    /// A damaged PNG is lost, any other misfit an error.
    ///
    /// # Errors
    /// As [`Recording::open`].
    pub fn of_frames(
        path: &Path,
        frames: impl IntoIterator<Item = Frame>,
        camera: &CameraFile,
        camera_path: &Path,
    ) -> Result<Self, DatasetError> {
        let (lens, unit) = camera.lens_and_unit(camera_path)?;
        let mean = folder::average(path, frames, (lens, unit, camera_path))?;
        let colour = camera.read_colour(&lens)?;
        let source = Source::Depth { camera: camera_of(lens), image: mean.image, colour };
        let damaged = mean.damage.len() as u64;
        Ok(Self {
            frames: mean.frames,
            whole_frames: mean.frames as u64,
            lost: (damaged > 0).then_some(Lost::Exactly(damaged)),
            damage: mean.damage,
            unlike: mean.unlike,
            depth_unit: Some(unit),
            ..Self::of_one(path.to_owned(), source, camera.segmentation.clone())
        })
    }

    /// The mean of depth images in memory, row by row in metres, of a camera with this lens; `name` stands in messages.
    ///
    /// # Errors
    /// [`DatasetError::Content`] for no image, one of another size than the lens, a depth of more than 100 m, or a
    /// focal length that is not in pixels.
    pub fn of_depths(
        name: &Path,
        lens: Intrinsics,
        frames: impl IntoIterator<Item = Vec<f32>>,
    ) -> Result<Self, DatasetError> {
        require_pixels(name, (lens.width, lens.height), (lens.fx, lens.fy))?;
        let refuse = |fault: Fault| fault.in_file(name);
        let (width, height) = (lens.width, lens.height);
        let mut mean: Option<Mean> = None;
        for values in frames {
            if values.len() != width * height {
                let allowed = format!("{width} x {height}, as the lens has it");
                return Err(refuse(Fault::new(
                    "the number of depths",
                    values.len().to_string(),
                    allowed,
                )));
            }
            let deepest = values.iter().copied().filter(|z| z.is_finite()).fold(0.0, f32::max);
            if deepest > DEEPEST {
                let allowed = format!("at most {DEEPEST} m: are they counts or millimetres?");
                return Err(refuse(Fault::new("the depths", format!("{deepest} m"), allowed)));
            }
            let frame = DepthFrame { width, height, values: Values::Metres(values) };
            match &mut mean {
                Some(mean) => mean.add(&frame).map_err(refuse)?,
                None => mean = Some(Mean::new(frame, 1.0)),
            }
        }
        let none = || Fault::new("the number of images", "0", "at least 1");
        let mean = mean.ok_or_else(none).map_err(refuse)?;
        let (frames, unlike) = (mean.frames(), mean.doubt());
        let image = mean.finish().map_err(refuse)?;
        let source = Source::Depth { camera: camera_of(lens), image, colour: None };
        let one = Self::of_one(name.to_owned(), source, Segmentation::default());
        Ok(Self { frames, window: 0..frames as u64, whole_frames: frames as u64, unlike, ..one })
    }

    fn take_messages(mut input: Input<'_>, options: &ReadOptions) -> Result<Self, DatasetError> {
        let file = options.camera.as_deref().map(CameraFile::load).transpose()?;
        let read = messages::read(&mut input, options, file.as_ref())?;
        let beside = file.as_ref().map(|file| file.read_colour(&read.intrinsics)).transpose()?;
        let colour = beside.flatten().or(read.colour);
        let source =
            Source::Depth { camera: camera_of(read.intrinsics), image: read.image, colour };
        let segmentation = file.map(|file| file.segmentation).unwrap_or_default();
        Ok(Self {
            topic: Some(read.topic),
            frames: read.frames,
            window: read.window,
            whole_frames: read.whole,
            lost: read.lost,
            damage: read.damage,
            unlike: read.unlike,
            depth_unit: Some(read.unit),
            ..Self::of_one(input.path().to_owned(), source, segmentation)
        })
    }

    /// The points of the formation under the recording's own segmentation.
    ///
    /// # Errors
    /// [`DatasetError::Recording`] for an empty mask, an image without valid depth, a setting out of range.
    pub fn formation(&self) -> Result<Formation, DatasetError> {
        self.formation_with(&self.segmentation)
    }

    /// The points of the formation under another segmentation.
    ///
    /// # Errors
    /// As [`Recording::formation`].
    pub fn formation_with(&self, segmentation: &Segmentation) -> Result<Formation, DatasetError> {
        self.formation_of(self.level_with(segmentation)?)
    }

    /// The points of the formation of this recording that was levelled before.
    ///
    /// # Errors
    /// [`DatasetError::Recording`] for an empty mask.
    pub fn formation_of(&self, levelled: Levelled) -> Result<Formation, DatasetError> {
        levelled
            .into_formation()
            .map_err(|source| DatasetError::Recording { path: self.path.clone(), source })
    }

    /// The ground, the heights above it and the mask, whether or not there is a grain.
    ///
    /// # Errors
    /// As [`Recording::formation`] but for an empty mask.
    pub fn level_with(&self, segmentation: &Segmentation) -> Result<Levelled, DatasetError> {
        match &self.source {
            Source::Heights(map) => level_height_map(map, segmentation),
            Source::Depth { camera, image, colour } => {
                level_depth(camera, image, colour.as_ref(), segmentation)
            }
        }
        .map_err(|source| DatasetError::Recording { path: self.path.clone(), source })
    }

    /// The paper's 16 statistics of the formation.
    ///
    /// # Errors
    /// As [`Recording::formation`], and for too few points.
    pub fn statistics(&self) -> Result<[f64; 16], DatasetError> {
        self.statistics_of(&self.formation()?)
    }

    /// The paper's 16 statistics of a formation that was found in this recording.
    ///
    /// # Errors
    /// [`DatasetError::Recording`] for too few points.
    pub fn statistics_of(&self, formation: &Formation) -> Result<[f64; 16], DatasetError> {
        paper16(&formation.points)
            .map_err(|source| DatasetError::Recording { path: self.path.clone(), source })
    }
}

/// A file that is no recording. Its bytes are not quoted: a link may lead to another user's file.
fn other_content(path: &Path, first: &[u8]) -> DatasetError {
    let found = match first {
        [] => "an empty file".to_owned(),
        _ if first.starts_with(b"#ROSBAG V") => {
            format!("{:?}", String::from_utf8_lossy(first).trim())
        }
        _ if first.starts_with(b"SQLite format 3") => folder::OTHER_STORAGE.to_owned(),
        _ if first.iter().all(|byte| matches!(byte, b'\t' | b'\n' | b'\r' | b' '..=b'~')) => {
            "text".to_owned()
        }
        _ => "bytes of another kind".to_owned(),
    };
    let allowed = "a ROS 1 bag (#ROSBAG V2.0), MCAP, .npz, .npy or .png, or a folder of .png; docs/guide.md makes .npy of \
                   raw counts and of point clouds";
    DatasetError::content(path, "the first bytes of a recording", found, allowed)
}

/// The folder of measured data that tests use: `$GRANULCAL_DATA`, else `../shared/data/measured`
/// beside `repository`; `None` where there is none.
pub fn measured_data(repository: &Path) -> Option<PathBuf> {
    let folder = std::env::var_os("GRANULCAL_DATA")
        .map_or_else(|| repository.join("../shared/data/measured"), PathBuf::from);
    folder.is_dir().then_some(folder)
}
