//! A batch whose parts are made elsewhere.

use std::path::PathBuf;

use granulcal_dataset::{GatheredBatch as Inner, GenerateOptions, Prior, Progress};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::error;
use crate::scene::Scene;

/// The folder of a batch, which takes parts until it is closed.
#[pyclass(module = "granulcal._native")]
pub(crate) struct GatheredBatch(Option<Inner>);

impl GatheredBatch {
    fn open(&self) -> PyResult<&Inner> {
        self.0.as_ref().ok_or_else(|| PyValueError::new_err("the batch is closed"))
    }
}

#[pymethods]
impl GatheredBatch {
    #[new]
    #[pyo3(signature = (scene, prior_toml, out, *, rows, seed, resume, chunk = None))]
    #[allow(clippy::too_many_arguments)] // Python's keywords.
    fn new(
        py: Python<'_>,
        scene: &Scene,
        prior_toml: &str,
        out: PathBuf,
        rows: u64,
        seed: u64,
        resume: bool,
        chunk: Option<u64>,
    ) -> PyResult<Self> {
        let prior = Prior::from_toml(prior_toml).map_err(error::dem)?;
        let plain = GenerateOptions::default();
        let chunk = chunk.unwrap_or(plain.chunk);
        let options = GenerateOptions { rows, seed, resume, chunk, ..plain };
        let scene = &scene.inner;
        py.detach(|| Inner::open(scene, &prior, &options, &out))
            .map(|batch| Self(Some(batch)))
            .map_err(error::dataset)
    }

    /// Number of chunks.
    #[getter]
    fn chunks(&self) -> PyResult<u64> {
        Ok(self.open()?.chunks())
    }

    /// Rows of a chunk.
    #[getter]
    fn chunk_size(&self) -> PyResult<u64> {
        Ok(self.open()?.chunk_size())
    }

    /// Chunks that lack rows, in order.
    fn missing(&self) -> PyResult<Vec<u64>> {
        Ok(self.open()?.missing().collect())
    }

    /// Rows in all, found, brought, unhealthy, jammed, without grains in view.
    fn counts(&self) -> PyResult<(u64, u64, u64, u64, u64, u64)> {
        let Progress { total, resumed, made, unhealthy, jammed, no_grains_in_view, .. } =
            self.open()?.progress();
        Ok((total, resumed, made, unhealthy, jammed, no_grains_in_view))
    }

    /// Takes the bytes of a part; returns whether the batch lacked it.
    fn put(&mut self, py: Python<'_>, chunk: u64, bytes: &[u8]) -> PyResult<bool> {
        let Some(inner) = &mut self.0 else {
            return Err(PyValueError::new_err("the batch is closed"));
        };
        py.detach(|| inner.put(chunk, bytes)).map_err(error::dataset)
    }

    /// Gives the folder back.
    fn close(&mut self) {
        self.0 = None;
    }
}
