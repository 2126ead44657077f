//! Files of time-stamped messages: ROS 1 .bag and .mcap, behind one walk from front to back.
//!
//! A file may be cut off or damaged. The walk shows every message that is whole, goes on behind what
//! is not where the file's index says where, and keeps a note of what it found.

mod bag;
mod format;
mod mcap;
mod mcap_record;
mod unpack;
mod visit;

use crate::DatasetError;
use crate::input::Input;
pub use format::MessageFormat;
pub use visit::Damage;
pub(crate) use visit::{Channel, Message, Visit, Walk};

/// Every format; a new one is a file in `message_file/` and a line here.
const FORMATS: &[&MessageFormat] = &[&bag::FORMAT, &mcap::FORMAT];

impl MessageFormat {
    /// The format that a file's first bytes belong to.
    pub(crate) fn of(first: &[u8]) -> Option<Self> {
        FORMATS.iter().find(|format| first.starts_with(format.magic)).map(|&&format| format)
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
    (format.walk)(input, visit)
}
