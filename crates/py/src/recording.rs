//! Class `Recording`.

use std::path::PathBuf;

use granulcal_dataset::{ReadOptions, Source};
use granulcal_features::Threshold;
use numpy::PyArray2;
use pyo3::prelude::*;

use crate::formation::Formation;
use crate::{array, error};

/// A measured depth image or height map.
#[pyclass(frozen, module = "granulcal._native")]
pub(crate) struct Recording {
    inner: granulcal_dataset::Recording,
}

#[pymethods]
impl Recording {
    #[staticmethod]
    #[pyo3(signature = (
        path,
        camera = None,
        *,
        topic = None,
        camera_topic = None,
        colour_topic = None,
        frames = None,
        first_frame = None,
    ))]
    #[allow(clippy::too_many_arguments)] // Python's keywords.
    fn open(
        py: Python<'_>,
        path: PathBuf,
        camera: Option<PathBuf>,
        topic: Option<String>,
        camera_topic: Option<String>,
        colour_topic: Option<String>,
        frames: Option<usize>,
        first_frame: Option<u64>,
    ) -> PyResult<Self> {
        let frames = frames.unwrap_or(usize::MAX);
        let options =
            ReadOptions { camera, topic, colour_topic, camera_topic, frames, first_frame };
        let inner = py.detach(|| granulcal_dataset::Recording::open(&path, &options));
        Ok(Self { inner: inner.map_err(error::dataset)? })
    }

    #[getter]
    fn topic(&self) -> Option<&str> {
        self.inner.topic.as_deref()
    }

    #[getter]
    fn whole_frames(&self) -> u64 {
        self.inner.whole_frames
    }

    /// Frames that are lost and how well that is known, or None.
    #[getter]
    fn lost(&self) -> Option<(u64, &'static str)> {
        self.inner.lost.map(|lost| (lost.frames(), lost.how()))
    }

    #[getter]
    fn damage(&self) -> Vec<String> {
        self.inner.damage.clone()
    }

    #[getter]
    fn frames(&self) -> usize {
        self.inner.frames
    }

    /// Depth [m], or None for a height map.
    #[getter]
    fn depth<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f32>>>> {
        match &self.inner.source {
            Source::Depth { image, .. } => {
                array::matrix(py, image.depth.clone(), image.height, image.width).map(Some)
            }
            Source::Heights(_) => Ok(None),
        }
    }

    /// Heights [m], or None for a depth image.
    #[getter]
    fn heights<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        match &self.inner.source {
            Source::Heights(map) => {
                array::matrix(py, map.z.clone(), map.height, map.width).map(Some)
            }
            Source::Depth { .. } => Ok(None),
        }
    }

    /// The points of the formation; what is None stays as the camera's file says.
    #[pyo3(signature = (
        *,
        height_threshold = None,
        threshold_floor = None,
        border_px = None,
        downsample = None,
        inlier_distance = None,
        max_height = None,
        min_component_px = None,
        plane_seed = None,
    ))]
    #[allow(clippy::too_many_arguments)] // Python's keywords.
    fn formation(
        &self,
        py: Python<'_>,
        height_threshold: Option<f64>,
        threshold_floor: Option<f64>,
        border_px: Option<usize>,
        downsample: Option<usize>,
        inlier_distance: Option<f64>,
        max_height: Option<f64>,
        min_component_px: Option<usize>,
        plane_seed: Option<u64>,
    ) -> PyResult<Formation> {
        let mut settings = self.inner.segmentation.clone();
        let replace = |place: &mut usize, value: Option<usize>| *place = value.unwrap_or(*place);
        replace(&mut settings.border_px, border_px);
        replace(&mut settings.downsample, downsample);
        replace(&mut settings.min_component_px, min_component_px);
        settings.height_threshold = height_threshold
            .map(Threshold::Absolute)
            .or(threshold_floor.map(|floor| Threshold::Automatic { floor }))
            .unwrap_or(settings.height_threshold);
        settings.inlier_distance = inlier_distance.unwrap_or(settings.inlier_distance);
        settings.max_height = max_height.or(settings.max_height);
        settings.plane_seed = plane_seed.unwrap_or(settings.plane_seed);
        let inner = py.detach(|| self.inner.formation_with(&settings));
        Ok(Formation { inner: inner.map_err(error::dataset)? })
    }
}
