//! The commands as a program calls them.

use std::ffi::OsString;
use std::sync::Arc;

use mba_cli::console::Listener;
use mba_cli::embedded::call;
use mba_cli::failure::{BAD_INPUT, Interrupted, causes, exit_code};
use mba_cli::interrupt;

fn call_with(words: &[&str]) -> (anyhow::Result<()>, Arc<Listener>) {
    let listener = Arc::new(Listener::default());
    let arguments = std::iter::once("mba").chain(words.iter().copied()).map(OsString::from);
    (call(arguments, &listener), listener)
}

/// One test, as what is asked for holds for the whole process.
#[test]
fn figures_are_heard_and_what_has_nothing_to_save_is_given_up() {
    let place = tempfile::tempdir().unwrap();
    let [first, second] = ["first", "second"].map(|name| place.path().join(name).display().to_string());
    let small = ["--frames", "3", "--size", "64x48", "--blur", "1"];
    let synth = |out: &str| call_with(&[&["synth", "--out", out], &small[..]].concat());

    let (outcome, listener) = synth(&first);
    outcome.unwrap();
    let figures: serde_json::Value = serde_json::from_str(&listener.take().result.unwrap()).unwrap();
    assert_eq!(figures["frames"], 3);
    assert_eq!(listener.standing().share(), 1.0);

    interrupt::ask();
    let (outcome, listener) = synth(&second);
    interrupt::withdraw();
    assert!(outcome.unwrap_err().is::<Interrupted>());
    assert!(listener.take().result.is_none());

    let error = call_with(&["track", "data", "--out", "run", "--virtual-views", "0"]).0.unwrap_err();
    assert_eq!(exit_code(&error), BAD_INPUT);
    assert!(causes(&error).starts_with("invalid value '0' for '--virtual-views <N>'"), "{}", causes(&error));
    let error = call_with(&["track"]).0.unwrap_err();
    assert!(
        causes(&error).contains("--out <RUN>") && !causes(&error).contains("Usage"),
        "{}",
        causes(&error)
    );
}
