//! Implicit discrete element method for rigid grains.
#![doc = ""]
//! A scene goes in, grains at rest come out:
//!
//! ```
//! use granulcal_dem::{Scene, Simulation, Status};
//!
//! let mut scene = Scene::drop(0.02);
//! scene.grains.count = 10;
//! let pour = Simulation::new(&scene, 7)?.run();
//! assert_eq!(pour.status, Status::AtRest);
//! # Ok::<(), granulcal_dem::DemError>(())
//! ```
//!
//! Read [`Scene`], then [`Simulation`]; the law is in `law.rs`, the solvers in `solver/`.
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | `x`, `v` | position and velocity of a grain | m, m/s |
//! | `w` | `r omega`, scaled angular velocity | m/s |
//! | `n` | contact normal, from j to i | - |
//! | `g` | gap, negative when overlapping | m |
//! | `w_n`, `u_t` | normal and tangential relative velocity | m/s |
//! | `rho` | relative rolling velocity | m/s |
//! | `lambda_n`, `lambda_t`, `lambda_r` | impulses over a typical mass | m/s |
//! | `b` | bias of the normal constraint | m/s |
//! | `A_n`, `A_t`, `A_r` | diagonal of the contact's Delassus block | - |

// The kernels are compiled for several register widths, which only reach what is inlined.
#![allow(clippy::inline_always)]

mod assemble;
mod bed;
mod blocks;
mod bodies;
mod body;
mod check;
mod checkpoint;
mod clumps;
mod contact;
mod contact_set;
mod contacts;
mod effect;
mod error;
mod frozen_search;
mod grain_shape;
mod health;
mod impact;
mod initial;
mod lanes;
mod law;
mod material;
mod neighbor;
mod parallel;
mod partners;
mod path;
mod period;
mod placement;
mod pour;
mod preset;
mod problem;
mod rebound;
mod scene;
mod simulation;
mod solver;
mod surroundings;
mod turns;
mod wall;
mod wall_load;

pub use checkpoint::CheckpointHeader;
pub use error::DemError;
pub use frozen_search::FrozenSearch;
pub use grain_shape::GrainShape;
pub use health::{Health, MAX_ENERGY_CREATED};
pub use impact::ImpactWork;
pub use law::LAW;
pub use material::{
    Material, WallMaterial, rolling_friction_from_length, rolling_friction_to_length,
};
pub use pour::{ConvexGrains, Pour, Status};
pub use preset::{
    Complementarity, ImpactSettings, Method, NewtonSettings, Preset, ReferenceSettings,
    SolverSettings,
};
pub use problem::{ContactProblem, DelassusBlock, FrozenContact, Partner, Side};
pub use scene::{
    Adhesion, BoxSide, CameraSpec, Capillary, Clump, Effect, Effects, EndRule, Ends, Fluid, Funnel,
    FunnelPose, GRAVITY, Grains, Ground, GroundUnlike, Layer, Lubrication, Mask, Mesh, MeshFile,
    Motion, NoiseSpec, Observe, ObserveDischarge, ObserveFront, ObserveImages, ObserveRadius,
    ObserveSpill, ObserveSurface, Outflow, Outlet, Periodic, PeriodicAxis, Polydispersity,
    Projection, RestitutionSpeed, RollingForm, Scene, SensorSpec, Shape, Start, StereoSpec, Tilt,
    TimeOfFlightSpec, Vibration, ViewSpec, Wall,
};
pub use simulation::Simulation;
pub use solver::frozen::{FrozenSolution, FrozenSolve};
pub use wall_load::WallLoad;
