//! A format of message files.

use super::visit::{Visit, Walk};
use crate::DatasetError;
use crate::input::Input;

/// Shows the messages of a file, from front to back.
pub(super) type Walker = fn(&mut Input<'_>, &mut Visit<'_>) -> Result<Walk, DatasetError>;

/// What a file of messages begins with, what it is called, and how it is walked.
#[derive(Clone, Copy, Debug)]
pub struct MessageFormat {
    /// Its name, as inspect shows it.
    pub(super) name: &'static str,
    /// The first bytes of every file.
    pub(super) magic: &'static [u8],
    /// The walk.
    pub(super) walk: Walker,
}

impl PartialEq for MessageFormat {
    fn eq(&self, other: &Self) -> bool {
        self.magic == other.magic
    }
}

impl Eq for MessageFormat {}

impl MessageFormat {
    /// Its name, as inspect shows it.
    pub fn name(self) -> &'static str {
        self.name
    }
}
