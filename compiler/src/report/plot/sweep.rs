//! A sweep: values at the end over one quantity as lines, over two of them as maps.

use plotters::style::RGBColor;

use super::MARGIN;
use super::axis::Axis;
use super::canvas::{Align, Canvas, INK, Point, Stroke};
use super::panel::{frame, vertical_ticks};

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
/// Below the last panel, and left of all of them: labels of the ticks and the title of the axis.
const FOOT: f64 = 34.0;
const SIDE: f64 = 58.0;
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
const COLOURS: [[f64; 3]; 4] = [
    [50.0, 30.0, 90.0],
    [30.0, 110.0, 140.0],
    [90.0, 180.0, 110.0],
    [250.0, 230.0, 80.0],
];

impl Sweep<'_> {
    /// The SVG text.
    pub fn write(&self) -> String {
        let is_map = self.axes.len() == 2;
        let height = if is_map { MAP } else { LINES };
        let n = self.panels.len() as f64;
        let (left, top) = (MARGIN + SIDE, MARGIN);
        let (right, bottom) = (left + WIDTH, top + n * height + (n - 1.0).max(0.0) * GAP);
        let beside = if is_map { SCALE.iter().sum() } else { 0.0 };
        let (name, values) = self.axes[0];
        let x = along(values).placed(left, right);
        Canvas::svg(right + beside + MARGIN, bottom + FOOT + MARGIN, |canvas| {
            for (k, panel) in self.panels.iter().enumerate() {
                let y = top + k as f64 * (height + GAP);
                match self.axes.get(1) {
                    Some(&(other, up)) => {
                        self.map(canvas, &x, (other, up), panel, [y, y + height]);
                    }
                    None => lines(canvas, (&x, values), panel, [y, y + height]),
                }
                frame(canvas, (left, y), (right, y + height));
            }
            let ticks = x.ticks(N_TICKS);
            for (value, label) in &ticks.marks {
                let at = x.at(*value);
                canvas.line(&[(at, bottom), (at, bottom - 3.0)], Stroke(0.7, INK));
                canvas.text((at, bottom + 9.0), label, Align::Centre, INK);
            }
            let middle = (0.5 * (left + right), bottom + 24.0);
            canvas.text(middle, &ticks.title(name), Align::Centre, INK);
        })
    }

    /// Values by colours, a cell for each run.
    fn map(
        &self,
        canvas: &Canvas<'_>,
        x: &Axis,
        (other, up): (&str, &[f64]),
        (name, values): &(&str, Vec<f64>),
        [top, bottom]: [f64; 2],
    ) {
        let y = along(up).placed(bottom, top);
        let scale = extent(values).placed(bottom, top);
        let columns = cells(self.axes[0].1, x);
        let rows = cells(up, &y);
        for &(i, [left, right]) in &columns {
            for &(j, [low, high]) in &rows {
                let value = values[i * up.len() + j];
                let colour = match value.is_finite() {
                    true => shade((value - scale.lo) / (scale.hi - scale.lo)),
                    false => NOTHING,
                };
                // Cells overlap, so that nothing shows between them.
                let (right, high) = ((right + OVERLAP).min(x.end), (high - OVERLAP).max(top));
                canvas.rect((left, low), (right, high), colour);
            }
        }
        let ticks = y.ticks(N_TICKS);
        vertical_ticks(canvas, &y, &ticks, x.start);
        let middle = 0.5 * (top + bottom);
        canvas.text(
            (MARGIN + 6.0, middle),
            &ticks.title(other),
            Align::Upwards,
            INK,
        );
        let from = x.end + SCALE[0];
        for k in 0..STEPS {
            let at = |k: usize| bottom + (top - bottom) * k as f64 / STEPS as f64;
            let colour = shade((k as f64 + 0.5) / STEPS as f64);
            let high = (at(k + 1) - OVERLAP).max(top);
            canvas.rect((from, high), (from + SCALE[1], at(k)), colour);
        }
        let ticks = scale.ticks(N_TICKS);
        for (value, label) in &ticks.marks {
            let beside = from + SCALE[1] + 4.0;
            canvas.text((beside, scale.at(*value)), label, Align::Left, INK);
        }
        let title = (from + SCALE[1] + 46.0, middle);
        canvas.text(title, &ticks.title(name), Align::Upwards, INK);
    }
}

/// Values as a line through the runs, which those without one interrupt.
fn lines(
    canvas: &Canvas<'_>,
    (x, at): (&Axis, &[f64]),
    (name, values): &(&str, Vec<f64>),
    [top, bottom]: [f64; 2],
) {
    let y = Axis::around(values.iter().copied()).placed(bottom, top);
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
    let ticks = y.ticks(4);
    vertical_ticks(canvas, &y, &ticks, x.start);
    let middle = (MARGIN + 6.0, 0.5 * (top + bottom));
    canvas.text(middle, &ticks.title(name), Align::Upwards, INK);
}

/// Covers the values with half a distance on either side.
fn along(values: &[f64]) -> Axis {
    let (lo, hi) = values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), &v| {
            (lo.min(v), hi.max(v))
        });
    let around = Axis::around(values.iter().copied());
    match hi > lo {
        true => {
            let half = 0.5 * (hi - lo) / (values.len().max(2) - 1) as f64;
            Axis::new((lo - half).max(around.lo), (hi + half).min(around.hi))
        }
        false => around,
    }
}

/// The range of finite values.
fn extent(values: &[f64]) -> Axis {
    let finite = values.iter().copied().filter(|value| value.is_finite());
    let (lo, hi) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), value| {
        (lo.min(value), hi.max(value))
    });
    let around = Axis::around(values.iter().copied());
    match hi - lo > 0.5 * (around.hi - around.lo) {
        true => Axis::new(lo, hi),
        false => around,
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

/// The colour of a share from 0 to 1.
fn shade(share: f64) -> RGBColor {
    let place = share.clamp(0.0, 1.0) * (COLOURS.len() - 1) as f64;
    let k = (place as usize).min(COLOURS.len() - 2);
    let part = place - k as f64;
    let mix = |c: usize| (COLOURS[k][c] + part * (COLOURS[k + 1][c] - COLOURS[k][c])).round() as u8;
    RGBColor(mix(0), mix(1), mix(2))
}
