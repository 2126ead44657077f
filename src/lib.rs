//! granulcal calibrates a granular simulator from depth images.
//!
//! This crate is the front door; the rooms are [`scene`] (what is asked: scenes, sensors, priors), [`dem`] (grains,
//! contact law, solver), [`features`] (camera, depth raster, segmentation, the 16 statistics), [`dataset`] (recordings,
//! resumable batches, Parquet, MCAP) and [`bayessim`] (the posterior that a trained model gives).
//!
//! ```
//! use granulcal::dem::{Scene, Simulation};
//!
//! let mut scene = Scene::drop(0.05);
//! scene.grains.count = 20;
//! let pour = Simulation::new(&scene, 1)?.run();
//! assert_eq!(pour.positions.len(), 20);
//! let seen = granulcal::dataset::observe(&scene.camera, &pour, 1)?;
//! assert!(seen.statistics?[0] > 0.0); // in the order of granulcal::features::PAPER16
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! `examples/library.rs` goes on from there: positions, energies and contact forces over time.

pub use granulcal_bayessim as bayessim;
pub use granulcal_dataset as dataset;
pub use granulcal_dem as dem;
pub use granulcal_features as features;
pub use granulcal_scene as scene;
