//! `mba man`.

mod page;

use std::path::Path;

use clap::CommandFactory;
use mba_mapper::output::{ExportFolder, Permission};
use serde::Serialize;

use crate::args::Cli;
use crate::args::shell::Man;
use crate::console::Console;
use crate::failure::{OrBadInput, bad_input, is_disk_full};
use crate::report::table::pairs;
use crate::written_run::{OUT_HINT, refuse};

/// What is printed.
#[derive(Clone, Debug, Serialize)]
struct Written {
    folder: String,
    pages: Vec<String>,
}

/// Prints one man page, or writes those of all commands.
///
/// # Errors
/// Bad input when there is no such command or the folder may not be written; failure when the disk is full.
pub fn run(args: &Man, console: &Console) -> anyhow::Result<()> {
    // Pages of `help` would only repeat the others.
    let mut program = Cli::command().disable_help_subcommand(true);
    // Gives commands their whole names and the options of every command.
    program.build();
    match &args.out {
        Some(out) => console.result(&write_all(&program, out, args.force)?, table),
        None => console.result(&page::of(named(&program, &args.command)?)?, String::clone),
    }
}

/// The command of these names.
fn named<'a>(program: &'a clap::Command, names: &[String]) -> anyhow::Result<&'a clap::Command> {
    names.iter().try_fold(program, |command, name| {
        command.find_subcommand(name).ok_or_else(|| {
            bad_input(format!("there is no command `mba {}`", names.join(" ")), "`mba --help` lists them all")
        })
    })
}

/// A command and those below it.
fn with_subcommands(command: &clap::Command) -> Vec<&clap::Command> {
    std::iter::once(command).chain(command.get_subcommands().flat_map(with_subcommands)).collect()
}

fn write_all(program: &clap::Command, out: &Path, force: bool) -> anyhow::Result<Written> {
    let commands = with_subcommands(program);
    let names: Vec<String> = commands.iter().map(|command| page::file_name(command)).collect();
    let permission = Permission { force, inputs: &[] };
    let mut folder = ExportFolder::claim(out, &permission, names.iter().cloned()).or_else(refuse)?;
    for (name, command) in names.iter().zip(commands) {
        match folder.write(name, page::of(command)?.as_bytes()) {
            Err(error) if is_disk_full(&error) => return Err(error.into()),
            written => written.or_bad_input(OUT_HINT)?,
        }
    }
    folder.finish().or_else(refuse)?;
    Ok(Written { folder: out.display().to_string(), pages: names })
}

fn table(written: &Written) -> String {
    pairs(&[("man pages", written.pages.len().to_string()), ("written to", written.folder.clone())])
}
