//! The TOML beside a measured recording: lens, unit of depth, colour image, segmentation.

use std::path::{Path, PathBuf};

use granulcal_features::{Camera, ColourImage, Intrinsics, Segmentation};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::form::marked;
use crate::readable::toml_error;
use crate::{DatasetError, Form, files, png};

/// A depth camera as a file states it.
///
/// Images as PNG need its lens and unit. A .bag or .mcap has its own, which are replaced by those that
/// are given.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(into = "CameraToml")]
pub struct CameraFile {
    /// The lens; the six keys `width`, `height`, `fx`, `fy`, `cx`, `cy` of the file.
    pub lens: Option<Intrinsics>,
    /// Metres per count of the depth image.
    pub depth_unit: Option<f64>,
    /// 8-bit RGB image of the same size and viewpoint; relative to the file where it stands in one.
    pub colour: Option<PathBuf>,
    /// How the image is segmented.
    pub segmentation: Segmentation,
}

/// Least focal length over the image's side: no lens without distortion sees 168 degrees.
const LEAST_FOCAL: f64 = 0.05;

/// The keys of the file.
///
/// `cx` and `cy` follow OpenCV and the RealSense SDK: the centre of the first pixel is (0, 0).
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraToml {
    #[serde(skip_serializing_if = "Option::is_none")]
    width: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    height: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fx: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fy: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    cx: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    cy: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    depth_unit: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    colour: Option<PathBuf>,
    #[serde(default, skip_serializing_if = "is_default")]
    segmentation: Segmentation,
}

fn is_default(segmentation: &Segmentation) -> bool {
    *segmentation == Segmentation::default()
}

impl From<CameraFile> for CameraToml {
    fn from(file: CameraFile) -> Self {
        let lens = file.lens;
        Self {
            width: lens.map(|lens| lens.width),
            height: lens.map(|lens| lens.height),
            fx: lens.map(|lens| lens.fx),
            fy: lens.map(|lens| lens.fy),
            cx: lens.map(|lens| lens.cx - 0.5),
            cy: lens.map(|lens| lens.cy - 0.5),
            depth_unit: file.depth_unit,
            colour: file.colour,
            segmentation: file.segmentation,
        }
    }
}

impl CameraFile {
    /// Reads and checks a camera; `colour` becomes relative to the working directory.
    ///
    /// # Errors
    /// [`DatasetError::Io`], and those of [`CameraFile::parse`].
    pub fn load(path: &Path) -> Result<Self, DatasetError> {
        let mut file = Self::parse(path, &files::read_text(path)?)?;
        if let (Some(colour), Some(folder)) = (&file.colour, path.parent()) {
            file.colour = Some(folder.join(colour));
        }
        Ok(file)
    }

    /// Checks the text of a file at `path`.
    ///
    /// # Errors
    /// [`DatasetError::Toml`], or [`DatasetError::Recording`] and [`DatasetError::Content`] for
    /// numbers that no camera has and for a lens of which a part is missing.
    pub fn parse(path: &Path, text: &str) -> Result<Self, DatasetError> {
        let file: CameraToml = toml::from_str(text)
            .map_err(|source| toml_error(path, "camera", text, Box::new(source.into())))?;
        file.depth_unit.map_or(Ok(()), |unit| require_unit(path, unit))?;
        Ok(Self {
            lens: file.lens(path)?,
            depth_unit: file.depth_unit,
            colour: file.colour,
            segmentation: file.segmentation,
        })
    }

    /// What stands beside a depth image that `camera` took.
    pub fn of(camera: &Camera, depth_unit: f64) -> Self {
        Self {
            lens: Some(camera.intrinsics),
            depth_unit: Some(depth_unit),
            colour: None,
            segmentation: Segmentation::default(),
        }
    }

    /// The lens and the metres per count of the file at `path`, which images of counts need.
    pub(crate) fn lens_and_unit(&self, path: &Path) -> Result<(Intrinsics, f64), DatasetError> {
        match (self.lens, self.depth_unit) {
            // Both can be set by hand.
            (Some(lens), Some(unit)) => require_unit(path, unit).map(|()| (lens, unit)),
            (lens, _) => {
                let found = if lens.is_some() { "no depth_unit" } else { "no lens" };
                let allowed = "width, height, fx, fy, cx, cy and depth_unit for an image of counts";
                Err(DatasetError::content(path, "the camera", found, allowed))
            }
        }
    }

    /// The colours of the image beside the camera, if it has one.
    ///
    /// # Errors
    /// As [`png::read_colour`], and [`DatasetError::Content`] for another size than that of `lens`.
    pub(crate) fn read_colour(
        &self,
        lens: &Intrinsics,
    ) -> Result<Option<ColourImage>, DatasetError> {
        let Some(path) = self.colour.as_deref() else { return Ok(None) };
        let colour = png::read_colour(path)?;
        if (colour.width, colour.height) != (lens.width, lens.height) {
            let found = format!("{}x{}", colour.width, colour.height);
            let allowed = format!("{}x{}, as the lens has it", lens.width, lens.height);
            return Err(DatasetError::content(path, "the size of the colour", found, allowed));
        }
        Ok(Some(colour))
    }

    /// Writes the file, where there is none or one that was written here and nobody has changed.
    ///
    /// # Errors
    /// [`DatasetError::Replaces`], [`DatasetError::Io`] or [`DatasetError::TomlWrite`].
    pub fn save(&self, path: &Path) -> Result<(), DatasetError> {
        let text = toml::to_string(self)
            .map_err(|e| DatasetError::TomlWrite { what: "the camera", source: Box::new(e) })?;
        files::write_file(path, Form::CameraToml, marked(&text).as_bytes())
    }
}

impl CameraToml {
    /// The lens: all six numbers or none.
    fn lens(&self, path: &Path) -> Result<Option<Intrinsics>, DatasetError> {
        let Self { width, height, fx, fy, cx, cy, .. } = *self;
        let numbers = [width.map(|w| w as f64), height.map(|h| h as f64), fx, fy, cx, cy];
        if numbers.iter().all(Option::is_none) {
            return Ok(None);
        }
        let (Some(width), Some(height), Some(fx), Some(fy), Some(cx), Some(cy)) =
            (width, height, fx, fy, cx, cy)
        else {
            let names = ["width", "height", "fx", "fy", "cx", "cy"];
            let missing = names.iter().zip(numbers).filter(|(_, number)| number.is_none());
            let missing: Vec<_> = missing.map(|(name, _)| *name).collect();
            let found = format!("no {}", missing.join(", "));
            let allowed = "given by all of width, height, fx, fy, cx, cy, or by none";
            return Err(DatasetError::content(path, "the lens", found, allowed));
        };
        require_pixels(path, (width, height), (fx, fy))?;
        Intrinsics::from_integer_centres(width, height, fx, fy, cx, cy)
            .map(Some)
            .map_err(|source| DatasetError::Recording { path: path.to_owned(), source })
    }
}

/// Refuses focal lengths that are in no pixels, of the file at `path` or an array.
pub(crate) fn require_pixels(
    path: &Path,
    (width, height): (usize, usize),
    (fx, fy): (f64, f64),
) -> Result<(), DatasetError> {
    for (name, focal, side, pixels) in [("fx", fx, "width", width), ("fy", fy, "height", height)] {
        let least = LEAST_FOCAL * pixels as f64;
        if focal > 0.0 && focal < least {
            let allowed = format!(
                "in pixels, at least {least} (a twentieth of the {side}): is it in millimetres or metres?"
            );
            return Err(DatasetError::content(path, name, focal.to_string(), allowed));
        }
    }
    Ok(())
}

fn require_unit(path: &Path, unit: f64) -> Result<(), DatasetError> {
    let refuse = || DatasetError::content(path, "depth_unit", unit.to_string(), png::UNITS);
    if png::is_unit(unit) { Ok(()) } else { Err(refuse()) }
}

/// The camera with a lens, at the origin of a world whose z axis points back at it.
pub(crate) fn camera_of(intrinsics: Intrinsics) -> Camera {
    let half_turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    let camera_from_world = Isometry3::from_parts(Translation3::identity(), half_turn);
    Camera { intrinsics, camera_from_world }
}

#[cfg(test)]
mod tests {
    use super::*;
    use granulcal_features::Threshold;

    #[test]
    fn a_focal_length_that_is_not_in_pixels_is_asked_for_its_unit() {
        let text = "width = 640\nheight = 480\nfx = 600.0\nfy = 600.0\ncx = 319.5\ncy = 239.5\n";
        let parse = |text: &str| CameraFile::parse(Path::new("camera.toml"), text);
        assert!(parse(text).is_ok());
        for (key, least) in
            [("fx", "at least 32 (a twentieth of the width)"), ("fy", "at least 24 (")]
        {
            let changed = text.replace(&format!("{key} = 600.0"), &format!("{key} = 1.93"));
            let error = parse(&changed).unwrap_err().to_string();
            assert!(error.contains(key) && error.contains("1.93"), "{error}");
            assert!(error.contains(least) && error.contains("millimetres"), "{error}");
        }
    }

    #[test]
    fn a_camera_that_somebody_changed_is_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("camera.toml");
        let camera = CameraFile::of(&Camera::overhead(0.4, 0.4, 100).unwrap(), 1e-3);
        let other = CameraFile::of(&Camera::overhead(0.3, 0.4, 100).unwrap(), 1e-3);
        camera.save(&path).unwrap();
        other.save(&path).unwrap();
        assert_eq!(CameraFile::load(&path).unwrap(), other);
        let text = std::fs::read_to_string(&path).unwrap();
        for changed in [
            format!("{text}\n[segmentation]\nborder_px = 8\n"),
            text.replace("depth_unit = 0.001", "depth_unit = 0.002"),
            text.split_once('\n').unwrap().1.to_owned(),
            "name = \"a scene\"\n".to_owned(),
        ] {
            assert_ne!(changed, text);
            std::fs::write(&path, &changed).unwrap();
            let error = camera.save(&path).unwrap_err().to_string();
            assert!(error.contains("camera.toml") && error.contains("another name"), "{error}");
            assert_eq!(std::fs::read_to_string(&path).unwrap(), changed);
        }
    }

    #[test]
    fn a_lens_is_whole_or_absent() {
        let parse = |text: &str| CameraFile::parse(Path::new("c.toml"), text);
        let settings = parse("[segmentation]\nborder_px = 8\n").unwrap();
        assert_eq!((settings.lens, settings.segmentation.border_px), (None, 8));
        let error = settings.lens_and_unit(Path::new("c.toml")).unwrap_err().to_string();
        assert!(error.contains("no lens"), "{error}");
        let part = parse("width = 8\nheight = 6\nfx = 1.0\n").unwrap_err().to_string();
        assert!(part.contains("no fy, cx, cy"), "{part}");
        let lens = "width = 8\nheight = 6\nfx = 10.0\nfy = 10.0\ncx = 3.5\ncy = 2.5\n";
        let file = parse(lens).unwrap();
        assert_eq!(file.lens.unwrap().cx, 4.0);
        assert_eq!(parse(&toml::to_string(&file).unwrap()).unwrap(), file);
        let error = file.lens_and_unit(Path::new("c.toml")).unwrap_err().to_string();
        assert!(error.contains("no depth_unit"), "{error}");
        for unit in [0.0, -1e-3, f64::NAN, f64::INFINITY] {
            let by_hand = CameraFile { depth_unit: Some(unit), ..file.clone() };
            let error = by_hand.lens_and_unit(Path::new("c.toml")).unwrap_err().to_string();
            assert!(error.contains("depth_unit must be positive and finite"), "{error}");
        }
    }

    #[test]
    fn a_threshold_is_a_height_or_a_table() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.toml");
        let of = |value: &str| {
            let text = format!("[segmentation]\nheight_threshold = {value}\n");
            std::fs::write(&path, text).unwrap();
            CameraFile::load(&path).map(|file| file.segmentation.height_threshold)
        };
        assert_eq!(of("0.0013").unwrap(), Threshold::Absolute(0.0013));
        assert_eq!(of("1").unwrap(), Threshold::Absolute(1.0));
        assert_eq!(of("{ absolute = 0.002 }").unwrap(), Threshold::Absolute(0.002));
        let automatic = of("{ automatic = { floor = 0.003 } }").unwrap();
        assert_eq!(automatic, Threshold::Automatic { floor: 0.003 });
        for (wrong, said) in [
            ("\"2 mm\"", "a height in m, { absolute = 0.002 }"),
            ("{ fixed = 0.002 }", "absolute"),
            ("{ automatic = { least = 1 } }", "floor"),
            ("{ automatic = 0.003 }", "Automatic"),
        ] {
            let error = of(wrong).unwrap_err();
            assert!(error.to_string().contains("c.toml"), "{error}");
            let why = std::error::Error::source(&error).unwrap().to_string();
            assert!(why.contains(said), "{wrong}: {why}");
        }
    }
}
