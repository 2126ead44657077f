//! Posteriors: reads what `granulcal train` wrote and evaluates it, for the command line and for Python.
//!
//! A [`Model`] is a folder of `model.json` and `weights.safetensors`. [`Model::posterior`] gives the
//! [`Posterior`] of one pour, or of several of one material, by the equations of
//! `docs/theory/bayessim.md`: an emulated likelihood, a mixture density network, or the average of
//! both. Python trains and draws plots; what it evaluates on the way, of folds and of models that are not saved yet, is
//! evaluated here, too.
//!
//! | module | what it is |
//! |---|---|
//! | `coordinates` | a prior's parameters mapped to where the inference lives |
//! | `standardiser` | statistics to spread 1 |
//! | `emulator`, `noise`, `likelihood` | density of statistics given coordinates |
//! | `network`, `mixture` | density of coordinates given statistics |
//! | `average`, `log_ratio` | how much each of both counts, and what the prior is multiplied by |
//! | `importance` | normaliser and draws of a density known up to a factor |
//! | `best_fit`, [`Misfit`] | whether any parameters explain an observation |
//! | [`Identifiability`] | what an observation tells |
//! | `waves`, `lanes` | random features and mixtures in wide registers |
//! | [`Model`], [`Posterior`] | the file, and what it says |
//! | [`Tensors`], [`Emulated`], [`Evidence`] | the same of parts that are in memory, which is how training asks |

#![warn(missing_debug_implementations)] // whoever holds one of these in a struct derives it
#![allow(clippy::inline_always)] // what is compiled for wider registers must be inlined to reach them

mod average;
mod best_fit;
mod component;
mod coordinates;
mod damage;
mod document;
mod emulated;
mod emulator;
mod error;
mod identifiability;
mod importance;
mod kernels;
mod lanes;
mod likelihood;
mod log_ratio;
mod matrix;
mod misfit;
mod mixture;
mod mode;
mod model;
mod network;
mod noise;
mod odd_pour;
mod posterior;
mod quasi;
mod random;
mod short_names;
mod standardiser;
mod stated_law;
mod tensors;
mod waves;

pub use average::{Average, Form};
pub use component::Component;
pub use coordinates::Coordinates;
pub use document::EmulatorScalars;
pub use emulated::Emulated;
pub use error::ModelError;
pub use identifiability::{Directions, Identifiability};
pub use misfit::{Misfit, MisfitReference, SIGNIFICANCE, StatisticMisfit};
pub use mixture::Mixture;
pub use model::Model;
pub use odd_pour::OddPour;
pub use posterior::{Evidence, Marginal, Posterior, Warning};
pub use quasi::QuasiUniform;
pub use stated_law::StatedLaw;
pub use tensors::{Array, Tensors};
