//! Posteriors without Python: what a robot waits for.

mod clock;

use std::fs;
use std::hint::black_box;
use std::path::{Path, PathBuf};

use clock::CpuTime;
use criterion::{BatchSize, BenchmarkId, Criterion, criterion_group, criterion_main};
use granulcal::bayessim::Model;
use rayon::ThreadPoolBuilder;

const DRAWS: usize = 1000;

/// The models of the crate's tests, small ones, or the folder in `GRANULCAL_MODEL`.
fn folders() -> Vec<(String, PathBuf)> {
    if let Some(folder) = std::env::var_os("GRANULCAL_MODEL") {
        return vec![("given".to_owned(), folder.into())];
    }
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/bayessim/tests/data");
    ["auto", "mdrff", "pile"].map(|name| (name.to_owned(), data.join(name))).into()
}

/// One pour: the numbers of `x.json` beside the model, or numbers that any model can take.
fn observation(model: &Model, folder: &Path) -> Vec<Vec<f64>> {
    let numbers = fs::read_to_string(folder.join("x.json")).ok();
    let listed = numbers.map(|text| {
        let entries = text.trim().trim_matches(['[', ']']).split(',');
        entries.map(|entry| entry.trim().parse().expect("a number")).collect()
    });
    vec![listed.unwrap_or_else(|| vec![0.1; model.x_names.len()])]
}

fn posterior(criterion: &mut Criterion<CpuTime>) {
    // The clock is that of this thread, so that all has to be done on it.
    let one = ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global();
    one.expect("no pool of threads yet");
    let mut group = criterion.benchmark_group("bayessim/posterior");
    group.sample_size(20);
    for (name, folder) in folders() {
        assert!(fs::exists(&folder).unwrap_or(false), "no model in {}", folder.display());
        let load = || Model::load(&folder).expect("a model");
        group.bench_function(BenchmarkId::new("first", &name), |b| {
            b.iter_batched(
                load,
                |model| {
                    let x = observation(&model, &folder);
                    let posterior = model.posterior(&x).expect("an observation of this model");
                    black_box(posterior.sample(DRAWS, 1));
                    drop(posterior);
                    model
                },
                BatchSize::PerIteration,
            );
        });
        let model = load();
        let x = observation(&model, &folder);
        model.posterior(&x).expect("an observation of this model");
        group.bench_function(BenchmarkId::new("draws_1000", &name), |b| {
            b.iter(|| {
                let posterior = model.posterior(black_box(&x)).expect("the same observation");
                posterior.sample(DRAWS, 1)
            });
        });
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().with_measurement(CpuTime);
    targets = posterior
}
criterion_main!(benches);
