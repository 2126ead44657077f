//! Golden counters: a solver that silently needs more sweeps fails here although its piles are right.
//!
//! The arithmetic of a substep is + - * /, fused multiply-add and square root in f64, without libm, all of which IEEE 754 defines to the bit; so the counters are compared exactly, on every
//! machine. They change whenever the order of contacts, the law or the settings change: run
//! `cargo test --test physics counters -- --nocapture`, read whether the change is meant, and copy the
//! printed numbers.

use granulcal::dem::{Simulation, Status};

use crate::scenes::{drop_of, material};

#[test]
fn a_small_drop_takes_its_substeps_and_sweeps() {
    let scene = drop_of(100, 0.05, material(0.5, 0.3, 0.5));
    let pour = Simulation::new(&scene, 1).expect("a valid scene").run();
    let health = pour.health;
    println!("{health:?}, {:?}", pour.status);
    assert_eq!(pour.status, Status::AtRest);
    assert_eq!((health.substeps, health.sweeps), (750, 2508));
    assert_eq!(health.mean_contacts, 217.78);
}
