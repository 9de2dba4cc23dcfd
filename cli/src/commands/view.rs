//! `mba view`.

use std::path::Path;
use std::process::{Command, Stdio};

use mba_mapper::map::StoredMap;
use mba_tracker::SimdLevel;
use serde::Serialize;

use super::open;
use crate::args::View;
use crate::console::Console;
use crate::failure::bad_input;
use crate::report;
use crate::written_run::advise_report;

/// What is printed.
#[derive(Serialize)]
struct Written {
    page: String,
}

/// Writes the page with the viewer into a RUN folder, and opens it.
///
/// # Errors
/// Bad input when the folder is not a run or has no map of Gaussians; failure when the page cannot be written.
pub fn run(args: &View, simd: SimdLevel, console: &Console) -> anyhow::Result<()> {
    let run = open::run(&args.run)?;
    let folder = run.folder.display();
    let StoredMap::Gaussians(map) = open::map(&run)? else {
        let message = format!("the map of {folder} is a tri-plane field, which the viewer does not know");
        return Err(bad_input(message, "`mba mesh` makes a surface of it, `mba report` shows views of it"));
    };
    let Some(camera) = &run.summary.settings.camera else {
        return Err(bad_input(format!("{folder} does not tell its camera"), "make the run again"));
    };
    let dataset = open::dataset_if_there(&run, args.dataset.as_deref(), simd, console)?;
    let page =
        report::write_view(&run, (&map, camera), dataset.as_ref(), args.force).or_else(advise_report)?;
    if !args.no_open && !open_in_browser(&page) {
        console.note(format!("open {} in a browser", page.display()));
    }
    console.result(&Written { page: page.display().to_string() }, |written| format!("wrote {}", written.page))
}

/// Asks the desktop to show a page; whether there is one to ask.
fn open_in_browser(page: &Path) -> bool {
    let mut command = if cfg!(target_os = "macos") {
        Command::new("open")
    } else if cfg!(target_os = "windows") {
        Command::new("explorer")
    } else {
        // Without a display it would start a browser in the terminal.
        if std::env::var_os("DISPLAY").is_none() && std::env::var_os("WAYLAND_DISPLAY").is_none() {
            return false;
        }
        Command::new("xdg-open")
    };
    command.arg(page).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().is_ok()
}
