//! Files of time-stamped messages: ROS 1 .bag and .mcap, behind one walk from front to back.
//!
//! A file may be cut off or damaged. The walk shows every message that is whole, goes on behind what
//! is not where the file's index says where, and keeps a note of what it found.

mod bag;
mod mcap;
mod mcap_record;
mod unpack;

use std::collections::BTreeMap;
use std::fmt;
use std::ops::ControlFlow;

use crate::DatasetError;
use crate::input::Input;

/// Notes that are kept; a file can be damaged in a million places.
const MAX_NOTES: usize = 20;

/// What a file of messages begins with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MessageFormat {
    /// ROS 1 bag, version 2.0.
    Bag,
    /// MCAP.
    Mcap,
}

impl MessageFormat {
    /// The format that a file's first bytes belong to.
    pub(crate) fn of(first: &[u8]) -> Option<Self> {
        if first.starts_with(bag::MAGIC) {
            Some(Self::Bag)
        } else if first.starts_with(::mcap::MAGIC) {
            Some(Self::Mcap)
        } else {
            None
        }
    }

    /// Its name, as inspect shows it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bag => "ROS 1 bag",
            Self::Mcap => "MCAP",
        }
    }
}

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
    fn note(&mut self, offset: u64, what: impl fmt::Display) {
        if self.damage.len() < MAX_NOTES {
            self.damage.push(Damage { offset, what: what.to_string() });
        }
    }

    fn note_cut(&mut self, channel: &Channel) {
        *self.cut.entry(channel.topic.clone()).or_default() += 1;
    }
}

/// Shows the messages of a file to `visit`.
///
/// # Errors
/// [`DatasetError::Io`], and whatever `visit` returns. Damage is no error.
pub(crate) fn walk(
    format: MessageFormat,
    input: &mut Input<'_>,
    visit: &mut Visit<'_>,
) -> Result<Walk, DatasetError> {
    match format {
        MessageFormat::Bag => bag::walk(input, visit),
        MessageFormat::Mcap => mcap::walk(input, visit),
    }
}
