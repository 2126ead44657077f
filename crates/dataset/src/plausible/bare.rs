//! What a scene's camera shows of the ground before anything is poured.

use granulcal_features::{Levelled, Segmentation, level_depth, level_height_map};
use granulcal_scene::CameraSpec;

use crate::DatasetError;
use crate::drawn::Drawn;
use crate::observe::{View, capture};

/// Images of a noisy sensor that are looked at.
const IMAGES: u64 = 6;

/// The ground in a scene's images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bare {
    /// Its largest bow `[m]`.
    pub(super) bow: f64,
    /// Share of the square of ground that is shown `[-]`.
    pub(super) shown: f64,
}

impl Bare {
    /// Of a camera without a sensor it is flat and seen whole.
    ///
    /// # Errors
    /// [`DatasetError::Features`] for a camera that no scene can have, or that sees nothing.
    pub(super) fn of(camera: &CameraSpec) -> Result<Self, DatasetError> {
        let mut found = Self { bow: 0.0, shown: 1.0 };
        if camera.sensor.is_none() {
            return Ok(found);
        }
        for seed in 0..IMAGES {
            let levelled = bare_ground(camera, seed)?;
            found.bow = found.bow.max(levelled.ground_bow().unwrap_or(0.0));
            found.shown = found.shown.min(shown(&levelled));
        }
        Ok(found)
    }
}

fn bare_ground(camera: &CameraSpec, seed: u64) -> Result<Levelled, DatasetError> {
    let none = Drawn { positions: &[], radii: &[], convex: None, bed: None };
    let settings = Segmentation::default().at_threshold_of(camera);
    match capture(camera, &none, seed)? {
        View::Depth(at, image) => level_depth(&at, &image, None, &settings),
        View::Heights(map) => level_height_map(&map, &settings),
    }
    .map_err(DatasetError::Features)
}

/// Share of the columns that have data somewhere, times that of the rows.
fn shown(levelled: &Levelled) -> f64 {
    let (width, height) = (levelled.width, levelled.height);
    let has_data = |column: usize, row: usize| levelled.heights[row * width + column].is_some();
    let columns = (0..width).filter(|&u| (0..height).any(|v| has_data(u, v))).count();
    let rows = (0..height).filter(|&v| (0..width).any(|u| has_data(u, v))).count();
    (columns * rows) as f64 / (width * height).max(1) as f64
}
