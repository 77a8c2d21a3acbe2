//! A sweep: values at the end over one quantity as lines, over two of them as maps.

use plotters::style::RGBColor;

use super::axis::{Axis, range};
use super::canvas::{Align, Canvas, INK, Point, Stroke, shade};
use super::frame::{FOOT, Frame, MARGIN, left_space};

/// Quantities with their values, and panels with a value for each run, the last quantity fastest; runs without one are
/// no numbers.
pub struct Sweep<'s> {
    /// One or two of them.
    pub axes: Vec<(&'s str, &'s [f64])>,
    /// What is drawn.
    pub panels: Vec<(&'s str, Vec<f64>)>,
}

const WIDTH: f64 = 380.0;
const LINES: f64 = 96.0;
const MAP: f64 = 200.0;
/// Between panels.
const GAP: f64 = 12.0;
/// The scale of colours: its distance, its width and the room for its labels.
const SCALE: [f64; 3] = [10.0, 12.0, 52.0];
const N_TICKS: usize = 6;
const CURVE: Stroke = Stroke(1.2, RGBColor(0, 65, 130));
const DOT: RGBColor = RGBColor(0, 65, 130);
/// Points that are marked one by one, at most.
const MOST_DOTS: usize = 100;
/// Cells along an axis of a map, at most, how far they reach into their neighbours, and steps of the scale of colours.
const MOST_CELLS: usize = 200;
const OVERLAP: f64 = 0.4;
const STEPS: usize = 64;
/// Of runs without a value.
const NOTHING: RGBColor = RGBColor(225, 225, 225);
/// From small to large values; their lightness grows, so that they are told apart without colours.
const COLOURS: [RGBColor; 4] = [
    RGBColor(50, 30, 90),
    RGBColor(30, 110, 140),
    RGBColor(90, 180, 110),
    RGBColor(250, 230, 80),
];

impl Sweep<'_> {
    /// The SVG text.
    pub fn write(&self) -> String {
        let (name, values) = self.axes[0];
        let up = self.axes.get(1);
        let height = if up.is_some() { MAP } else { LINES };
        let vertical = |(_, values): &(&str, Vec<f64>)| match up {
            Some((_, up)) => along(up),
            None => Axis::around(values.iter().copied()),
        };
        let vertical: Vec<Axis> = self.panels.iter().map(vertical).collect();
        let spaces = vertical.iter().map(|y| left_space(&y.ticks(N_TICKS)));
        let left = MARGIN + spaces.fold(0.0, f64::max);
        let frames = vertical.into_iter().enumerate().map(|(k, y)| {
            let corner = (left, MARGIN + k as f64 * (height + GAP));
            Frame::new(along(values), y, corner, (WIDTH, height))
        });
        let frames: Vec<Frame> = frames.collect();
        let beside = if up.is_some() {
            SCALE.iter().sum()
        } else {
            0.0
        };
        let bottom = frames.last().map_or(MARGIN, |frame| frame.y.start);
        let width = left + WIDTH + beside + MARGIN;
        Canvas::svg(width, bottom + FOOT + MARGIN, |canvas| {
            for (frame, panel) in frames.iter().zip(&self.panels) {
                let title = match up {
                    Some(&(other, up)) => {
                        self.map(canvas, frame, up, panel);
                        other
                    }
                    None => {
                        lines(canvas, frame, values, &panel.1);
                        panel.0
                    }
                };
                frame.beside(canvas, &frame.y.ticks(N_TICKS), title, MARGIN);
                frame.border(canvas);
            }
            if let Some(last) = frames.last() {
                let ticks = last.x.ticks(N_TICKS);
                last.ticks_below(canvas, &ticks);
                last.labels_below(canvas, &ticks, name);
            }
        })
    }

    /// Values by colours, a cell for each run.
    fn map(
        &self,
        canvas: &Canvas<'_>,
        Frame { x, y }: &Frame,
        up: &[f64],
        (name, values): &(&str, Vec<f64>),
    ) {
        let [bottom, top] = y.ends();
        let scale = extent(values).placed(bottom, top);
        let columns = cells(self.axes[0].1, x);
        let rows = cells(up, y);
        for &(i, [left, right]) in &columns {
            for &(j, [low, high]) in &rows {
                let value = values[i * up.len() + j];
                let colour = match value.is_finite() {
                    true => shade(&COLOURS, (value - scale.lo) / (scale.hi - scale.lo)),
                    false => NOTHING,
                };
                // Cells overlap, so that nothing shows between them.
                let (right, high) = ((right + OVERLAP).min(x.end), (high - OVERLAP).max(top));
                canvas.rect((left, low), (right, high), colour);
            }
        }
        let from = x.end + SCALE[0];
        for k in 0..STEPS {
            let at = |k: usize| bottom + (top - bottom) * k as f64 / STEPS as f64;
            let colour = shade(&COLOURS, (k as f64 + 0.5) / STEPS as f64);
            let high = (at(k + 1) - OVERLAP).max(top);
            canvas.rect((from, high), (from + SCALE[1], at(k)), colour);
        }
        let ticks = scale.ticks(N_TICKS);
        for (value, label) in &ticks.marks {
            let beside = from + SCALE[1] + 4.0;
            canvas.text((beside, scale.at(*value)), label, Align::Left, INK);
        }
        let title = (from + SCALE[1] + 46.0, y.middle());
        canvas.text(title, &ticks.title(name), Align::Upwards, INK);
    }
}

/// Values as a line through the runs, which those without one interrupt.
fn lines(canvas: &Canvas<'_>, Frame { x, y }: &Frame, at: &[f64], values: &[f64]) {
    let mut points: Vec<Point> = at
        .iter()
        .zip(values)
        .map(|(&a, &v)| (x.at(a), y.at(v)))
        .collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    canvas.line(&points, CURVE);
    if points.len() <= MOST_DOTS {
        let finite = points.iter().filter(|point| point.1.is_finite());
        finite.for_each(|&point| canvas.disc(point, 1.8, DOT));
    }
}

/// Covers the values with half a distance on either side.
fn along(values: &[f64]) -> Axis {
    let around = Axis::around(values.iter().copied());
    match range(values.iter().copied()) {
        Some((lo, hi)) if hi > lo => {
            let half = 0.5 * (hi - lo) / (values.len().max(2) - 1) as f64;
            Axis::new((lo - half).max(around.lo), (hi + half).min(around.hi))
        }
        _ => around,
    }
}

/// The range of finite values.
fn extent(values: &[f64]) -> Axis {
    let around = Axis::around(values.iter().copied());
    match range(values.iter().copied()) {
        Some((lo, hi)) if hi - lo > 0.5 * (around.hi - around.lo) => Axis::new(lo, hi),
        _ => around,
    }
}

/// Where the cell of each value begins and ends, half way to its neighbours, in order; of very many values some.
fn cells(values: &[f64], axis: &Axis) -> Vec<(usize, [f64; 2])> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    order.dedup_by(|a, b| values[*a] == values[*b]);
    let order: Vec<usize> = (order.iter().copied())
        .step_by(order.len().div_ceil(MOST_CELLS))
        .collect();
    let between = |a: usize, b: usize| axis.at(0.5 * (values[order[a]] + values[order[b]]));
    let cell = |k: usize| {
        let low = k.checked_sub(1).map_or(axis.start, |last| between(last, k));
        let high = match k + 1 < order.len() {
            true => between(k, k + 1),
            false => axis.end,
        };
        (order[k], [low, high])
    };
    (0..order.len()).map(cell).collect()
}
