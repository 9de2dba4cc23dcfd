//! Ctrl-C and requests to end: the first one is noted, so that a command can save what it has; the second one ends the
//! process at once.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicI32, Ordering};

/// The signal that came first; 0 for none.
static FIRST: AtomicI32 = AtomicI32::new(0);

/// Exit code of a process that a signal ended is this plus the signal's number, as in shells.
const SIGNAL_CODE: i32 = 128;

/// Starts to watch for signals. Until then they end the process at once.
#[cfg(unix)]
pub fn watch() {
    use std::sync::Once;
    use std::thread;

    use signal_hook::consts::{SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;

    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // Without a watcher signals end the process at once, as everywhere else.
        let Ok(mut signals) = Signals::new([SIGINT, SIGTERM]) else { return };
        let wait = move || {
            for signal in signals.forever() {
                if FIRST.swap(signal, Ordering::SeqCst) != 0 {
                    std::process::exit(SIGNAL_CODE + signal);
                }
                eprintln!("stopping: what is there is being saved; once more to stop at once");
            }
        };
        // For the same reason nothing is lost if there is no thread to be had.
        let _ = thread::Builder::new().name("signals".to_owned()).spawn(wait);
    });
}

/// Starts to watch for signals, where there are any.
#[cfg(not(unix))]
pub fn watch() {}

/// Whether to go on.
pub fn flow() -> ControlFlow<()> {
    if FIRST.load(Ordering::SeqCst) == 0 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
}

/// The exit code of a command that stopped because [`flow`] said so.
#[must_use]
pub fn exit_code() -> u8 {
    u8::try_from(SIGNAL_CODE + FIRST.load(Ordering::SeqCst)).unwrap_or(u8::MAX)
}

/// The command line of this process with `--resume`, for a shell.
#[must_use]
pub fn command_to_go_on(resumes: bool) -> String {
    const RESUME: &str = "--resume";
    let mut words: Vec<String> =
        std::env::args_os().skip(1).map(|word| quoted(&word.to_string_lossy())).collect();
    if resumes && !words.iter().any(|word| word == RESUME) {
        words.push(RESUME.to_owned());
    }
    format!("mba {}", words.join(" "))
}

/// A word as a POSIX shell reads it back.
fn quoted(word: &str) -> String {
    let is_plain = |character: char| character.is_ascii_alphanumeric() || "-_./=:,+@%".contains(character);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_quoted_for_a_shell() {
        assert_eq!(quoted("../a/b-1.txt"), "../a/b-1.txt");
        assert_eq!(quoted("my run"), "'my run'");
        assert_eq!(quoted("it's"), "'it'\\''s'");
        assert_eq!(quoted(""), "''");
    }
}
