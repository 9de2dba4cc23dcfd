//! `mba eval mesh`.

use std::fmt::Write as _;
use std::path::Path;

use mba_mapper::evaluation::{
    MeshDepthFigures, SurfaceFigures, evaluate_mesh_depth, evaluate_surface, refine_by_icp,
};
use mba_mapper::mesh::{Mesh, read_mesh};
use mba_mapper::surfaces::sample_surface;
use mba_mapper::trajectory_file::{TimedPose, read_trajectory};
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use serde::Serialize;

use super::alignment::{AlignmentFigures, align};
use super::open;
use crate::args::surface::EvalMesh;
use crate::console::Console;
use crate::failure::{OrBadInput, bad_input};
use crate::report::table::{pairs, percent};

/// Neighbours for `--icp` are at most this far away, metres.
const ICP_REACH: f64 = 0.1;

/// Poses that `--views` takes of a trajectory at most.
const MOST_VIEWS: usize = 100;

/// Width and height of depth images, pixels.
const VIEW_SIZE: [usize; 2] = [320, 240];

/// Angle between the left and the right border of depth images, degrees.
const VIEW_ANGLE: f64 = 60.0;

/// Advice for files without a surface.
const EMPTY: &str = "give files with points or triangles";

/// What is printed.
#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    figures: SurfaceFigures,
    #[serde(skip_serializing_if = "Option::is_none")]
    depth: Option<MeshDepthFigures>,
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
/// Bad input when a file is unreadable or empty, or when `--views` cannot be made of one.
pub fn run(args: &EvalMesh, console: &Console) -> anyhow::Result<()> {
    let true_mesh = read(&args.reference)?;
    let mut estimate = read(&args.estimate)?;
    let views = args.views.as_deref().map(read_views).transpose()?;
    if views.is_some() {
        has_triangles(&args.reference, &true_mesh)?;
        has_triangles(&args.estimate, &estimate)?;
    }
    let reference = points(&args.reference, &true_mesh, args.samples)?;
    let sampled = |estimate: &Mesh| points(&args.estimate, estimate, args.samples);
    let alignment = match (&args.align, &args.trajectory) {
        (Some(file), Some(run)) => Some(align(&open::run(run)?, file, args.max_dt)?),
        _ => None,
    };
    if let Some(alignment) = &alignment {
        estimate.transform(&alignment.reference_from_estimate);
    }
    let mut icp = None;
    if args.icp {
        let refined = refine_by_icp(&reference, &sampled(&estimate)?, ICP_REACH);
        icp = Some(Motion::of(&refined, &estimate));
        estimate.transform(&refined);
    }
    let figures = evaluate_surface(&reference, &sampled(&estimate)?, &args.threshold_cm)
        .or_bad_content(&args.estimate, EMPTY)?;
    let depth = views.map(|views| depth(&args.reference, &true_mesh, &estimate, &views)).transpose()?;
    let report = Report { figures, depth, alignment: alignment.as_ref().map(AlignmentFigures::from), icp };
    console.result(&report, table)
}

fn read(path: &Path) -> anyhow::Result<Mesh> {
    read_mesh(path).or_bad_input("give a PLY file with vertices, such as `mba mesh` writes")
}

/// The poses of `--views`, evenly chosen if there are many.
fn read_views(path: &Path) -> anyhow::Result<Vec<RigidTransform>> {
    let poses = read_trajectory(path).or_bad_input("--views needs lines `timestamp tx ty tz qx qy qz qw`")?;
    if poses.is_empty() {
        let message = format!("{} holds no poses", path.display());
        return Err(bad_input(
            message,
            "--views needs a line `timestamp tx ty tz qx qy qz qw` for every pose",
        ));
    }
    Ok(evenly(&poses, MOST_VIEWS).map(|pose| pose.world_from_camera).collect())
}

/// At most `most` poses, those in the middle of equally long parts.
fn evenly(poses: &[TimedPose], most: usize) -> impl Iterator<Item = &TimedPose> {
    let count = poses.len().min(most);
    (0..count).map(move |part| &poses[(2 * part + 1) * poses.len() / (2 * count)])
}

fn has_triangles(path: &Path, mesh: &Mesh) -> anyhow::Result<()> {
    if mesh.triangles.is_empty() {
        let message = format!("{} has no triangles, of which depth images are made", path.display());
        return Err(bad_input(message, "give meshes, or leave --views out for clouds of points"));
    }
    Ok(())
}

fn depth(
    file: &Path,
    reference: &Mesh,
    estimate: &Mesh,
    views: &[RigidTransform],
) -> anyhow::Result<MeshDepthFigures> {
    let [width, height] = VIEW_SIZE;
    let focal = 0.5 * width as f64 / (0.5 * VIEW_ANGLE.to_radians()).tan();
    let [cx, cy] = VIEW_SIZE.map(|length| 0.5 * (length as f64 - 1.0));
    let camera = PinholeCamera { width, height, fx: focal, fy: focal, cx, cy };
    evaluate_mesh_depth(reference, estimate, &camera, views).or_bad_content(
        file,
        "--views needs camera-to-world poses in the frame of the reference, e.g. the ground truth",
    )
}

/// Points on the surface of a file.
fn points(path: &Path, mesh: &Mesh, samples: u32) -> anyhow::Result<Vec<[f32; 3]>> {
    let points = sample_surface(mesh, samples as usize);
    if points.is_empty() {
        return Err(bad_input(
            format!("{} has no surface: there are no points on it", path.display()),
            EMPTY,
        ));
    }
    Ok(points)
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
    rows.extend(report.depth.as_ref().map(|depth| ("depth L1", depth_text(depth))));
    rows.extend(report.alignment.as_ref().map(AlignmentFigures::row));
    rows.extend(report.icp.as_ref().map(|motion| {
        ("moved by ICP", format!("{:.2} deg and {:.2} cm", motion.rotation_deg, motion.translation_cm))
    }));
    text + &pairs(&rows)
}

fn depth_text(depth: &MeshDepthFigures) -> String {
    let l1 = depth.l1_cm.map_or_else(|| String::from("none"), |l1| format!("{l1:.2} cm"));
    format!("{l1} over {} of the reference in {} views", percent(depth.covered_share), depth.views)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_are_chosen_evenly() {
        let pose =
            |k: u32| TimedPose { timestamp: f64::from(k), world_from_camera: RigidTransform::identity() };
        let poses: Vec<TimedPose> = (0..10).map(pose).collect();
        let chosen = |most: usize| -> Vec<f64> { evenly(&poses, most).map(|pose| pose.timestamp).collect() };
        // The middles of [0, 3.3), [3.3, 6.7) and [6.7, 10).
        assert_eq!(chosen(3), [1.0, 5.0, 8.0]);
        assert_eq!(chosen(9).len(), 9);
        assert_eq!(chosen(100), (0..10).map(f64::from).collect::<Vec<_>>());
        assert_eq!(evenly(&[], 3).count(), 0);
    }
}
