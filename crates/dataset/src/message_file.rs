//! Files of time-stamped messages: ROS 1 .bag and .mcap, behind one walk from front to back.
//!
//! A file may be cut off or damaged. The walk shows every message that is whole, goes on behind what
//! is not where the file's index says where, and keeps a note of what it found.

mod bag;
mod mcap;
mod mcap_record;
mod unpack;
mod visit;

use crate::DatasetError;
use crate::input::Input;
pub use visit::Damage;
pub(crate) use visit::{Channel, Message, Visit, Walk};

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
