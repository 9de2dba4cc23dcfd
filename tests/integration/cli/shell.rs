//! Completions and man pages, read by what they are made for.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use super::mba;

/// Runs another program on `input`; none, said on stderr, where the machine lacks it.
fn other(program: &str, arguments: &[&str], input: &str) -> Option<Output> {
    use std::io::Write;
    let mut command = Command::new(program);
    command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let Ok(mut child) = command.spawn() else {
        eprintln!("skipped: there is no {program}");
        return None;
    };
    child.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
    Some(child.wait_with_output().unwrap())
}

/// Names of the commands as the help lists them, without `help`.
fn commands() -> Vec<String> {
    let help = mba(["--help"]).stdout;
    let (_, listed) = help.split_once("Commands:\n").unwrap();
    let names = listed.lines().take_while(|line| !line.is_empty()).filter_map(|line| {
        let line = line.strip_prefix("  ").filter(|line| !line.starts_with(' '))?;
        line.split(' ').next().map(str::to_owned)
    });
    names.filter(|name| name != "help").collect()
}

#[test]
fn completions_know_every_command() {
    for shell in ["bash", "zsh", "fish"] {
        let script = mba(["completions", shell]);
        assert_eq!((script.code, script.stderr.as_str()), (Some(0), ""));
        for command in commands() {
            assert!(script.stdout.contains(&command), "{command} is missing for {shell}");
        }
        if let Some(checked) = other(shell, &["-n"], &script.stdout) {
            assert!(checked.status.success(), "{shell}: {}", String::from_utf8_lossy(&checked.stderr));
        }
    }
    assert_eq!(mba(["completions", "csh"]).code, Some(2));
}

#[test]
fn bash_completes_commands_options_and_values() {
    let script = mba(["completions", "bash"]).stdout;
    for (words, expected) in [
        (vec!["mba", "tr"], vec!["track"]),
        (vec!["mba", "eval", "tra"], vec!["trajectory"]),
        (vec!["mba", "track", "data", "--virt"], vec!["--virtual-views"]),
        (vec!["mba", "export", "run", "--to", "k"], vec!["kitti"]),
        (vec!["mba", "completions", ""], vec!["bash", "zsh", "fish"]),
    ] {
        let (last, before) = (words[words.len() - 1], words[words.len() - 2]);
        let ask = format!(
            "\nCOMP_WORDS=({})\nCOMP_CWORD={}\n_mba mba '{last}' '{before}'\nprintf '%s\\n' \"${{COMPREPLY[@]}}\"\n",
            words.iter().map(|word| format!("'{word}' ")).collect::<String>(),
            words.len() - 1
        );
        let Some(answer) = other("bash", &["--norc", "-s"], &(script.clone() + &ask)) else { return };
        let answer = String::from_utf8(answer.stdout).unwrap();
        let found: Vec<&str> = answer.split_whitespace().collect();
        // After a value that is asked for, options of the command are of no use but may come, too.
        assert!(expected.iter().all(|word| found.contains(word)), "{words:?}: {answer}");
        assert!(last.is_empty() || found.len() == expected.len(), "{words:?}: {answer}");
    }
}

/// The pages in a folder by name.
fn pages(folder: &Path) -> BTreeMap<String, String> {
    let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let pages = files.filter(|path| path.extension().is_some_and(|extension| extension == "1"));
    pages
        .map(|path| {
            let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
            (name, fs::read_to_string(&path).unwrap())
        })
        .collect()
}

#[test]
fn every_command_has_a_man_page_with_an_example() {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("man1");
    // Twice: earlier pages are replaced.
    for _ in 0..2 {
        let written = mba(["man", "--json", "--out", out.to_str().unwrap()]).json();
        assert_eq!(written["pages"].as_array().unwrap().len(), pages(&out).len());
    }
    let pages = pages(&out);
    for command in commands() {
        assert!(pages.contains_key(&format!("mba-{command}")), "{command} has no page");
    }
    assert!(pages.contains_key("mba") && pages.contains_key("mba-eval-images"));
    for (name, page) in &pages {
        for section in ["NAME", "SYNOPSIS", "DESCRIPTION"] {
            assert!(page.contains(&format!(".SH {section}\n")), "{name} has no {section}");
        }
        let call = name.replace('-', " ");
        let is_group = ["mba", "mba eval"].contains(&call.as_str());
        let examples = page.split_once(".SH EXAMPLES\n").map_or("", |(_, examples)| examples);
        assert!(is_group || examples.contains(&call), "{name} has no example");
    }
}

#[test]
fn pages_are_read_without_a_warning_and_say_what_the_help_says() {
    let place = tempfile::tempdir().unwrap();
    mba(["man", "--out", place.path().join("man1").to_str().unwrap()]);
    for (name, page) in pages(&place.path().join("man1")) {
        // Without hyphens at the ends of lines.
        let asked = ["-man", "-rHY=0", "-Tutf8", "-ww", "-P-bcou"];
        let Some(shown) = other("groff", &asked, &page) else { return };
        let errors = String::from_utf8(shown.stderr).unwrap();
        assert!(shown.status.success() && errors.is_empty(), "{name}: {errors}");
        let words = |text: &str| -> Vec<String> {
            // Titles have capitals, and hyphens and quotes are those of a printer.
            let words = text.split(|letter: char| !letter.is_alphanumeric());
            words.filter(|word| !word.is_empty()).map(str::to_lowercase).collect()
        };
        let call: Vec<String> = name.split('-').skip(1).map(str::to_owned).collect();
        let help = mba(call.iter().map(String::as_str).chain(["--help"])).stdout;
        let shown = words(&String::from_utf8(shown.stdout).unwrap());
        // Usage is said in another form.
        let (_, options) = help.split_once("Options").unwrap();
        let options = options.replace("\nExample:", "\nExamples:");
        let missing: Vec<String> = words(&options).into_iter().filter(|word| !shown.contains(word)).collect();
        assert!(missing.is_empty(), "{name} lacks {missing:?}");
    }
}

#[test]
fn a_single_page_goes_to_the_standard_output() {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("man1");
    mba(["man", "--out", out.to_str().unwrap()]);
    let page = mba(["man", "eval", "images"]).stdout;
    assert_eq!(page, fs::read_to_string(out.join("mba-eval-images.1")).unwrap());
    assert!(mba(["man"]).stdout.contains("mba\\-eval(1)"));
    mba(["man", "dance"]).assert_error(2, &["no command `mba dance`"]);
}

#[test]
fn folders_of_others_are_left_alone_unless_forced() {
    let place = tempfile::tempdir().unwrap();
    let (other, out) = (place.path().join("ls.1"), place.path().to_str().unwrap());
    fs::write(&other, "mine").unwrap();
    mba(["man", "--out", out]).assert_error(2, &["ls.1"]);
    assert_eq!(mba(["man", "--out", out, "--force"]).code, Some(0));
    assert_eq!(fs::read_to_string(other).unwrap(), "mine");
    assert!(place.path().join("mba-track.1").is_file());
}
