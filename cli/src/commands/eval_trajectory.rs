//! `mba eval trajectory`.

use std::path::Path;

use mba_mapper::dataset::survey;
use mba_mapper::evaluation::{
    BlurFigures, TrajectoryError, TrajectoryFigures, TrajectoryOptions, evaluate_blur, evaluate_trajectory,
};
use mba_mapper::run::mid_pose;
use mba_mapper::trajectory_file::{TimedExposure, TimedPose, has_exposures, read_exposures, read_trajectory};
use mba_tracker::SimdLevel;
use serde::Serialize;

use super::open;
use crate::args::EvalTrajectory;
use crate::console::Console;
use crate::failure::{OrBadInput, bad_input};
use crate::report::table;

/// Frames from which the median depth is taken.
const SAMPLED_FRAMES: usize = 16;

/// What is printed.
#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    trajectory: TrajectoryFigures,
    #[serde(skip_serializing_if = "Option::is_none")]
    blur: Option<BlurFigures>,
}

/// Compares two files and prints the figures.
///
/// # Errors
/// Bad input when a file is unreadable or the two do not belong together.
pub fn run(args: &EvalTrajectory, simd: SimdLevel, console: &Console) -> anyhow::Result<()> {
    let reference = Poses::read(&args.reference)?;
    let estimate = Poses::read(&args.estimate)?;
    let options = TrajectoryOptions { alignment: args.align.into(), max_dt: args.max_dt };
    let evaluation =
        evaluate_trajectory(&reference.trajectory, &estimate.trajectory, &options).map_err(|error| {
            let [reference, estimate] =
                [&args.reference, &args.estimate].map(|path| path.display().to_string());
            bad_input(format!("{estimate} against {reference}: {error}"), hint(&error))
        })?;
    let blur = blur_figures((args, simd), &reference, &estimate, console)?;
    let report = Report { trajectory: TrajectoryFigures::from(&evaluation), blur };
    console.result(&report, |report| {
        let mut text = table::trajectory(&report.trajectory);
        if let Some(blur) = &report.blur {
            text.push_str(&table::blur(blur));
        }
        text
    })
}

/// The blur figures when both files have exposures and the data set is known.
fn blur_figures(
    (args, simd): (&EvalTrajectory, SimdLevel),
    reference: &Poses,
    estimate: &Poses,
    console: &Console,
) -> anyhow::Result<Option<BlurFigures>> {
    let (reference, estimate, folder) = match (&reference.exposures, &estimate.exposures, &args.dataset) {
        (Some(reference), Some(estimate), Some(folder)) => (reference, estimate, folder),
        (Some(_), Some(_), None) => {
            console.note("note: give --dataset to get the blur figures of these exposures too");
            return Ok(None);
        }
        (_, _, Some(_)) => {
            return Err(bad_input(
                "--dataset is for exposures, but one of the files is a plain trajectory",
                "leave --dataset out, or compare groundtruth_exposure.txt with exposures.txt",
            ));
        }
        _ => return Ok(None),
    };
    let dataset = open::dataset(folder, simd)?;
    let depth = survey(&dataset, SAMPLED_FRAMES).median_depth.ok_or_else(|| {
        bad_input(format!("{} has no depth at all", folder.display()), "leave --dataset out")
    })?;
    let camera = &dataset.calibration().camera;
    Ok(Some(BlurFigures::from(&evaluate_blur(reference, estimate, args.max_dt, camera, depth))))
}

fn hint(error: &TrajectoryError) -> &'static str {
    match error {
        TrajectoryError::TooFewMatches { .. } => {
            "check that both files use the same clock, or raise --max-dt"
        }
        TrajectoryError::Alignment(_) => "use --align none, or compare a longer piece of trajectory",
        TrajectoryError::NotFinite => "check the files for nan and inf",
    }
}

/// A trajectory file of either kind.
struct Poses {
    trajectory: Vec<TimedPose>,
    exposures: Option<Vec<TimedExposure>>,
}

impl Poses {
    fn read(path: &Path) -> anyhow::Result<Self> {
        const HINT: &str = "a TUM trajectory has lines `timestamp tx ty tz qx qy qz qw`";
        if !has_exposures(path).or_bad_input(HINT)? {
            return Ok(Self { trajectory: read_trajectory(path).or_bad_input(HINT)?, exposures: None });
        }
        let exposures = read_exposures(path).or_bad_input(HINT)?;
        Ok(Self { trajectory: exposures.iter().map(mid_pose).collect(), exposures: Some(exposures) })
    }
}
