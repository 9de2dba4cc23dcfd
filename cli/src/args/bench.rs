//! Arguments of `mba bench`.

use std::path::PathBuf;

use clap::Args;

/// Arguments of `mba bench`.
#[derive(Debug, Args)]
#[command(after_help = "\
FILE names sequences and what has been published of them:

  title = \"ATE on my sequences\"
  of = \"track\"                      # or \"slam\"
  [[sequence]]
  name = \"desk\"
  dataset = \"recordings/desk\"
  [[published]]
  method = \"another one\"
  source = \"where its figures stand\"
  ate_cm = { desk = 1.7 }           # also psnr_db and ssim

DIR gets one RUN folder per sequence and repetition; runs whose folder is complete are not run again. Sequences that are \
not there are left out. docs/benchmarks/ has files for TUM RGB-D, Replica, ScanNet and ArchViz.

Examples:
  mba bench docs/benchmarks/tum.toml --data datasets --out tum
  mba bench docs/benchmarks/archviz.toml --data ArchViz --out archviz --repeats 5")]
pub struct Bench {
    /// Benchmark: sequences and published figures
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Folder that the data sets of FILE lie in; default: that of FILE
    #[arg(long, value_name = "DATA")]
    pub data: Option<PathBuf>,
    /// Folder for the runs
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Runs of each sequence, with focal lengths that differ by a ten-thousandth. The table has the middle of the runs, the
    /// least and the most
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=99))]
    pub repeats: u16,
}
