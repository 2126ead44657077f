//! Rendering 2000 grains under the bird's-eye camera of the paper.

mod clock;

use std::hint::black_box;

use clock::CpuTime;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use granulcal::features::{Camera, height_map, render, render_grid};
use nalgebra::Vector3;

const GRAINS: usize = 2000;
const RADIUS: f64 = 0.002;

/// A shallow heap on a sunflower spiral: the spread of a real pour, without a random number.
fn heap() -> (Vec<Vector3<f64>>, Vec<f64>) {
    let golden_angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let positions = (0..GRAINS)
        .map(|i| {
            let share = i as f64 / GRAINS as f64;
            let (sin, cos) = (golden_angle * i as f64).sin_cos();
            let r = 0.06 * share.sqrt();
            Vector3::new(r * cos, r * sin, RADIUS + 0.02 * (1.0 - share))
        })
        .collect();
    (positions, vec![RADIUS; GRAINS])
}

fn raster(criterion: &mut Criterion<CpuTime>) {
    let (positions, radii) = heap();
    let camera = Camera::overhead(0.29, 0.58, 1920).expect("the paper's camera");
    let mut group = criterion.benchmark_group("features/raster");
    group.throughput(Throughput::Elements(GRAINS as u64));
    group.bench_function("1920", |b| {
        b.iter(|| render(black_box(&camera), black_box(&positions), &radii));
    });
    group.bench_function("1920_tilted", |b| {
        let camera = camera.tilted(0.05, -0.03);
        b.iter(|| render(black_box(&camera), black_box(&positions), &radii));
    });
    group.bench_function("1920_grid_20", |b| {
        b.iter(|| render_grid(black_box(&camera), black_box(&positions), &radii, 20));
    });
    group.bench_function("height_map_512", |b| {
        b.iter(|| height_map(black_box(&positions), &radii, 512, 0.0005, (0.0, 0.0)));
    });
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().with_measurement(CpuTime);
    targets = raster
}
criterion_main!(benches);
