//! The envelope of a checkpoint: what a simulation's bytes say of themselves, and how damage is found.
//!
//! docs/theory/checkpoint.md has the layout. What is inside the envelope is in `simulation/state.rs`.

use granulcal_scene::{Scene, SceneError, SolverSettings, first_difference};
use serde::{Deserialize, Serialize};
use toml::Value;
use xxhash_rust::xxh3::xxh3_128;

use crate::error::DemError;
use crate::law::{arithmetic, law_of};

/// What a checkpoint begins with.
const MAGIC: &[u8] = b"granulcal checkpoint\n";
/// The format of header and state. Between two versions that are released a change of either is a new format.
pub(crate) const FORMAT: u32 = 9;
/// The version of granulcal that writes and reads.
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Bytes of the length of the whole, and of the format.
const LENGTH: usize = size_of::<u64>();
const FORMAT_FIELD: usize = size_of::<u32>();
/// Bytes of the hash at the end.
const HASH: usize = size_of::<u128>();
/// Bytes of an envelope with nothing in it.
const LEAST: usize = MAGIC.len() + LENGTH + FORMAT_FIELD + HASH;

/// What a checkpoint is of.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckpointHeader {
    /// The version of granulcal that wrote it.
    pub version: String,
    /// The scene.
    pub scene: Scene,
    /// The seed of the start.
    pub seed: u64,
    /// The solver's settings, those of the scene's preset unless they were replaced.
    pub settings: SolverSettings,
    /// Substeps taken.
    pub substep: usize,
}

/// The header as it is written.
#[derive(Serialize, Deserialize)]
struct Written {
    // First in every format, so that every version can name the one that wrote.
    version: String,
    law: u32,
    arithmetic: u32,
    scene: String,
    seed: u64,
    settings: SolverSettings,
    substep: usize,
}

impl CheckpointHeader {
    /// The header of a simulation of this version.
    pub(crate) fn new(scene: &Scene, seed: u64, settings: SolverSettings, substep: usize) -> Self {
        Self { version: VERSION.to_owned(), scene: scene.clone(), seed, settings, substep }
    }

    /// Reads what a checkpoint is of; the whole of it is read, so that damage is found.
    ///
    /// # Errors
    /// [`DemError::NotACheckpoint`], [`DemError::CheckpointLength`], [`DemError::CheckpointDamaged`],
    /// [`DemError::CheckpointFormat`], [`DemError::CheckpointVersion`], [`DemError::CheckpointLaw`] or
    /// [`DemError::CheckpointArithmetic`].
    pub fn read(bytes: &[u8]) -> Result<Self, DemError> {
        Ok(open(bytes)?.0)
    }

    /// Simulated time `[s]`.
    pub fn time(&self) -> f64 {
        self.substep as f64 * self.settings.dt
    }

    /// Refuses the checkpoint of another pour than `given` and names the first difference.
    pub(crate) fn require_same(&self, given: &Self) -> Result<(), DemError> {
        let differs = |what: String, found: String, given: String| {
            Err(DemError::CheckpointDiffers {
                what: what.into(),
                found: found.into(),
                given: given.into(),
            })
        };
        if let Some((path, found, given)) = self.scene.first_difference(&given.scene)? {
            return differs(format!("scene.{path}"), found, given);
        }
        if self.seed != given.seed {
            return differs("seed".to_owned(), self.seed.to_string(), given.seed.to_string());
        }
        let (here, there) = (Value::try_from(self.settings), Value::try_from(given.settings));
        let tree = |value: Result<Value, _>| value.map_err(|e| SceneError::TomlWrite(Box::new(e)));
        let difference = first_difference("settings", Some(&tree(here)?), Some(&tree(there)?));
        if let Some((path, found, given)) = difference {
            return differs(path, found, given);
        }
        Ok(())
    }
}

/// The hash that checkpoints end with.
pub(crate) fn hash(bytes: &[u8]) -> u128 {
    xxh3_128(bytes)
}

/// A checkpoint of a header and a state.
pub(crate) fn seal(header: &CheckpointHeader, state: &[u8]) -> Vec<u8> {
    let written = Written {
        version: header.version.clone(),
        law: law_of(&header.scene),
        arithmetic: arithmetic(&header.scene),
        // Numbers of a scene that a simulation was made of can be written.
        scene: header.scene.to_toml().expect("a checked scene as TOML"),
        seed: header.seed,
        settings: header.settings,
        substep: header.substep,
    };
    let header = postcard::to_stdvec(&written).expect("a header in memory");
    let total = LEAST + header.len() + state.len();
    let mut bytes = Vec::with_capacity(total);
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&(total as u64).to_le_bytes());
    bytes.extend_from_slice(&FORMAT.to_le_bytes());
    bytes.extend_from_slice(&header);
    bytes.extend_from_slice(state);
    let hash = hash(&bytes);
    bytes.extend_from_slice(&hash.to_le_bytes());
    bytes
}

/// Header and state of a checkpoint that is whole and of this version.
pub(crate) fn open(bytes: &[u8]) -> Result<(CheckpointHeader, &[u8]), DemError> {
    let (format, body) = open_envelope(bytes)?;
    if format != FORMAT {
        let version: &str = postcard::take_from_bytes(body).map_or("?", |(version, _)| version);
        let version = version.to_owned();
        return Err(DemError::CheckpointFormat { got: format, allowed: FORMAT, version });
    }
    let strange = |_| DemError::CheckpointState { what: "a header that cannot be read" };
    let (written, state): (Written, _) = postcard::take_from_bytes(body).map_err(strange)?;
    let Written { version, law, arithmetic: got, scene, seed, settings, substep } = written;
    if version != VERSION {
        return Err(DemError::CheckpointVersion { got: version, allowed: VERSION });
    }
    let scene = Scene::parse(&scene)?;
    if law != law_of(&scene) {
        return Err(DemError::CheckpointLaw { got: law, allowed: law_of(&scene) });
    }
    let allowed = arithmetic(&scene);
    if got != allowed {
        return Err(DemError::CheckpointArithmetic { got, allowed });
    }
    Ok((CheckpointHeader { version, scene, seed, settings, substep }, state))
}

/// The format, and what lies between it and the hash. Every format has this envelope.
fn open_envelope(bytes: &[u8]) -> Result<(u32, &[u8]), DemError> {
    let begin = &bytes[..bytes.len().min(MAGIC.len())];
    if !MAGIC.starts_with(begin) {
        let found = String::from_utf8_lossy(begin).into_owned();
        return Err(DemError::NotACheckpoint { found });
    }
    let expected = |expected| DemError::CheckpointLength { got: bytes.len(), expected };
    if bytes.len() < LEAST {
        return Err(expected(LEAST as u64));
    }
    let (body, hash_at_end) = bytes.split_at(bytes.len() - HASH);
    let (total, rest) = body[MAGIC.len()..].split_at(LENGTH);
    let (format, inside) = rest.split_at(FORMAT_FIELD);
    let total = little_endian(total) as u64;
    if total != bytes.len() as u64 {
        return Err(expected(total));
    }
    let (stored, computed) = (little_endian(hash_at_end), hash(body));
    if computed != stored {
        return Err(DemError::CheckpointDamaged { stored, computed });
    }
    Ok((little_endian(format) as u32, inside))
}

/// A whole number of at most 16 bytes.
fn little_endian(bytes: &[u8]) -> u128 {
    bytes.iter().rev().fold(0, |number, &byte| number << 8 | u128::from(byte))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Simulation;
    use crate::law::LAW;

    fn simulation() -> Simulation {
        let mut scene = Scene::drop(0.01);
        scene.grains.count = 2;
        Simulation::new(&scene, 1).expect("a valid scene")
    }

    /// The same bytes with the hash that they should have.
    fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
        let body = bytes.len() - HASH;
        let hash = hash(&bytes[..body]);
        bytes[body..].copy_from_slice(&hash.to_le_bytes());
        bytes
    }

    #[test]
    fn another_format_names_the_version_that_wrote_it() {
        let mut bytes = simulation().checkpoint();
        bytes[MAGIC.len() + LENGTH] = 99;
        let error = simulation().resume(&sealed(bytes)).unwrap_err().to_string();
        let expected = format!("must have format {FORMAT}, got 99, written by granulcal {VERSION}");
        assert!(error.contains(&expected), "{error}");
    }

    #[test]
    fn another_version_is_refused_and_named() {
        let mut bytes = simulation().checkpoint();
        let begin = LEAST - HASH + 1; // after the length of the text
        assert_eq!(&bytes[begin..begin + VERSION.len()], VERSION.as_bytes());
        bytes[begin] = b'7';
        let error = simulation().resume(&sealed(bytes)).unwrap_err();
        assert!(matches!(&error, DemError::CheckpointVersion { got, .. } if got.starts_with('7')));
        assert!(error.to_string().contains(VERSION), "{error}");
    }

    #[test]
    fn another_law_is_refused_and_named() {
        let mut bytes = simulation().checkpoint();
        // Behind the text of the version and its length; numbers below 128 take one byte.
        let law = LEAST - HASH + 1 + VERSION.len();
        assert_eq!(u32::from(bytes[law]), LAW);
        bytes[law] = 1;
        let error = simulation().resume(&sealed(bytes)).unwrap_err();
        assert!(matches!(error, DemError::CheckpointLaw { got: 1, allowed: LAW }), "{error}");
        let said = error.to_string();
        assert!(said.contains("law 1") && said.contains(&format!("law {LAW}")), "{said}");
    }

    #[test]
    fn another_arithmetic_is_refused_and_named() {
        let mut bytes = simulation().checkpoint();
        let at = LEAST - HASH + 1 + VERSION.len() + 1;
        assert_eq!(u32::from(bytes[at]), arithmetic(&Scene::drop(0.01)));
        bytes[at] = 99;
        let error = simulation().resume(&sealed(bytes)).unwrap_err();
        assert!(matches!(error, DemError::CheckpointArithmetic { got: 99, .. }), "{error}");
        assert!(error.to_string().contains("arithmetic 99"), "{error}");
    }

    #[test]
    fn what_is_no_checkpoint_is_named() {
        let error = simulation().resume(b"[grains]\ncount = 3\n and more").unwrap_err();
        assert!(error.to_string().contains("[grains]"), "{error}");
        assert!(matches!(simulation().resume(b""), Err(DemError::CheckpointLength { .. })));
    }
}
