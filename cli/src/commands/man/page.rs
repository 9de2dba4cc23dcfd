//! The man page of one command, from what its `--help` says.

use clap::Command;
use clap_mangen::Man;
use clap_mangen::roff::{Roff, bold, roman};

/// Section of the manual: commands of users.
const SECTION: &str = "1";

/// Name of the program, whose page the others refer to.
const PROGRAM: &str = "mba";

/// What stands above every page.
const MANUAL: &str = "Motion-blur-aware RGB-D SLAM";

/// Lines that begin the examples of a help text.
const EXAMPLES: [&str; 2] = ["Example:", "Examples:"];

/// What a line of an example, and one of a table, begins with.
const INDENT: &str = "  ";

/// Name of a command's file.
pub(super) fn file_name(command: &Command) -> String {
    format!("{}.{SECTION}", whole_name(command))
}

/// Name with those of the commands above, such as `mba-eval-images`.
fn whole_name(command: &Command) -> &str {
    command.get_display_name().unwrap_or_else(|| command.get_name())
}

/// The page in the language of troff, of a command that is built.
pub(super) fn of(command: &Command) -> anyhow::Result<String> {
    let man = Man::new(command.clone());
    let mut bytes = title(command).into_bytes();
    man.render_name_section(&mut bytes)?;
    synopsis(command).to_writer(&mut bytes)?;
    let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    let (notes, calls) = parts(&help);
    if notes.is_empty() {
        man.render_description_section(&mut bytes)?;
    } else {
        description(&notes).to_writer(&mut bytes)?;
    }
    man.render_options_section(&mut bytes)?;
    if command.has_subcommands() {
        man.render_subcommands_section(&mut bytes)?;
    }
    examples(&calls).to_writer(&mut bytes)?;
    if whole_name(command) != PROGRAM {
        see_also().to_writer(&mut bytes)?;
    }
    Ok(String::from_utf8(bytes)?)
}

/// What stands above and below the text. There is no date: equal programs write equal pages.
fn title(command: &Command) -> String {
    let (name, version) = (whole_name(command), env!("CARGO_PKG_VERSION"));
    format!(".TH {name} {SECTION} \"\" \"{PROGRAM} {version}\" \"{MANUAL}\"\n")
}

/// The call as `--help` says it.
fn synopsis(command: &Command) -> Roff {
    let usage = command.clone().render_usage().to_string();
    let mut roff = Roff::new();
    roff.control("SH", ["SYNOPSIS"]);
    for call in usage.trim_start_matches("Usage:").lines() {
        roff.control("PP", []);
        roff.text([roman(call.trim())]);
    }
    roff
}

/// The lines of a help text before and after the word that begins the examples.
fn parts(help: &str) -> (Vec<&str>, Vec<&str>) {
    let mut lines = help.lines();
    let notes = lines.by_ref().take_while(|line| !EXAMPLES.contains(line)).collect();
    (notes, lines.collect())
}

/// Paragraphs, with tables as lists of terms.
fn description(lines: &[&str]) -> Roff {
    let mut roff = Roff::new();
    roff.control("SH", ["DESCRIPTION"]);
    let mut is_in_table = false;
    for line in lines {
        match term(line) {
            Some((term, meaning)) => {
                roff.control("TP", []);
                roff.text([bold(term)]);
                roff.text([roman(meaning)]);
                is_in_table = true;
            }
            None if line.is_empty() || is_in_table => {
                roff.control("PP", []);
                if !line.is_empty() {
                    roff.text([roman(*line)]);
                }
                is_in_table = false;
            }
            None => {
                roff.text([roman(*line)]);
            }
        }
    }
    roff
}

/// The two columns of a line in a table, which is indented.
fn term(line: &str) -> Option<(&str, &str)> {
    let (term, meaning) = line.strip_prefix(INDENT)?.split_once(INDENT)?;
    Some((term, meaning.trim_start()))
}

/// Calls, each in a line of its own.
fn examples(lines: &[&str]) -> Roff {
    let mut roff = Roff::new();
    if lines.is_empty() {
        return roff;
    }
    roff.control("SH", ["EXAMPLES"]);
    roff.control("nf", []);
    for line in lines {
        roff.text([roman(line.strip_prefix(INDENT).unwrap_or(line))]);
    }
    roff.control("fi", []);
    roff
}

fn see_also() -> Roff {
    let mut roff = Roff::new();
    roff.control("SH", ["SEE ALSO"]);
    roff.text([bold(PROGRAM), roman(format!("({SECTION})"))]);
    roff
}
