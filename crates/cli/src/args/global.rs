//! What can be said to every command.

use clap::Args;

/// Options that every command takes.
#[derive(Clone, Debug, Args)]
pub struct Global {
    /// No progress and no messages but errors
    #[arg(long, short, global = true)]
    pub quiet: bool,
    /// More messages; twice for all
    #[arg(long, short, global = true, action = clap::ArgAction::Count, conflicts_with = "quiet")]
    pub verbose: u8,
}
