//! Further cameras as a scene states them: they look from where the overhead camera does not.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::camera::{IN_LENGTHS, LENGTHS};
use crate::check::{finite, within};
use crate::error::SceneError;

/// A depth camera at rest anywhere, that looks at a point. Its image is without noise, and no statistics are taken of
/// it.
///
/// The world's z axis is up in the image; for a camera that looks straight down or up, the y axis is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ViewSpec {
    /// What it is called on the command line and in MCAP files.
    pub name: String,
    /// Where the camera is `[m]`.
    pub eye: [f64; 3],
    /// The point that it looks at `[m]`.
    pub target: [f64; 3],
    /// Width of what is in view at the distance of the target `[m]`.
    pub field_width: f64,
    /// Columns and rows of the image.
    #[serde(default = "full_hd")]
    pub pixels: [usize; 2],
}

fn full_hd() -> [usize; 2] {
    [1920, 1080]
}

impl ViewSpec {
    /// Whether the name is one that a topic can carry.
    fn is_named(&self) -> bool {
        let fits = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        !self.name.is_empty() && self.name.chars().all(fits)
    }

    /// From the eye to the target `[m]`.
    pub fn distance(&self) -> f64 {
        self.eye.iter().zip(self.target).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
    }

    /// Refuses a camera that no scene can have, whatever it is called; `path` is where it stands.
    ///
    /// # Errors
    /// [`SceneError::OutOfRange`] names the number.
    pub fn check(&self, path: &str) -> Result<(), SceneError> {
        for &value in self.eye.iter().chain(&self.target) {
            finite(&format!("{path}.eye, target"), value)?;
        }
        within(&format!("{path}.field_width"), self.field_width, LENGTHS, IN_LENGTHS)?;
        let way = format!("{path}: way from eye to target");
        within(&way, self.distance(), LENGTHS, IN_LENGTHS)?;
        for pixels in self.pixels {
            if pixels == 0 || pixels > 16_384 {
                let name = format!("{path}.pixels");
                return Err(SceneError::range(&name, pixels as f64, "in 1..=16384"));
            }
        }
        Ok(())
    }
}

/// Checks every view, and that no two have one name.
pub(crate) fn check_views(views: &[ViewSpec]) -> Result<(), SceneError> {
    let mut names = BTreeSet::new();
    for (index, view) in views.iter().enumerate() {
        if !view.is_named() || !names.insert(&view.name) {
            let path = format!("views.{index}.name");
            return Err(SceneError::ViewName { path, got: view.name.clone() });
        }
        view.check(&format!("views.{index}"))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn side() -> ViewSpec {
        ViewSpec {
            name: "side".to_owned(),
            eye: [0.0, -0.5, 0.05],
            target: [0.0, 0.0, 0.05],
            field_width: 0.3,
            pixels: [64, 48],
        }
    }

    #[test]
    fn what_no_camera_can_be_is_named() {
        check_views(&[side()]).unwrap();
        for (change, name) in [
            ((|v: &mut ViewSpec| v.name = "a b".to_owned()) as fn(&mut ViewSpec), "views.0.name"),
            (|v| v.name.clear(), "views.0.name"),
            (|v| v.eye = v.target, "from eye to target"),
            (|v| v.eye[1] = f64::NAN, "views.0.eye"),
            (|v| v.field_width = 0.0, "views.0.field_width"),
            (|v| v.pixels[1] = 0, "views.0.pixels"),
        ] {
            let mut view = side();
            change(&mut view);
            assert!(check_views(&[view]).unwrap_err().to_string().contains(name), "{name}");
        }
        assert!(check_views(&[side(), side()]).unwrap_err().to_string().contains("views.1.name"));
    }
}
