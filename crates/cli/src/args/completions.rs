//! The arguments of `completions`.

use clap::Args;
use clap_complete::Shell;

/// Print a completion script for a shell
#[derive(Debug, Args)]
#[command(long_about = "\
Prints a completion script.

Example:
  granulcal-cli completions bash > ~/.local/share/bash-completion/completions/granulcal-cli")]
pub struct CompletionsArgs {
    /// Shell to write for
    pub shell: Shell,
}
