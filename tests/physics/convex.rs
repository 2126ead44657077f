//! Grains that are convex bodies, through the same door as all others: scene, pour, checkpoint. What one body does has
//! closed forms, in `crates/dem/src/bodies/exams.rs`.

use granulcal::dem::{
    DemError, GrainShape, Motion, Pour, Scene, Shape, Simulation, Start, Status, Wall, WallMaterial,
};
use nalgebra::Vector3;

fn scene(shape: GrainShape, count: usize) -> Scene {
    let mut scene = Scene::drop(0.01);
    scene.grains.count = count;
    scene.grains.shape = Some(shape);
    if let Start::Ball { solid_fraction, .. } = &mut scene.start {
        *solid_fraction = 0.3;
    }
    scene
}

fn cube() -> GrainShape {
    GrainShape::Box { aspect: [1.0; 3] }
}

fn lowest(pour: &Pour) -> f64 {
    let convex = pour.convex.as_ref().expect("convex grains");
    let grains = pour.positions.iter().zip(&convex.orientations);
    let corners = |(at, turned): (&Vector3<f64>, &nalgebra::UnitQuaternion<f64>)| {
        convex.corners.iter().map(|corner| (at + turned * corner).z).fold(f64::MAX, f64::min)
    };
    grains.map(corners).fold(f64::MAX, f64::min)
}

#[test]
fn a_heap_of_cubes_comes_to_rest_above_the_ground() {
    let pour = Simulation::new(&scene(cube(), 60), 3).unwrap().run();
    assert_eq!(pour.status, Status::AtRest, "{:?}", pour.health);
    assert_eq!(pour.convex.as_ref().unwrap().orientations.len(), 60);
    assert!(lowest(&pour) > -2e-4, "{}", lowest(&pour));
    assert!(pour.health.energy_created < 1e-3, "{:?}", pour.health);
    // A cube that lies flat has its centre at half of its edge.
    assert!(pour.positions.iter().all(|x| x.z > 1.9e-3));
}

#[test]
fn threads_pieces_and_checkpoints_change_no_bit() {
    let scene = scene(GrainShape::Cylinder { aspect: 1.0 }, 30);
    let whole = Simulation::new(&scene, 5).unwrap().run();
    let shared = Simulation::new(&scene, 5).unwrap().with_threads(2).unwrap().run();
    assert_eq!(whole, shared);
    let mut first = Simulation::new(&scene, 5).unwrap();
    first.advance(0.07);
    let second = Simulation::new(&scene, 5).unwrap().resume(&first.checkpoint()).unwrap();
    assert_eq!(second.state_hash(), first.state_hash());
    assert_eq!(second.run(), whole);
    let other = Simulation::new(&self::scene(cube(), 30), 5).unwrap();
    assert!(matches!(other.resume(&first.checkpoint()), Err(DemError::CheckpointDiffers { .. })));
}

#[test]
fn a_shape_is_read_from_toml_and_its_numbers_have_paths() {
    let text = scene(cube(), 10).to_toml().unwrap();
    assert!(text.contains("kind = \"box\""), "{text}");
    let read = Scene::from_toml(&text).unwrap();
    assert_eq!(read, scene(cube(), 10));
    let changed = read.with("grains.shape.aspect.2", 2.0).unwrap();
    assert_eq!(changed.grains.shape, Some(GrainShape::Box { aspect: [1.0, 1.0, 2.0] }));
    let error = read.with("grains.shape.aspect.2", 30.0).unwrap_err().to_string();
    assert!(error.contains("grains.shape.aspect"), "{error}");
}

#[test]
fn what_convex_grains_cannot_be_with_is_named() {
    let refused = |change: fn(&mut Scene), told: &str| {
        let mut scene = scene(cube(), 10);
        change(&mut scene);
        let error = scene.check().unwrap_err().to_string();
        assert!(error.contains("grains.shape") && error.contains(told), "{error}");
    };
    refused(|s| s.effects.capillary.bond = 1.0, "effects but");
    refused(|s| s.preset = granulcal::dem::Preset::Paper, "preset paper");
    refused(|s| s.outflow = Some(granulcal::dem::Outflow { below: -1.0, until: None }), "outflow");
    let simulation = Simulation::new(&scene(cube(), 10), 1).unwrap();
    let error = simulation.contact_problem().unwrap_err().to_string();
    assert!(error.contains("grains.shape"), "{error}");
}

#[test]
fn a_thin_wall_that_moves_takes_a_body_along() {
    let (speed, end) = (2.0, 0.02);
    for seed in 0..6 {
        let mut scene = scene(cube(), 1);
        scene.gravity = [0.0; 3];
        scene.start = Start::Positions { positions: vec![[0.0, 0.0, 0.3]] };
        (scene.end.horizon, scene.end.kinetic_energy) = (end, 1e-30);
        let (centre, normal) = ([-0.02, 0.0, 0.3], [1.0, 0.0, 0.0]);
        let shape = Shape::Disc { centre, normal, radius: 0.05 };
        let motion = Motion::Lift { velocity: [speed, 0.0, 0.0], begin: 0.0, end };
        scene.walls.push(Wall { motion, ..Wall::fixed(shape, WallMaterial::default()) });
        let pour = Simulation::new(&scene, seed).unwrap().run();
        assert!(pour.health.worst_penetration < 0.1, "{seed}: {:?}", pour.health);
        // The wall comes 20 mm past where the cube was.
        assert!(pour.positions[0].x > 0.02, "{seed}: {}", pour.positions[0].x);
    }
}

#[test]
fn bodies_begin_as_their_start_states_and_what_lay_stays() {
    let count = 12;
    let pour = Simulation::new(&scene(cube(), count), 3).unwrap().run();
    let convex = pour.convex.as_ref().unwrap();
    let positions: Vec<[f64; 3]> = pour.positions.iter().map(|&at| at.into()).collect();
    let orientations: Vec<[f64; 4]> =
        convex.orientations.iter().map(|turn| turn.coords.into()).collect();
    let mut lying = scene(cube(), count);
    lying.start = Start::Poses { positions, orientations };
    let simulation = Simulation::new(&lying, 8).unwrap();
    simulation.check_start().unwrap();
    let begun = simulation.convex().unwrap();
    for (a, b) in begun.orientations.iter().zip(&convex.orientations) {
        assert!(a.angle_to(b) < 1e-12);
    }
    let again = simulation.run();
    assert_eq!(again.status, Status::AtRest);
    for (a, b) in again.positions.iter().zip(&pour.positions) {
        // Radii are 2 mm.
        assert!((a - b).norm() < 1e-4, "{a} {b}");
    }
}
