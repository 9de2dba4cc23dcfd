//! The `mba` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    mba_cli::main(std::env::args_os())
}
