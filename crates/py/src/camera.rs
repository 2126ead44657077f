//! Class `Camera`.

use std::path::PathBuf;

use granulcal_dataset::{CameraFile, Claims, Form, Product, Room, load_sensor, png};
use granulcal_features::{DepthImage, FeatureError, Intrinsics, Observe, SensorNoise};
use numpy::PyArray2;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

use crate::array::{Image, Numbers, Vectors};
use crate::signals::Watch;
use crate::{array, error};

/// A pinhole camera in the world.
#[pyclass(frozen, module = "granulcal._native")]
pub(crate) struct Camera {
    inner: granulcal_features::Camera,
}

#[pymethods]
impl Camera {
    #[staticmethod]
    fn overhead(height: f64, field_width: f64, pixels: usize) -> PyResult<Self> {
        let inner = granulcal_features::Camera::overhead(height, field_width, pixels);
        Ok(Self { inner: inner.map_err(error::features)? })
    }

    /// Looks straight down from `height` [m]; the lens as OpenCV gives it, the first pixel's centre at 0.
    #[staticmethod]
    fn above(height: f64, lens: (usize, usize, f64, f64, f64, f64)) -> PyResult<Self> {
        let (columns, rows, fx, fy, cx, cy) = lens;
        let camera =
            granulcal_features::Camera::overhead(height, 1.0, 1).map_err(error::features)?;
        let intrinsics = Intrinsics::from_integer_centres(columns, rows, fx, fy, cx, cy);
        let intrinsics = intrinsics.map_err(error::features)?;
        Ok(Self { inner: granulcal_features::Camera { intrinsics, ..camera } })
    }

    fn tilted(&self, tilt_x_rad: f64, tilt_y_rad: f64) -> Self {
        Self { inner: self.inner.tilted(tilt_x_rad, tilt_y_rad) }
    }

    /// Depth [m] of grains over the ground, with the noise of a sensor.
    #[allow(clippy::too_many_arguments)] // Python's arguments.
    fn render<'py>(
        &self,
        py: Python<'py>,
        positions: &Bound<'py, PyAny>,
        radii: &Bound<'py, PyAny>,
        depth_sigma: f64,
        blur_px: f64,
        seed: u64,
        sensor: Option<PathBuf>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let lens = &self.inner.intrinsics;
        Room::of_image(lens.width * lens.height).require(None).map_err(error::dataset)?;
        let sensor = sensor.map(|path| load_sensor(&path)).transpose().map_err(error::dataset)?;
        let positions = Vectors::borrow("positions", positions)?;
        let radii = Numbers::borrow("radii", radii)?;
        let (positions, radii) = (positions.as_slice()?, radii.as_slice()?);
        let (image, interrupted) = py.detach(|| {
            let watch = Watch::new();
            let noise = SensorNoise { blur_px, depth_sigma };
            let image = granulcal_features::render(&self.inner, positions, radii)
                .and_then(|image| noise.apply_while(&image, seed, &|| watch.keep_going(|_| Ok(()))))
                .and_then(|image| match (image, &sensor) {
                    (Some(image), Some(sensor)) => {
                        sensor.observe(&self.inner, &image, seed).map(Some)
                    }
                    (image, _) => Ok(image),
                });
            (image, watch.finish())
        });
        interrupted?;
        let image = image.map_err(error::features)?;
        let image = image.ok_or_else(|| PyKeyboardInterrupt::new_err("the image was given up"))?;
        array::matrix(py, image.depth, image.height, image.width)
    }

    /// Writes a depth image as 16-bit PNG and the camera's TOML beside it.
    fn save_image(
        &self,
        image: &Bound<'_, PyAny>,
        png_path: PathBuf,
        camera_path: PathBuf,
        depth_unit: f64,
    ) -> PyResult<()> {
        let image = Image::borrow("image", image)?;
        let (width, height, depth) = image.parts()?;
        let image = DepthImage::new(width, height, depth.to_vec()).map_err(error::features)?;
        let lens = &self.inner.intrinsics;
        let (got, expected) = ((width, height), (lens.width, lens.height));
        if got != expected {
            let what = "the image of this camera";
            return Err(error::features(FeatureError::SizeMismatch { what, got, expected }));
        }
        let mut claims = Claims::default();
        claims.write("the image", &png_path, Product::File(Form::Png));
        claims.write("the camera", &camera_path, Product::File(Form::CameraToml));
        claims.check().map_err(error::dataset)?;
        png::write_depth(&png_path, &image, depth_unit).map_err(error::dataset)?;
        CameraFile::of(&self.inner, depth_unit).save(&camera_path).map_err(error::dataset)
    }
}
