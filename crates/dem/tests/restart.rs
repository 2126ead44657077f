//! A pour that is stopped and goes on is the pour that was not stopped, to the last bit.

use std::sync::LazyLock;

use granulcal_dem::{
    CheckpointHeader, DemError, Funnel, Material, Preset, Scene, Shape, Simulation, SolverSettings,
    Start, Status, Wall, WallMaterial,
};
use nalgebra::Vector3;
use proptest::prelude::*;

const SEED: u64 = 3;

/// Grains through a funnel onto a tilted wall of another material: pairs, shells and planes.
fn funnel() -> Scene {
    let mut scene = Scene::funnel(0.02);
    scene.grains.count = 60;
    scene.start = Start::Grid { counts: [4, 4, 4], spacing: 5e-3, jitter: 2e-4, base: 2e-3 };
    let stem_radius = 8e-3;
    scene.funnel = Some(Funnel {
        height: 0.02,
        stem_radius,
        rim_radius: 0.02,
        cone_length: 0.02,
        ..Funnel::default()
    });
    scene.material = Material { tangential_restitution: 0.3, ..Material::default() };
    let shape = Shape::Plane { point: [0.0; 3], normal: [0.1, 0.0, 1.0] };
    let material = WallMaterial { sliding_friction: Some(0.2), ..WallMaterial::default() };
    scene.walls.push(Wall::fixed(shape, material));
    scene.end.horizon = 0.5;
    scene
}

/// A ball of grains that falls apart, solved as `preset` says.
fn drop(preset: Preset) -> Scene {
    let mut scene = Scene::drop(0.02);
    scene.preset = preset;
    scene.grains.count = 40;
    scene.end.horizon = 0.3;
    scene
}

fn start(scene: &Scene) -> Simulation {
    Simulation::new(scene, SEED).expect("a valid scene")
}

fn substeps(simulation: &mut Simulation, count: usize) {
    let dt = simulation.settings().dt;
    simulation.advance(count as f64 * dt);
}

/// A scene, the substeps to its end and the hash there.
struct Whole {
    scene: Scene,
    substeps: usize,
    hash: u128,
}

impl Whole {
    fn new(scene: Scene) -> Self {
        let pour = start(&scene).run();
        assert!(pour.health.substeps > 100 && pour.status != Status::Unhealthy, "{pour:?}");
        Self { scene, substeps: pour.health.substeps, hash: pour.state_hash }
    }
}

static WHOLES: LazyLock<Vec<Whole>> = LazyLock::new(|| {
    let drops = Preset::ALL.into_iter().map(drop);
    std::iter::once(funnel()).chain(drops).map(Whole::new).collect()
});

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    /// Between two lists and at them, before the first contact and at rest, on other threads than before.
    #[test]
    fn a_pour_cut_anywhere_is_the_whole_pour(
        kind in 0..WHOLES.len(), share in 0f64..1.2, threads in prop::array::uniform2(1usize..5),
    ) {
        let Whole { scene, substeps: total, hash } = &WHOLES[kind];
        let cut = (share * *total as f64) as usize;
        let mut first = start(scene).with_threads(threads[0]).unwrap();
        substeps(&mut first, cut);
        let bytes = first.checkpoint();
        let second = start(scene).with_threads(threads[1]).unwrap().resume(&bytes).unwrap();
        prop_assert_eq!(second.state_hash(), first.state_hash());
        prop_assert!(second.checkpoint() == bytes);
        prop_assert_eq!(second.wall_loads().unwrap(), first.wall_loads().unwrap());
        prop_assert_eq!(second.run().state_hash, *hash);
    }
}

#[test]
fn a_pour_cut_at_every_substep_is_the_whole_pour() {
    for Whole { scene, substeps: total, hash } in WHOLES.iter() {
        let mut pieces = start(scene);
        while pieces.ended().is_none() {
            substeps(&mut pieces, 1);
            pieces = start(scene).resume(&pieces.checkpoint()).unwrap();
        }
        assert_eq!(pieces.health().substeps, *total);
        assert_eq!(pieces.state_hash(), *hash, "{} {}", scene.name, scene.preset);
    }
}

#[test]
fn a_checkpoint_says_what_it_is_of() {
    let scene = funnel();
    let mut simulation = start(&scene);
    substeps(&mut simulation, 17);
    let header = CheckpointHeader::read(&simulation.checkpoint()).unwrap();
    assert_eq!((&header.scene, header.seed, header.substep), (&scene, SEED, 17));
    assert_eq!(header.settings, scene.settings());
    assert_eq!(header.time(), simulation.time());
}

#[test]
fn motion_and_settings_that_were_set_are_kept() {
    let scene = drop(Preset::Default);
    let settings = SolverSettings { sweeps: 7, ..scene.settings() };
    let begin = || start(&scene).with_settings(settings).unwrap();
    let mut first = begin();
    substeps(&mut first, 33);
    first.set_motion(4, Vector3::new(0.1, 0.2, 2.0), Vector3::x()).unwrap();
    let second = begin().resume(&first.checkpoint()).unwrap();
    assert_eq!(second.run().state_hash, first.run().state_hash);
}

#[test]
fn every_truncation_and_every_changed_byte_is_refused() {
    let mut scene = drop(Preset::Fast);
    scene.grains.count = 3;
    let mut simulation = start(&scene);
    simulation.advance(0.1);
    let whole = simulation.checkpoint();
    let refused = |bytes: &[u8]| start(&scene).resume(bytes).expect_err("damage");
    for length in 0..whole.len() {
        let error = refused(&whole[..length]);
        assert!(
            matches!(error, DemError::CheckpointLength { got, .. } if got == length),
            "{error}"
        );
    }
    let longer = [&whole[..], &[0]].concat();
    assert!(matches!(refused(&longer), DemError::CheckpointLength { .. }));
    let mut bytes = whole.clone();
    for at in 0..whole.len() {
        for change in [1, 0x80, 0xff] {
            bytes[at] ^= change;
            let error = refused(&bytes);
            let expected = match at {
                0..21 => matches!(error, DemError::NotACheckpoint { .. }),
                21..29 => matches!(error, DemError::CheckpointLength { .. }),
                _ => matches!(error, DemError::CheckpointDamaged { .. }),
            };
            assert!(expected, "byte {at}: {error}");
            bytes[at] = whole[at];
        }
    }
    assert!(start(&scene).resume(&whole).is_ok());
}

#[test]
fn another_pour_is_refused_by_name() {
    let scene = drop(Preset::Default);
    let bytes = start(&scene).checkpoint();
    let refused = |simulation: Simulation| simulation.resume(&bytes).unwrap_err().to_string();
    let message = refused(start(&scene.with("material.restitution", 0.7).unwrap()));
    assert!(
        message.contains("scene.material.restitution is 0.5 there, but 0.7 is given"),
        "{message}"
    );
    let message = refused(start(&drop(Preset::Fast)));
    assert!(message.contains("scene.preset is \"default\" there, but \"fast\""), "{message}");
    let message = refused(Simulation::new(&scene, SEED + 1).unwrap());
    assert!(message.contains("seed is 3 there, but 4 is given"), "{message}");
    let settings = SolverSettings { sweeps: 7, ..scene.settings() };
    let message = refused(start(&scene).with_settings(settings).unwrap());
    assert!(message.contains("settings.sweeps is 4 there, but 7 is given"), "{message}");
    let message = refused(start(&funnel()));
    assert!(message.contains("scene.name"), "{message}");
}
