//! The phase plane of two states, with the curves on which they switch.

use super::Surface;
use super::axis::Axis;
use super::canvas::{Align, Canvas, INK, Point, Stroke, TEXT_SIZE, text_width};
use super::contour::zero_set;
use super::marks::{self, CURVE, LINES, Legend};
use super::panel::{frame, vertical_ticks};
use crate::report::Trajectory;

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
    /// The plane of the two states of `trajectory`, so wide and high.
    pub fn new(trajectory: &Trajectory, surfaces: &[Surface<'_>], width: f64, height: f64) -> Self {
        let entries: Vec<(String, Vec<f64>)> = trajectory
            .states
            .iter()
            .flat_map(|series| {
                let n = series.n_entries();
                let column = move |k| series.values.iter().skip(k).step_by(n).copied().collect();
                series.entry_names().into_iter().zip((0..n).map(column))
            })
            .collect();
        let mut entries = entries.into_iter();
        let (x_name, x) = entries.next().unwrap_or_default();
        let (y_name, y) = entries.next().unwrap_or_default();
        let around = |values: &[f64]| Axis::around(values.iter().copied());
        let mut axes = [around(&x), around(&y)];
        if trajectory.states.len() == 1 {
            one_scale(&mut axes, (width, height));
        }
        let [x_range, y_range] = [&axes[0], &axes[1]].map(|axis| (axis.lo, axis.hi));
        let curves = surfaces.iter().filter_map(|surface| {
            let lines = zero_set(&surface.psi, x_range, y_range);
            (!lines.is_empty()).then_some((&surface.name, lines))
        });
        let (names, curves): (Vec<_>, Vec<_>) = curves.take(DASHES.len()).unzip();
        let names: Vec<_> = names.into_iter().cloned().zip(DASHES).collect();
        Plane {
            names: [x_name, y_name],
            columns: [x, y],
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
        let ticks = self.axes[1].ticks(N_TICKS);
        let labels = ticks
            .marks
            .iter()
            .map(|(_, label)| text_width(label, TEXT_SIZE));
        labels.fold(0.0, f64::max) + 9.0 + 1.8 * TEXT_SIZE
    }

    /// Draws it right of `left`, the frame between two heights.
    pub fn draw(
        &self,
        canvas: &Canvas<'_>,
        trajectory: &Trajectory,
        left: f64,
        (top, bottom): (f64, f64),
    ) {
        let start = left + self.left_space();
        let [x, y] = self.axes.clone();
        let (x, y) = (x.placed(start, start + self.size.0), y.placed(bottom, top));
        let at = |p: Point| (x.at(p.0), y.at(p.1));

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
            if k > 0
                && trajectory.time[k] == trajectory.time[k - 1]
                && points.last().is_some_and(jumps)
            {
                points.push((f64::NAN, f64::NAN));
            }
            points.push(place);
        }
        canvas.line(&points, Stroke(1.3, LINES[0]));
        arrows(canvas, &points);

        if trajectory.events.len() <= super::MAX_EVENT_LINES {
            for event in &trajectory.events {
                let k = trajectory.time.partition_point(|&t| t < event.time);
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

        frame(canvas, (start, top), (start + self.size.0, bottom));
        let ticks = y.ticks(N_TICKS);
        vertical_ticks(canvas, &y, &ticks, start);
        let title = (left + 0.5 * TEXT_SIZE, 0.5 * (top + bottom));
        canvas.text(title, &ticks.title(&self.names[1]), Align::Upwards, INK);
        let ticks = x.ticks(N_TICKS);
        for (value, label) in &ticks.marks {
            let place = x.at(*value);
            canvas.line(&[(place, bottom), (place, bottom - 3.0)], Stroke(0.7, INK));
            canvas.text((place, bottom + 11.0), label, Align::Centre, INK);
        }
        let middle = start + 0.5 * self.size.0;
        canvas.text(
            (middle, bottom + 27.0),
            &ticks.title(&self.names[0]),
            Align::Centre,
            INK,
        );
        let legend = (start, top - 3.0 - self.legend_height());
        self.legend.draw(canvas, legend, self.size.0);
    }
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
