//! Function `generate`.

use std::path::PathBuf;
use std::sync::Mutex;

use granulcal_dataset::{DatasetError, Engine, GenerateOptions, Outcome, Prior, Progress, Shard};
use granulcal_dem as dem;
use pyo3::prelude::*;

use crate::array::{Numbers, Vectors};
use crate::error;
use crate::scene::Scene;
use crate::signals::Watch;

/// Makes the rows that a folder lacks, by our simulator or by `engine`, a pair of its name and a function of
/// (scene, seed) that returns (positions, radii), or points alone; `progress` is called with (total, resumed, made,
/// unhealthy, jammed, without grains in view). Of `shard`, a pair (index, count), those of this shard;
/// `chunk` rows are a part.
///
/// On Ctrl-C the finished rows are written before KeyboardInterrupt is raised.
#[pyfunction]
#[pyo3(signature = (scene, prior_toml, out, *, rows, seed, threads, resume, progress, engine = None, shard = None, chunk = None))]
#[allow(clippy::too_many_arguments)] // Python's keywords.
pub(crate) fn generate(
    py: Python<'_>,
    scene: &Scene,
    prior_toml: &str,
    out: PathBuf,
    rows: u64,
    seed: u64,
    threads: Option<usize>,
    resume: bool,
    progress: Option<Py<PyAny>>,
    engine: Option<(String, Py<PyAny>)>,
    shard: Option<(u64, u64)>,
    chunk: Option<u64>,
) -> PyResult<Counts> {
    let prior = Prior::from_toml(prior_toml).map_err(error::dem)?;
    let default = GenerateOptions::default();
    let threads = threads.unwrap_or(default.threads);
    let shard = shard.map_or(Shard::WHOLE, |(index, count)| Shard { index, count });
    let chunk = chunk.unwrap_or(default.chunk);
    let options = GenerateOptions { rows, seed, threads, resume, shard, chunk, ..default };
    let scene = &scene.inner;
    let (name, pours) = engine.unzip();
    let name = name.unwrap_or_default();
    let raised = Mutex::new(None);
    let pour = |scene: &dem::Scene, seed| {
        Python::attach(|py| {
            let call = pours.as_ref().expect("only an engine is asked");
            foreign(py, call, scene, seed).map_err(|error| {
                let reason = error.to_string();
                // Among thousands of pours: which one.
                let note = format!("granulcal asked {name} for a pour with seed {seed}");
                let _ = error.value(py).call_method1("add_note", (note,));
                raised.lock().expect("no panic while it is held").get_or_insert(error);
                DatasetError::Engine { name: name.clone(), reason }
            })
        })
    };
    let (outcome, interrupted) = py.detach(|| {
        let engine = pours.as_ref().map(|_| Engine { name: &name, pour: &pour });
        let watch = Watch::new();
        let mut report = |now: &Progress| {
            watch.keep_going(|py| match &progress {
                Some(call) => call.call1(py, counts(now)).map(drop),
                None => Ok(()),
            })
        };
        let outcome =
            granulcal_dataset::generate_with(engine, scene, &prior, &options, &out, &mut report);
        (outcome, watch.finish())
    });
    interrupted?;
    if let Some(error) = raised.into_inner().expect("no panic while it was held") {
        return Err(error);
    }
    outcome.map(|summary| counts(&summary.progress)).map_err(error::dataset)
}

/// Asks a function of Python for a pour.
fn foreign(py: Python<'_>, call: &Py<PyAny>, scene: &dem::Scene, seed: u64) -> PyResult<Outcome> {
    let left = call.bind(py).call1((Scene { inner: scene.clone() }, seed))?;
    let Ok((positions, radii)) = left.extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>)>() else {
        return Ok(Outcome::Points(Vectors::borrow("points", &left)?.as_slice()?.to_vec()));
    };
    Ok(Outcome::Grains {
        positions: Vectors::borrow("positions", &positions)?.as_slice()?.to_vec(),
        radii: Numbers::borrow("radii", &radii)?.as_slice()?.to_vec(),
    })
}

/// Rows in all, found, made, unhealthy, jammed, without grains in view.
type Counts = (u64, u64, u64, u64, u64, u64);

fn counts(progress: &Progress) -> Counts {
    let Progress { total, resumed, made, unhealthy, jammed, no_grains_in_view, .. } = *progress;
    (total, resumed, made, unhealthy, jammed, no_grains_in_view)
}
