use super::*;
use crate::contact_set::ContactSet;
use crate::lanes::Row;
use crate::wall::Walls;

const GRAVITY: f64 = 9.81;
const RADIUS: f64 = 4e-3;
const DT: f64 = 5e-4;

/// A liquid 50 mm high and a single grain.
fn scene() -> Scene {
    let mut scene = Scene::drop(0.02);
    scene.grains.count = 1;
    scene.grains.diameter = 2.0 * RADIUS;
    scene.effects.liquid = granulcal_scene::Liquid {
        height: 0.05,
        radius: 0.1,
        viscosity: 0.1,
        ..granulcal_scene::Liquid::default()
    };
    scene
}

fn grains(places: &[[f64; 3]]) -> Particles {
    let spheres = places.iter().map(|&[x, y, z]| Row([x, y, z, RADIUS])).collect();
    Particles::new(spheres, vec![1.0; places.len()], None)
}

/// Lets a liquid act on grains for a substep.
fn act(liquid: &mut Liquid, particles: &mut Particles, scene: &Scene) {
    let (none, walls) = (ContactSet::default(), Walls::of(scene));
    let context = EffectContext {
        pairs: &none,
        at_walls: &none,
        walls: &walls,
        gravity: Vector3::new(0.0, 0.0, -GRAVITY),
        radius: RADIUS,
        dt: DT,
    };
    liquid.act(particles, &context, 0.0);
}

#[test]
fn a_grain_under_water_has_buoyancy_and_one_above_has_none() {
    let scene = scene();
    let mut liquid = Liquid::of(&scene).unwrap();
    let mut particles = grains(&[[0.03, 0.0, 0.02], [0.05, 0.0, 0.06], [0.04, 0.0, 0.05]]);
    act(&mut liquid, &mut particles, &scene);
    let up = |grain: usize| particles.velocity(grain).z / (DT * GRAVITY);
    let ratio = 1000.0 / scene.grains.density;
    // Drag takes a share of the first step, but of a grain that starts from rest only the share k dt of it.
    assert!((up(0) / ratio - 1.0).abs() < 0.1, "{}", up(0));
    assert_eq!(up(1), 0.0);
    assert!((up(2) / ratio - 0.5).abs() < 0.1, "{}", up(2));
}

#[test]
fn a_tube_that_is_lifted_opens_a_gap() {
    let mut scene = scene();
    assert!(Tube::of(&scene).is_none());
    scene.walls.push(granulcal_scene::Wall {
        shape: Shape::Cylinder {
            from: [0.0, 0.0, 0.0],
            to: [0.0, 0.0, 0.1],
            radius: 0.102,
            closed: granulcal_scene::Ends::default(),
        },
        material: granulcal_scene::WallMaterial::default(),
        motion: Motion::Lift { velocity: [0.0, 0.0, 0.5], begin: 0.1, end: 0.3 },
    });
    let tube = Tube::of(&scene).expect("a tube");
    assert_eq!(tube.gap(0.05), 0.0);
    assert!((tube.gap(1.0) - 0.1).abs() < 1e-12);
    assert!((tube.gap(0.2) - 0.05).abs() < 1e-12);
}
