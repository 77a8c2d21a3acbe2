//! A frame with a few curves over time.

use plotters::style::RGBColor;

use super::axis::{Axis, Ticks};
use super::canvas::{Align, Canvas, INK, Point, Stroke, TEXT_SIZE, text_width};
use super::marks::LINES;
use crate::report::{Ensemble, Series, Trajectory};

/// Panels before scalar quantities share one.
const MAX_PANELS: usize = 8;
/// Curves of one panel that are told apart by colour.
const MAX_CURVES: usize = LINES.len();
/// Steps between ticks.
const N_TICKS: usize = 4;

/// Width of the line of one of many runs.
pub const SINGLE: f64 = 0.5;
/// How much of its colour the outer and the inner band of quantiles have.
pub const SHADES: [f64; 2] = [0.22, 0.5];

/// A frame with a few curves over time.
pub struct Panel {
    /// Name of the vertical axis.
    title: String,
    curves: Vec<Curve>,
    axis: Axis,
}

struct Curve {
    name: String,
    values: Vec<f64>,
    color: RGBColor,
    /// Whether the name stands at its end.
    labelled: bool,
    /// Quantiles of many runs.
    quantiles: Vec<Vec<f64>>,
}

/// One panel per state, output and control; scalars share panels when there are many.
pub fn arrange(trajectory: &Trajectory) -> Vec<Panel> {
    let groups = [
        &trajectory.states,
        &trajectory.outputs,
        &trajectory.controls,
    ];
    let many = trajectory.ensemble.as_ref();
    let n_panels: usize = groups.iter().map(|group| group.len()).sum();
    let mut panels = Vec::new();
    for group in groups {
        if n_panels <= MAX_PANELS {
            panels.extend(group.iter().map(|series| Panel::new(&[series], many)));
            continue;
        }
        let (scalars, others): (Vec<_>, Vec<_>) = group.iter().partition(|s| s.n_entries() == 1);
        panels.extend(
            scalars
                .chunks(MAX_CURVES)
                .map(|group| Panel::new(group, many)),
        );
        panels.extend(others.into_iter().map(|series| Panel::new(&[series], many)));
    }
    panels.retain(|panel| !panel.curves.is_empty());
    panels
}

impl Panel {
    fn new(group: &[&Series], many: Option<&Ensemble>) -> Self {
        let entries: Vec<(String, Vec<f64>)> = group
            .iter()
            .flat_map(|series| {
                let n = series.n_entries();
                let column = move |k| series.values.iter().skip(k).step_by(n).copied().collect();
                series.entry_names().into_iter().zip((0..n).map(column))
            })
            .collect();
        let n = entries.len();
        let curves: Vec<Curve> = entries
            .into_iter()
            .enumerate()
            .map(|(k, (name, values))| Curve {
                quantiles: (many.and_then(|many| many.of(&name)))
                    .map_or_else(Vec::new, |bands| bands.values.clone()),
                name,
                values,
                color: if n <= MAX_CURVES {
                    LINES[k]
                } else {
                    shade(k, n)
                },
                labelled: n > 1 && (n <= MAX_CURVES || k == 0 || k == n - 1),
            })
            .collect();
        let title = match group {
            [series] => series.name.clone(),
            _ => String::new(),
        };
        let drawn = |curve: &Curve| {
            let quantiles = curve.quantiles.iter().flatten().copied();
            curve
                .values
                .iter()
                .copied()
                .chain(quantiles)
                .collect::<Vec<_>>()
        };
        let axis = Axis::around(curves.iter().flat_map(drawn));
        Panel {
            title,
            curves,
            axis,
        }
    }

    /// Space left of the frame for labels and title.
    pub fn left_space(&self) -> f64 {
        let ticks = self.axis.ticks(N_TICKS);
        let labels = ticks
            .marks
            .iter()
            .map(|(_, label)| text_width(label, TEXT_SIZE));
        labels.fold(0.0, f64::max) + 9.0 + 1.8 * TEXT_SIZE
    }

    /// Space right of the frame for the names of its curves.
    pub fn right_space(&self) -> f64 {
        let names = self.curves.iter().filter(|curve| curve.labelled);
        let widest = names
            .map(|curve| text_width(&curve.name, TEXT_SIZE))
            .fold(0.0, f64::max);
        if widest > 0.0 { widest + 8.0 } else { 0.0 }
    }

    /// Draws curves, frame, ticks and names between the heights `y`.
    pub fn draw(
        &self,
        canvas: &Canvas<'_>,
        trajectory: &Trajectory,
        time: &Axis,
        y: (f64, f64),
        time_ticks: &Ticks,
    ) {
        let axis = self.axis.clone().placed(y.1, y.0);
        if axis.lo < 0.0 && axis.hi > 0.0 {
            let zero = axis.at(0.0);
            let faint = RGBColor(190, 190, 190);
            canvas.line(&[(time.start, zero), (time.end, zero)], Stroke(0.5, faint));
        }
        let width = if self.curves.len() > 8 { 0.8 } else { 1.3 };
        let many = trajectory.ensemble.as_ref();
        let width = if many.is_some() { SINGLE } else { width };
        for (curve, many) in self.curves.iter().filter_map(|curve| Some((curve, many?))) {
            curve.draw_quantiles(canvas, &many.time, time, &axis);
        }
        for curve in &self.curves {
            let values = trajectory.time.iter().zip(&curve.values);
            let points = values.map(|(&t, &value)| (time.at(t), axis.at(value)));
            canvas.line(&interrupted(points), Stroke(width, curve.color));
        }

        frame(canvas, (time.start, y.0), (time.end, y.1));
        for (value, _) in &time_ticks.marks {
            let x = time.at(*value);
            canvas.line(&[(x, y.1), (x, y.1 - 3.0)], Stroke(0.7, INK));
        }
        let ticks = axis.ticks(N_TICKS);
        vertical_ticks(canvas, &axis, &ticks, time.start);
        let title = (super::MARGIN + 0.5 * TEXT_SIZE, 0.5 * (y.0 + y.1));
        canvas.text(title, &ticks.title(&self.title), Align::Upwards, INK);
        self.draw_names(canvas, &axis, time.end + 5.0, y);
    }

    /// The names of the curves at their ends, pushed apart where they would overlap.
    fn draw_names(&self, canvas: &Canvas<'_>, axis: &Axis, x: f64, y: (f64, f64)) {
        let last = |curve: &Curve| curve.values.iter().rev().copied().find(|v| v.is_finite());
        let mut names: Vec<(f64, &Curve)> = self
            .curves
            .iter()
            .filter(|curve| curve.labelled)
            .map(|curve| (axis.at(last(curve).unwrap_or(0.0)), curve))
            .collect();
        names.sort_by(|a, b| a.0.total_cmp(&b.0));
        let distance = TEXT_SIZE + 2.0;
        for k in 1..names.len() {
            names[k].0 = names[k].0.max(names[k - 1].0 + distance);
        }
        let mut limit = y.1 - 2.0;
        for (place, _) in names.iter_mut().rev() {
            *place = place.min(limit);
            limit = *place - distance;
        }
        for (place, curve) in names {
            canvas.text((x, place), &curve.name, Align::Left, curve.color);
        }
    }
}

impl Curve {
    /// The outer and the inner quantiles as bands, and the median as a line.
    fn draw_quantiles(&self, canvas: &Canvas<'_>, instants: &[f64], time: &Axis, axis: &Axis) {
        let points = |values: &[f64]| -> Vec<Point> {
            let points = instants.iter().zip(values);
            points.map(|(&t, &v)| (time.at(t), axis.at(v))).collect()
        };
        let n = self.quantiles.len();
        for k in 0..n / 2 {
            let mut outline = points(&self.quantiles[k]);
            outline.extend(points(&self.quantiles[n - 1 - k]).into_iter().rev());
            outline.retain(|point| point.1.is_finite());
            canvas.polygon(&outline, pale(self.color, SHADES[k.min(1)]));
        }
        if let Some(median) = self.quantiles.get(n / 2) {
            canvas.line(&points(median), Stroke(1.6, self.color));
        }
    }
}

/// A colour mixed with white, of which `share` is left.
pub fn pale(color: RGBColor, share: f64) -> RGBColor {
    let mix = |c: u8| (255.0 - share * (255.0 - f64::from(c))) as u8;
    RGBColor(mix(color.0), mix(color.1), mix(color.2))
}

/// A thin frame.
pub fn frame(canvas: &Canvas<'_>, from: Point, to: Point) {
    let corners = [from, (to.0, from.1), to, (from.0, to.1), from];
    canvas.line(&corners, Stroke(0.7, INK));
}

/// Ticks and labels along a vertical axis at `x`.
pub fn vertical_ticks(canvas: &Canvas<'_>, axis: &Axis, ticks: &Ticks, x: f64) {
    for (value, label) in &ticks.marks {
        let y = axis.at(*value);
        canvas.line(&[(x, y), (x + 3.0, y)], Stroke(0.7, INK));
        // Labels in the corners would meet those of the next frame.
        if (y - axis.start).abs().min((y - axis.end).abs()) > 3.5 {
            canvas.text((x - 5.0, y), label, Align::Right, INK);
        }
    }
}

/// The points with a gap where an instant stands twice and the value jumps visibly.
fn interrupted(points: impl Iterator<Item = Point>) -> Vec<Point> {
    let mut line: Vec<Point> = Vec::new();
    for point in points {
        if let Some(last) = line.last()
            && last.0 == point.0
            && (last.1 - point.1).abs() > 0.5
        {
            line.push((f64::NAN, f64::NAN));
        }
        line.push(point);
    }
    line
}

/// The k-th of n colours from dark blue to orange through grey green.
fn shade(k: usize, n: usize) -> RGBColor {
    const STOPS: [[f64; 3]; 4] = [
        [40.0, 60.0, 130.0],
        [35.0, 130.0, 140.0],
        [110.0, 170.0, 80.0],
        [220.0, 140.0, 30.0],
    ];
    let place = k as f64 / (n.max(2) - 1) as f64 * 3.0;
    let stop = (place as usize).min(2);
    let share = place - stop as f64;
    let mix = |c: usize| (STOPS[stop][c] * (1.0 - share) + STOPS[stop + 1][c] * share) as u8;
    RGBColor(mix(0), mix(1), mix(2))
}
