//! Arguments of `mba completions` and `mba man`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

/// Arguments of `mba completions`.
#[derive(Debug, Args)]
#[command(after_help = "\
The script goes to the standard output. Shells look for it in these files:

  bash  ~/.local/share/bash-completion/completions/mba
  zsh   _mba in a folder of $fpath
  fish  ~/.config/fish/completions/mba.fish

Examples:
  mba completions bash > ~/.local/share/bash-completion/completions/mba
  mba completions zsh > ~/.zfunc/_mba
  mba completions fish > ~/.config/fish/completions/mba.fish")]
pub struct Completions {
    /// Shell that completes commands, options and their values
    #[arg(value_enum, value_name = "SHELL")]
    pub shell: Shell,
}

/// Shells with completions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Shell {
    /// Bash, with the package bash-completion
    Bash,
    /// Z shell
    Zsh,
    /// Friendly interactive shell
    Fish,
}

/// Arguments of `mba man`.
#[derive(Debug, Args)]
#[command(after_help = "\
Without --out the page of COMMAND goes to the standard output, or that of the program itself. A page says what --help says.

Examples:
  mba man --out ~/.local/share/man/man1 --force
  mba man track | man -l -
  mba man eval trajectory > mba-eval-trajectory.1")]
pub struct Man {
    /// Command whose page is printed; default: the program
    #[arg(value_name = "COMMAND", conflicts_with = "out")]
    pub command: Vec<String>,
    /// Folder for the pages of all commands, such as man1; earlier pages in it are replaced
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Write also into a folder with files of others, and over pages that this program did not write
    #[arg(long, requires = "out")]
    pub force: bool,
}
