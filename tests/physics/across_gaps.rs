//! Forces across gaps, pulls and films, on one or two grains against their closed forms; docs/theory/effects.md.

use std::f64::consts::PI;

use granulcal::dem::{
    Adhesion, Capillary, GRAVITY, Grains, Lubrication, Motion, Scene, Shape, Start, Wall,
    WallMaterial,
};
use nalgebra::Vector3;

use crate::effects::{DT, after};
use crate::scenes::{RADIUS, material, one_grain, start};

/// One grain that touches a ceiling from below.
fn hanging() -> Scene {
    let mut scene = one_grain(0.1, material(0.5, 0.1, 0.5));
    scene.walls.push(Wall {
        shape: Shape::Disc {
            centre: [0.0, 0.0, 0.1 + RADIUS],
            normal: [0.0, 0.0, -1.0],
            radius: 0.05,
        },
        material: WallMaterial::default(),
        motion: Motion::default(),
    });
    scene
}

fn fallen(scene: &Scene) -> f64 {
    let mut simulation = start(scene);
    simulation.advance(0.2);
    0.1 - simulation.positions()[0].z
}

#[test]
fn a_bridge_or_adhesion_holds_a_grain_at_a_ceiling_up_to_its_pull() {
    // The pull at a flat wall is twice that of a pair: 2 bond m g against m g.
    for (bond, holds) in [(0.52, true), (0.48, false)] {
        let mut scene = hanging();
        scene.effects.capillary = Capillary { bond, ..Capillary::default() };
        assert_eq!(fallen(&scene) < 1e-4, holds, "capillary {bond}: {}", fallen(&scene));
        let mut scene = hanging();
        scene.effects.adhesion = Adhesion { bond, ..Adhesion::default() };
        assert_eq!(fallen(&scene) < 1e-4, holds, "adhesion {bond}: {}", fallen(&scene));
    }
}

/// The share of its speed with which a grain that falls from `height` `[m]` on the ground leaves it, restitution 0.8.
fn rebound(scene: &Scene, height: f64) -> f64 {
    let mut simulation = start(scene);
    let fall = (2.0 * height / GRAVITY).sqrt();
    simulation.advance(fall + 0.012);
    let (z, v) = (simulation.positions()[0].z - RADIUS, simulation.velocities()[0].z);
    // Velocities live half a substep earlier.
    let speed = v - 0.5 * DT * GRAVITY;
    (2.0 * GRAVITY * z + speed * speed).sqrt() / (GRAVITY * fall)
}

#[test]
fn what_a_pull_takes_of_a_rebound_is_its_work_however_short_it_reaches() {
    let speed: f64 = 0.3;
    let height = speed * speed / (2.0 * GRAVITY);
    let mut scene = one_grain(RADIUS + height, material(0.5, 0.1, 0.8));
    assert!((rebound(&scene, height) - 0.8).abs() < 2e-3);
    // Twice the pull of a pair at a wall, over 0.005 radii: a fifteenth of the way of a substep.
    scene.effects.adhesion = Adhesion { bond: 3.0, ..Adhesion::default() };
    let work = 2.0 * 3.0 * GRAVITY * scene.effects.adhesion.range * RADIUS;
    let left = (0.64 * speed * speed - 2.0 * work).sqrt() / speed;
    let found = rebound(&scene, height);
    assert!((found - left).abs() < 2e-3, "{found} {left}");
    scene.effects.adhesion = Adhesion::default();
    scene.effects.capillary = Capillary { bond: 3.0, ..Capillary::default() };
    let work = 3.0 * GRAVITY * RADIUS * scene.effects.capillary.work(0.0, 2.0);
    let left = (0.64 * speed * speed - 2.0 * work).sqrt() / speed;
    let found = rebound(&scene, height);
    assert!((found - left).abs() < 6e-3, "{found} {left}");
}

#[test]
fn a_film_carries_no_weight_so_a_grain_slides_where_it_would_without() {
    for (slope, slides) in [(0.47, false), (0.53, true)] {
        let mut scene = one_grain(RADIUS, material(0.5, 10.0, 0.5));
        scene.effects.lubrication = Lubrication { viscosity: 0.2, ..Lubrication::default() };
        scene.effects.tilt.y = f64::atan(slope);
        let mut simulation = start(&scene);
        simulation.advance(0.2);
        let at = simulation.positions()[0];
        let slid = at.x.hypot(at.y);
        assert_eq!(slid > 1e-3, slides, "{slope}: {slid}");
        assert!(slides || slid < 1e-5, "{slope}: {slid}");
    }
}

#[test]
fn the_work_of_a_wall_that_a_grain_hangs_on_is_not_created() {
    let mut scene = hanging();
    scene.effects.capillary = Capillary { bond: 3.0, ..Capillary::default() };
    scene.walls[0].motion =
        Motion::Shake { amplitude: [0.0, 0.0, 1e-3], frequency: 5.0, begin: 0.05, end: Some(0.45) };
    let mut simulation = start(&scene);
    simulation.advance(0.4);
    let place = 0.1 + 1e-3 * (2.0 * PI * 5.0 * 0.35).sin();
    let hangs = simulation.positions()[0].z;
    assert!((hangs - place).abs() < 5e-5, "{hangs} {place}");
    let created = simulation.health().energy_created;
    // What the bridge holds counts as nothing; the wall's work alone had been 5.
    assert!(created < 0.03, "{created}");
}

/// Two touching grains without weight that are sent apart at `speed` `[m/s]` each: how far apart they are in the end.
fn parted(capillary: Capillary, speed: f64) -> f64 {
    let mut scene = one_grain(0.1, material(0.5, 0.1, 0.5));
    scene.grains.count = 2;
    scene.start = Start::Positions { positions: vec![[0.0, 0.0, 0.1], [2.0 * RADIUS, 0.0, 0.1]] };
    scene.effects.capillary = capillary;
    // The weight that the bond is relative to stands across the pair; both fall alike.
    let mut simulation = start(&scene);
    simulation.advance(2.0 * DT);
    simulation.set_motion(0, Vector3::new(-speed, 0.0, 0.0), Vector3::zeros()).unwrap();
    simulation.set_motion(1, Vector3::new(speed, 0.0, 0.0), Vector3::zeros()).unwrap();
    simulation.advance(0.1);
    let at = simulation.positions();
    at[1].x - at[0].x - 2.0 * RADIUS
}

#[test]
fn two_grains_part_when_their_energy_is_the_bridges() {
    let wet = Capillary { bond: 2.0, volume: 1e-2, ..Capillary::default() };
    // Integral of Willett's force up to rupture, over the mass: 2 bond's of kinetic energy v^2 / 2 pay for it.
    let rupture = wet.volume.cbrt() * RADIUS;
    let steps = 20_000;
    let energy: f64 = (0..steps)
        .map(|k| {
            let s = (f64::from(k) + 0.5) / f64::from(steps) * rupture;
            let scaled = s / RADIUS * (1.0 / wet.volume).sqrt();
            wet.bond * GRAVITY / (1.0 + 1.05 * scaled + 2.5 * scaled * scaled)
        })
        .sum::<f64>()
        * rupture
        / f64::from(steps);
    let escape = energy.sqrt();
    assert!(parted(wet, 1.03 * escape) > rupture, "{}", parted(wet, 1.03 * escape));
    assert!(parted(wet, 0.97 * escape) < 1e-4, "{}", parted(wet, 0.97 * escape));
}

#[test]
fn a_bridge_does_not_pull_before_grains_have_touched() {
    let mut scene = one_grain(0.1, material(0.5, 0.1, 0.5));
    scene.grains.count = 2;
    let gap = 0.02 * RADIUS;
    scene.start =
        Start::Positions { positions: vec![[0.0, 0.0, 0.1], [2.0 * RADIUS + gap, 0.0, 0.1]] };
    scene.effects.capillary = Capillary { bond: 5.0, volume: 1e-2, ..Capillary::default() };
    let at = after(&scene, 0.05).positions();
    assert_eq!(at[1].x - at[0].x, 2.0 * RADIUS + gap);
}

/// A frictionless wet grain at `place`, sent along with `velocity`, beside a wall; how it is after `seconds`.
fn wet_beside(shape: Shape, place: [f64; 3], velocity: [f64; 3], seconds: f64) -> Vector3<f64> {
    let mut scene = one_grain(0.1, material(0.0, 0.0, 0.5));
    scene.start = Start::Positions { positions: vec![place] };
    scene.end.kinetic_energy = f64::MIN_POSITIVE;
    scene.effects.capillary = Capillary { tension: 0.07, volume: 0.1, ..Capillary::default() };
    if velocity[2] < 0.0 {
        scene.gravity = [0.0; 3];
    }
    scene.walls.push(Wall::fixed(shape, WallMaterial::default()));
    let mut simulation = start(&scene);
    simulation.set_motion(0, velocity.into(), Vector3::zeros()).unwrap();
    simulation.advance(seconds);
    simulation.positions()[0]
}

#[test]
fn a_bridge_goes_on_from_one_triangle_of_a_wall_to_the_next() {
    let (top, touching) = (0.1, 0.1 + RADIUS);
    // It rebounds with less than the work of its bridge, and is over the next triangle before it comes back.
    let plane = Shape::Plane { point: [0.0, 0.0, top], normal: [0.0, 0.0, 1.0] };
    let cube = Shape::Box { min: [-0.05, -0.05, 0.0], max: [0.05, 0.05, top], open: Vec::new() };
    for shape in [plane, cube] {
        let place = [-4e-4, 0.0, touching + 2e-5];
        let found = wet_beside(shape, place, [0.3, 0.0, -0.2], 0.05);
        assert!((found.z - touching).abs() < 0.02 * RADIUS, "{}", (found.z - touching) / RADIUS);
        assert!(found.x > 0.01);
    }
}

#[test]
fn a_bridge_to_the_floor_is_none_to_the_side_beside_it() {
    // Along a side that it does not touch, from one triangle of the floor to the next.
    let (min, max) = ([-0.05, -0.1, 0.01], [0.05, 0.1, 0.05]);
    let x = max[0] - 1.05 * RADIUS;
    let place = [x, 0.094, min[2] + RADIUS];
    let found = wet_beside(Shape::Box { min, max, open: Vec::new() }, place, [0.0, 0.1, 0.0], 0.03);
    assert!((found.x - x).abs() < 1e-9 && found.y > 0.0965, "{found}");
}

/// Two grains that fall side by side, `gap` apart and sent along x at `speeds`, with a film of 0.05 Pa s between them:
/// their gap and their speeds along x.
fn in_a_film(gap: f64, speeds: [f64; 2], seconds: f64) -> (f64, [f64; 2]) {
    let mut scene = one_grain(0.1, material(0.5, 0.1, 0.5));
    scene.grains = Grains::balls(2, 2.0 * RADIUS, 2500.0);
    scene.start =
        Start::Positions { positions: vec![[0.0, 0.0, 0.1], [2.0 * RADIUS + gap, 0.0, 0.1]] };
    scene.effects.lubrication = Lubrication { viscosity: 0.05, ..Lubrication::default() };
    let mut simulation = start(&scene);
    for (grain, &speed) in speeds.iter().enumerate() {
        simulation.set_motion(grain, Vector3::new(speed, 0.0, 0.0), Vector3::zeros()).unwrap();
    }
    simulation.advance(seconds);
    let (at, v) = (simulation.positions(), simulation.velocities());
    (at[1].x - at[0].x - 2.0 * RADIUS, [v[0].x, v[1].x])
}

#[test]
fn a_film_takes_speed_from_what_comes_together_and_none_from_what_moves_as_one() {
    let mass = 2500.0 * 4.0 / 3.0 * PI * RADIUS.powi(3);
    let gap = 0.4 * RADIUS;
    let (left, v) = in_a_film(gap, [0.1, -0.1], 2e-3);
    // dv/dt = -2 (3/2) pi mu a^2 v / (m h) and dh/dt = -v.
    let lost = 3.0 * PI * 0.05 * RADIUS.powi(2) / mass * (gap / left).ln();
    assert!(left < 0.95 * gap && left > 0.02 * RADIUS);
    assert!((0.2 - (v[0] - v[1]) - lost).abs() < 0.03 * lost, "{} {lost}", 0.2 - (v[0] - v[1]));
    assert!((v[0] + v[1]).abs() < 1e-12);
    let (still, v) = in_a_film(gap, [0.1, 0.1], 2e-3);
    assert!((still - gap).abs() < 1e-12 && (v[0] - 0.1).abs() < 1e-15 && v[0] == v[1]);
    // However thick the film and close the grains, it only takes speed; what is left may bounce.
    let (_, v) = in_a_film(1e-3 * RADIUS, [0.1, -0.1], 5e-3);
    assert!(v[0].abs() < 0.05 && (v[0] + v[1]).abs() < 1e-12, "{v:?}");
}

/// Two weightless grains side by side along x, `gap` apart, with a film of 0.05 Pa s that resists shear: velocities and
/// spins after `seconds` of those given.
fn sheared(motion: [[Vector3<f64>; 2]; 2], gap: f64, seconds: f64) -> [[Vector3<f64>; 2]; 2] {
    let mut scene = one_grain(0.1, material(0.5, 0.1, 0.5));
    scene.gravity = [0.0; 3];
    scene.grains = Grains::balls(2, 2.0 * RADIUS, 2500.0);
    scene.start =
        Start::Positions { positions: vec![[0.0, 0.0, 0.1], [2.0 * RADIUS + gap, 0.0, 0.1]] };
    scene.effects.lubrication =
        Lubrication { viscosity: 0.05, shear: 1.0, ..Lubrication::default() };
    let mut simulation = start(&scene);
    for (grain, [velocity, spin]) in motion.iter().enumerate() {
        simulation.set_motion(grain, *velocity, *spin).unwrap();
    }
    simulation.advance(seconds);
    let (v, w) = (simulation.velocities(), simulation.angular_velocities());
    [[v[0], w[0]], [v[1], w[1]]]
}

#[test]
fn a_film_takes_speed_from_surfaces_that_slide_and_none_from_what_turns_as_gears() {
    let mass = 2500.0 * 4.0 / 3.0 * PI * RADIUS.powi(3);
    let (gap, seconds, speed) = (0.05 * RADIUS, 40.0 * DT, 0.01);
    let (up, still) = (speed * Vector3::z(), Vector3::zeros());
    let found = sheared([[up, still], [-up, still]], gap, seconds);
    // du/dt = -2 (7/2) pi mu a ln(a / h) u / m; the gap hardly opens on so short a way.
    let rate = 7.0 * PI * 0.05 * RADIUS * (RADIUS / gap).ln() / mass;
    let slides = |[[v, w], [v_j, w_j]]: [[Vector3<f64>; 2]; 2]| {
        v.z - v_j.z - RADIUS * ((w + w_j).cross(&-Vector3::x())).z
    };
    let left = slides(found) / (2.0 * speed);
    assert!(left < 0.9, "{left}");
    assert!((left.ln() / (-rate * seconds) - 1.0).abs() < 0.03, "{left} {}", rate * seconds);
    // Nothing of the momentum, and of the angular momentum about the middle nothing either.
    let [[v, w], [v_j, w_j]] = found;
    assert!((v + v_j).norm() < 1e-15);
    let arm = RADIUS + 0.5 * gap;
    let before = -2.0 * arm * -speed;
    let after = -arm * -(v.z - v_j.z) + 0.4 * RADIUS * RADIUS * (w + w_j).y;
    assert!((after / before - 1.0).abs() < 0.03, "{after} {before}");
    // Gears: spins that are opposite have equal surfaces.
    let turn = Vector3::new(0.0, 5.0, 0.0);
    assert_eq!(
        sheared([[still, turn], [still, -turn]], gap, seconds),
        [[still, turn], [still, -turn]]
    );
    // However thick the film, it turns nothing round; so slowly that the pair itself hardly turns.
    let slow = 1e-3 * up;
    let thick = slides(sheared([[slow, still], [-slow, still]], 1e-3 * RADIUS, 0.1)) / slow.z;
    assert!(thick.abs() < 1e-2, "{thick}");
}

#[test]
fn what_a_pull_that_reaches_radii_gives_is_not_created() {
    let mut scene = one_grain(0.1, material(0.5, 0.1, 0.7));
    scene.grains.count = 2;
    scene.start = Start::Positions { positions: vec![[0.0, 0.0, 0.1], [2.9 * RADIUS, 0.0, 0.1]] };
    scene.effects.adhesion = Adhesion { bond: 20.0, range: 1.0, ..Adhesion::default() };
    let mut simulation = start(&scene);
    let mut fastest = 0.0_f64;
    for _ in 0..80 {
        simulation.advance(DT);
        fastest = fastest.max(simulation.velocities()[0].x);
    }
    // All the work of the way to the contact, half of it in each grain.
    let work = 20.0 * GRAVITY * 0.9 * RADIUS;
    // A substep is a sixth of the fall's time.
    assert!((fastest / work.sqrt() - 1.0).abs() < 0.2, "{fastest} {}", work.sqrt());
    // Of 0.1 m of height the pull has 0.18 in store.
    assert!(simulation.health().energy_created < 1e-3, "{:?}", simulation.health());
    let grains = Grains { count: 200, ..Scene::drop(0.02).grains };
    let crowd = Scene { effects: scene.effects.clone(), grains, ..Scene::drop(0.02) };
    let pour = start(&crowd).run();
    assert!(pour.health.energy_created < 1e-2, "{:?}", pour.health);
}
