//! The same bits from run to run, on any number of threads and however the time is cut.

use granulcal::dem::{Material, Scene, Simulation, Start};

use crate::scenes::{bits, block, drop_of, material, start};

/// A cube of 13,824 grains that nearly touch: 27 blocks and more in each loop than one thread's share.
fn large() -> Scene {
    let (counts, spacing, base) = ([24, 24, 24], 4.05e-3, 2.1e-3);
    let mut scene = block(counts, spacing, base, Material::default());
    scene.start = Start::Grid { counts, spacing, jitter: 1e-5, base };
    scene
}

fn after(scene: &Scene, threads: usize, seconds: f64) -> Simulation {
    let mut simulation = start(scene).with_threads(threads).expect("threads");
    simulation.advance(seconds);
    simulation
}

#[test]
fn threads_do_not_change_a_bit() {
    let scene = large();
    let seconds = 24.0 / 2400.0;
    let alone = after(&scene, 1, seconds);
    assert!(alone.health().mean_contacts > 30_000.0, "{:?}", alone.health());
    let expected = bits(&alone);
    for threads in [2, 4, 8] {
        assert!(bits(&after(&scene, threads, seconds)) == expected, "{threads} threads differ");
    }
}

#[test]
fn threads_do_not_change_a_bit_with_tangential_restitution() {
    let mut scene = large();
    scene.material.tangential_restitution = 0.5;
    let seconds = 12.0 / 2400.0;
    let expected = bits(&after(&scene, 1, seconds));
    assert!(bits(&after(&scene, 3, seconds)) == expected);
}

#[test]
fn a_run_repeats_itself() {
    let scene = drop_of(200, 0.05, material(0.5, 0.1, 0.7));
    let run = || Simulation::new(&scene, 5).expect("a valid scene").run();
    assert!(run() == run());
    let other = Simulation::new(&scene, 6).expect("a valid scene").run();
    assert!(run().positions != other.positions);
}

#[test]
fn a_run_in_pieces_is_a_run() {
    let scene = drop_of(200, 0.05, material(0.5, 0.1, 0.7));
    let whole = start(&scene).run();
    let mut pieces = start(&scene);
    for substeps in (1..).take_while(|n| *n < 5000) {
        pieces.advance(f64::from(substeps % 7) / 2400.0);
        if pieces.ended().is_some() {
            break;
        }
        // A copy goes on where the original was.
        pieces = pieces.clone();
    }
    assert!(pieces.into_pour() == whole);
}

#[test]
fn a_watched_run_is_a_run() {
    let scene = drop_of(100, 0.02, material(0.5, 0.1, 0.5));
    assert!(start(&scene).run_while(&|| true).expect("not stopped") == start(&scene).run());
    assert!(start(&scene).run_while(&|| false).is_none());
}
