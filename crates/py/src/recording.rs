//! Class `Recording`.

use std::path::{Path, PathBuf};

use granulcal_dataset::{ReadOptions, Source};
use granulcal_features::Intrinsics;
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::array::Images;
use crate::formation::Formation;
use crate::levelled::Levelled;
use crate::{array, error, segmentation};

/// A measured depth image or height map.
#[pyclass(frozen, module = "granulcal._native")]
pub(crate) struct Recording {
    pub(crate) inner: granulcal_dataset::Recording,
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

    /// The mean of images in memory [m], shape (k, h, w), float32; `lens` is fx, fy, cx, cy.
    #[staticmethod]
    fn of_depths(
        py: Python<'_>,
        depth: &Bound<'_, PyAny>,
        lens: (f64, f64, f64, f64),
        unit: Option<f64>,
    ) -> PyResult<Self> {
        let images = Images::borrow("depth", depth)?;
        let (rows, columns, values) = images.parts()?;
        let (fx, fy, cx, cy) = lens;
        let lens = Intrinsics::from_integer_centres(columns, rows, fx, fy, cx, cy)
            .map_err(error::features)?;
        let name = Path::new("depth array");
        let frames = values.chunks_exact(rows * columns).map(<[f32]>::to_vec);
        let inner = py.detach(|| granulcal_dataset::Recording::of_depths(name, lens, frames));
        let inner = inner.map_err(error::dataset)?;
        Ok(Self { inner: granulcal_dataset::Recording { depth_unit: unit, ..inner } })
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
    fn unlike(&self) -> Option<String> {
        self.inner.unlike.clone()
    }

    #[getter]
    fn damage(&self) -> Vec<String> {
        self.inner.damage.clone()
    }

    #[getter]
    fn frames(&self) -> usize {
        self.inner.frames
    }

    /// Width, height, focal lengths and principal point [px], the first pixel's centre at 0; or None for a height map.
    #[getter]
    fn lens(&self) -> Option<(usize, usize, f64, f64, f64, f64)> {
        match &self.inner.source {
            Source::Depth { camera, .. } => {
                let lens = &camera.intrinsics;
                let centre = (lens.cx - 0.5, lens.cy - 0.5);
                Some((lens.width, lens.height, lens.fx, lens.fy, centre.0, centre.1))
            }
            Source::Heights(_) => None,
        }
    }

    /// Metres per count of a depth image.
    #[getter]
    fn depth_unit(&self) -> Option<f64> {
        self.inner.depth_unit
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
    #[pyo3(signature = (**settings))]
    fn formation(
        &self,
        py: Python<'_>,
        settings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Formation> {
        let settings = segmentation::changed(&self.inner.segmentation, settings)?;
        let inner = py.detach(|| self.inner.formation_with(&settings));
        Ok(Formation { inner: inner.map_err(error::dataset)? })
    }

    /// Ground, heights and mask, whether or not there is a grain; keywords as `formation`.
    #[pyo3(signature = (**settings))]
    fn level(&self, py: Python<'_>, settings: Option<&Bound<'_, PyDict>>) -> PyResult<Levelled> {
        let settings = segmentation::changed(&self.inner.segmentation, settings)?;
        let inner = py.detach(|| self.inner.level_with(&settings));
        Ok(Levelled { inner: inner.map_err(error::dataset)? })
    }
}
