//! Posteriors without Python: reads what `granulcal train` wrote and evaluates it.
//!
//! A [`Model`] is a folder of `model.json` and `weights.safetensors`. [`Model::posterior`] gives the
//! [`Posterior`] of one pour, or of several of one material, by the equations of
//! `docs/theory/bayessim.md`: an emulated likelihood, a mixture density network, or the average of
//! both. Where Python integrates over evenly spread points these are the same points, so that
//! densities agree to rounding; draws have another generator and agree in distribution.
//!
//! | module | what it is |
//! |---|---|
//! | `coordinates` | a prior's parameters mapped to where the inference lives |
//! | `standardiser` | statistics to spread 1 |
//! | `emulator`, `noise`, `likelihood` | density of statistics given coordinates |
//! | `network`, `mixture` | density of coordinates given statistics |
//! | `average`, `tilt` | how much each of both counts, and what the prior is multiplied by |
//! | `importance` | normaliser and draws of a density known up to a factor |
//! | [`Misfit`], [`Identifiability`] | whether any parameters explain an observation, and what it tells |
//! | `waves`, `lanes` | random features and mixtures in wide registers |
//! | [`Model`], [`Posterior`] | the file, and what it says |

#![allow(clippy::inline_always)] // what is compiled for wider registers must be inlined to reach them

mod average;
mod component;
mod coordinates;
mod damage;
mod document;
mod emulator;
mod error;
mod identifiability;
mod importance;
mod lanes;
mod likelihood;
mod matrix;
mod misfit;
mod mixture;
mod mode;
mod model;
mod network;
mod noise;
mod posterior;
mod quasi;
mod random;
mod standardiser;
mod tensors;
mod tilt;
mod waves;

pub use error::ModelError;
pub use identifiability::Identifiability;
pub use misfit::{Misfit, StatisticMisfit};
pub use model::Model;
pub use posterior::{Marginal, Posterior, Warning};
