//! Golden counters: a solver that silently needs more sweeps fails here although its piles are right.
//!
//! The arithmetic of a substep is + - * /, fused multiply-add and square root in f64, without libm, all of which IEEE
//! 754 defines to the bit; so the counters are compared exactly, on every machine. They change whenever the order of
//! contacts, the law or the settings change: run `cargo test --test physics counters -- --nocapture`, read whether the
//! change is meant, and copy the printed numbers.

use granulcal::dem::{
    Method, Periodic, PeriodicAxis, Preset, Scene, Shape, Simulation, SolverSettings, Status, Wall,
    WallMaterial,
};

use crate::scenes::{drop_of, material};

/// What a pour has taken: substeps, sweeps, mean contacts at an examination; and how it has ended, if it has.
type Counters = (usize, usize, f64, Option<Status>);

/// Simulates `seconds`, or to the end if that comes before.
fn taken(scene: &Scene, method: Method, seconds: f64) -> Counters {
    let settings = SolverSettings { method, ..scene.settings() };
    let start = Simulation::new(scene, 1).expect("a valid scene");
    let mut simulation = start.with_settings(settings).expect("valid settings");
    simulation.advance(seconds);
    let health = simulation.health();
    let counters = (health.substeps, health.sweeps, health.mean_contacts, simulation.ended());
    println!("{method}: {counters:?}");
    counters
}

fn small_drop() -> Scene {
    drop_of(100, 0.05, material(0.5, 0.3, 0.5))
}

/// Cone, stem and ground.
fn small_funnel() -> Scene {
    let mut scene = Scene::funnel(0.05);
    scene.grains.count = 100;
    scene.material = material(0.4, 0.1, 0.6);
    scene
}

/// Space that repeats along y between two walls, without libm in any place.
fn channel() -> Scene {
    let mut scene = drop_of(120, 0.03, material(0.3, 0.05, 0.7));
    scene.periodic = Some(Periodic { axis: PeriodicAxis::Y, from: -0.012, to: 0.012 });
    for (x, normal) in [(-0.02, 1.0), (0.02, -1.0)] {
        let side = Shape::Plane { point: [x, 0.0, 0.0], normal: [normal, 0.0, 0.0] };
        scene.walls.push(Wall::fixed(side, WallMaterial::default()));
    }
    scene
}

#[test]
fn gauss_seidel_takes_its_substeps_and_sweeps() {
    let found = [
        taken(&small_drop(), Method::Nsgs, 4.0),
        taken(&small_funnel(), Method::Nsgs, 0.4),
        taken(&channel(), Method::Nsgs, 0.3),
    ];
    let expected = [
        (755, 2500, 212.013_245_033_112_58, Some(Status::AtRest)),
        (800, 2465, 68.631_25, None),
        (600, 3170, 410.933_333_333_333_34, None),
    ];
    assert_eq!(found, expected);
}

#[test]
fn newton_takes_its_steps() {
    let paper = Scene { preset: Preset::Paper, ..small_drop() };
    let found =
        [taken(&paper, Method::NewtonPcr, 0.3), taken(&small_drop(), Method::NewtonPcr, 0.2)];
    let expected = [(180, 10_870, 250.844_444_444_444_43, None), (400, 17_894, 277.812_5, None)];
    assert_eq!(found, expected);
}

#[test]
fn the_reference_takes_its_sweeps() {
    let mut few = small_drop();
    few.grains.count = 30;
    assert_eq!(taken(&few, Method::Reference, 0.15), (300, 2600, 76.3, None));
}
