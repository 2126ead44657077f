//! Laws of many grains, measured: a silo's loads, a hopper's rate, a column's run-out, a heap's slope.
//!
//! The tests run them small, `make bench-physics` (examples/bench_physics.rs) runs them large; both share
//! these scenes. Lengths in arguments and results are grain diameters unless they wear a unit.

pub mod collapse;
pub mod fit;
pub mod hopper;
pub mod packed;
pub mod repose;
pub mod silo;
