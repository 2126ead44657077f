//! A pour of small grains is that of large ones, lengths in proportion and times like their roots:
//! docs/theory/contact.md, "Small grains".

use granulcal::dem::{Scene, Simulation, Start, Status};

const SEEDS: u64 = 12;

/// Median distance from the axis of the grains of a drop, over their radius: mean over seeds and its standard error.
fn spread_of_a_drop(size: f64) -> [f64; 2] {
    let mut scene = Scene::drop(8e-3 * size);
    scene.grains.count = 300;
    scene.grains.diameter *= size;
    if let Start::Ball { jitter, .. } = &mut scene.start {
        *jitter *= size;
    }
    scene.substep = Some(size.sqrt() * scene.preset.settings().dt);
    scene.end.kinetic_energy *= size;
    let radius = scene.grains.radius();
    let medians: Vec<f64> = (0..SEEDS)
        .map(|seed| {
            let pour = Simulation::new(&scene, seed).unwrap().run();
            assert_eq!(pour.status, Status::AtRest, "{size}: {:?}", pour.health);
            let mut all: Vec<f64> =
                pour.positions.iter().map(|at| at.x.hypot(at.y) / radius).collect();
            all.sort_by(f64::total_cmp);
            all[all.len() / 2]
        })
        .collect();
    let count = SEEDS as f64;
    let mean = medians.iter().sum::<f64>() / count;
    let variance = medians.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (count - 1.0);
    [mean, (variance / count).sqrt()]
}

#[test]
fn grains_of_half_a_millimetre_spread_as_those_of_four() {
    let [large, of_large] = spread_of_a_drop(1.0);
    let [small, of_small] = spread_of_a_drop(0.125);
    // With the lengths and speeds of large grains they spread 0.9 radii less.
    let error = of_large.hypot(of_small);
    assert!((large - small).abs() < 3.0 * error && error < 0.25, "{large} {small} {error}");
}
