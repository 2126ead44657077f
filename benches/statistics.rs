//! The statistics of a heap, as dense as down-sampled and full depth images give it.

mod clock;

use std::hint::black_box;

use clock::CpuTime;
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use granulcal::features::{DiagnosticSettings, PAPER16, Prepared, diagnostics, paper16};
use nalgebra::Vector3;

/// A cone with a rough surface, on a sunflower spiral.
fn cone(count: usize) -> Vec<Vector3<f64>> {
    let golden_angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    (0..count)
        .map(|i| {
            let share = i as f64 / count as f64;
            let (sin, cos) = (golden_angle * i as f64).sin_cos();
            let r = 0.06 * share.sqrt();
            let roughness = 0.002 * (12.9898 * i as f64).sin();
            Vector3::new(r * cos, r * sin, 0.02 * (1.0 - share) + roughness)
        })
        .collect()
}

fn statistics(criterion: &mut Criterion<CpuTime>) {
    let mut group = criterion.benchmark_group("features/statistics");
    for count in [1_000_usize, 10_000, 100_000] {
        let points = cone(count);
        group.throughput(Throughput::Elements(count as u64));
        group.bench_with_input(BenchmarkId::new("paper16", count), &points, |b, points| {
            b.iter(|| paper16(black_box(points)));
        });
    }
    let points = cone(10_000);
    // Until it is told anew, the throughput is that of the largest cloud above.
    group.throughput(Throughput::Elements(points.len() as u64));
    for statistic in PAPER16.iter().filter(|s| ["chi_df", "dcor_r_z"].contains(&s.name)) {
        group.bench_function(BenchmarkId::new(statistic.name, points.len()), |b| {
            b.iter(|| Prepared::new(black_box(&points)).map(|p| (statistic.value)(&p)));
        });
    }
    let spacing = 0.06 * (std::f64::consts::PI / points.len() as f64).sqrt();
    let settings = DiagnosticSettings { pour_axis: None, grain_diameter: 4e-3, spacing };
    group.bench_function(BenchmarkId::new("diagnostics", points.len()), |b| {
        b.iter(|| diagnostics(black_box(&points), &settings));
    });
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().with_measurement(CpuTime);
    targets = statistics
}
criterion_main!(benches);
