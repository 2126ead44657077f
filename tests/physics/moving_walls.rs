//! Grains at walls that move, against closed forms (docs/theory/contact.md, "Walls that move").

use granulcal::dem::{
    Ends, GRAVITY, Motion as WallMotion, Preset, Scene, Shape, Simulation, Start, Status, Wall,
    WallMaterial,
};
use nalgebra::Vector3;

use crate::scenes::{RADIUS, drop_of, material, motion, one_grain, start};

/// Where the wall is that moves, above the ground `[m]`.
const HEIGHT: f64 = 0.1;

/// One grain that touches a level wall which moves so.
fn on_a_moving_wall(wall_motion: WallMotion, at: [f64; 2], mu_s: f64, restitution: f64) -> Scene {
    let mut scene = one_grain(HEIGHT + RADIUS, material(mu_s, 0.0, restitution));
    scene.material.torsional_friction = 0.0;
    scene.start = Start::Positions { positions: vec![[at[0], at[1], HEIGHT + RADIUS]] };
    let shape = Shape::Plane { point: [0.0, 0.0, HEIGHT], normal: [0.0, 0.0, 1.0] };
    scene.walls.push(Wall { motion: wall_motion, ..Wall::fixed(shape, WallMaterial::default()) });
    scene
}

fn lift(velocity: [f64; 3]) -> WallMotion {
    WallMotion::Lift { velocity, begin: 0.0, end: 10.0 }
}

#[test]
fn a_lift_carries_its_grain() {
    let mut simulation = start(&on_a_moving_wall(lift([0.0, 0.0, 0.04]), [0.0; 2], 0.5, 0.0));
    simulation.advance(1.0);
    let grain = motion(&simulation, 0);
    assert!((grain.v - 0.04 * Vector3::<f64>::z()).norm() < 1e-9, "{grain:?}");
    let height = simulation.positions()[0].z - (HEIGHT + 0.04 + RADIUS);
    assert!(height.abs() < 2e-5, "{height}"); // the slop of a resting contact
    assert!(simulation.health().energy_created < 1e-9, "{:?}", simulation.health());
    // A floor that sinks slower than a grain falls keeps it, too.
    let mut simulation = start(&on_a_moving_wall(lift([0.0, 0.0, -0.04]), [0.0; 2], 0.5, 0.0));
    simulation.advance(1.0);
    assert!((motion(&simulation, 0).v + 0.04 * Vector3::<f64>::z()).norm() < 1e-9);
}

#[test]
fn a_belt_drags_a_grain_to_two_sevenths_of_its_speed() {
    // Friction P gives v = P / m and r omega = -5/2 P / m; slip ends when v - r omega = V (1 + 5/2) v = V.
    let belt = 0.7;
    let mut simulation = start(&on_a_moving_wall(lift([belt, 0.0, 0.0]), [0.0; 2], 0.3, 0.0));
    // While it slips the grain gains mu g t.
    let time = 0.03;
    simulation.advance(time);
    assert!((motion(&simulation, 0).v.x / (0.3 * GRAVITY * time) - 1.0).abs() < 1e-9);
    simulation.advance(1.0);
    let grain = motion(&simulation, 0);
    assert!((grain.v.x - 2.0 / 7.0 * belt).abs() < 1e-9, "{grain:?}");
    assert!((grain.w.y + 5.0 / 7.0 * belt).abs() < 1e-9, "{grain:?}");
    assert!(simulation.health().energy_created < 1e-9, "{:?}", simulation.health());
}

#[test]
fn rolling_friction_on_a_belt_ends_in_rest_on_it() {
    let mut scene = on_a_moving_wall(lift([0.3, 0.0, 0.0]), [0.0; 2], 0.5, 0.0);
    scene.material.rolling_friction = 0.1;
    let mut simulation = start(&scene);
    simulation.advance(1.0);
    let grain = motion(&simulation, 0);
    assert!((grain.v.x - 0.3).abs() < 1e-9 && grain.w.norm() < 1e-9, "{grain:?}");
}

#[test]
fn a_ball_on_a_turntable_goes_round_at_two_sevenths_of_its_rate() {
    // Rolling without slip on a table of rate Omega: dv/dt = 2/7 Omega z x v, circles wherever they are
    // (Weltner 1979, doi:10.1119/1.11602).
    let rate = 4.0;
    let (point, axis) = ([0.0; 3], [0.0, 0.0, 1.0]);
    let table = WallMotion::Spin { point, axis, rate, begin: 0.0, end: None };
    let mut simulation = start(&on_a_moving_wall(table, [0.05, 0.0], 1.0, 0.0));
    simulation.advance(0.2);
    let begin = motion(&simulation, 0).v;
    assert!(begin.norm() > 0.01, "{begin}");
    let time = 1.5;
    simulation.advance(time);
    let end = motion(&simulation, 0).v;
    let turned = begin.cross(&end).z.atan2(begin.dot(&end));
    let expected = 2.0 / 7.0 * rate * time;
    assert!((turned / expected - 1.0).abs() < 2e-3, "{turned}, expected {expected}");
    assert!((end.norm() / begin.norm() - 1.0).abs() < 2e-3, "{begin} {end}");
}

#[test]
fn a_racket_throws_a_grain_at_its_speed_and_its_restitution() {
    for (restitution, speed) in [(0.0, 1.0), (0.5, 0.4), (0.9, 2.0)] {
        let mut scene = on_a_moving_wall(lift([0.0, 0.0, speed]), [0.0; 2], 0.5, restitution);
        scene.gravity = [0.0; 3];
        let positions = vec![[0.0, 0.0, HEIGHT + 2.0 * RADIUS]];
        scene.start = Start::Positions { positions };
        let mut simulation = start(&scene);
        simulation.advance(0.02);
        let velocity = motion(&simulation, 0).v;
        let expected = (1.0 + restitution) * speed * Vector3::<f64>::z();
        assert!((velocity - expected).norm() < 1e-9, "{velocity}, expected {expected}");
        assert!(simulation.health().energy_created < 1e-9, "{:?}", simulation.health());
    }
}

/// Grains in a drum that turns, ended by `seconds`.
fn drum(seconds: f64) -> Scene {
    let mut scene = drop_of(120, 0.0, material(0.5, 0.05, 0.4));
    let (from, to, radius) = ([0.0, -0.01, 0.06], [0.0, 0.01, 0.06], 0.04);
    let (point, axis) = (from, [0.0, 1.0, 0.0]);
    let turning = WallMotion::Spin { point, axis, rate: 3.0, begin: 0.0, end: None };
    for shape in [
        Shape::Cylinder { from, to, radius, closed: Ends::None },
        Shape::Plane { point: from, normal: [0.0, 1.0, 0.0] },
        Shape::Plane { point: to, normal: [0.0, -1.0, 0.0] },
    ] {
        let motion = turning.clone();
        scene.walls.push(Wall { motion, ..Wall::fixed(shape, WallMaterial::default()) });
    }
    let place = |index: usize| {
        let (x, rest) = (index % 8, index / 8);
        let (y, z) = (rest % 3, rest / 3);
        [0.006 * (x as f64 - 3.5), 0.0055 * (y as f64 - 1.0), 0.045 + 0.006 * z as f64]
    };
    scene.start = Start::Positions { positions: (0..120).map(place).collect() };
    scene.end.horizon = seconds;
    scene
}

#[test]
fn a_drum_lifts_its_grains_and_creates_no_energy() {
    let pour = start(&drum(1.5)).run();
    assert_eq!(pour.status, Status::Horizon, "{:?}", pour.health);
    assert_eq!(pour.health.grains_lost, 0);
    assert!(pour.health.energy_created < 1e-3, "{:?}", pour.health);
    // The bed leans: the right hand about +y takes the lowest point of the drum to -x.
    let mean = pour.positions.iter().map(|x| x.x).sum::<f64>() / 120.0;
    assert!(mean < -0.005, "{mean}");
}

#[test]
fn a_drum_is_the_same_on_any_threads_and_after_a_restart() {
    let scene = drum(0.3);
    let whole = start(&scene).run();
    let threads = start(&scene).with_threads(3).unwrap().run();
    assert_eq!(whole.state_hash, threads.state_hash);
    for time in [0.05, 0.151] {
        let mut first = start(&scene);
        first.advance(time);
        let second = start(&scene).resume(&first.checkpoint()).unwrap();
        assert_eq!(second.run().state_hash, whole.state_hash);
    }
}

#[test]
fn a_shaken_floor_keeps_its_grains_and_its_books() {
    let (amplitude, frequency) = ([0.0, 0.0, 5e-4], 40.0);
    let shake = WallMotion::Shake { amplitude, frequency, begin: 0.1, end: Some(0.6) };
    let mut scene = drop_of(60, HEIGHT, material(0.5, 0.1, 0.5));
    let shape = Shape::Plane { point: [0.0, 0.0, HEIGHT], normal: [0.0, 0.0, 1.0] };
    scene.walls.push(Wall { motion: shake, ..Wall::fixed(shape, WallMaterial::default()) });
    let pour = start(&scene).run();
    assert_eq!(pour.status, Status::AtRest, "{:?}", pour.health);
    assert!(pour.simulated_s > 0.6, "{}", pour.simulated_s);
    assert!(pour.health.energy_created < 1e-3, "{:?}", pour.health);
    assert!(pour.positions.iter().all(|x| x.z > HEIGHT + RADIUS - 1e-4));
}

#[test]
fn the_contact_problem_knows_the_walls_motion() {
    for method in [Preset::Default, Preset::Paper] {
        let mut scene = on_a_moving_wall(lift([0.3, 0.0, 0.02]), [0.0; 2], 0.5, 0.0);
        scene.preset = method;
        let mut simulation: Simulation = start(&scene);
        simulation.advance(0.05);
        let problem = simulation.contact_problem().unwrap();
        let velocity = problem.velocities()[0];
        // 0.3 m/s to the right at most, lifted at 0.02.
        assert!((velocity[2] - 0.02).abs() < 1e-5, "{velocity}");
        assert!(velocity[0] > 0.05 && velocity[0] < 0.3 && problem.residual() < 1e-12);
    }
}

#[test]
fn a_grain_that_walls_crush_costs_no_more_than_others() {
    // A press comes down on a grain on the ground: no impact can let go of it, and that is said once in a substep.
    let mut scene = one_grain(RADIUS, material(0.5, 0.3, 0.5));
    let shape = Shape::Plane { point: [0.0, 0.0, 2.0 * RADIUS + 1e-4], normal: [0.0, 0.0, -1.0] };
    let press =
        Wall { motion: lift([0.0, 0.0, -0.5]), ..Wall::fixed(shape, WallMaterial::default()) };
    scene.walls.push(press);
    for preset in [Preset::Fast, Preset::Default, Preset::Accurate] {
        scene.preset = preset;
        let mut simulation = start(&scene);
        let settings = *simulation.settings();
        simulation.advance(2e-3);
        let work = simulation.impact_work();
        let substeps = simulation.health().substeps as f64;
        assert!(work.impacts > 0, "{preset}: {work:?}");
        assert!(work.impacts as f64 <= substeps, "{preset}: {work:?} {substeps}");
        let most = 400.0 / settings.impact.micro_step * work.impacts as f64;
        assert!(work.micro_steps as f64 <= most, "{preset}: {work:?}");
    }
}
