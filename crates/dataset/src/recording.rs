//! Measured height maps and depth images, described by the same code as simulated ones.

use std::path::{Path, PathBuf};

use granulcal_features::{
    Camera, ColourImage, DepthImage, Formation, HeightMap, Levelled, Segmentation, level_depth,
    level_height_map, paper16,
};

use crate::{CameraFile, DatasetError, Npz, png};

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
    /// Frames that were averaged.
    pub frames: usize,
    /// How it is segmented: from the camera's file, else the default.
    pub segmentation: Segmentation,
}

impl Recording {
    /// Opens a recording: an .npz height map, a 16-bit depth PNG, or a folder of such PNGs of one
    /// formation, which are averaged. PNGs need the TOML of their camera.
    ///
    /// # Errors
    /// [`DatasetError`] names the file, what was found and what is allowed.
    pub fn open(path: &Path, camera: Option<&Path>) -> Result<Self, DatasetError> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        let frames = match extension.as_deref() {
            _ if path.is_dir() => frames_in(path)?,
            Some("npz") => return Self::open_npz(path, camera),
            Some("png") => vec![path.to_owned()],
            other => {
                // A name without a file deserves the plainer message.
                std::fs::metadata(path).map_err(DatasetError::io("read", path))?;
                let found = other.unwrap_or("no extension").to_owned();
                let allowed = ".npz, .png or a folder of .png";
                return Err(DatasetError::content(path, "a recording", found, allowed));
            }
        };
        let Some(camera) = camera else {
            let allowed = "given for depth images (--camera camera.toml)";
            return Err(DatasetError::content(path, "the camera", "none", allowed));
        };
        Self::open_frames(path, &frames, camera)
    }

    fn open_npz(path: &Path, camera: Option<&Path>) -> Result<Self, DatasetError> {
        if let Some(camera) = camera {
            let found = camera.display().to_string();
            return Err(DatasetError::content(
                path,
                "the camera",
                found,
                "absent: a height map has none",
            ));
        }
        let map = Npz::open(path)?.height_map()?;
        let source = Source::Heights(map);
        let segmentation = Segmentation::default();
        Ok(Self { path: path.to_owned(), source, frames: 1, segmentation })
    }

    fn open_frames(
        path: &Path,
        frames: &[PathBuf],
        camera_path: &Path,
    ) -> Result<Self, DatasetError> {
        let file = CameraFile::load(camera_path)?;
        let camera = file.camera(camera_path)?;
        let mut mean = Mean::new(file.width * file.height);
        for frame in frames {
            let image = png::read_depth(frame, file.depth_unit)?;
            if (image.width, image.height) != (file.width, file.height) {
                let found = format!("{}x{}", image.width, image.height);
                let allowed =
                    format!("{}x{} as in {}", file.width, file.height, camera_path.display());
                return Err(DatasetError::content(frame, "the size", found, allowed));
            }
            mean.add(&image);
        }
        let image = DepthImage::new(file.width, file.height, mean.finish())
            .map_err(|source| DatasetError::Recording { path: path.to_owned(), source })?;
        let colour = file.colour.as_deref().map(png::read_colour).transpose()?;
        Ok(Self {
            path: path.to_owned(),
            source: Source::Depth { camera, image, colour },
            frames: frames.len(),
            segmentation: file.segmentation,
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

/// Mean per pixel over the frames that have data there.
struct Mean {
    sums: Vec<f64>,
    counts: Vec<u32>,
}

impl Mean {
    fn new(pixels: usize) -> Self {
        Self { sums: vec![0.0; pixels], counts: vec![0; pixels] }
    }

    fn add(&mut self, image: &DepthImage) {
        for ((sum, count), &depth) in self.sums.iter_mut().zip(&mut self.counts).zip(&image.depth) {
            if depth > 0.0 {
                *sum += f64::from(depth);
                *count += 1;
            }
        }
    }

    fn finish(&self) -> Vec<f32> {
        let mean = |(&sum, &count): (&f64, &u32)| match count {
            0 => 0.0,
            count => (sum / f64::from(count)) as f32,
        };
        self.sums.iter().zip(&self.counts).map(mean).collect()
    }
}

/// The PNGs of a folder, in order of their names.
fn frames_in(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let list = || DatasetError::io("list", folder);
    let entries = std::fs::read_dir(folder).map_err(list())?;
    let entries = entries.collect::<Result<Vec<_>, _>>().map_err(list())?;
    let is_png = |path: &PathBuf| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"));
    let mut frames: Vec<_> = entries.iter().map(std::fs::DirEntry::path).filter(is_png).collect();
    frames.sort();
    if frames.is_empty() {
        return Err(DatasetError::content(folder, "the folder", "no .png", "depth frames as .png"));
    }
    Ok(frames)
}

/// The folder of measured data that tests use: `$GRANULCAL_DATA`, else `../shared/data/measured`
/// beside `repository`; `None` where there is none.
pub fn measured_data(repository: &Path) -> Option<PathBuf> {
    let folder = std::env::var_os("GRANULCAL_DATA")
        .map_or_else(|| repository.join("../shared/data/measured"), PathBuf::from);
    folder.is_dir().then_some(folder)
}
