//! What is asked, as checked data: a scene, its sensor, and the prior of its numbers.
#![doc = ""]
//! The solver, the camera and the files all take their numbers from here, so that a number has one place, one range and
//! one message when it is refused:
//!
//! ```
//! use granulcal_scene::{Prior, Scene};
//!
//! let scene = Scene::funnel(0.12).with("material.sliding_friction", 0.4)?;
//! Prior::default().check(&scene)?;
//! assert!(scene.with("camera.pixels", 0.0).is_err());
//! # Ok::<(), granulcal_scene::SceneError>(())
//! ```

mod bed;
mod camera;
mod check;
mod distribution;
mod effects;
mod end;
mod error;
mod grain_shape;
mod grains;
mod gravity;
mod intruder;
mod material;
mod mesh;
mod motion;
mod normal;
mod observe;
mod outflow;
mod path;
mod periodic;
mod preset;
mod prior;
mod scene;
mod sensor;
mod start;
mod sweep;
mod symmetry;
mod together;
mod toml_fault;
mod uniforms;
mod view;
mod walls;

pub use bed::Bed;
pub use camera::{CameraSpec, MAX_BLUR, MAX_DEPTH_NOISE, MAX_SENSOR_PIXELS, Mask, Projection};
pub use distribution::Distribution;
pub use effects::*;
pub use end::{EndRule, RolledAway};
pub use error::SceneError;
pub use grain_shape::{GrainShape, Solid, parry};
pub use grains::Grains;
pub use gravity::GRAVITY;
pub use intruder::Intruder;
pub use material::{
    Material, WallMaterial, rolling_friction_from_length, rolling_friction_to_length,
};
pub use mesh::{Mesh, MeshFile};
pub use motion::Motion;
pub use observe::{
    Observe, ObserveClock, ObserveDischarge, ObserveFront, ObserveImages, ObserveLiquid,
    ObserveRadius, ObserveSpill, ObserveSurface,
};
pub use outflow::Outflow;
pub use path::first_difference;
pub use periodic::{Periodic, PeriodicAxis};
pub use preset::{
    Complementarity, ImpactSettings, Method, NewtonSettings, Preset, ReferenceSettings,
    SolverSettings,
};
pub use prior::{Keys, Parameter, Prior};
pub use scene::Scene;
pub use sensor::{
    DepthSensor, GRAZING_DEG, NoiseField, StereoSensor, TimeOfFlightSensor, round_to,
};
pub use start::Start;
pub use toml_fault::TomlFault;
pub use view::ViewSpec;
pub use walls::{BoxSide, Ends, Funnel, Ground, Shape, Wall};
