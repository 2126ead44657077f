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
//! A pour is looked into while it goes on, at times of the caller's own:
//!
//! ```
//! use granulcal_dem::{Partner, Scene, Simulation};
//!
//! let mut scene = Scene::drop(0.0);
//! scene.grains.count = 10;
//! let mut simulation = Simulation::new(&scene, 7)?;
//! for frame in 1..=20 {
//!     simulation.advance_to(0.01 * f64::from(frame));
//!     let highest = simulation.positions().iter().map(|at| at.z).fold(0.0, f64::max);
//!     println!("{:.2} s: {highest:.4} m, {:?}", simulation.time(), simulation.energy());
//! }
//! // What the ground carries, over the weight of a grain.
//! let forces = simulation.contact_forces()?;
//! let on_ground = forces.iter().filter(|contact| contact.partner == Partner::Wall(0));
//! let carried = on_ground.map(|contact| contact.force.z).sum::<f64>() / granulcal_dem::GRAVITY;
//! assert!((carried - 10.0).abs() < 0.1);
//! # Ok::<(), granulcal_dem::DemError>(())
//! ```
//!
//! Vectors are those of `nalgebra`, which a program of its own depends on, too. Read [`Scene`], then [`Simulation`];
//! the law is in `law.rs`, the solvers in `solver/`.
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
mod blocks;
mod bodies;
mod body;
mod bonds;
mod cells;
mod checkpoint;
mod clumps;
mod contact;
mod contact_context;
mod contact_force;
mod contact_set;
mod contacts;
mod effect;
mod energy;
mod error;
mod frozen_search;
mod health;
mod impact;
mod initial;
mod lanes;
mod law;
mod liquid;
mod neighbor;
mod parallel;
mod particles;
mod parting;
mod partners;
mod path;
mod period;
mod placement;
mod pour;
mod problem;
mod rebound;
mod simulation;
mod solver;
mod turning;
mod turns;
mod wall;
mod wall_load;

pub use checkpoint::CheckpointHeader;
pub use contact_force::ContactForce;
pub use energy::Energy;
pub use error::DemError;
pub use frozen_search::FrozenSearch;
/// What is asked, from the crate below; all of it is in [`granulcal_scene`].
pub use granulcal_scene::{
    Adhesion, Bed, Bonds, BoxSide, CameraSpec, Capillary, Clump, Complementarity, DepthSensor,
    Effect, Effects, EndRule, Ends, Fluid, Funnel, FunnelPose, GRAVITY, GrainShape, Grains, Ground,
    GroundUnlike, ImpactSettings, Intruder, Layer, Liquid, Lubrication, Mask, Material, Mesh,
    MeshFile, Method, Motion, NewtonSettings, NoiseField, Observe, ObserveClock, ObserveDischarge,
    ObserveFront, ObserveImages, ObserveLiquid, ObserveRadius, ObserveSpill, ObserveSurface,
    Outflow, Outlet, Periodic, PeriodicAxis, Polydispersity, Preset, Projection, ReferenceSettings,
    RestitutionSpeed, RolledAway, RollingForm, Scene, SceneError, Shape, SolverSettings, Start,
    StereoSensor, Tilt, TimeOfFlightSensor, Vibration, ViewSpec, Wall, WallMaterial,
    rolling_friction_from_length, rolling_friction_to_length,
};
pub use health::{Breach, Health, MAX_ENERGY_CREATED};
pub use impact::ImpactWork;
pub use law::{LAW, arithmetic, law_of};
pub use pour::{BedAtRest, ConvexGrains, Pour, Status};
pub use problem::{ContactProblem, DelassusBlock, FrozenContact, Partner, Side};
pub use simulation::Simulation;
pub use solver::frozen::{FrozenSolution, FrozenSolve};
pub use wall_load::WallLoad;
