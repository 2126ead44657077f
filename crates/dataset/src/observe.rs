//! From a pour to its image and its statistics: the simulated half of every comparison.

use std::fmt;

use granulcal_dem::{CameraSpec, Pour, Projection};
use granulcal_features::stats::DIAGNOSTIC_COUNT;
use granulcal_features::{
    Camera, DepthImage, DiagnosticSettings, FeatureError, HeightMap, SensorNoise, diagnostics,
    grain_points, height_map, paper16, render_grid,
};
use nalgebra::{Vector2, Vector3};

use crate::DatasetError;
use crate::random::camera_seed;

/// What the scene's camera delivers.
#[derive(Clone, Debug, PartialEq)]
pub enum View {
    /// A depth image and the camera that took it, both down-sampled.
    Depth(Camera, DepthImage),
    /// A height map, down-sampled.
    Heights(HeightMap),
}

impl View {
    /// The points of the pixels that lie above `threshold` `[m]`, in the world.
    fn grain_points(&self, threshold: f64) -> Result<Vec<Vector3<f64>>, FeatureError> {
        match self {
            Self::Depth(camera, image) => grain_points(camera, image, threshold),
            Self::Heights(map) => {
                let all = map.to_points();
                let highest = all.iter().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max);
                let valid = all.len();
                let points: Vec<_> = all.into_iter().filter(|p| p.z > threshold).collect();
                if points.is_empty() {
                    return Err(FeatureError::EmptyMask { valid, highest, threshold });
                }
                Ok(points)
            }
        }
    }
}

/// A pour as the camera saw it.
#[derive(Clone, Debug, PartialEq)]
pub struct Observation {
    /// The image.
    pub view: View,
    /// The points taken for grains `[m]`, in the world.
    pub points: Vec<Vector3<f64>>,
    /// The paper's 16 statistics, or why there are none.
    pub statistics: Result<[f64; 16], TooFewGrains>,
    /// What the diagnostic statistics have to know: the pour axis is the scene's z axis.
    pub diagnostic_settings: DiagnosticSettings,
}

impl Observation {
    /// The diagnostic statistics of the points.
    ///
    /// # Errors
    /// `TooFewPoints` where there are no [`Observation::statistics`], `OutOfRange` for grains or pixels
    /// of a size that none has.
    pub fn diagnostics(&self) -> Result<[f64; DIAGNOSTIC_COUNT], FeatureError> {
        diagnostics(&self.points, &self.diagnostic_settings)
    }
}

/// Too few grains are in view for statistics; a property of the pour, not a mistake.
#[derive(Clone, Debug, PartialEq)]
pub struct TooFewGrains(FeatureError);

impl fmt::Display for TooFewGrains {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "too few grains in view: {}", self.0)
    }
}

impl std::error::Error for TooFewGrains {}

/// The image and the statistics of a pour under the scene's camera.
///
/// `pour_seed` is the seed of the pour; the camera's noise takes its own seed from it.
///
/// # Errors
/// [`DatasetError::Features`] if the camera cannot exist or grains are nowhere (NaN positions).
pub fn observe(
    camera: &CameraSpec,
    pour: &Pour,
    pour_seed: u64,
) -> Result<Observation, DatasetError> {
    let view = look(camera, &pour.positions, &pour.radii, pour_seed)?;
    let diagnostic_settings = DiagnosticSettings {
        pour_axis: Some(Vector2::zeros()),
        grain_diameter: 2.0 * pour.radii.iter().sum::<f64>() / pour.radii.len().max(1) as f64,
        spacing: camera.field_width / camera.pixels as f64 * camera.downsample as f64,
    };
    let points = match view.grain_points(camera.height_threshold) {
        Err(error) if is_too_few(&error) => {
            let statistics = Err(TooFewGrains(error));
            return Ok(Observation { view, points: Vec::new(), statistics, diagnostic_settings });
        }
        other => other.map_err(DatasetError::Features)?,
    };
    let statistics = match paper16(&points) {
        Err(error) if is_too_few(&error) => Err(TooFewGrains(error)),
        other => Ok(other.map_err(DatasetError::Features)?),
    };
    Ok(Observation { view, points, statistics, diagnostic_settings })
}

/// What the camera delivers of grains over the ground: rendered, down-sampled, disturbed.
///
/// # Errors
/// [`DatasetError::Features`] as [`observe`].
pub fn look(
    camera: &CameraSpec,
    positions: &[Vector3<f64>],
    radii: &[f64],
    pour_seed: u64,
) -> Result<View, DatasetError> {
    let noise = SensorNoise { blur_px: camera.blur, depth_sigma: camera.depth_noise };
    let seed = camera_seed(pour_seed);
    let view = match camera.projection {
        Projection::Pinhole => {
            let full = overhead(camera)?;
            render_grid(&full, positions, radii, camera.downsample)
                .and_then(|image| noise.apply(&image, seed))
                .and_then(|image| Ok(View::Depth(full.downsampled(camera.downsample)?, image)))
        }
        Projection::Orthographic => {
            let resolution = camera.field_width / camera.pixels as f64;
            height_map(positions, radii, camera.pixels, resolution, (0.0, 0.0))
                .and_then(|map| map.downsample(camera.downsample))
                .and_then(|map| noise.apply_to_height_map(&map, seed))
                .map(View::Heights)
        }
    };
    view.map_err(DatasetError::Features)
}

/// The scene's pinhole camera before down-sampling.
///
/// # Errors
/// [`DatasetError::Features`] if the camera cannot exist.
pub fn overhead(camera: &CameraSpec) -> Result<Camera, DatasetError> {
    Camera::overhead(camera.height, camera.field_width, camera.pixels)
        .map_err(DatasetError::Features)
}

fn is_too_few(error: &FeatureError) -> bool {
    matches!(
        error,
        FeatureError::EmptyMask { .. }
            | FeatureError::NoValidDepth { .. }
            | FeatureError::TooFewPoints { .. }
    )
}

#[cfg(test)]
mod tests {
    use granulcal_dem::{Health, Scene, Status};

    use super::*;

    /// Grains on a square lattice on the ground, as a pour at rest.
    fn carpet(offset: f64) -> Pour {
        let radius = 2e-3;
        let at = |i: i32| 0.01 * f64::from(i - 4);
        let positions: Vec<_> =
            (0..81).map(|i| Vector3::new(at(i % 9) + offset, at(i / 9), radius)).collect();
        Pour {
            velocities: vec![Vector3::zeros(); 81],
            angular_velocities: vec![Vector3::zeros(); 81],
            radii: vec![radius; 81],
            positions,
            status: Status::AtRest,
            health: Health::default(),
            grains_in_funnel: 0,
            simulated_s: 1.0,
            state_hash: 0,
        }
    }

    #[test]
    fn both_projections_agree_on_a_carpet_of_grains() {
        let mut camera = Scene::drop(0.1).camera;
        camera.downsample = 4;
        let pinhole = observe(&camera, &carpet(0.0), 1).unwrap().statistics.unwrap();
        camera = CameraSpec { projection: Projection::Orthographic, ..camera };
        let map = observe(&camera, &carpet(0.0), 1).unwrap().statistics.unwrap();
        assert!((pinhole[0] - 4e-3).abs() < 2e-4, "{}", pinhole[0]);
        // Heights, radii and spreads; the shape statistics of a carpet hang on single pixels.
        for (a, b) in pinhole.iter().zip(map).take(11) {
            assert!((a - b).abs() < 0.05 * b.abs(), "{pinhole:?} {map:?}");
        }
    }

    #[test]
    fn every_grain_of_a_carpet_is_isolated() {
        let camera = CameraSpec { downsample: 2, ..Scene::drop(0.1).camera };
        let seen = observe(&camera, &carpet(0.0), 1).unwrap();
        let diagnostics = seen.diagnostics().unwrap();
        let value = |name| {
            let names = granulcal_features::DIAGNOSTICS.map(|statistic| statistic.name);
            diagnostics[names.iter().position(|n| *n == name).unwrap()]
        };
        assert_eq!((value("isolated_grains"), value("clusters")), (81.0, 0.0));
        assert_eq!(value("count_in_view"), seen.points.len() as f64);
        assert!(value("mass_cos_1").abs() < 0.01 && value("rim_sin_2").abs() < 0.05);
    }

    #[test]
    fn noise_belongs_to_the_seed() {
        let camera = CameraSpec { depth_noise: 1e-3, ..CameraSpec::default() };
        let view = |seed| observe(&camera, &carpet(0.0), seed).unwrap().view;
        assert_eq!(view(1), view(1));
        assert_ne!(view(1), view(2));
    }

    #[test]
    fn grains_out_of_view_are_an_outcome() {
        let seen = observe(&CameraSpec::default(), &carpet(2.0), 1).unwrap();
        assert!(seen.points.is_empty());
        assert!(seen.statistics.unwrap_err().to_string().starts_with("too few grains in view"));
    }
}
