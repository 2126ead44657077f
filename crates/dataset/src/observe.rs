//! From a pour to its image and its statistics: the simulated half of every comparison.

use std::fmt;

use granulcal_dem::Pour;
use granulcal_features::stats::DIAGNOSTIC_COUNT;
use granulcal_features::{
    Camera, DepthImage, DiagnosticSettings, FeatureError, HeightMap, Observe, SensorNoise,
    diagnostics, height_map, paper16,
};
use granulcal_scene::{CameraSpec, Mask, Projection, SceneError, ViewSpec};
use nalgebra::{Vector2, Vector3};

use crate::DatasetError;
use crate::drawn::Drawn;
use crate::random::{camera_seed, sensor_seed};

/// Height above the ground `[m]` from which a pixel of a noise-free image shows a grain, at least.
const BARE: f64 = 1e-6;

/// Depth beyond which a view has no data, in distances of its target: the ground goes on to the horizon.
const FARTHEST: f64 = 3.0;

/// What the scene's camera delivers.
#[derive(Clone, Debug, PartialEq)]
pub enum View {
    /// A depth image and the camera that took it, both down-sampled.
    Depth(Camera, DepthImage),
    /// A height map, down-sampled.
    Heights(HeightMap),
}

impl View {
    /// What each pixel saw, row by row, in the world `[m]`; `None` = nothing.
    fn points(&self) -> Vec<Option<Vector3<f64>>> {
        match self {
            Self::Depth(camera, image) => {
                let pixels = image.depth.iter().enumerate();
                let point = |(i, &depth): (usize, &f32)| {
                    let (u, v) = ((i % image.width) as f64, (i / image.width) as f64);
                    (depth > 0.0 && depth.is_finite())
                        .then(|| camera.unproject(u + 0.5, v + 0.5, f64::from(depth)))
                };
                pixels.map(point).collect()
            }
            Self::Heights(map) => (0..map.z.len())
                .map(|i| Some(map.point(i % map.width, i / map.width)).filter(|p| p.z.is_finite()))
                .collect(),
        }
    }

    /// The points of the pixels that `is_grain` takes for grains, given their index and point.
    fn grain_points(
        &self,
        is_grain: impl Fn(usize, &Vector3<f64>) -> bool,
        threshold: f64,
    ) -> Result<Vec<Vector3<f64>>, FeatureError> {
        let all = self.points();
        let seen = || all.iter().enumerate().filter_map(|(i, point)| Some((i, (*point)?)));
        let points: Vec<_> =
            seen().filter(|(i, point)| is_grain(*i, point)).map(|(_, point)| point).collect();
        if !points.is_empty() {
            return Ok(points);
        }
        let valid = seen().count();
        if valid == 0 {
            return Err(FeatureError::NoValidDepth { pixels: all.len(), got: 0, min: 1 });
        }
        let highest = seen().map(|(_, p)| p.z).fold(f64::NEG_INFINITY, f64::max);
        Err(FeatureError::no_grain_in_image(valid, highest, threshold))
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
    /// What the diagnostic statistics have to know: the pour axis is the scene's z axis; the grains' diameter is the
    /// mean of the spheres', until [`Observation::with_grain_diameter`] says the scene's.
    pub diagnostic_settings: DiagnosticSettings,
}

/// Diameters that differ by a smaller share are the same, but for the rounding of a mean.
const SAME_DIAMETER: f64 = 1e-9;

impl Observation {
    /// The observation with the diameter that the scene states, `[m]`, for that of a grain, as a recording has none
    /// else: grains of unequal sizes have another mean, and the spheres of a clump are thinner than its ball.
    #[must_use]
    pub fn with_grain_diameter(mut self, stated: f64) -> Self {
        let mean = self.diagnostic_settings.grain_diameter;
        // Equal balls keep the last bit of their mean.
        if (mean - stated).abs() > SAME_DIAMETER * stated {
            self.diagnostic_settings.grain_diameter = stated;
        }
        self
    }

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
/// [`DatasetError::Features`] if no scene can have the camera or grains are nowhere (NaN positions).
pub fn observe(
    camera: &CameraSpec,
    pour: &Pour,
    pour_seed: u64,
) -> Result<Observation, DatasetError> {
    camera.check().map_err(no_camera)?;
    observe_grains(camera, &Drawn::of(pour), pour_seed)
}

/// Height `[m]` from which a pixel of the camera's noise-free image shows a grain: above the rounding of an f32 depth.
fn bare(camera: &CameraSpec) -> f64 {
    match camera.projection {
        Projection::Pinhole => BARE.max(f64::from(f32::EPSILON) * camera.height),
        Projection::Orthographic => BARE,
    }
}

/// The image and the statistics of grains under the camera of a checked scene, as [`observe`].
pub(crate) fn observe_grains(
    camera: &CameraSpec,
    grains: &Drawn<'_>,
    pour_seed: u64,
) -> Result<Observation, DatasetError> {
    let (clean, view) = views(camera, grains, pour_seed)?;
    let radii = grains.radii;
    let diagnostic_settings = DiagnosticSettings {
        pour_axis: Some(Vector2::zeros()),
        grain_diameter: 2.0 * radii.iter().sum::<f64>() / radii.len().max(1) as f64,
        spacing: camera.field_width / camera.pixels as f64 * camera.downsample as f64,
    };
    let threshold = camera.height_threshold;
    let found = match camera.mask {
        Mask::Height => view.grain_points(|_, point| point.z > threshold, threshold),
        Mask::Colour => {
            let bare = bare(camera);
            let shows_grain: Vec<bool> =
                clean.points().iter().map(|point| point.is_some_and(|p| p.z > bare)).collect();
            view.grain_points(|i, _| shows_grain[i], bare)
        }
    };
    let points = match found {
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
pub fn capture(
    camera: &CameraSpec,
    grains: &Drawn<'_>,
    pour_seed: u64,
) -> Result<View, DatasetError> {
    camera.check().map_err(no_camera)?;
    views(camera, grains, pour_seed).map(|(_, view)| view)
}

/// What one of the scene's further cameras sees of grains over the ground; without noise, and without data
/// beyond three times the distance of its target.
///
/// # Errors
/// [`DatasetError::Features`] as [`observe`].
pub fn capture_from(view: &ViewSpec, grains: &Drawn<'_>) -> Result<View, DatasetError> {
    view.check("view").map_err(no_camera)?;
    let [width, height] = view.pixels;
    let farthest = FARTHEST * view.distance();
    Camera::looking_at(view.eye.into(), view.target.into(), view.field_width, (width, height))
        .and_then(|camera| {
            let mut image = grains.render(&camera, 1)?;
            let beyond = |depth: &&mut f32| f64::from(**depth) > farthest;
            image.depth.iter_mut().filter(beyond).for_each(|depth| *depth = 0.0);
            Ok(View::Depth(camera, image))
        })
        .map_err(DatasetError::Features)
}

/// The noise-free image and the one that the camera delivers.
fn views(
    camera: &CameraSpec,
    grains: &Drawn<'_>,
    pour_seed: u64,
) -> Result<(View, View), DatasetError> {
    let noise = SensorNoise { blur_px: camera.blur, depth_sigma: camera.depth_noise };
    let sensor = camera.sensor.as_ref();
    let seed = camera_seed(pour_seed);
    let views = match camera.projection {
        Projection::Pinhole => {
            let full = above(camera)?;
            let small = full.downsampled(camera.downsample).map_err(DatasetError::Features)?;
            grains.render(&full, camera.downsample).and_then(|clean| {
                let mut image = noise.apply(&clean, seed)?;
                if let Some(sensor) = sensor {
                    image = sensor.observe(&small, &image, sensor_seed(pour_seed))?;
                }
                Ok((View::Depth(small, clean), View::Depth(small, image)))
            })
        }
        Projection::Orthographic => {
            let resolution = camera.field_width / camera.pixels as f64;
            // A checked scene has no convex grains under this camera.
            let heights = |places: &[Vector3<f64>], radii: &[f64]| {
                height_map(places, radii, camera.pixels, resolution, (0.0, 0.0))
            };
            heights(grains.positions, grains.radii)
                .and_then(|map| match grains.bed {
                    Some(bed) => map.less(&heights(&bed.positions, &bed.radii)?),
                    None => Ok(map),
                })
                .and_then(|map| map.downsample(camera.downsample))
                .and_then(|clean| {
                    let mut map = noise.apply_to_height_map(&clean, seed)?;
                    if let Some(sensor) = sensor {
                        map = sensor.observe_height_map(&map, sensor_seed(pour_seed))?;
                    }
                    Ok((View::Heights(clean), View::Heights(map)))
                })
        }
    };
    views.map_err(DatasetError::Features)
}

/// The scene's pinhole camera before down-sampling.
///
/// # Errors
/// [`DatasetError::Features`] if no scene can have the camera.
pub fn overhead(camera: &CameraSpec) -> Result<Camera, DatasetError> {
    camera.check().map_err(no_camera)?;
    above(camera)
}

fn no_camera(error: SceneError) -> DatasetError {
    DatasetError::Features(error.into())
}

fn above(camera: &CameraSpec) -> Result<Camera, DatasetError> {
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
    use granulcal_dem::{BedAtRest, Health, Status};
    use granulcal_features::{DepthSensor, NoiseField, StereoSensor};
    use granulcal_scene::Scene;

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
            radii_out: Vec::new(),
            positions,
            status: Status::AtRest,
            health: Health::default(),
            grains_in_funnel: 0,
            simulated_s: 1.0,
            convex: None,
            bed: None,
            state_hash: 0,
        }
    }

    #[test]
    fn a_map_of_a_bed_shows_what_has_become_of_it() {
        let mut camera = Scene::drop(0.1).camera;
        (camera.projection, camera.downsample) = (Projection::Orthographic, 4);
        let mut pour = carpet(0.0);
        let before = BedAtRest { positions: pour.positions.clone(), radii: pour.radii.clone() };
        pour.bed = Some(before);
        let heights = |pour: &Pour| match capture(&camera, &Drawn::of(pour), 1).unwrap() {
            View::Heights(map) => map,
            View::Depth(..) => panic!("a depth image"),
        };
        // Nothing has happened: no grain is in view.
        assert!(heights(&pour).z.iter().all(|&z| z == 0.0));
        assert!(observe(&camera, &pour, 1).unwrap().statistics.is_err());
        // The grain at (0, 0) lies on its neighbour at (0.01, 0): a hole and a hill of its height.
        let (hole, hill) = (40, 41);
        pour.positions[hole] = pour.positions[hill] + Vector3::new(0.0, 0.0, 4e-3);
        let map = heights(&pour);
        let at = |place: Vector3<f64>| {
            let pixel = |c: f64| (c / map.resolution_x + 0.5 * map.width as f64) as usize;
            map.at(pixel(place.x), pixel(place.y))
        };
        let (low, high) = (at(before_of(&pour)[hole]), at(before_of(&pour)[hill]));
        // A pixel is within 0.9 mm of the middle of a grain of 2 mm radius.
        assert!((low + 4e-3).abs() < 5e-4 && (high - 4e-3).abs() < 5e-4, "{low} {high}");
    }

    fn before_of(pour: &Pour) -> &[Vector3<f64>] {
        &pour.bed.as_ref().unwrap().positions
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
    fn a_grain_is_as_wide_as_the_scene_says_on_both_sides() {
        // Spheres of 2.8 and 5.2 mm in a scene of grains of 5 mm: a recording knows the 5 mm alone.
        let mut pour = carpet(0.0);
        pour.radii.iter_mut().enumerate().for_each(|(i, r)| *r *= [0.7, 1.3][i % 2]);
        let seen = observe(&Scene::drop(0.1).camera, &pour, 1).unwrap();
        let of_scene = seen.clone().with_grain_diameter(5e-3);
        let stated = DiagnosticSettings { grain_diameter: 5e-3, ..seen.diagnostic_settings };
        assert_eq!(of_scene.diagnostics(), diagnostics(&seen.points, &stated));
        assert_ne!(of_scene.diagnostics(), seen.diagnostics());
        // Equal balls keep every bit.
        let equal = observe(&Scene::drop(0.1).camera, &carpet(0.0), 1).unwrap();
        assert_eq!(equal.clone().with_grain_diameter(4e-3 * (1.0 + 1e-12)), equal);
    }

    #[test]
    fn a_camera_far_above_sees_bare_ground_by_colour() {
        // Of a depth of 100.7 m a number of 32 bits leaves 4 um of rounding.
        let far = CameraSpec { height: 100.7, mask: Mask::Colour, ..CameraSpec::default() };
        let near = CameraSpec { height: 10.0, ..far };
        let found =
            [near, far].map(|camera| observe(&camera, &carpet(0.0), 1).unwrap().points.len());
        assert!(found[0].abs_diff(found[1]) <= found[0] / 10, "{found:?}");
    }

    #[test]
    fn a_camera_that_no_scene_has_is_refused() {
        let (pour, plain) = (carpet(0.0), CameraSpec::default());
        let orthographic = CameraSpec { projection: Projection::Orthographic, ..plain };
        for (camera, named) in [
            // Nothing would be higher than NaN: a pour without grains.
            (CameraSpec { height_threshold: f64::NAN, ..plain }, "camera.height_threshold"),
            (CameraSpec { height_threshold: -1.0, ..plain }, "camera.height_threshold"),
            (CameraSpec { pixels: usize::MAX, ..orthographic }, "camera.pixels"),
            (CameraSpec { pixels: 0, ..orthographic }, "camera.pixels"),
            (CameraSpec { downsample: 0, ..plain }, "camera.downsample"),
            (CameraSpec { height: f64::INFINITY, ..plain }, "camera.height"),
            (CameraSpec { depth_noise: -1e-3, ..plain }, "camera.depth_noise"),
        ] {
            for error in [
                observe(&camera, &pour, 1).unwrap_err(),
                capture(&camera, &Drawn::of(&pour), 1).unwrap_err(),
                overhead(&camera).unwrap_err(),
            ] {
                let reason = std::error::Error::source(&error).unwrap().to_string();
                assert!(reason.contains(named), "{reason}");
            }
        }
        let side = ViewSpec {
            name: String::new(),
            eye: [0.0, -0.4, 0.02],
            target: [0.0; 3],
            field_width: 0.1,
            pixels: [4, 2],
        };
        capture_from(&side, &Drawn::of(&pour)).unwrap();
        let large = ViewSpec { pixels: [usize::MAX, 2], ..side };
        let error = capture_from(&large, &Drawn::of(&pour)).unwrap_err();
        let reason = std::error::Error::source(&error).unwrap().to_string();
        assert!(reason.contains("pixels must be in 1..=16384"), "{reason}");
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

    /// A D435 as `fit-sensor` finds it on a board, with a pattern.
    fn d435() -> DepthSensor {
        let noise = NoiseField {
            correlated: 0.1,
            correlation_x: 6.0,
            correlation_y: 5.0,
            ..NoiseField::default()
        };
        DepthSensor::Stereo(StereoSensor {
            focal_length: 390.43,
            baseline: 0.05017,
            quantisation: 1.0 / 32.0,
            depth_unit: 1e-4,
            edge_margin: 2.0,
            left_margin: 11.0,
            grazing_deg: 80.0,
            dropout: 0.003,
            pattern_seed: 7,
            noise,
            fixed_pattern: NoiseField::default(),
        })
    }

    #[test]
    fn a_sensor_disturbs_the_image_and_only_when_it_is_given() {
        let plain = CameraSpec { downsample: 4, ..CameraSpec::default() };
        let noisy = CameraSpec { sensor: Some(d435()), ..plain };
        let depth = |camera: &CameraSpec, seed| match observe(camera, &carpet(0.0), seed) {
            Ok(Observation { view: View::Depth(_, image), .. }) => image,
            other => panic!("{other:?}"),
        };
        assert_eq!(depth(&noisy, 1), depth(&noisy, 1));
        assert_ne!(depth(&noisy, 1), depth(&noisy, 2));
        let (clean, noisy) = (depth(&plain, 1), depth(&noisy, 1));
        let errors: Vec<f64> = clean
            .depth
            .iter()
            .zip(&noisy.depth)
            .filter(|(_, d)| **d > 0.0)
            .map(|(a, b)| f64::from(b - a))
            .collect();
        // 0.1 px at 0.29 m are 0.43 mm, to which the rounding adds next to nothing; the right imager
        // misses a band of 68 + 11 of the 781 columns that see the field.
        let sd = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
        assert!((sd / 4.3e-4 - 1.0).abs() < 0.05, "{sd}");
        let share = errors.len() as f64 / clean.depth.len() as f64;
        assert!((share - 0.9).abs() < 0.01, "{share}");
    }

    #[test]
    fn colour_finds_the_grains_through_the_noise() {
        let DepthSensor::Stereo(d435) = d435() else { unreachable!() };
        let noise = NoiseField { correlated: 0.2, ..d435.noise };
        let sensor = Some(DepthSensor::Stereo(StereoSensor { noise, ..d435 }));
        let by_height = CameraSpec { sensor, ..CameraSpec::default() };
        let by_colour = CameraSpec { mask: Mask::Colour, ..by_height };
        let clean = observe(&CameraSpec::default(), &carpet(0.0), 3).unwrap().points.len();
        let found = |camera| observe(camera, &carpet(0.0), 3).unwrap().points;
        // Ground that noise lifts by a millimetre passes for grain where height decides.
        assert!(found(&by_height).len() > 2 * clean);
        let points = found(&by_colour);
        assert!(points.len() > clean / 2 && points.len() < 2 * clean, "{} {clean}", points.len());
        assert!(points.iter().all(|p| p.x.abs().max(p.y.abs()) < 0.045), "all within the carpet");
    }

    #[test]
    fn a_stereo_sensor_needs_a_pinhole_camera() {
        let camera = CameraSpec {
            sensor: Some(d435()),
            projection: Projection::Orthographic,
            ..CameraSpec::default()
        };
        let error = observe(&camera, &carpet(0.0), 1).unwrap_err();
        let reason = std::error::Error::source(&error).unwrap().to_string();
        assert!(reason.contains("pinhole"), "{reason}");
    }
}
