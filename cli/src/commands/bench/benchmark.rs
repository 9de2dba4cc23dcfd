//! Benchmarks: files that name sequences, and what has been published of them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use mba_mapper::FileError;
use mba_mapper::whole_file::read_text;
use serde::{Deserialize, Serialize};

/// Name of the mean over all sequences among published figures.
pub(super) const MEAN: &str = "mean";

/// Most sequences of a benchmark: each is a run.
const MOST_SEQUENCES: usize = 1000;

/// A benchmark as its file has it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Benchmark {
    /// What it is, in a line.
    pub(super) title: String,
    /// How figures are measured where that differs between publications.
    #[serde(default)]
    pub(super) notes: String,
    /// What is run.
    #[serde(default)]
    pub(super) of: BenchmarkedCommand,
    /// In the order of the table's columns.
    #[serde(rename = "sequence")]
    pub(super) sequences: Vec<BenchmarkSequence>,
    /// In the order of the table's rows.
    #[serde(default)]
    pub(super) published: Vec<PublishedFigures>,
}

/// What is run on the sequences of a benchmark.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum BenchmarkedCommand {
    /// The tracker alone.
    #[default]
    Track,
    /// Tracking and mapping.
    Slam,
}

/// A sequence of a benchmark.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BenchmarkSequence {
    /// What publications call it: letters, digits, `-`, `_` and `.`.
    pub(super) name: String,
    /// Folder of the data set, relative to where the benchmark's data lie.
    pub(super) dataset: PathBuf,
}

/// What has been published of one method, by name of the sequence or [`MEAN`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PublishedFigures {
    /// Name of the method.
    pub(super) method: String,
    /// Where the figures stand.
    pub(super) source: String,
    /// Root mean square of the absolute trajectory error, cm.
    #[serde(default)]
    pub(super) ate_cm: BTreeMap<String, f64>,
    /// Peak signal-to-noise ratio of rendered views against sharp images, dB.
    #[serde(default)]
    pub(super) psnr_db: BTreeMap<String, f64>,
    /// Structural similarity of the same.
    #[serde(default)]
    pub(super) ssim: BTreeMap<String, f64>,
}

/// A benchmark cannot be used.
#[derive(Debug, thiserror::Error)]
pub(super) enum BenchmarkError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file is no TOML.
    #[error("{path}, line {line}: {message}")]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What is wrong.
        message: String,
    },
    /// A key is missing or unknown, or what the file says makes no sense.
    #[error("{path}: {problem}")]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong, with names and values.
        problem: String,
    },
}

impl Benchmark {
    /// Reads a benchmark.
    ///
    /// # Errors
    /// See [`BenchmarkError`].
    pub(super) fn read(path: &Path) -> Result<Self, BenchmarkError> {
        let text = read_text(path)?;
        // By way of values of any kind: read as themselves, each structure would have a copy of the reader.
        let values: serde_json::Value = toml::from_str(&text).map_err(|error| {
            let before = text.get(..error.span().map_or(0, |span| span.start)).unwrap_or_default();
            let line = 1 + before.matches('\n').count();
            let message = error.message().replace('\n', ", ");
            BenchmarkError::Syntax { path: path.to_owned(), line, message }
        })?;
        let content = |problem| BenchmarkError::Content { path: path.to_owned(), problem };
        let benchmark: Self = serde_json::from_value(values).map_err(|error| content(error.to_string()))?;
        match benchmark.problem() {
            Some(problem) => Err(content(problem)),
            None => Ok(benchmark),
        }
    }

    /// What makes no sense, if anything.
    fn problem(&self) -> Option<String> {
        let count = self.sequences.len();
        if count == 0 || count > MOST_SEQUENCES {
            return Some(format!("it has {count} sequences, expected 1 to {MOST_SEQUENCES}"));
        }
        let mut names = BTreeSet::from([MEAN]);
        for BenchmarkSequence { name, .. } in &self.sequences {
            // A folder is named by it.
            let is_plain = |letter: char| letter.is_ascii_alphanumeric() || "-_.".contains(letter);
            if !name.chars().all(is_plain) || name.trim_matches('.').is_empty() {
                return Some(format!("a sequence is called {name:?}, expected letters, digits, - _ ."));
            }
            if !names.insert(name) {
                return Some(format!("two columns are called {name:?}"));
            }
        }
        self.published.iter().find_map(|published| published.problem(&names))
    }
}

impl PublishedFigures {
    fn problem(&self, names: &BTreeSet<&str>) -> Option<String> {
        let kinds = [("ate_cm", &self.ate_cm), ("psnr_db", &self.psnr_db), ("ssim", &self.ssim)];
        let mut figures =
            kinds.iter().flat_map(|(kind, figures)| figures.keys().map(move |name| (kind, name)));
        figures.find_map(|(kind, name)| {
            (!names.contains(name.as_str()))
                .then(|| format!("{:?} has {kind} of {name:?}, which is no sequence", self.method))
        })
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const GOOD: &str = "title = \"t\"\n[[sequence]]\nname = \"a\"\ndataset = \"folder/a\"\n\
                        [[published]]\nmethod = \"M\"\nsource = \"S\"\nate_cm = { a = 1.5, mean = 1.5 }\n";

    fn read(text: &str) -> Result<Benchmark, BenchmarkError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("b.toml");
        fs::write(&path, text).unwrap();
        Benchmark::read(&path)
    }

    #[test]
    fn what_is_in_the_file_is_read() {
        let benchmark = read(GOOD).unwrap();
        assert_eq!(benchmark.of, BenchmarkedCommand::Track);
        assert_eq!(benchmark.sequences[0].dataset, Path::new("folder/a"));
        assert_eq!(benchmark.published[0].ate_cm["a"], 1.5);
        assert_eq!(read(&format!("of = \"slam\"\n{GOOD}")).unwrap().of, BenchmarkedCommand::Slam);
    }

    #[test]
    fn what_makes_no_sense_is_named() {
        for (old, new, expected) in [
            ("title", "titel", "unknown field `titel`"),
            ("name = \"a\"", "name = \"../a\"", "called \"../a\""),
            ("name = \"a\"", "name = \"..\"", "called \"..\""),
            ("name = \"a\"", "name = \"mean\"", "two columns are called \"mean\""),
            ("{ a = 1.5", "{ b = 1.5", "\"M\" has ate_cm of \"b\", which is no sequence"),
            ("a = 1.5", "a = nan", "expected f64"),
            ("source = \"S\"\n", "", "missing field `source`"),
            ("a = 1.5", "a = 1.5.5", "line 8"),
        ] {
            let message = read(&GOOD.replacen(old, new, 1)).unwrap_err().to_string();
            assert!(message.contains(expected), "{expected:?} is missing in {message:?}");
        }
    }
}
