//! Posteriors without Python: what a robot waits for.

use std::fs;
use std::hint::black_box;
use std::path::{Path, PathBuf};

use criterion::{BatchSize, BenchmarkId, Criterion, criterion_group, criterion_main};
use granulcal_bayessim::Model;

const DRAWS: usize = 1000;

/// The models of the crate's tests, small ones; a folder in `GRANULCAL_MODEL` instead is one of full size.
fn folders() -> Vec<(String, PathBuf)> {
    if let Some(folder) = std::env::var_os("GRANULCAL_MODEL") {
        return vec![("given".to_owned(), folder.into())];
    }
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/bayessim/tests/data");
    ["auto", "mdrff", "pile"].map(|name| (name.to_owned(), data.join(name))).into()
}

/// An observation that the model can take: the table says nothing of its values.
fn observation(model: &Model) -> Vec<Vec<f64>> {
    vec![vec![0.1; model.x_names.len()]]
}

fn posterior(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("bayessim/posterior");
    group.sample_size(20);
    for (name, folder) in folders() {
        assert!(fs::exists(&folder).unwrap_or(false), "no model in {}", folder.display());
        let load = || Model::load(&folder).expect("a model");
        group.bench_function(BenchmarkId::new("first", &name), |b| {
            b.iter_batched(
                load,
                |model| {
                    let x = observation(&model);
                    let posterior = model.posterior(&x).expect("an observation of this model");
                    black_box(posterior.sample(DRAWS, 1));
                    drop(posterior);
                    model
                },
                BatchSize::PerIteration,
            );
        });
        let model = load();
        let x = observation(&model);
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

criterion_group!(benches, posterior);
criterion_main!(benches);
