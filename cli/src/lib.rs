//! The commands of the `mba` program as a library, so that tests can call them without a process.
//!
//! Exit codes: 0 done, 1 failed, 2 wrong use or bad input, 75 stopped by a signal while mapping a
//! group of a job: try again, 130 and 143 otherwise stopped by Ctrl-C or a request to end. Results go to stdout, everything else to stderr.

use std::ffi::OsString;
use std::process::ExitCode;

use clap::Parser;
use mba_tracker::SimdLevel;
use mba_tracker::simd::{level_name, levels_up_to};

pub mod args;
pub mod commands;
pub mod console;
pub mod embedded;
pub mod failure;
pub mod interrupt;
pub mod itself;
pub mod progress;
pub mod written_run;

pub use mba_report as report;

use args::{Cli, Command, EvalCommand, MOST_THREADS};
use console::Console;
use failure::bad_input;

/// Parses the command line (program name first), runs the command, reports an error and returns the exit code.
pub fn main(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    ExitCode::from(exit_code(arguments))
}

/// As [`main`], with the exit code as a number.
pub fn exit_code(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version are "errors" of the parser too and have exit code 0. A closed pipe is nobody's loss.
            let _ = error.print();
            return u8::try_from(error.exit_code()).unwrap_or(2);
        }
    };
    match run(&cli) {
        Ok(()) => 0,
        Err(error) => {
            eprintln!("{}", failure::message(&error));
            failure::exit_code(&error)
        }
    }
}

/// Runs a parsed command line.
///
/// # Errors
/// Whatever stops the command; [`failure::exit_code`] tells bad input from failure.
pub fn run(cli: &Cli) -> anyhow::Result<()> {
    interrupt::watch();
    run_with(cli, &Console::new(&cli.global))
}

fn run_with(cli: &Cli, console: &Console) -> anyhow::Result<()> {
    // Chosen here once; whatever computes is told.
    let simd = simd_level(cli.global.simd.as_deref())?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads(cli.global.threads)).build()?;
    pool.install(|| dispatch(&cli.command, simd, console))
}

/// The SIMD level of that name; the best of this machine where none is asked for.
fn simd_level(asked: Option<&str>) -> anyhow::Result<SimdLevel> {
    let best = SimdLevel::new();
    let Some(asked) = asked else { return Ok(best) };
    let levels = levels_up_to(best);
    levels.iter().copied().find(|level| level_name(*level) == asked).ok_or_else(|| {
        let names: Vec<&str> = levels.iter().map(|level| level_name(*level)).collect();
        let message = format!("--simd {asked}: this machine has {}", names.join(", "));
        bad_input(message, "name one of these, or leave it out for the best")
    })
}

/// Number of worker threads; 0 for as many as the thread pool chooses itself, which listens to the environment.
fn threads(asked: Option<u16>) -> usize {
    let environment = std::env::var("RAYON_NUM_THREADS").ok().and_then(|text| text.parse::<usize>().ok());
    match (asked, environment) {
        (Some(asked), _) => asked.into(),
        (None, Some(count)) if count > MOST_THREADS.into() => MOST_THREADS.into(),
        (None, _) => 0,
    }
}

fn dispatch(command: &Command, simd: SimdLevel, console: &Console) -> anyhow::Result<()> {
    match command {
        Command::Demo(args) => commands::demo::run(args, simd, console),
        Command::Synth(args) => commands::synth::run(args, console),
        Command::Import(args) => commands::import::run(args, console),
        Command::Info(args) => commands::info::run(args, simd, console),
        Command::Calibrate(args) => commands::calibrate::run(args, simd, console),
        Command::Track(args) => commands::track::run(args, simd, console),
        Command::Map(args) => commands::map_job::run(args, simd, console),
        Command::Slam(args) => commands::slam::run(args, simd, console),
        Command::Ablate(args) => commands::ablate::run(args, simd, console),
        Command::Bench(args) => commands::bench::run(args, simd, console),
        Command::Split(args) => commands::split::run(args, simd, console),
        Command::Status(args) => commands::status::run(args, console),
        Command::Merge(args) => commands::merge::run(args, simd, console),
        Command::Localise(args) => commands::localise::run(args, simd, console),
        Command::Render(args) => commands::render::run(args, simd, console),
        Command::Mesh(args) => commands::mesh::run(args, simd, console),
        Command::Export(args) => commands::export::run(args, simd, console),
        Command::Report(args) => commands::report::run(args, simd, console),
        Command::View(args) => commands::view::run(args, simd, console),
        Command::Eval(EvalCommand::Trajectory(args)) => commands::eval_trajectory::run(args, simd, console),
        Command::Eval(EvalCommand::Images(args)) => commands::eval_images::run(args, simd, console),
        Command::Eval(EvalCommand::Mesh(args)) => commands::eval_mesh::run(args, console),
        Command::Completions(args) => commands::completions::run(args, console),
        Command::Man(args) => commands::man::run(args, console),
    }
}
