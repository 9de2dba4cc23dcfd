//! The `mba` program under a name of its own, so that cargo builds it for the tests of this package.

use std::process::ExitCode;

fn main() -> ExitCode {
    mba_cli::main(std::env::args_os())
}
