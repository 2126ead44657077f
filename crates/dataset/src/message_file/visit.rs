//! What a walk through a file shows, and what it found besides.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::ControlFlow;

use crate::DatasetError;

/// Notes that are kept; a file can be damaged in a million places.
const MAX_NOTES: usize = 20;

/// Messages of one kind, in the order in which they came.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Channel {
    pub(crate) topic: String,
    /// Name of the type, empty if none is given.
    pub(crate) schema: String,
    /// How messages are serialised.
    pub(crate) encoding: String,
}

/// One message.
pub(crate) struct Message<'a> {
    pub(crate) channel: &'a Channel,
    /// When it was recorded `[ns]`.
    pub(crate) time_ns: u64,
    pub(crate) data: &'a [u8],
}

/// Called with each message; says whether to go on.
pub(crate) type Visit<'v> = dyn FnMut(&Message<'_>) -> Result<ControlFlow<()>, DatasetError> + 'v;

/// A place in a file where something is wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// Where, from the start of the file `[B]`.
    pub offset: u64,
    /// What is wrong there.
    pub what: String,
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "byte {}: {}", self.offset, self.what)
    }
}

/// What a walk found besides messages.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Walk {
    /// What is wrong, by place; at most the first [`MAX_NOTES`].
    pub(crate) damage: Vec<Damage>,
    /// Messages of each topic that the file says it holds, where it is whole enough to say so.
    pub(crate) expected: Option<BTreeMap<String, u64>>,
    /// Messages of each topic that were seen but not whole.
    pub(crate) cut: BTreeMap<String, u64>,
    /// Bytes of messages that are missing at the end and bytes that are there, where known.
    pub(crate) missing: Option<(u64, u64)>,
}

impl Walk {
    pub(super) fn note(&mut self, offset: u64, what: impl fmt::Display) {
        if self.damage.len() < MAX_NOTES {
            self.damage.push(Damage { offset, what: what.to_string() });
        }
    }

    pub(super) fn note_cut(&mut self, channel: &Channel) {
        *self.cut.entry(channel.topic.clone()).or_default() += 1;
    }
}
