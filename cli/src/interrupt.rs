//! Ctrl-C and requests to end. A command that has something to save saves it after the first signal, and the second one
//! ends the process at once; where there is nothing to save the first one does.

use std::ffi::OsStr;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};

/// The signal that came first; 0 for none.
static FIRST: AtomicI32 = AtomicI32::new(0);

/// Whether a command is at work that looks at [`flow`] and saves what it has.
static SAVES: AtomicBool = AtomicBool::new(false);

/// Exit code of a process that a signal ended is this plus the signal's number, as in shells.
const SIGNAL_CODE: i32 = 128;

/// Starts to watch for signals. Until then they end the process without a word.
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
        let wait = move || signals.forever().for_each(receive);
        // For the same reason nothing is lost if there is no thread to be had.
        let _ = thread::Builder::new().name("signals".to_owned()).spawn(wait);
    });
}

/// Starts to watch for signals, where there are any.
#[cfg(not(unix))]
pub fn watch() {}

/// Does what a signal asks for.
#[cfg(unix)]
fn receive(signal: i32) {
    let is_first = FIRST.swap(signal, Ordering::SeqCst) == 0;
    if is_first && SAVES.load(Ordering::SeqCst) {
        eprintln!("stopping: what is there is being saved; once more to stop at once");
        return;
    }
    if is_first {
        eprintln!("error: stopped before there was anything to go on from");
        eprintln!("hint: {}", Resumption::Never.advice());
    }
    std::process::exit(SIGNAL_CODE + signal);
}

/// While this lives, the first signal does not end the process: whoever holds it looks at [`flow`].
#[derive(Debug)]
pub struct Saving(());

/// Begins work of which something can be saved.
#[must_use]
pub fn saving() -> Saving {
    SAVES.store(true, Ordering::SeqCst);
    Saving(())
}

impl Drop for Saving {
    fn drop(&mut self) {
        SAVES.store(false, Ordering::SeqCst);
    }
}

/// Whether to go on.
pub fn flow() -> ControlFlow<()> {
    if FIRST.load(Ordering::SeqCst) == 0 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
}

/// Asks what is at work in this process to stop, as Ctrl-C asks the program: for a program that calls its commands and has
/// signal handlers of its own. It holds until [`withdraw`] is called.
pub fn ask() {
    /// What Ctrl-C sends on every system.
    const INTERRUPT: i32 = 2;
    FIRST.store(INTERRUPT, Ordering::SeqCst);
}

/// Takes [`ask`] back.
pub fn withdraw() {
    FIRST.store(0, Ordering::SeqCst);
}

/// What unwinds a command that was given up.
#[derive(Debug)]
pub(crate) struct GivenUp;

/// Ends a command that has nothing to save and was asked to stop, by unwinding to whoever called it. In the program itself a
/// signal has ended the process before.
pub(crate) fn give_up_if_asked() {
    if flow().is_break() && !SAVES.load(Ordering::SeqCst) {
        std::panic::resume_unwind(Box::new(GivenUp));
    }
}

/// The exit code of a command that stopped because [`flow`] said so.
#[must_use]
pub fn exit_code() -> u8 {
    u8::try_from(SIGNAL_CODE + FIRST.load(Ordering::SeqCst)).unwrap_or(u8::MAX)
}

/// How a command that was stopped is gone on with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resumption {
    /// With `--resume`, which was given or not.
    Option(bool),
    /// By the same command: it always looks for what was done.
    Always,
    /// Not at all.
    Never,
}

impl Resumption {
    /// Whether to go on from what a stopped run left.
    #[must_use]
    pub fn resumes(self) -> bool {
        matches!(self, Self::Option(true) | Self::Always)
    }

    /// The command line of this process, for a shell, as advice how to go on.
    #[must_use]
    pub fn advice(self) -> String {
        const RESUME: &str = "--resume";
        let mut words: Vec<String> = std::env::args_os().skip(1).map(|word| quoted(&word)).collect();
        if matches!(self, Self::Option(_)) && !words.iter().any(|word| word == RESUME) {
            words.push(RESUME.to_owned());
        }
        let outcome = if self == Self::Never { "starts again" } else { "goes on" };
        format!("`mba {}` {outcome}", words.join(" "))
    }
}

/// A word as a shell reads it back.
fn quoted(word: &OsStr) -> String {
    let is_plain = |character: char| character.is_ascii_alphanumeric() || "-_./=:,+@%".contains(character);
    match word.to_str() {
        Some(word) if !word.is_empty() && word.chars().all(is_plain) => word.to_owned(),
        Some(word) => format!("'{}'", word.replace('\'', "'\\''")),
        // Bytes of another encoding cannot be printed; `$'...'` names them.
        None => {
            let of_byte = |byte: &u8| match byte {
                b' '..=b'~' if !b"'\\".contains(byte) => char::from(*byte).to_string(),
                other => format!("\\x{other:02x}"),
            };
            format!("$'{}'", word.as_encoded_bytes().iter().map(of_byte).collect::<String>())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_quoted_for_a_shell() {
        let quoted = |word: &str| super::quoted(word.as_ref());
        assert_eq!(quoted("../a/b-1.txt"), "../a/b-1.txt");
        assert_eq!(quoted("my run"), "'my run'");
        assert_eq!(quoted("it's"), "'it'\\''s'");
        assert_eq!(quoted(""), "''");
        assert_eq!(quoted("früh"), "'früh'");
    }

    #[cfg(unix)]
    #[test]
    fn words_in_other_encodings_are_named_byte_by_byte() {
        use std::os::unix::ffi::OsStrExt;
        assert_eq!(super::quoted(OsStr::from_bytes(b"fr\xfch it's")), "$'fr\\xfch it\\x27s'");
    }
}
