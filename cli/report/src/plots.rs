//! The charts of a run.

use mba_mapper::run::Run;
use mba_tracker::geometry::RigidTransform;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use super::chart::{ALARM, Chart, ESTIMATE, Series, Stroke, TRUTH};
use super::view::RunView;

/// One chart with the name of its file.
#[derive(Clone, Debug)]
pub struct Plot {
    /// File name without extension.
    pub name: &'static str,
    /// SVG document.
    pub svg: String,
}

/// All charts for which the run has data.
///
/// # Errors
/// When the drawing library fails.
pub fn plots(run: &Run, view: &RunView) -> anyhow::Result<Vec<Plot>> {
    let [top, side] = trajectory(view);
    let charts = [
        ("trajectory_top", top),
        ("trajectory_side", side),
        ("error", error(view)),
        ("blur", blur(view)),
        ("time", time(run, view)),
    ];
    let mut plots = Vec::new();
    for (name, chart) in charts {
        if let Some(svg) = chart.to_svg()? {
            plots.push(Plot { name, svg });
        }
    }
    Ok(plots)
}

/// Top view and side view. "Up" is where the camera's upper edge points on average, "along" the horizontal direction
/// in which it travels farthest.
fn trajectory(view: &RunView) -> [Chart; 2] {
    let positions: Vec<Vector3<f64>> = view.estimate.iter().map(|pose| pose.translation).collect();
    let origin = positions.first().copied().unwrap_or_default();
    let up = up_direction(&view.estimate);
    let along = main_horizontal_direction(&positions, &up);
    let across = up.cross(&along);
    let map = |title: &str, y_label: &str, vertical: Vector3<f64>| {
        let project = |p: &Vector3<f64>| (along.dot(&(p - origin)), vertical.dot(&(p - origin)));
        let mut series = Vec::new();
        if !view.truth.is_empty() {
            series.push(line("ground truth", view.truth.iter().map(project).collect(), TRUTH, 4));
        }
        series.push(line("estimate", positions.iter().map(project).collect(), ESTIMATE, 2));
        if !view.lost.is_empty() {
            let lost = view.lost.iter().map(|(_, k)| project(&positions[*k])).collect();
            series.push(dots("lost", lost));
        }
        Chart {
            title: title.into(),
            x_label: "along [m]".into(),
            y_label: y_label.into(),
            series,
            is_map: true,
        }
    };
    [map("Trajectory from above", "across [m]", across), map("Trajectory from the side", "up [m]", up)]
}

fn error(view: &RunView) -> Chart {
    let centimetres = view.errors.iter().map(|(t, metres)| (*t, 100.0 * metres)).collect();
    over_time("Position error", "error [cm]", vec![line("error", centimetres, ESTIMATE, 2)])
}

fn blur(view: &RunView) -> Chart {
    let mut series = Vec::new();
    if !view.true_blur.is_empty() {
        series.push(line("ground truth", view.true_blur.clone(), TRUTH, 4));
    }
    series.push(line("estimate", view.blur.clone(), ESTIMATE, 2));
    if !view.lost.is_empty() {
        series.push(dots("lost", view.lost.iter().map(|(t, _)| (*t, 0.0)).collect()));
    }
    over_time("Blur length", "blur [px]", series)
}

fn time(run: &Run, view: &RunView) -> Chart {
    let mut series = vec![line("per frame", view.milliseconds.clone(), ESTIMATE, 2)];
    let limit = 1e3 / run.summary.settings.frame_rate;
    if let (Some(first), Some(last), true) =
        (view.milliseconds.first(), view.milliseconds.last(), limit.is_finite())
    {
        series.push(line("real time", vec![(first.0, limit), (last.0, limit)], ALARM, 2));
    }
    over_time("Tracking time", "time [ms]", series)
}

fn over_time(title: &str, y_label: &str, series: Vec<Series>) -> Chart {
    Chart { title: title.into(), x_label: "time [s]".into(), y_label: y_label.into(), series, is_map: false }
}

fn line(label: &str, points: Vec<(f64, f64)>, colour: plotters::style::RGBColor, width: u32) -> Series {
    Series { label: label.into(), points, colour, stroke: Stroke::Line(width) }
}

fn dots(label: &str, points: Vec<(f64, f64)>) -> Series {
    Series { label: label.into(), points, colour: ALARM, stroke: Stroke::Dots(4) }
}

/// The mean of the cameras' upward axes; the world's z where they cancel.
fn up_direction(world_from_camera: &[RigidTransform]) -> Vector3<f64> {
    let sum: Vector3<f64> = world_from_camera.iter().map(|pose| pose.rotation * -Vector3::y()).sum();
    sum.try_normalize(0.1).unwrap_or_else(Vector3::z)
}

/// The horizontal direction of largest spread.
fn main_horizontal_direction(positions: &[Vector3<f64>], up: &Vector3<f64>) -> Vector3<f64> {
    let mean = positions.iter().sum::<Vector3<f64>>() / positions.len().max(1) as f64;
    let horizontal = |p: &Vector3<f64>| {
        let d = p - mean;
        d - up * up.dot(&d)
    };
    let spread: Matrix3<f64> = positions.iter().map(|p| horizontal(p) * horizontal(p).transpose()).sum();
    let eigen = SymmetricEigen::new(spread);
    let along: Vector3<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
    let horizontal = along - up * up.dot(&along);
    // A camera that does not move has no main direction; any horizontal one will do.
    let any = if up.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    horizontal.try_normalize(1e-6).unwrap_or_else(|| (any - up * up.dot(&any)).normalize())
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    #[test]
    fn views_follow_the_camera_not_the_world_axes() {
        // A camera that looks along the world's x with its upper edge along the world's z, as on a table.
        let r = Matrix3::from_columns(&[-Vector3::y(), -Vector3::z(), Vector3::x()]);
        let rotation = UnitQuaternion::from_matrix(&r);
        let poses =
            [0.0, 1.0, 2.0].map(|x| RigidTransform::new(rotation, Vector3::new(x, 0.1 * x, 0.02 * x * x)));
        let up = up_direction(&poses);
        assert!((up - Vector3::z()).norm() < 1e-9);
        let along = main_horizontal_direction(&poses.map(|pose| pose.translation), &up);
        assert!((along.dot(&Vector3::new(1.0, 0.1, 0.0).normalize()).abs() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_still_camera_has_a_horizontal_direction_too() {
        let along = main_horizontal_direction(&[Vector3::zeros(); 4], &Vector3::x());
        assert!((along.norm() - 1.0).abs() < 1e-12 && along.x.abs() < 1e-12);
    }
}
