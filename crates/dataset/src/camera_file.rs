//! The TOML beside a measured depth image: lens, unit of depth, colour image, segmentation.

use std::path::{Path, PathBuf};

use granulcal_features::{Camera, Intrinsics, Segmentation};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::{DatasetError, files};

/// A depth camera as a file states it.
///
/// `cx` and `cy` follow OpenCV and the RealSense SDK: the centre of the first pixel is (0, 0).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraFile {
    /// Columns `[px]`.
    pub width: usize,
    /// Rows `[px]`.
    pub height: usize,
    /// Focal length along x `[px]`.
    pub fx: f64,
    /// Focal length along y `[px]`.
    pub fy: f64,
    /// Principal point, x `[px]`.
    pub cx: f64,
    /// Principal point, y `[px]`.
    pub cy: f64,
    /// Metres per count of the depth image.
    pub depth_unit: f64,
    /// 8-bit RGB image of the same size and viewpoint; a path relative to the file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub colour: Option<PathBuf>,
    /// How the image is segmented.
    #[serde(default, skip_serializing_if = "is_default")]
    pub segmentation: Segmentation,
}

fn is_default(segmentation: &Segmentation) -> bool {
    *segmentation == Segmentation::default()
}

impl CameraFile {
    /// Reads and checks a camera; `colour` becomes relative to the working directory.
    ///
    /// # Errors
    /// [`DatasetError::Io`], [`DatasetError::Toml`], or [`DatasetError::Recording`] and
    /// [`DatasetError::Content`] for numbers that no camera has.
    pub fn load(path: &Path) -> Result<Self, DatasetError> {
        let mut file: Self = toml::from_str(&files::read_text(path)?).map_err(|source| {
            DatasetError::Toml { path: path.to_owned(), what: "camera", source: Box::new(source) }
        })?;
        if !(file.depth_unit > 0.0 && file.depth_unit.is_finite()) {
            let found = file.depth_unit.to_string();
            return Err(DatasetError::content(path, "depth_unit", found, "positive and finite"));
        }
        file.camera(path)?;
        if let (Some(colour), Some(folder)) = (&file.colour, path.parent()) {
            file.colour = Some(folder.join(colour));
        }
        Ok(file)
    }

    /// The camera of a file at `path`, at the origin of a world whose z axis points back at it.
    pub(crate) fn camera(&self, path: &Path) -> Result<Camera, DatasetError> {
        let intrinsics = Intrinsics::from_integer_centres(
            self.width,
            self.height,
            self.fx,
            self.fy,
            self.cx,
            self.cy,
        )
        .map_err(|source| DatasetError::Recording { path: path.to_owned(), source })?;
        let half_turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        let camera_from_world = Isometry3::from_parts(Translation3::identity(), half_turn);
        Ok(Camera { intrinsics, camera_from_world })
    }

    /// What stands beside a depth image that `camera` took.
    pub fn of(camera: &Camera, depth_unit: f64) -> Self {
        let Intrinsics { width, height, fx, fy, cx, cy } = camera.intrinsics;
        Self {
            width,
            height,
            fx,
            fy,
            cx: cx - 0.5,
            cy: cy - 0.5,
            depth_unit,
            colour: None,
            segmentation: Segmentation::default(),
        }
    }

    /// Writes the file.
    ///
    /// # Errors
    /// [`DatasetError::Io`] or [`DatasetError::TomlWrite`].
    pub fn save(&self, path: &Path) -> Result<(), DatasetError> {
        let text = toml::to_string(self)
            .map_err(|e| DatasetError::TomlWrite { what: "the camera", source: Box::new(e) })?;
        files::write_file(path, text.as_bytes())
    }
}
