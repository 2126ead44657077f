//! The solver against closed forms, against itself on other threads, and against scenes that break solvers.
//!
//! One topic a module. Every tolerance stands beside its number with what it was measured from; see
//! docs/theory/contact.md for the equations.

mod across_gaps;
mod bonds;
mod bulk;
mod bulk_laws;
mod clump;
mod collision;
mod convex;
mod counters;
mod determinism;
mod effect_lists;
mod effects;
mod ground_impact;
mod impact;
mod incline;
mod layer;
mod liquid;
mod meshes;
mod moving_walls;
mod packing;
mod periodic;
mod rebound;
mod restitution;
mod rim;
mod robustness;
mod rolling;
mod rolling_dashpot;
mod scenes;
mod similarity;
mod solvers;
mod splash;
mod stack;
mod touching;
mod vessels;
