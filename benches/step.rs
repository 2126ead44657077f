//! What a pour costs: substeps of a full funnel and a whole small drop, the scenes of `tests/physics`.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use granulcal::dem::{Material, Preset, Scene, Simulation};

/// Substeps in one iteration of the funnel's benchmark: several searches for pairs.
const SUBSTEPS: usize = 20;
/// When every grain is in the funnel and the stem runs full `[s]`.
const FULL: f64 = 0.3;

fn simulation(scene: &Scene) -> Simulation {
    Simulation::new(scene, 1).expect("a valid scene")
}

/// The paper's funnel at t = 0.3 s, 2000 grains; throughput in grain substeps.
fn funnel(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("dem/pour/funnel_2000");
    group.sample_size(20);
    for preset in Preset::ALL {
        let scene = Scene { preset, ..Scene::funnel(0.12) };
        let mut full = simulation(&scene);
        full.advance(FULL);
        let seconds = SUBSTEPS as f64 * preset.settings().dt;
        group.throughput(Throughput::Elements((scene.grains.count * SUBSTEPS) as u64));
        group.bench_function(format!("{SUBSTEPS}_substeps_{preset}"), |b| {
            b.iter_batched_ref(
                || full.clone(),
                |pour| pour.advance(black_box(seconds)),
                BatchSize::LargeInput,
            );
        });
    }
    group.finish();
}

/// 300 grains from 0.2 m until they are at rest; throughput in grains.
fn drop_to_rest(criterion: &mut Criterion) {
    let mut scene = Scene::drop(0.2);
    scene.grains.count = 300;
    scene.material = Material { rolling_friction: 0.3, ..Material::default() };
    let mut group = criterion.benchmark_group("dem/pour/drop_300");
    group.sample_size(10);
    group.throughput(Throughput::Elements(scene.grains.count as u64));
    for preset in [Preset::Fast, Preset::Default] {
        let scene = Scene { preset, ..scene.clone() };
        group.bench_function(format!("to_rest_{preset}"), |b| {
            b.iter(|| simulation(black_box(&scene)).run());
        });
    }
    group.finish();
}

criterion_group!(benches, funnel, drop_to_rest);
criterion_main!(benches);
