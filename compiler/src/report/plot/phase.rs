//! The phase plane of two states, with the curves on which they switch.

use super::Phase;
use super::axis::Axis;
use super::canvas::{Canvas, INK, Point, Stroke};
use super::contour::zero_set;
use super::frame::{Frame, left_space};
use super::marks::{self, CURVE, LINES, Legend};
use crate::model::Units;
use crate::report::History;

/// Dash patterns that tell switching curves apart.
const DASHES: [(f64, f64); 4] = [(1e9, 0.0), (5.0, 3.0), (1.5, 2.0), (9.0, 3.0)];
/// Steps between ticks.
const N_TICKS: usize = 5;
/// Ratio of the ranges up to which both axes have one scale.
const MAX_RATIO: f64 = 3.0;

/// The phase plane of two states.
pub struct Plane {
    names: [String; 2],
    columns: [Vec<f64>; 2],
    axes: [Axis; 2],
    /// Lines of each switching curve.
    curves: Vec<Vec<Vec<Point>>>,
    legend: Legend,
    size: (f64, f64),
}

impl Plane {
    /// The plane of two scalars, so wide and high.
    pub fn new(phase: &Phase<'_>, units: &Units, (width, height): (f64, f64)) -> Self {
        let [(x_name, x), (y_name, y)] = &phase.axes;
        let axes = axes(phase, (width, height));
        let [x_range, y_range] = [&axes[0], &axes[1]].map(|axis| (axis.lo, axis.hi));
        let curves = phase.surfaces.iter().filter_map(|surface| {
            let lines = zero_set(&surface.psi, x_range, y_range);
            (!lines.is_empty()).then_some((&surface.name, lines))
        });
        let (names, curves): (Vec<_>, Vec<_>) = curves.take(DASHES.len()).unzip();
        let names: Vec<_> = names.into_iter().cloned().zip(DASHES).collect();
        Plane {
            names: [x_name, y_name].map(|name| units.title(name)),
            columns: [x.clone(), y.clone()],
            axes,
            curves,
            legend: Legend::of_phase_plane(&names),
            size: (width, height),
        }
    }

    /// Width with labels and title.
    pub fn width(&self) -> f64 {
        self.left_space() + self.size.0
    }

    /// Height of the legend above the frame.
    pub fn legend_height(&self) -> f64 {
        self.legend.height(self.size.0)
    }

    fn left_space(&self) -> f64 {
        left_space(&self.axes[1].ticks(N_TICKS))
    }

    /// Draws it right of `left`, the frame between two heights.
    pub fn draw(
        &self,
        canvas: &Canvas<'_>,
        (time, history): (&[f64], &History),
        left: f64,
        (top, bottom): (f64, f64),
    ) {
        let start = left + self.left_space();
        let [x, y] = self.axes.clone();
        let frame = Frame::new(x, y, (start, top), (self.size.0, bottom - top));
        let at = |p: Point| (frame.x.at(p.0), frame.y.at(p.1));

        for (lines, dash) in self.curves.iter().zip(DASHES) {
            for line in lines {
                let line: Vec<_> = line.iter().copied().map(at).collect();
                canvas.dashed(&line, dash, CURVE);
            }
        }

        let [xs, ys] = &self.columns;
        let mut points: Vec<Point> = Vec::with_capacity(xs.len());
        for (k, place) in xs.iter().zip(ys).map(|(&u, &v)| at((u, v))).enumerate() {
            let jumps = |last: &Point| (last.0 - place.0).hypot(last.1 - place.1) > 0.5;
            if k > 0 && time[k] == time[k - 1] && points.last().is_some_and(jumps) {
                points.push((f64::NAN, f64::NAN));
            }
            points.push(place);
        }
        canvas.line(&points, Stroke(1.3, LINES[0]));
        arrows(canvas, &points);

        if history.events.len() <= super::MAX_EVENT_LINES {
            for event in &history.events {
                let k = time.partition_point(|&t| t < event.time);
                if let (Some(&u), Some(&v)) = (xs.get(k), ys.get(k)) {
                    canvas.disc(at((u, v)), 2.3, INK);
                }
            }
        }
        let finite = |p: &&Point| p.0.is_finite() && p.1.is_finite();
        if let Some(&first) = points.iter().find(finite) {
            marks::start(canvas, first);
        }
        if let Some(&last) = points.iter().rev().find(finite) {
            marks::end(canvas, last);
        }

        frame.border(canvas);
        let [x_name, y_name] = &self.names;
        frame.beside(canvas, &frame.y.ticks(N_TICKS), y_name, left);
        let ticks = frame.x.ticks(N_TICKS);
        frame.ticks_below(canvas, &ticks);
        frame.labels_below(canvas, &ticks, x_name);
        let legend = (start, top - 3.0 - self.legend_height());
        self.legend.draw(canvas, legend, self.size.0);
    }
}

/// Width of a plane with labels and title where its frame is so wide and high.
pub fn width_in(phase: &Phase<'_>, size: (f64, f64)) -> f64 {
    left_space(&axes(phase, size)[1].ticks(N_TICKS)) + size.0
}

fn axes(phase: &Phase<'_>, size: (f64, f64)) -> [Axis; 2] {
    let around = |values: &[f64]| Axis::around(values.iter().copied());
    let mut axes = phase.axes.each_ref().map(|(_, values)| around(values));
    if phase.is_of_one {
        one_scale(&mut axes, size);
    }
    axes
}

/// Widens one range so that a circle is drawn as one, unless that would flatten the curve.
fn one_scale(axes: &mut [Axis; 2], (width, height): (f64, f64)) {
    let per_point = |axis: &Axis, length: f64| (axis.hi - axis.lo) / length;
    let scales = [per_point(&axes[0], width), per_point(&axes[1], height)];
    let scale = scales[0].max(scales[1]);
    if scale > MAX_RATIO * scales[0].min(scales[1]) {
        return;
    }
    for (axis, length) in axes.iter_mut().zip([width, height]) {
        let middle = 0.5 * (axis.lo + axis.hi);
        *axis = Axis::new(middle - 0.5 * scale * length, middle + 0.5 * scale * length);
    }
}

/// Two arrow heads along the way, at a third and two thirds of its length.
fn arrows(canvas: &Canvas<'_>, points: &[Point]) {
    let length = |pair: &[Point]| {
        let length = (pair[1].0 - pair[0].0).hypot(pair[1].1 - pair[0].1);
        if length.is_finite() { length } else { 0.0 }
    };
    let total: f64 = points.windows(2).map(length).sum();
    if total < 60.0 {
        return;
    }
    let mut walked = 0.0;
    let mut marks = [total / 3.0, 2.0 * total / 3.0].into_iter().peekable();
    for pair in points.windows(2) {
        let step = length(pair);
        walked += step;
        if step > 0.0 && marks.next_if(|&mark| walked >= mark).is_some() {
            let (u, v) = (
                (pair[1].0 - pair[0].0) / step,
                (pair[1].1 - pair[0].1) / step,
            );
            let (x, y) = pair[1];
            let corner =
                |along: f64, across: f64| (x + along * u - across * v, y + along * v + across * u);
            canvas.polygon(
                &[corner(5.0, 0.0), corner(-3.0, 3.2), corner(-3.0, -3.2)],
                LINES[0],
            );
        }
    }
}
