//! The binary; everything is in the library, which the Python wheel calls too.

use std::process::ExitCode;

fn main() -> ExitCode {
    granulcal_cli::interrupt::handle_signals();
    ExitCode::from(granulcal_cli::run(std::env::args_os()))
}
