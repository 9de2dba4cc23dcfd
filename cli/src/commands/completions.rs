//! `mba completions`.

use clap::CommandFactory;
use clap_complete::{generate, shells};

use crate::args::Cli;
use crate::args::shell::{Completions, Shell};
use crate::console::Console;

/// Name by which a shell knows the program.
const PROGRAM: &str = "mba";

/// Prints the completions for a shell.
///
/// # Errors
/// Failure when the standard output cannot be written.
pub fn run(args: &Completions, console: &Console) -> anyhow::Result<()> {
    console.result(&script(args.shell)?, String::clone)
}

fn script(shell: Shell) -> anyhow::Result<String> {
    let mut command = Cli::command();
    let mut bytes = Vec::new();
    match shell {
        Shell::Bash => generate(shells::Bash, &mut command, PROGRAM, &mut bytes),
        Shell::Zsh => generate(shells::Zsh, &mut command, PROGRAM, &mut bytes),
        Shell::Fish => generate(shells::Fish, &mut command, PROGRAM, &mut bytes),
    }
    Ok(String::from_utf8(bytes)?)
}
