//! Bonds that break, on two grains and on a ball of them: docs/theory/effects.md, "Bonds".

use granulcal::dem::{
    Bed, Bonds, GRAVITY, Projection, Scene, Shape, Simulation, Start, Status, Wall, WallMaterial,
};
use nalgebra::Vector3;

use crate::scenes::{RADIUS, bits, drop_of, material, one_grain, start};

const DT: f64 = 1.0 / 2000.0;
const BOND: f64 = 20.0;
const RANGE: f64 = 0.1;

fn glue() -> Bonds {
    Bonds { bond: BOND, range: RANGE, ..Bonds::default() }
}

/// Speed of each of two grains that has the energy of their bond, `m v^2 = F range`.
fn escape() -> f64 {
    (BOND * GRAVITY * RANGE * RADIUS).sqrt()
}

/// Two smooth grains that touch, along x; both fall alike.
fn pair(bonds: Bonds) -> Scene {
    let mut scene = one_grain(1e3, material(0.0, 0.0, 1.0));
    scene.grains.count = 2;
    scene.start = Start::Positions { positions: vec![[0.0, 0.0, 1e3], [2.0 * RADIUS, 0.0, 1e3]] };
    scene.effects.bonds = bonds;
    scene
}

/// The pair after `seconds`, once its second grain has been set in motion and the first in the opposite one.
fn sent(scene: &Scene, velocity: Vector3<f64>, spin: Vector3<f64>, seconds: f64) -> Simulation {
    let mut simulation = start(scene);
    simulation.advance(2.0 * DT);
    let fall = simulation.velocities()[0];
    simulation.set_motion(0, fall - velocity, spin).unwrap();
    simulation.set_motion(1, fall + velocity, spin).unwrap();
    simulation.advance(seconds);
    simulation
}

/// Half of the pair's relative velocity, and its gap `[m/s, m]`.
fn apart(simulation: &Simulation) -> (Vector3<f64>, f64) {
    let (v, x) = (simulation.velocities(), simulation.positions());
    (0.5 * (v[1] - v[0]), (x[1] - x[0]).norm() - 2.0 * RADIUS)
}

#[test]
fn parting_costs_the_pull_times_its_range_at_any_speed() {
    let scene = pair(glue());
    for factor in [1.1, 1.5, 5.0, 30.0] {
        let speed = factor * escape();
        // Velocities live half a substep earlier, before half of what the bond takes in one: so exact is it.
        let half = 0.5 * BOND * GRAVITY * DT;
        let sent_at = (speed + half) * Vector3::x();
        let left = apart(&sent(&scene, sent_at, Vector3::zeros(), 0.1)).0.x;
        let expected = (speed * speed - escape() * escape()).sqrt();
        assert!((left - expected).abs() < 0.6 * half, "{factor}: {left} {expected}");
    }
    let held = apart(&sent(&scene, 0.9 * escape() * Vector3::x(), Vector3::zeros(), 0.1));
    assert!(held.1 < RANGE * RADIUS, "{}", held.1);
}

#[test]
fn what_is_broken_stays_so() {
    let mut simulation = sent(&pair(glue()), 5.0 * escape() * Vector3::x(), Vector3::zeros(), 0.01);
    let fall = 0.5 * (simulation.velocities()[0] + simulation.velocities()[1]);
    for (grain, sign) in [(0, 1.0), (1, -1.0)] {
        let back = fall + sign * 0.5 * escape() * Vector3::x();
        simulation.set_motion(grain, back, Vector3::zeros()).unwrap();
    }
    simulation.advance(0.2);
    // Half of the speed that the bond would hold, and nothing is lost.
    let (velocity, gap) = apart(&simulation);
    assert!(gap > 2.0 * RANGE * RADIUS && (velocity.x - 0.5 * escape()).abs() < 1e-6 * escape());
}

#[test]
fn surfaces_that_slide_by_its_range_break_it_and_those_that_turn_together_do_not() {
    // A dumbbell that turns as one body, its force m w^2 r half of the pull and twice as much.
    for (share, holds) in [(0.5, true), (2.0, false)] {
        let turn = (share * BOND * GRAVITY / RADIUS).sqrt() * Vector3::z();
        let velocity = turn.cross(&(RADIUS * Vector3::x()));
        let gap = apart(&sent(&pair(glue()), velocity, turn, 0.2)).1;
        assert_eq!(gap < RANGE * RADIUS, holds, "{share}: {gap}");
    }
    // The same speed without the turn: it goes on nearly straight once the surfaces have slid by the range.
    let speed = (0.5 * BOND * GRAVITY * RADIUS).sqrt();
    let (velocity, gap) = apart(&sent(&pair(glue()), speed * Vector3::y(), Vector3::zeros(), 0.2));
    assert!(gap > RADIUS, "{gap}");
    // What the pull has turned it by until then: F / (m v) for a time of range R / 2 v, and the way of a substep.
    let time = 0.5 * RANGE * RADIUS / speed;
    let turned = -velocity.x / speed;
    let expected = BOND * GRAVITY * time / speed;
    let substep = BOND * GRAVITY * DT / speed;
    assert!(turned > 0.0 && turned < expected + 2.0 * substep, "{turned} {expected} {substep}");
}

/// A grain between the rims of two discs, and one that is glued to it from below: how far that has fallen in a second.
fn hung(bond: f64) -> f64 {
    let (half, top) = (0.9 * RADIUS, 0.1);
    let above = (RADIUS * RADIUS - half * half).sqrt();
    let mut scene = one_grain(top, material(0.8, 0.1, 0.3));
    scene.grains.count = 2;
    let lower = top + above - 2.0 * RADIUS;
    scene.start = Start::Positions { positions: vec![[0.0, 0.0, top + above], [0.0, 0.0, lower]] };
    for side in [-1.0, 1.0] {
        let centre = [side * (half + 0.02), 0.0, top];
        let shape = Shape::Disc { centre, normal: [0.0, 0.0, 1.0], radius: 0.02 };
        scene.walls.push(Wall::fixed(shape, WallMaterial::default()));
    }
    scene.effects.bonds = Bonds { bond, ..glue() };
    let mut simulation = start(&scene);
    simulation.advance(1.0);
    lower - simulation.positions()[1].z
}

#[test]
fn a_bond_carries_a_grain_of_less_than_its_strength_for_good() {
    for (bond, holds) in [(0.9, false), (1.1, true), (50.0, true)] {
        let fallen = hung(bond);
        assert_eq!(fallen < 0.1 * RANGE * RADIUS, holds, "{bond}: {fallen}");
    }
}

#[test]
fn a_low_fall_leaves_a_glued_ball_whole_and_a_high_one_does_not() {
    let spread = |height: f64, bond: f64| {
        let mut scene = drop_of(200, height, material(0.4, 0.05, 0.5));
        scene.effects.bonds = Bonds { bond, ..Bonds::default() };
        let pour = start(&scene).run();
        assert!(pour.health.energy_created < 1e-3, "{:?}", pour.health);
        assert!(matches!(pour.status, Status::AtRest | Status::OutOfView), "{}", pour.status);
        let mut radii: Vec<_> = pour.positions.iter().map(|x| x.xy().norm()).collect();
        radii.sort_by(f64::total_cmp);
        radii[150]
    };
    let dry = spread(0.05, 0.0);
    let (whole, broken) = (spread(0.05, 10.0), spread(0.5, 10.0));
    assert!(whole < 0.8 * dry && broken > 1.5 * whole, "{whole} {dry} {broken}");
}

#[test]
fn the_bits_are_those_of_any_number_of_threads_and_of_a_restart() {
    let mut scene = drop_of(200, 0.05, material(0.4, 0.05, 0.5));
    scene.effects.bonds = Bonds { begin: 0.01, ..glue() };
    let after = |threads, seconds| {
        let mut simulation = start(&scene).with_threads(threads).unwrap();
        simulation.advance(seconds);
        simulation
    };
    let whole = after(1, 0.2);
    assert_eq!(bits(&whole), bits(&after(3, 0.2)));
    for at in [0.005, 0.12] {
        let mut second = start(&scene).resume(&after(1, at).checkpoint()).unwrap();
        second.advance(0.2 - at);
        assert_eq!(second.state_hash(), whole.state_hash());
    }
}

#[test]
fn of_a_ball_above_a_bed_the_ball_alone_is_glued() {
    let mut scene = drop_of(60, 0.03, material(0.4, 0.05, 0.5));
    scene.camera.projection = Projection::Orthographic;
    (scene.camera.pixels, scene.camera.downsample) = (200, 1);
    scene.bed = Some(Bed { radius: 0.03, height: 0.02, spacing: 5e-3, jitter: 1e-4, settle: 0.2 });
    let settled = |scene: &Scene| {
        let mut simulation = start(scene);
        simulation.advance(0.19);
        bits(&simulation)
    };
    let loose = settled(&scene);
    scene.effects.bonds = glue();
    assert_eq!(settled(&scene), loose);
    let mut first = start(&scene);
    first.advance(0.3);
    let second = start(&scene).resume(&first.checkpoint()).unwrap();
    assert_eq!(second.run(), first.run());
}

#[test]
fn what_they_cannot_be_with_is_refused() {
    let mut scene = pair(glue());
    scene.effects.clump.aspect = 1.5;
    let error = scene.check().unwrap_err().to_string();
    assert!(error.contains("effects.bonds") && error.contains("effects.clump"), "{error}");
    scene.effects.clump.aspect = 1.0;
    scene.effects.bonds.range = 0.0;
    let error = scene.check().unwrap_err().to_string();
    assert!(error.starts_with("effects.bonds.range must be"), "{error}");
}
