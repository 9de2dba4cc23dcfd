//! `mba eval mesh`.

use std::fmt::Write as _;
use std::path::Path;

use mba_mapper::evaluation::{SurfaceFigures, evaluate_surface, refine_by_icp};
use mba_mapper::surfaces::{Mesh, read_mesh, sample_surface};
use mba_tracker::geometry::RigidTransform;
use serde::Serialize;

use super::alignment::{AlignmentFigures, align};
use super::open;
use crate::args::surface::EvalMesh;
use crate::console::Console;
use crate::failure::OrBadInput;
use crate::report::table::{pairs, percent};

/// Neighbours for `--icp` are at most this far away, metres.
const ICP_REACH: f64 = 0.1;

/// What is printed.
#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    figures: SurfaceFigures,
    #[serde(skip_serializing_if = "Option::is_none")]
    alignment: Option<AlignmentFigures>,
    #[serde(skip_serializing_if = "Option::is_none")]
    icp: Option<Motion>,
}

/// How far `--icp` has moved the estimate.
#[derive(Serialize)]
struct Motion {
    rotation_deg: f64,
    /// Of the middle of the estimate.
    translation_cm: f64,
}

/// Compares two surfaces and prints the figures.
///
/// # Errors
/// Bad input when a file is unreadable or empty.
pub fn run(args: &EvalMesh, console: &Console) -> anyhow::Result<()> {
    let reference = points(&read(&args.reference)?, args.samples);
    let mut estimate = read(&args.estimate)?;
    let alignment = match (&args.align, &args.trajectory) {
        (Some(file), Some(run)) => Some(align(&open::run(run)?, file, args.max_dt)?),
        _ => None,
    };
    if let Some(alignment) = &alignment {
        estimate.transform(&alignment.reference_from_estimate);
    }
    let icp = args.icp.then(|| {
        let refined = refine_by_icp(&reference, &points(&estimate, args.samples), ICP_REACH);
        let motion = Motion::of(&refined, &estimate);
        estimate.transform(&refined);
        motion
    });
    let figures = evaluate_surface(&reference, &points(&estimate, args.samples), &args.threshold_cm)
        .or_bad_input("give files with points or triangles")?;
    let report = Report { figures, alignment: alignment.as_ref().map(AlignmentFigures::from), icp };
    console.result(&report, table)
}

fn read(path: &Path) -> anyhow::Result<Mesh> {
    read_mesh(path).or_bad_input("give a PLY file with vertices, such as `mba mesh` writes")
}

fn points(mesh: &Mesh, samples: u32) -> Vec<[f32; 3]> {
    sample_surface(mesh, samples as usize)
}

impl Motion {
    fn of(motion: &RigidTransform, mesh: &Mesh) -> Self {
        let sum = |axis: usize| mesh.vertices.iter().map(|vertex| f64::from(vertex[axis])).sum::<f64>();
        let middle = nalgebra::Vector3::from_fn(|axis, _| sum(axis) / mesh.vertices.len().max(1) as f64);
        Self {
            rotation_deg: motion.rotation.angle().to_degrees(),
            translation_cm: 100.0 * (motion.transform_point(&middle) - middle).norm(),
        }
    }
}

fn table(report: &Report) -> String {
    let SurfaceFigures { reference_points, estimate_points, accuracy_cm, completion_cm, .. } =
        &report.figures;
    let mut text = format!("{:24}{:>12}{:>12}{:>12}\n", "within", "precision", "recall", "F1");
    for at in &report.figures.thresholds {
        let [precision, recall, f1] = [at.precision, at.recall, at.f1].map(percent);
        let distance = format!("{} cm", at.threshold_cm);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{distance:24}{precision:>12}{recall:>12}{f1:>12}");
    }
    let spread = |mean: f64, median: f64| format!("mean {mean:.2} cm, median {median:.2} cm");
    let mut rows = vec![
        ("accuracy", spread(accuracy_cm.mean, accuracy_cm.median)),
        ("completion", spread(completion_cm.mean, completion_cm.median)),
        ("points", format!("{estimate_points} against {reference_points} of the reference")),
        ("reference spacing", format!("median {:.2} cm", report.figures.reference_spacing_cm)),
    ];
    rows.extend(report.alignment.as_ref().map(AlignmentFigures::row));
    rows.extend(report.icp.as_ref().map(|motion| {
        ("moved by ICP", format!("{:.2} deg and {:.2} cm", motion.rotation_deg, motion.translation_cm))
    }));
    text + &pairs(&rows)
}
