//! Every effect by itself, on one or two grains, against its closed form; docs/theory/effects.md.

use std::f64::consts::PI;

use granulcal::dem::{
    Capillary, Fluid, FunnelPose, GRAVITY, Grains, GroundUnlike, Polydispersity, RestitutionSpeed,
    Scene, Start, Status, Tilt, Vibration,
};
use nalgebra::Vector3;

use crate::scenes::{RADIUS, bits, drop_of, material, one_grain, start};

/// Substep of the preset `[s]`.
pub const DT: f64 = 1.0 / 2000.0;

#[test]
fn an_effect_that_is_off_changes_no_bit() {
    let plain = drop_of(120, 0.05, material(0.5, 0.1, 0.6));
    let mut said = plain.clone();
    said.effects.capillary.volume = 1e-2;
    said.effects.adhesion.range = 0.1;
    said.effects.fluid.added_mass = 0.0;
    said.effects.vibration.frequency = 10.0;
    said.effects.restitution_speed.reference = 3.0;
    said.effects.layer.stiffness = 5.0;
    said.effects.fluid.entrained = 1.0;
    assert!(!said.effects.is_plain());
    assert_eq!(bits(&after(&plain, 0.3)), bits(&after(&said, 0.3)));
}

pub fn after(scene: &Scene, seconds: f64) -> granulcal::dem::Simulation {
    let mut simulation = start(scene);
    simulation.advance(seconds);
    simulation
}

#[test]
fn terminal_speed_is_schillers_and_naumanns() {
    // Glycerol, water, and ten times as thick: Re 0.03, 1700, 120.
    for (density, viscosity) in [(1260.0, 1.4), (1000.0, 1e-3), (1000.0, 1e-2)] {
        let mut scene = one_grain(5.0, material(0.5, 0.1, 0.5));
        scene.grains = Grains::balls(1, 2.0 * RADIUS, 2500.0);
        scene.effects.fluid = Fluid { density, viscosity, ..Fluid::default() };
        let speed = -after(&scene, 2.0).velocities()[0].z;
        let reynolds = density * speed * 2.0 * RADIUS / viscosity;
        let coefficient = if reynolds < 1000.0 {
            24.0 / reynolds * (1.0 + 0.15 * reynolds.powf(0.687))
        } else {
            0.44
        };
        let weight = (2500.0 - density) * GRAVITY * 4.0 / 3.0 * PI * RADIUS.powi(3);
        let drag = coefficient / 8.0 * PI * density * (2.0 * RADIUS * speed).powi(2);
        assert!((drag / weight - 1.0).abs() < 1e-3, "Re {reynolds}: {}", drag / weight);
    }
}

#[test]
fn a_grain_in_a_perfect_fluid_falls_with_buoyancy_and_added_mass() {
    let mut scene = one_grain(1.0, material(0.5, 0.1, 0.5));
    scene.grains.density = 2000.0;
    scene.effects.fluid = Fluid { density: 1000.0, viscosity: 0.0, ..Fluid::default() };
    let simulation = after(&scene, 20.0 * DT);
    let begun = -simulation.velocities()[0].z / 0.01;
    // (rho - rho_f) / (rho + rho_f / 2) g, before drag has grown.
    assert!((begun / (0.4 * GRAVITY) - 1.0).abs() < 5e-3, "{begun}");
}

#[test]
fn restitution_falls_with_the_speed_of_the_impact() {
    let rebound = |drop: f64, effect: RestitutionSpeed| {
        let mut scene = one_grain(RADIUS + drop, material(0.5, 0.1, 0.6));
        scene.effects.restitution_speed = effect;
        let mut simulation = start(&scene);
        simulation.advance((2.0 * drop / GRAVITY).sqrt() + 2.0 * DT);
        let at = simulation.positions()[0].z;
        simulation.advance(DT);
        let upwards = (simulation.positions()[0].z - at) / DT + 0.5 * GRAVITY * DT;
        let height = at - RADIUS + upwards * upwards / (2.0 * GRAVITY);
        (height / drop).sqrt()
    };
    let plastic = RestitutionSpeed { exponent: 0.25, reference: 1.0 };
    for drop in [0.02, 0.1, 0.4] {
        let speed = (2.0 * GRAVITY * drop).sqrt();
        let expected = 0.6 * speed.powf(-0.25);
        let found = rebound(drop, plastic);
        assert!((found - expected).abs() < 2e-3, "{drop}: {found} {expected}");
    }
}

#[test]
fn a_soft_ground_takes_what_it_says() {
    let mut scene = one_grain(RADIUS + 0.05, material(0.5, 0.1, 0.8));
    scene.effects.ground = GroundUnlike { restitution: 0.5, ..GroundUnlike::default() };
    let mut highest: f64 = 0.0;
    let mut simulation = start(&scene);
    simulation.advance((2.0 * 0.05 / GRAVITY).sqrt() + 4.0 * DT);
    for _ in 0..400 {
        highest = highest.max(simulation.positions()[0].z - RADIUS);
        simulation.advance(DT);
    }
    assert!((highest / (0.16 * 0.05) - 1.0).abs() < 0.02, "{highest}");
}

#[test]
fn a_grain_slides_down_a_tilted_table() {
    let tilt = 0.05;
    let mut scene = one_grain(RADIUS, material(0.0, 0.0, 0.0));
    scene.effects.tilt = Tilt { x: 0.0, y: tilt };
    let speed = after(&scene, 0.2).velocities()[0].x;
    assert!((speed / (0.2 * GRAVITY * tilt.sin()) - 1.0).abs() < 1e-6, "{speed}");
}

#[test]
fn a_shaken_grain_lifts_off_above_one_g() {
    for (acceleration, lifts) in [(0.9, false), (1.5, true)] {
        let mut scene = one_grain(RADIUS, material(0.5, 0.1, 0.5));
        scene.effects.vibration =
            Vibration { acceleration, frequency: 20.0, begin: 0.05, duration: 0.2 };
        let mut simulation = start(&scene);
        let mut highest: f64 = 0.0;
        for _ in 0..700 {
            simulation.advance(DT);
            highest = highest.max(simulation.positions()[0].z - RADIUS);
        }
        assert_eq!(highest > 1e-4, lifts, "{acceleration}: {highest}");
    }
}

#[test]
fn grains_of_all_sizes_come_to_rest_and_hold_together_when_wet() {
    let mut scene = drop_of(150, 0.03, material(0.5, 0.1, 0.3));
    scene.start = Start::Grid { counts: [5, 5, 6], spacing: 9e-3, jitter: 1e-4, base: 0.01 };
    scene.effects.polydispersity = Polydispersity { cv: 0.25, diameters: Vec::new() };
    let dry = granulcal::dem::Simulation::new(&scene, 3).unwrap().run();
    assert_eq!(dry.status, Status::AtRest, "{:?}", dry.health);
    scene.effects.capillary = Capillary { bond: 3.0, ..Capillary::default() };
    let wet = granulcal::dem::Simulation::new(&scene, 3).unwrap().run();
    assert_eq!(wet.status, Status::AtRest, "{:?}", wet.health);
    let spread = |pour: &granulcal::dem::Pour| {
        pour.positions.iter().map(|p| p.x.hypot(p.y)).sum::<f64>() / pour.positions.len() as f64
    };
    assert!(spread(&wet) < 0.9 * spread(&dry), "{} {}", spread(&wet), spread(&dry));
    // And a checkpoint keeps the bridges.
    let mut first = start(&scene);
    first.advance(0.2);
    let second = start(&scene).resume(&first.checkpoint()).unwrap();
    assert!(first.run() == second.run());
}

#[test]
fn fluid_inside_a_cluster_goes_with_it() {
    // A grain and its twelve neighbours of a face-centred cubic lattice, too far apart to touch, in something very
    // thick.
    let spacing = 2.1 * RADIUS / 2f64.sqrt();
    let mut positions = vec![[0.0, 0.0, 1.0]];
    for [a, b] in [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]] {
        let (a, b) = (a * spacing, b * spacing);
        positions.extend([[a, b, 1.0], [a, 0.0, 1.0 + b], [0.0, a, 1.0 + b]]);
    }
    let mut scene = one_grain(1.0, material(0.5, 0.1, 0.5));
    scene.grains = Grains::balls(13, 2.0 * RADIUS, 2500.0);
    scene.start = Start::Positions { positions };
    let viscosity = 14.0;
    scene.effects.fluid = Fluid { density: 1260.0, viscosity, entrained: 1.0, ..Fluid::default() };
    let speeds = after(&scene, 0.01).velocities();
    let lone = (2500.0 - 1260.0) * GRAVITY * 2.0 / 9.0 * RADIUS * RADIUS / viscosity;
    // The middle one goes lone faster than its neighbours; one of those, with five neighbours of the eight that a
    // packing has, lone faster than (4 v + v_middle) / 8: v = 3 lone, v_middle = 4 lone. The mean over all outer
    // grains:
    let outer = -speeds[1..].iter().map(|v| v.z).sum::<f64>() / 12.0;
    assert!((-speeds[0].z / (4.0 * lone) - 1.0).abs() < 0.01, "{} {lone}", speeds[0].z);
    assert!((outer / (3.0 * lone) - 1.0).abs() < 0.01, "{outer} {lone}");
}

#[test]
fn rolling_that_is_resisted_by_its_speed_dies_away_exponentially() {
    let (speed, mu_r, v_0) = (0.1, 0.2, 0.5);
    let mut scene = one_grain(RADIUS, material(1.0, mu_r, 0.0));
    scene.effects.rolling_form.speed = v_0;
    let rolled = |scene: &Scene, seconds| {
        let mut simulation = start(scene);
        let (v, w) = (Vector3::new(speed, 0.0, 0.0), Vector3::new(0.0, speed / RADIUS, 0.0));
        simulation.set_motion(0, v, w).unwrap();
        simulation.advance(seconds);
        simulation.velocities()[0].x / speed
    };
    // 7/5 m dv/dt = -mu_r m g v / v_0.
    let expected = (-5.0 / 7.0 * mu_r * GRAVITY / v_0 * 0.2).exp();
    assert!((rolled(&scene, 0.2) / expected - 1.0).abs() < 0.01, "{}", rolled(&scene, 0.2));
    // A speed of nearly nothing is Coulomb's form: 7/5 m dv/dt = -mu_r m g.
    scene.effects.rolling_form.speed = 1e-9;
    let expected = 1.0 - 5.0 / 7.0 * mu_r * GRAVITY * 0.04 / speed;
    assert!((rolled(&scene, 0.04) / expected - 1.0).abs() < 0.01, "{}", rolled(&scene, 0.04));
}

#[test]
fn a_funnel_that_hangs_aside_pours_aside() {
    let mut scene = Scene::funnel(0.05);
    scene.grains.count = 120;
    let middle = |scene: &Scene| {
        let pour = start(scene).run();
        // A grain may still roll where nobody looks.
        let has_ended = matches!(pour.status, Status::AtRest | Status::OutOfView);
        assert!(has_ended && pour.grains_in_funnel == 0, "{:?}", pour.status);
        pour.positions.iter().sum::<Vector3<f64>>() / 120.0
    };
    // The mean of 120 grains scatters by 5 mm from pour to pour.
    let mean = middle(&scene);
    scene.effects.funnel.x = 0.05;
    assert!((middle(&scene).x - mean.x - 0.05).abs() < 0.02, "{}", middle(&scene).x);
    // One whose rim leans to positive x pours to negative x.
    scene.effects.funnel = FunnelPose { lean_y: 0.3, ..FunnelPose::default() };
    assert!(middle(&scene).x < mean.x - 0.02, "{}", middle(&scene).x);
}

#[test]
fn a_rough_funnel_pours_more_slowly() {
    let half_out = |ratio: f64| {
        let mut scene = Scene::funnel(0.05);
        scene.grains.count = 400;
        scene.material.sliding_friction = 0.2;
        scene.effects.funnel.sliding_friction = ratio;
        let mut simulation = start(&scene);
        while simulation.positions().iter().filter(|place| place.z < 0.05).count() < 200 {
            assert!(simulation.time() < 2.0, "it does not flow");
            simulation.advance(0.001);
        }
        simulation.time()
    };
    let (smooth, plain, rough) = (half_out(0.1), half_out(1.0), half_out(4.0));
    assert!(smooth < plain && plain < rough, "{smooth} {plain} {rough}");
}

#[test]
fn an_oval_outlet_pours_an_oval() {
    let spreads = |aspect: f64| {
        let mut scene = Scene::funnel(0.03);
        scene.grains.count = 400;
        scene.effects.outlet.aspect = aspect;
        let mut simulation = start(&scene);
        // Half axes of what is below the outlet, while it flows.
        let mut square = [0.0; 2];
        let mut seen = 0.0;
        while simulation.time() < 0.5 {
            simulation.advance(0.005);
            for place in simulation.positions() {
                if (0.01..0.03).contains(&place.z) && place.xy().norm() < 0.04 {
                    square[0] += place.x.powi(2);
                    square[1] += place.y.powi(2);
                    seen += 1.0;
                }
            }
        }
        assert!(seen > 1000.0, "{seen}");
        (square[0] / square[1]).sqrt()
    };
    let (round, facets, oval) = (spreads(1.0), spreads(1.0 + 1e-9), spreads(2.0));
    assert!((round - 1.0).abs() < 0.1 && (facets - 1.0).abs() < 0.1, "{round} {facets}");
    assert!(oval > 1.3, "{oval}");
}

#[test]
fn unknown_effects_and_impossible_numbers_are_named() {
    let scene = Scene::funnel(0.1);
    let error = scene.with("effects.magnetism.strength", 1.0).unwrap_err().to_string();
    assert!(error.contains("magnetism") && error.contains("capillary"), "{error}");
    let error = scene.with("effects.capillary.bond", -1.0).unwrap_err().to_string();
    assert_eq!(error, "effects.capillary.bond must be zero or positive, and finite, got -1");
    let wet = scene.with("effects.capillary.bond", 1.5).unwrap();
    assert_eq!(wet.effects.capillary.bond, 1.5);
    assert_eq!(Scene::from_toml(&wet.to_toml().unwrap()).unwrap(), wet);
}
