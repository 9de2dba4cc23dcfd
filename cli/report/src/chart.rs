//! Line charts as SVG text.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::prelude::*;

/// Width and height of a chart in its own units; on a telephone it is shown at about two thirds of this size.
const SIZE: (u32, u32) = (580, 360);
const MARGIN: u32 = 10;
const LEFT_LABELS: u32 = 66;
const BOTTOM_LABELS: u32 = 42;
const TITLE_HEIGHT: u32 = 30;
const FONT: &str = "sans-serif";

/// Stand-in for the text colour of the page, replaced by `currentColor` in the finished text so that one chart serves
/// light and dark pages.
const INK: RGBColor = RGBColor(1, 2, 3);
const INK_IN_SVG: &str = "#010203";

/// The estimate.
pub(super) const ESTIMATE: RGBColor = RGBColor(52, 120, 246);
/// The truth.
pub(super) const TRUTH: RGBColor = RGBColor(234, 148, 20);
/// What is bad: lost frames, the border of real time.
pub(super) const ALARM: RGBColor = RGBColor(220, 50, 60);

/// How the points of a series are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Stroke {
    /// A line of this width; it is interrupted where a point is not finite.
    Line(u32),
    /// A disc of this radius at every point.
    Dots(u32),
}

/// Points with a name.
#[derive(Clone, Debug)]
pub(super) struct Series {
    /// Name in the legend.
    pub(super) label: String,
    /// (x, y).
    pub(super) points: Vec<(f64, f64)>,
    /// Colour of line and legend.
    pub(super) colour: RGBColor,
    /// Line or dots.
    pub(super) stroke: Stroke,
}

/// A chart with linear axes.
#[derive(Clone, Debug)]
pub(super) struct Chart {
    /// Above the chart.
    pub(super) title: String,
    /// Quantity and unit along x.
    pub(super) x_label: String,
    /// Quantity and unit along y.
    pub(super) y_label: String,
    /// Drawn in this order.
    pub(super) series: Vec<Series>,
    /// Whether one unit has the same length on both axes (a map), or y starts at zero (a quantity over time).
    pub(super) is_map: bool,
}

impl Chart {
    /// The chart as an SVG document; `None` when there is nothing finite to draw.
    ///
    /// # Errors
    /// When the drawing library fails.
    pub(super) fn to_svg(&self) -> anyhow::Result<Option<String>> {
        let Some((x_range, y_range)) = self.ranges() else { return Ok(None) };
        let mut svg = String::new();
        {
            let area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
            let mut chart = ChartBuilder::on(&area)
                .margin(MARGIN)
                .caption(&self.title, (FONT, 19).into_font().color(&INK))
                .x_label_area_size(BOTTOM_LABELS)
                .y_label_area_size(LEFT_LABELS)
                .build_cartesian_2d(Axis(x_range), Axis(y_range))?;
            let text = || (FONT, 15).into_font().color(&INK);
            chart
                .configure_mesh()
                .x_labels(7)
                .y_labels(6)
                .bold_line_style(INK.mix(0.13))
                .light_line_style(TRANSPARENT)
                .axis_style(INK.mix(0.4))
                .label_style(text())
                .axis_desc_style(text())
                .x_desc(&self.x_label)
                .y_desc(&self.y_label)
                .draw()?;
            for series in &self.series {
                draw_series(&mut chart, series)?;
            }
            if self.series.len() > 1 {
                chart
                    .configure_series_labels()
                    .position(SeriesLabelPosition::UpperRight)
                    .label_font(text())
                    .legend_area_size(22)
                    .draw()?;
            }
            area.present()?;
        }
        Ok(Some(svg.replace(INK_IN_SVG, "currentColor")))
    }

    fn ranges(&self) -> Option<(Range<f64>, Range<f64>)> {
        let points =
            || self.series.iter().flat_map(|s| &s.points).filter(|p| p.0.is_finite() && p.1.is_finite());
        let (x_min, x_max) = extent(points().map(|p| p.0))?;
        let (y_min, y_max) = extent(points().map(|p| p.1))?;
        if self.is_map {
            return Some(equal_scale((x_min, x_max), (y_min, y_max)));
        }
        // The legend of several series stands above the curves.
        let headroom = if self.series.len() > 1 { 1.3 } else { 1.1 };
        let top = if y_max > 0.0 { headroom * y_max } else { 1.0 };
        let width = (x_max - x_min).max(1e-3);
        Some((x_min..x_min + width, y_min.min(0.0)..top))
    }
}

type Context<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<Axis, Axis>>;

fn draw_series(chart: &mut Context<'_, '_>, series: &Series) -> anyhow::Result<()> {
    let colour = series.colour;
    let is_finite = |p: &(f64, f64)| p.0.is_finite() && p.1.is_finite();
    match series.stroke {
        Stroke::Line(width) => {
            let style = colour.stroke_width(width);
            for (k, piece) in
                series.points.split(|p| !is_finite(p)).filter(|piece| !piece.is_empty()).enumerate()
            {
                let drawn = chart.draw_series(LineSeries::new(piece.iter().copied(), style))?;
                if k == 0 {
                    drawn
                        .label(&series.label)
                        .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style));
                }
            }
        }
        Stroke::Dots(radius) => {
            let dots = series.points.iter().filter(|p| is_finite(p));
            chart
                .draw_series(dots.map(|p| Circle::new(*p, radius, colour.filled())))?
                .label(&series.label)
                .legend(move |(x, y)| Circle::new((x + 9, y), radius, colour.filled()));
        }
    }
    Ok(())
}

/// Smallest and largest value; `None` without values.
fn extent(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.fold(None, |extent, v| {
        let (low, high) = extent.unwrap_or((v, v));
        Some((v.min(low), v.max(high)))
    })
}

/// Ranges around both extents, padded, in which a unit has the same length on the page.
fn equal_scale(x: (f64, f64), y: (f64, f64)) -> (Range<f64>, Range<f64>) {
    let page_width = f64::from(SIZE.0 - 2 * MARGIN - LEFT_LABELS);
    let page_height = f64::from(SIZE.1 - 2 * MARGIN - BOTTOM_LABELS - TITLE_HEIGHT);
    let units = 1.15 * ((x.1 - x.0) / page_width).max((y.1 - y.0) / page_height).max(1e-6);
    let around = |(low, high): (f64, f64), page: f64| {
        let (middle, half) = (0.5 * (low + high), 0.5 * units * page);
        middle - half..middle + half
    };
    (around(x, page_width), around(y, page_height))
}

/// A linear axis whose labels carry as many decimals as their distance needs.
struct Axis(Range<f64>);

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let share = (value - self.0.start) / (self.0.end - self.0.start);
        limit.0 + (share * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        let step = self.label_distance(hint.max_num_points());
        let first = (self.0.start / step).ceil() as i64;
        let last = (self.0.end / step).floor() as i64;
        (first..=last).map(|k| k as f64 * step).collect()
    }

    fn range(&self) -> Range<f64> {
        self.0.clone()
    }
}

impl Axis {
    /// The smallest of 1, 2, 5 times a power of ten that gives at most `count` labels.
    fn label_distance(&self, count: usize) -> f64 {
        let rough = (self.0.end - self.0.start) / count.clamp(2, 8) as f64;
        let power = 10f64.powf(rough.log10().floor());
        [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|step| *step >= rough).unwrap_or(rough)
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, value: &f64) -> String {
        // A label at zero must not show the sign of a rounding error.
        let decimals = (-self.label_distance(8).log10().floor()).clamp(0.0, 9.0) as usize;
        format!("{:.decimals$}", value + 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<(f64, f64)>, is_map: bool) -> Chart {
        let label = "a".to_owned();
        let series = vec![Series { label, points, colour: ESTIMATE, stroke: Stroke::Line(2) }];
        Chart { title: "t".into(), x_label: "x".into(), y_label: "y".into(), series, is_map }
    }

    #[test]
    fn a_map_has_one_scale() {
        let (x, y) = chart(vec![(0.0, 0.0), (4.0, 0.5)], true).ranges().unwrap();
        let per_unit = |r: &Range<f64>, page: f64| page / (r.end - r.start);
        assert!((per_unit(&x, 494.0) - per_unit(&y, 268.0)).abs() < 1e-9);
        assert!(x.start < 0.0 && x.end > 4.0 && y.start < 0.0 && y.end > 0.5);
    }

    #[test]
    fn a_gap_interrupts_the_line() {
        let svg = chart(vec![(0.0, 1.0), (1.0, 2.0), (2.0, f64::NAN), (3.0, 1.0), (4.0, 2.0)], false);
        let svg = svg.to_svg().unwrap().unwrap();
        assert_eq!(svg.matches("#3478F6").count(), 2, "{svg}");
        assert!(svg.contains("currentColor") && !svg.contains(INK_IN_SVG));
    }

    #[test]
    fn nothing_finite_gives_no_chart() {
        assert!(chart(vec![(0.0, f64::NAN)], false).to_svg().unwrap().is_none());
        assert!(chart(Vec::new(), true).to_svg().unwrap().is_none());
    }

    #[test]
    fn labels_are_round_numbers() {
        let axis = Axis(-0.013..0.061);
        assert_eq!(axis.label_distance(8), 0.01);
        assert_eq!(axis.format_ext(&0.02), "0.02");
        assert_eq!(axis.format_ext(&-0.0), "0.00");
    }
}
