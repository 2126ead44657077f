//! The files of granulcal: the only crate that touches the disk.
//!
//! A [`Prior`] says which numbers of a scene are unknown; [`generate()`] draws, pours and describes
//! until a folder holds every row; [`Dataset`] reads it back. A [`Recording`] is a measured depth
//! image or height map, described by the same code. Formats are in `docs/theory/dataset.md`.
//!
//! Two promises hold everywhere: a file that is written is complete or absent, and a file that is
//! read is refused with its name, what was found and what is allowed.
//!
//! | module | what it is |
//! |---|---|
//! | [`Prior`], [`Distribution`] | parameters by path, drawn by seed and row |
//! | [`observe()`] | pour to image to statistics |
//! | [`Observer`] | what a scene observes over time and at its end |
//! | [`generate()`] | resumable batches |
//! | [`GatheredBatch`] | batches whose parts are made elsewhere |
//! | [`Dataset`] | Parquet back into memory |
//! | [`merge`] | shards to one file |
//! | [`Recording`] | measured height maps and depth images |
//! | [`Survey`] | what is in a .bag or .mcap |
//! | [`png`], [`npy`] | 16-bit depth PNG, arrays |
//! | [`record_pour`] | a pour over time as MCAP |
//! | [`write_checkpoint`], [`resume_checkpoint`] | a pour that is stopped and goes on |
//! | [`Claims`] | what a command reads and writes, checked before it runs |

mod camera_file;
mod checkpoint_file;
mod claims;
mod contact_problem_file;
mod contained;
mod dataset;
mod depth_frame;
mod drawn;
mod engine;
mod error;
mod fault;
mod faults;
mod files;
mod form;
mod frame_rate;
mod gaps;
mod generate;
mod header;
mod image_file;
mod input;
mod manifest;
mod mcap_file;
mod mean;
mod merge;
mod mesh_file;
mod message;
mod message_file;
pub mod npy;
mod npz;
mod observe;
mod observer;
mod pictures;
mod plausible;
pub mod png;
mod random;
mod readable;
mod recording;
mod room;
mod row;
mod scene_file;
mod sensor_file;
mod signature;
mod survey;
mod table;
mod trajectory_file;
mod trial;

pub use camera_file::CameraFile;
pub use checkpoint_file::{read_checkpoint_header, resume_checkpoint, write_checkpoint};
pub use claims::{Claims, Input, Product};
pub use contact_problem_file::write_contact_problem;
pub use dataset::Dataset;
pub use drawn::Drawn;
pub use engine::{Engine, Outcome, foreign_pour};
pub use error::DatasetError;
pub use files::{is_writing, read_file, read_text, remove_temporaries, write_file};
pub use form::Form;
pub use generate::{
    GatheredBatch, GenerateOptions, Progress, Shard, Summary, generate, generate_with,
    look as look_at_batch,
};
/// Priors, from the crate of what is asked.
pub use granulcal_scene::{Distribution, Parameter, Prior};
pub use header::{Header, VERSION};
pub use input::ReadSeek;
pub use manifest::NAME as MANIFEST;
pub use mcap_file::{Filmed, record_pour};
pub use merge::{Merged, merge};
pub use message_file::{Damage, MessageFormat};
pub use npz::{Npz, write_height_map};
pub use observe::{Observation, TooFewGrains, View, capture, capture_from, observe, overhead};
pub use observer::{
    DISCHARGE_RANGE, Observed, ObservedStatistic, Observer, POLL_INTERVAL, Series, discharge_rate,
    observed_statistics,
};
pub use pictures::{Pictures, write_mask, write_pictures};
pub use plausible::{LEAST_SHOWN, Limits, Places, UNIT_FACTOR};
pub use readable::{plain, readable};
pub use recording::{
    FRAMES, Folder, Frame, ReadOptions, Recording, Source, camera_beside, measured_data,
};
pub use room::Room;
pub use row::{Row, RowStatus};
pub use scene_file::{load_prior, load_scene, scene_from_text};
pub use sensor_file::{load_sensor, save_sensor};
pub use survey::{Choice, DepthUnit, Lost, Survey, Topic};
pub use trial::{Trial, try_pour};
