//! What a pour costs: its parts, substeps, whole pours; the scenes of `tests/physics` and of the comparison with other
//! engines (docs/results/peers.md).

use std::hint::black_box;
use std::thread;

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use granulcal::dem::{Material, Preset, Scene, Simulation, SolverSettings, Start, WallMaterial};

/// Substeps in one iteration of the benchmarks in a running pour: several searches for pairs.
const SUBSTEPS: usize = 20;
/// When every grain is in the funnel and the stem runs full `[s]`.
const FULL: f64 = 0.3;
/// Sweeps in one iteration of the solver's benchmark.
const SWEEPS: usize = 50;

fn simulation(scene: &Scene) -> Simulation {
    Simulation::new(scene, 1).expect("a valid scene")
}

/// The pour that other engines made, too: sliding friction 0.5, rolling torque at most 0.3 R F_n, restitution 0.3.
fn set_p() -> Scene {
    let material = Material {
        sliding_friction: 0.5,
        rolling_friction: 0.6,
        restitution: 0.3,
        ..Material::default()
    };
    let wall = WallMaterial { rolling_friction: Some(0.3), ..WallMaterial::default() };
    let mut scene = Scene { material, ..Scene::funnel(0.12) };
    scene.ground.material = wall;
    if let Some(funnel) = &mut scene.funnel {
        funnel.material = wall;
    }
    scene
}

/// A loose cube of grains of set P, dropped, after it has collapsed for 0.1 s.
fn cube(grains: usize, threads: usize) -> Simulation {
    let edge = (grains as f64).cbrt().ceil() as usize;
    let mut scene = Scene { funnel: None, ..set_p() };
    let spacing = 1.1 * scene.grains.diameter;
    let base = 0.6 * scene.grains.diameter;
    scene.grains.count = grains;
    scene.start = Start::Grid { counts: [edge; 3], spacing, jitter: 1e-4, base };
    let mut cube = simulation(&scene).with_threads(threads).expect("threads");
    cube.advance(0.1);
    cube
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

/// Set P to rest: one pour, and two at once on two threads.
fn set_p_to_rest(criterion: &mut Criterion) {
    let scene = set_p();
    let mut group = criterion.benchmark_group("dem/pour/set_p_to_rest");
    group.sample_size(10);
    group.throughput(Throughput::Elements(1));
    group.bench_function("one", |b| b.iter(|| simulation(black_box(&scene)).run()));
    group.throughput(Throughput::Elements(2));
    group.bench_function("two_at_once", |b| {
        b.iter(|| {
            thread::scope(|scope| {
                let pours = [0; 2].map(|_| scope.spawn(|| simulation(black_box(&scene)).run()));
                pours.map(|pour| pour.join().expect("no panic"))
            })
        });
    });
    group.finish();
}

/// One sweep over the contacts of set P in full flow; throughput in contacts times sweeps.
fn sweeps(criterion: &mut Criterion) {
    let mut flow = simulation(&set_p());
    flow.advance(FULL);
    let problem = flow.frozen_solve().expect("balls");
    let settings = SolverSettings {
        sweeps: SWEEPS,
        max_sweeps: SWEEPS,
        relaxation: 1.0,
        settled: f64::MIN_POSITIVE,
        ..Preset::Default.settings()
    };
    let mut group = criterion.benchmark_group("dem/solver");
    group.throughput(Throughput::Elements((problem.contact_count() * SWEEPS) as u64));
    group.bench_function(format!("{SWEEPS}_sweeps"), |b| {
        b.iter(|| problem.solve(black_box(&settings)).expect("settings in range"));
    });
    group.finish();
}

/// The list of pairs of set P in full flow and at rest; throughput in grains.
fn pair_list(criterion: &mut Criterion) {
    let scene = set_p();
    let mut group = criterion.benchmark_group("dem/pair_list");
    group.throughput(Throughput::Elements(scene.grains.count as u64));
    for (name, seconds) in [("flow", FULL), ("rest", scene.end.horizon)] {
        let mut pour = simulation(&scene);
        pour.advance(seconds);
        let mut search = pour.frozen_search().expect("balls");
        group.bench_function(name, |b| b.iter(|| search.pairs()));
    }
    group.finish();
}

/// A collapsing cube of few and of many grains on one and on two threads; throughput in grain substeps.
fn scale(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("dem/scale");
    group.sample_size(10);
    for (grains, threads) in [(2_000, 1), (100_000, 1), (100_000, 2)] {
        let cube = cube(grains, threads);
        let seconds = SUBSTEPS as f64 * Preset::Default.settings().dt;
        group.throughput(Throughput::Elements((grains * SUBSTEPS) as u64));
        group.bench_function(BenchmarkId::new(format!("{grains}_grains"), threads), |b| {
            b.iter_batched_ref(
                || cube.clone(),
                |pour| pour.advance(black_box(seconds)),
                BatchSize::LargeInput,
            );
        });
    }
    group.finish();
}

criterion_group!(benches, funnel, drop_to_rest, set_p_to_rest, sweeps, pair_list, scale);
criterion_main!(benches);
