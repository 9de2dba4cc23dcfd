//! How this program starts itself.

use std::ffi::OsString;
use std::io;
use std::process::Command;
use std::sync::OnceLock;

/// The words of a shell that start the program; none where it is the executable of this process.
static WORDS: OnceLock<Vec<OsString>> = OnceLock::new();

/// Says with which words the program starts, for one that runs inside another, such as an interpreter. The first call counts.
pub fn starts_with(words: Vec<OsString>) {
    let _ = WORDS.set(words);
}

/// The program, without arguments.
///
/// # Errors
/// When the system does not tell the executable of this process.
pub(crate) fn command() -> io::Result<Command> {
    match WORDS.get().and_then(|words| words.split_first()) {
        Some((program, arguments)) => {
            let mut command = Command::new(program);
            command.args(arguments);
            Ok(command)
        }
        None => Ok(Command::new(std::env::current_exe()?)),
    }
}
