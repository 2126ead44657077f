//! A liquid with a flow of its own among grains: docs/theory/effects.md, "Liquid".

use granulcal::dem::{
    EndRule, Ends, GRAVITY, Grains, Liquid, Motion, Scene, Shape, Simulation, Start, Wall,
    WallMaterial,
};

use crate::scenes::{RADIUS, bits, block, material, start};

const TUBE: f64 = 0.02;
const RELEASE: f64 = 0.2;

/// A column of grains in a tube that is lifted off at `RELEASE`, with liquid up to 24 mm.
fn column(lift: f64, liquid: Liquid) -> Scene {
    let mut scene = block([1, 1, 1], 1.0, 0.1, material(0.3, 0.05, 0.6));
    scene.grains = Grains::balls(400, 2.0 * RADIUS, 2500.0);
    scene.start = Start::Cylinder {
        from: [0.0; 3],
        to: [0.0, 0.0, 0.1],
        radius: TUBE,
        spacing: 2.3 * RADIUS,
        jitter: 1e-4,
    };
    scene.walls.push(Wall {
        shape: Shape::Cylinder {
            from: [0.0; 3],
            to: [0.0, 0.0, 0.2],
            radius: TUBE,
            closed: Ends::default(),
        },
        material: WallMaterial::default(),
        motion: Motion::Lift { velocity: [0.0, 0.0, lift], begin: RELEASE, end: 1.0 },
    });
    scene.effects.liquid = Liquid { height: 0.024, radius: TUBE, begin: 0.5 * RELEASE, ..liquid };
    scene
}

fn water() -> Liquid {
    Liquid {
        density: 1000.0,
        viscosity: 1e-3,
        tension: 0.07,
        contact_angle: 1.0,
        ..Liquid::default()
    }
}

fn at(scene: &Scene, seconds: f64) -> Simulation {
    let mut simulation = start(scene);
    simulation.advance(seconds);
    simulation
}

/// Radius within which half of the grains are, and that up to which the liquid stands half a millimetre high `[m]`.
fn fronts(simulation: &Simulation) -> [f64; 2] {
    let mut radii: Vec<_> = simulation.positions().iter().map(|x| x.x.hypot(x.y)).collect();
    radii.sort_by(f64::total_cmp);
    let (ring, heights) = simulation.liquid_profile().expect("a liquid");
    let wet = heights.iter().rposition(|&height| height > 5e-4).expect("somewhere");
    [radii[radii.len() / 2], ring * (wet + 1) as f64]
}

#[test]
fn in_its_tube_a_liquid_stays_and_carries_what_archimedes_says() {
    let scene = column(0.0, Liquid { height: 0.024, ..water() });
    let mut simulation = at(&scene, 0.6);
    let (ring, heights) = simulation.liquid_profile().unwrap();
    assert!((ring * heights.iter().filter(|&&h| h > 0.0).count() as f64 - TUBE).abs() < 1e-9);
    let mean = heights[1..9].iter().sum::<f64>() / 8.0;
    assert!(heights[1..9].iter().all(|h| (h / mean - 1.0).abs() < 0.02), "{heights:?}");
    // Weight less that of the liquid that the grains below its surface displace, on ground and tube.
    let wet: f64 = simulation
        .positions()
        .iter()
        .map(|x| {
            let share = ((mean - x.z + RADIUS) / (2.0 * RADIUS)).clamp(0.0, 1.0);
            share * share * (3.0 - 2.0 * share)
        })
        .sum();
    // Over a grain's mass.
    let expected = GRAVITY * (400.0 - wet * 1000.0 / 2500.0);
    let mut force = 0.0;
    for _ in 0..40 {
        simulation.advance(5e-4);
        let loads = simulation.wall_loads().unwrap();
        force += loads.iter().map(|load| -load.force.z).sum::<f64>() / 40.0;
    }
    assert!((force / expected - 1.0).abs() < 0.02, "{force} {expected}");
}

#[test]
fn the_liquid_runs_ahead_of_the_grains_the_farther_the_more_permeable_they_are() {
    let ahead = |permeability: f64| {
        let scene = column(1.0, Liquid { permeability, viscosity: 5e-3, ..water() });
        let [grains, liquid] = fronts(&at(&scene, RELEASE + 0.08));
        assert!(liquid > grains, "{permeability}: {liquid} {grains}");
        liquid - grains
    };
    let found = [0.1, 1.0, 10.0].map(ahead);
    assert!(found[0] < found[1] && found[1] < found[2], "{found:?}");
}

#[test]
fn a_restart_and_threads_change_no_bit_of_it() {
    let scene = column(1.0, water());
    let first = at(&scene, RELEASE + 0.05);
    let mut second = start(&scene).resume(&first.checkpoint()).unwrap();
    let mut threads = start(&scene).with_threads(2).unwrap();
    second.advance(0.05);
    threads.advance(RELEASE + 0.1);
    let whole = at(&scene, RELEASE + 0.1);
    assert_eq!(bits(&whole), bits(&second));
    assert_eq!(bits(&whole), bits(&threads));
    assert_eq!(whole.liquid_profile(), second.liquid_profile());
    assert_eq!(whole.state_hash(), threads.state_hash());
}

#[test]
fn what_it_cannot_be_with_is_named() {
    let mut scene = column(1.0, water());
    scene.effects.tilt.x = 0.1;
    let error = scene.check().unwrap_err().to_string();
    assert!(error.contains("effects.liquid") && error.contains("effects.tilt"), "{error}");
    scene.effects.tilt.x = 0.0;
    scene.effects.liquid.permeability = 0.0;
    let error = scene.check().unwrap_err().to_string();
    assert!(error.starts_with("effects.liquid.permeability must be"), "{error}");
}

#[test]
fn a_pour_waits_for_its_liquid_and_goes_on_while_that_flows() {
    let mut scene = column(0.5, water());
    scene.walls.clear();
    // At rest long before; the column spreads out and takes grains with it.
    scene.start = Start::Ball { height: 1e-3, solid_fraction: 0.5, jitter: 1e-5, turned: false };
    scene.material.rolling_friction = 0.5;
    scene.effects.liquid.begin = 1.5;
    scene.end = EndRule { horizon: 3.0, ..Scene::drop(0.1).end };
    let dry = {
        let mut dry = scene.clone();
        dry.effects.liquid.height = 0.0;
        dry
    };
    let ended = start(&dry).run().simulated_s;
    assert!(ended < 1.2, "{ended}");
    let wet = start(&scene).run().simulated_s;
    assert!(wet > 1.6, "{wet}");
}
