//! A frame with a few curves over time.

use plotters::style::RGBColor;

use super::axis::Axis;
use super::canvas::{Align, Canvas, Point, Stroke, TEXT_SIZE, mixed, shade, widest};
use super::frame::{Frame, MARGIN, left_space};
use super::marks::LINES;
use crate::model::Units;
use crate::report::{ClosedLoop, Ensemble, Measurements, Planned, Samples, Series, Several};

/// Panels before scalar quantities share one.
const MAX_PANELS: usize = 8;
/// Curves of one panel that are told apart by colour.
const MAX_CURVES: usize = LINES.len();
/// Steps between ticks.
const N_TICKS: usize = 4;

/// Colours of more curves, from the first to the last.
pub const MANY: [RGBColor; 4] = [
    RGBColor(40, 60, 130),
    RGBColor(35, 130, 140),
    RGBColor(110, 170, 80),
    RGBColor(220, 140, 30),
];

/// Plans of a controller that are drawn at most, how thin, and how much of its colour each has.
const MOST_PLANS: usize = 40;
const THIN: f64 = 0.6;
const PALE: f64 = 0.4;
/// Radius of a measurement.
const DOT: f64 = 1.3;
/// Width of the line of one of many runs.
pub const SINGLE: f64 = 0.5;
/// How much of its colour the outer and the inner band of quantiles have.
pub const SHADES: [f64; 2] = [0.22, 0.5];

/// A frame with a few curves over time.
pub struct Panel {
    /// Name of the vertical axis.
    title: String,
    curves: Vec<Curve>,
    dots: Vec<Beside>,
    /// Plans of a controller, or other runs that were measured.
    plans: Vec<Beside>,
    axis: Axis,
}

/// What was measured, or planned.
struct Beside {
    time: Vec<f64>,
    values: Vec<f64>,
    color: RGBColor,
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
pub fn arrange(samples: &Samples) -> Vec<Vec<&Series>> {
    let groups = [&samples.states, &samples.outputs, &samples.controls];
    if samples.series().count() <= MAX_PANELS {
        return samples.series().map(|series| vec![series]).collect();
    }
    let mut panels: Vec<Vec<&Series>> = Vec::new();
    for group in groups {
        let (scalars, others): (Vec<_>, Vec<_>) = group.iter().partition(|s| s.n_entries() == 1);
        panels.extend(scalars.chunks(MAX_CURVES).map(<[_]>::to_vec));
        panels.extend(others.into_iter().map(|series| vec![series]));
    }
    panels
}

impl Panel {
    /// The entries of these, with quantiles of many runs, and with what was measured of them.
    pub fn new(group: &[&Series], units: &Units, several: &Several, end: f64) -> Self {
        let entries: Vec<_> = group.iter().flat_map(|series| series.columns()).collect();
        let (n, many) = (entries.len(), several.ensemble.as_ref());
        let measured = several.fit.iter().flat_map(|fit| &fit.data);
        let measured = measured.filter(|data| data.with.is_none());
        let measured: Vec<(usize, &Measurements)> = measured
            .filter_map(|data| {
                let mut names = entries.iter();
                let place = names.position(|(name, _)| *name == data.quantity)?;
                Some((place, data))
            })
            .collect();
        let names: Vec<String> = entries.iter().map(|(name, _)| name.clone()).collect();
        let curves: Vec<Curve> = entries
            .into_iter()
            .enumerate()
            .map(|(k, (name, values))| Curve {
                quantiles: (many.and_then(|many| many.of(&name)))
                    .map_or_else(Vec::new, |bands| bands.values.clone()),
                // One quantity has its unit beside the axis.
                name: match group {
                    [_] => name,
                    _ => units.title(&name),
                },
                values,
                color: if n <= MAX_CURVES {
                    LINES[k]
                } else {
                    shade(&MANY, k as f64 / (n - 1) as f64)
                },
                labelled: n > 1 && (n <= MAX_CURVES || k == 0 || k == n - 1),
            })
            .collect();
        let title = match group {
            [series] => units.title(&series.name),
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
        let dots = measured.iter().map(|&(curve, data)| Beside {
            time: data.time.clone(),
            values: data.measured.clone(),
            color: curves[curve].color,
        });
        let dots: Vec<Beside> = dots.collect();
        let measured = dots.iter().flat_map(|dots| dots.values.iter().copied());
        let plans = several.closed_loop.as_ref();
        let plans = plans.map_or_else(Vec::new, |found| planned(found, (&names, &curves), end));
        let expected = plans.iter().flat_map(|plan| plan.values.iter().copied());
        let beside = measured.chain(expected);
        let axis = Axis::around(curves.iter().flat_map(drawn).chain(beside));
        Panel {
            title,
            curves,
            dots,
            plans,
            axis,
        }
    }

    /// What was measured, with what a run of its own has at these instants.
    pub fn of_run(data: &Measurements) -> Self {
        let found = data.measured.iter().zip(&data.residuals);
        let found: Vec<f64> = found.map(|(y, residual)| y + residual).collect();
        let beside = |values: &[f64], color| Beside {
            time: data.time.clone(),
            values: values.to_vec(),
            color,
        };
        Panel {
            title: data.quantity.clone() + &data.run(),
            curves: Vec::new(),
            axis: Axis::around(data.measured.iter().chain(&found).copied()),
            dots: vec![beside(&data.measured, LINES[0])],
            plans: vec![beside(&found, LINES[0])],
        }
    }

    /// The run less what was measured.
    pub fn of_residuals(data: &Measurements) -> Self {
        Panel {
            title: format!("{} - {}{}", data.quantity, data.column, data.run()),
            curves: Vec::new(),
            plans: Vec::new(),
            axis: Axis::around(data.residuals.iter().copied().chain([0.0])),
            dots: vec![Beside {
                time: data.time.clone(),
                values: data.residuals.clone(),
                color: LINES[0],
            }],
        }
    }

    /// Whether it shows nothing.
    pub fn is_empty(&self) -> bool {
        self.curves.is_empty() && self.dots.is_empty()
    }

    /// Whether quantiles of some curve are known.
    pub fn has_quantiles(&self) -> bool {
        self.curves.iter().any(|curve| !curve.quantiles.is_empty())
    }

    /// Space left of the frame for labels and title.
    pub fn left_space(&self) -> f64 {
        left_space(&self.axis.ticks(N_TICKS))
    }

    /// Space right of the frame for the names of its curves.
    pub fn right_space(&self) -> f64 {
        let names = self.curves.iter().filter(|curve| curve.labelled);
        let widest = widest(names.map(|curve| curve.name.as_str()));
        if widest > 0.0 { widest + 8.0 } else { 0.0 }
    }

    /// Its frame over an axis of time that has been placed, between two heights.
    pub fn frame(&self, time: &Axis, (top, bottom): (f64, f64)) -> Frame {
        Frame {
            x: time.clone(),
            y: self.axis.clone().placed(bottom, top),
        }
    }

    /// Draws curves, frame, ticks and names.
    pub fn draw(
        &self,
        canvas: &Canvas<'_>,
        instants: &[f64],
        many: Option<&Ensemble>,
        frame: &Frame,
    ) {
        let Frame { x: time, y: axis } = frame;
        if axis.lo < 0.0 && axis.hi > 0.0 {
            let faint = RGBColor(190, 190, 190);
            canvas.line(&frame.horizontal(axis.at(0.0)), Stroke(0.5, faint));
        }
        let width = if self.curves.len() > 8 { 0.8 } else { 1.3 };
        let width = if many.is_some() { SINGLE } else { width };
        for (curve, many) in self.curves.iter().filter_map(|curve| Some((curve, many?))) {
            curve.draw_quantiles(canvas, &many.time, frame);
        }
        for plan in &self.plans {
            let points = plan.time.iter().zip(&plan.values);
            let points: Vec<Point> = points.map(|(&t, &x)| (time.at(t), axis.at(x))).collect();
            canvas.line(&points, Stroke(THIN, pale(plan.color, PALE)));
        }
        for curve in &self.curves {
            let values = instants.iter().zip(&curve.values);
            let points = values.map(|(&t, &value)| (time.at(t), axis.at(value)));
            canvas.line(&interrupted(points), Stroke(width, curve.color));
        }
        for dots in &self.dots {
            for (&t, &value) in dots.time.iter().zip(&dots.values) {
                canvas.disc((time.at(t), axis.at(value)), DOT, dots.color);
            }
        }

        frame.border(canvas);
        frame.ticks_below(canvas, &time.ticks(super::TIME_TICKS));
        frame.beside(canvas, &axis.ticks(N_TICKS), &self.title, MARGIN);
        self.draw_names(canvas, frame);
    }

    /// The names of the curves at their ends, pushed apart where they would overlap.
    fn draw_names(&self, canvas: &Canvas<'_>, Frame { x, y }: &Frame) {
        let last = |curve: &Curve| curve.values.iter().rev().copied().find(|v| v.is_finite());
        let mut names: Vec<(f64, &Curve)> = self
            .curves
            .iter()
            .filter(|curve| curve.labelled)
            .map(|curve| (y.at(last(curve).unwrap_or(0.0)), curve))
            .collect();
        names.sort_by(|a, b| a.0.total_cmp(&b.0));
        let distance = TEXT_SIZE + 2.0;
        for k in 1..names.len() {
            names[k].0 = names[k].0.max(names[k - 1].0 + distance);
        }
        let mut limit = y.start - 2.0;
        for (place, _) in names.iter_mut().rev() {
            *place = place.min(limit);
            limit = *place - distance;
        }
        for (place, curve) in names {
            canvas.text((x.end + 5.0, place), &curve.name, Align::Left, curve.color);
        }
    }
}

/// What was planned for these curves until an instant, of so many plans that each is seen.
fn planned(found: &ClosedLoop, (names, curves): (&[String], &[Curve]), end: f64) -> Vec<Beside> {
    let plans: Vec<&Planned> = found.samples.iter().flat_map(|one| &one.plan).collect();
    let every = plans.len().div_ceil(MOST_PLANS).max(1);
    let shown = plans.into_iter().step_by(every);
    let of_curve = |plan: &Planned, (name, curve): (&String, &Curve)| {
        let (_, values) = plan.states.iter().find(|(known, _)| known == name)?;
        let n = plan.time.partition_point(|&t| t <= end);
        Some(Beside {
            time: plan.time[..n].to_vec(),
            values: values[..n].to_vec(),
            color: curve.color,
        })
    };
    shown
        .flat_map(|plan| (names.iter().zip(curves)).filter_map(move |one| of_curve(plan, one)))
        .collect()
}

impl Curve {
    /// The outer and the inner quantiles as bands, and the median as a line.
    fn draw_quantiles(&self, canvas: &Canvas<'_>, instants: &[f64], Frame { x, y }: &Frame) {
        let points = |values: &[f64]| -> Vec<Point> {
            let points = instants.iter().zip(values);
            points.map(|(&t, &v)| (x.at(t), y.at(v))).collect()
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
    mixed(RGBColor(255, 255, 255), color, share)
}

/// The points with a gap where an instant stands twice and the value jumps visibly.
pub fn interrupted(points: impl Iterator<Item = Point>) -> Vec<Point> {
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
