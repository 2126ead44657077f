//! The binary; everything is in the library, which the Python wheel calls too.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(granulcal_cli::run(std::env::args_os()))
}
