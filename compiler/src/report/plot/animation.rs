//! Shapes that move in the plane, as SVG whose attributes are animated (SMIL).
//!
//! An attribute a(t) has the values a(t_k) at the shares (t_k - t_0)/(t_n - t_0) of a period, straight lines between them,
//! and two values at an instant where the shape jumps. The t_k are those from which straight lines follow the shape.

use std::fmt::Write;

use plotters::style::{RGBColor, WHITE};

use super::axis::Axis;
use super::canvas::{Align, Canvas, INK, UNITS, mixed};
use super::frame::{FOOT, Frame, MARGIN, left_space};
use super::marks::LINES;
use super::{TIME_TICKS, TITLE, TITLE_SIZE, time_axis};
use crate::report::curve::thin;
use crate::report::{Samples, Series};
use crate::system::experiment::DrawingKind;

/// The largest frame, from left to right and from the bottom to the top.
const LARGEST: [f64; 2] = [420.0, 320.0];
/// The smallest side of a frame.
const SMALLEST: f64 = 90.0;
/// Steps between ticks.
const N_TICKS: usize = 5;
/// Height of the bar of time, and radius of the mark on it.
const BAR: f64 = 6.0;
const MARK: f64 = 4.0;
/// Width of lines, in points.
const LINE: f64 = 2.0;
/// How much of the paper is in the colour of areas, and of traces.
const PALE: f64 = 0.72;
const FAINT: f64 = 0.5;

/// Shapes over time.
pub struct Animation<'a> {
    /// The run at as many instants as its curves need, with the numbers of each shape as an output.
    pub samples: &'a Samples,
    /// What they mean, shape by shape.
    pub kinds: Vec<DrawingKind>,
    /// The unit of coordinates.
    pub unit: Option<&'a str>,
    /// The title of the bar of time.
    pub time: String,
    /// What stands above.
    pub title: Option<&'a str>,
    /// The width of the sheet in pixels; none for that of the frame.
    pub width: Option<f64>,
    /// Seconds of the run in a second.
    pub speed: f64,
}

/// A shape at the instants from which straight lines follow it.
struct Moving {
    kind: DrawingKind,
    /// Shares of the period, from 0 to 1.
    shares: Vec<f64>,
    /// Its numbers at these: x and y in turn; of a disc x, y, radius, and x and y of the point of its rim at its angle.
    columns: Vec<Vec<f64>>,
    /// Shares at which it has no place, ascending.
    holes: Vec<f64>,
}

impl Animation<'_> {
    /// The SVG text.
    pub fn write(&self) -> String {
        let outputs = self.samples.outputs.iter();
        let shapes = self.kinds.iter().zip(outputs);
        let shapes = shapes.map(|(&kind, series)| Moving::new(kind, series, &self.samples.time));
        let shapes: Vec<Moving> = shapes.collect();
        let [x, y] = axes(&shapes);
        let scale = (LARGEST[0] / (x.hi - x.lo)).min(LARGEST[1] / (y.hi - y.lo));
        let [x, y] = [x, y].map(|axis| widened(&axis, SMALLEST / scale));
        let [wide, high] = [&x, &y].map(|axis| scale * (axis.hi - axis.lo));
        let left = MARGIN + left_space(&y.ticks(N_TICKS));
        let title = if self.title.is_some() { TITLE } else { 0.0 };
        let frame = Frame::new(x, y, (left, MARGIN + title), (wide, high));
        let bar = frame.y.start + FOOT + MARGIN;
        let time = time_axis(self.samples.time.iter()).placed(left, left + wide);
        let bar = Frame {
            x: time,
            y: Axis::new(0.0, 1.0).placed(bar + BAR, bar),
        };
        let sheet = (left + wide + MARGIN, bar.y.start + FOOT + MARGIN);
        let svg = Canvas::svg_of_width(self.width, sheet, |canvas| {
            if let Some(title) = self.title {
                let place = (0.5 * sheet.0, 0.5 * (MARGIN + TITLE));
                canvas.sized_text(place, title, Align::Centre, INK, TITLE_SIZE);
            }
            let names = ["x", "y"].map(|name| match self.unit {
                Some(unit) => format!("{name} [{unit}]"),
                None => name.to_owned(),
            });
            frame.draw(canvas, names.each_ref().map(String::as_str), N_TICKS);
            bar.border(canvas);
            bar.labels_below(canvas, &bar.x.ticks(TIME_TICKS), &self.name_of_time());
        });
        let moving = self.elements(&shapes, &frame, &bar);
        svg.replacen("</svg>", &format!("{moving}</svg>"), 1)
    }

    fn name_of_time(&self) -> String {
        match self.speed {
            1.0 => self.time.clone(),
            speed => format!("{}, {speed} times as fast", self.time),
        }
    }

    /// The shapes in the coordinates of the model, and the mark on the bar of time.
    fn elements(&self, shapes: &[Moving], frame: &Frame, bar: &Frame) -> String {
        let [[a, c], [b, d]] = [frame.x.line(), frame.y.line()];
        let [a, b, c, d] = [a, b, c, d].map(|number| UNITS * number);
        let matrix = format!("matrix({a} 0 0 {b} {c} {d})");
        let width = LINE * UNITS / a;
        let seconds = (bar.x.hi - bar.x.lo) / self.speed;
        let mut text = format!(
            "<g transform=\"{matrix}\" stroke-width=\"{width}\" stroke-linejoin=\"round\">\n"
        );
        let mut colors = LINES.iter().cycle();
        for shape in shapes {
            let color = match shape.moves() {
                true => colors.next().copied().unwrap_or(INK),
                false => INK,
            };
            shape.write(&mut text, color, seconds);
        }
        let mut mark = Element::new("circle", format!("fill=\"{}\"", hex(INK)), seconds);
        mark.attribute("r", (MARK * UNITS).to_string());
        mark.attribute("cy", (bar.y.middle() * UNITS).to_string());
        let places = bar.x.ends().map(|x| (x * UNITS).to_string());
        mark.values("cx", &[0.0, 1.0], &places);
        text.push_str("</g>\n");
        mark.end(&mut text);
        text
    }
}

impl Moving {
    fn new(kind: DrawingKind, series: &Series, time: &[f64]) -> Self {
        let n = series.n_entries();
        let rows = time.iter().zip(series.values.chunks(n.max(1)));
        let (start, end) = match (time.first(), time.last()) {
            (Some(&start), Some(&end)) if end > start => (start, end),
            _ => (0.0, 1.0),
        };
        let share = |t: &f64| (t - start) / (end - start);
        let is_finite = |row: &[f64]| row.iter().all(|value| value.is_finite());
        let holes = rows.clone().filter(|(_, row)| !is_finite(row));
        let holes = holes.map(|(t, _)| share(t)).collect();
        let finite = rows.filter(|(_, row)| is_finite(row));
        let (time, rows): (Vec<f64>, Vec<Vec<f64>>) =
            finite.map(|(time, row)| (time, numbers(kind, row))).unzip();
        let (time, rows) = followed(time, &rows);
        let n = rows.first().map_or(0, Vec::len);
        let column = |k: usize| rows.iter().map(|row| row[k]).collect();
        Moving {
            kind,
            shares: time.iter().map(share).collect(),
            columns: (0..n).map(column).collect(),
            holes,
        }
    }

    fn moves(&self) -> bool {
        self.kind == DrawingKind::Trace || self.columns.iter().any(|column| !is_constant(column))
    }

    /// Points of the plane, each over time: corners, or the lower left and the upper right of a disc.
    fn corners(&self, from: usize) -> impl Iterator<Item = f64> + '_ {
        let radius = match self.kind {
            DrawingKind::Disc => self.columns.get(2),
            _ => None,
        };
        let axis = self.columns.iter().skip(from).step_by(2);
        let last = if radius.is_some() { 1 } else { usize::MAX };
        axis.take(last).flat_map(move |column| {
            let radius = move |k: usize| radius.map_or(0.0, |radius| radius[k].abs());
            let ends = column.iter().enumerate();
            ends.flat_map(move |(k, at)| [at - radius(k), at + radius(k)])
        })
    }

    fn write(&self, text: &mut String, color: RGBColor, seconds: f64) {
        if self.columns.is_empty() {
            return;
        }
        let stroked = |color| format!("fill=\"none\" stroke=\"{}\"", hex(color));
        let line = stroked(color);
        let pale = hex(mixed(color, WHITE, PALE));
        let area = format!("fill=\"{pale}\" stroke=\"{}\"", hex(color));
        match self.kind {
            DrawingKind::Disc => {
                let mut disc = Element::new("circle", area, seconds);
                for (name, column) in ["cx", "cy"].into_iter().zip(&self.columns) {
                    disc.values(name, &self.shares, &texts(column));
                }
                let radii = self.columns[2]
                    .iter()
                    .map(|radius| radius.abs().to_string());
                disc.values("r", &self.shares, &radii.collect::<Vec<_>>());
                disc.end(text);
                if let [x, y, _, u, v] = &self.columns[..] {
                    let mut spoke = Element::new("line", line, seconds);
                    for (name, column) in [("x1", x), ("y1", y), ("x2", u), ("y2", v)] {
                        spoke.values(name, &self.shares, &texts(column));
                    }
                    spoke.end(text);
                }
            }
            DrawingKind::Segment | DrawingKind::Polygon => {
                let (name, look) = match self.kind {
                    DrawingKind::Segment => ("polyline", line),
                    _ => ("polygon", area),
                };
                let mut shape = Element::new(name, look, seconds);
                let points: Vec<String> = (0..self.shares.len()).map(|k| self.points(k)).collect();
                shape.values("points", &self.shares, &points);
                shape.end(text);
            }
            DrawingKind::Trace => self.trace(text, &stroked(mixed(color, WHITE, FAINT)), seconds),
        }
    }

    /// All points at an instant.
    fn points(&self, k: usize) -> String {
        let numbers = self.columns.iter().map(|column| column[k].to_string());
        numbers.collect::<Vec<_>>().join(" ")
    }

    /// A line from jump to jump, of which a dash as long as the way until now is drawn.
    fn trace(&self, text: &mut String, look: &str, seconds: f64) {
        let [xs, ys] = &self.columns[..] else {
            return;
        };
        let jumps = |k: usize| {
            let [before, here] = [k - 1, k].map(|k| self.shares[k]);
            let hole = self.holes.partition_point(|hole| *hole < before);
            before == here && [xs[k], ys[k]] != [xs[k - 1], ys[k - 1]]
                || self.holes.get(hole).is_some_and(|hole| *hole <= here)
        };
        let mut from = 0;
        for to in 1..=xs.len() {
            if to < xs.len() && !jumps(to) {
                continue;
            }
            let rows = from..to;
            from = to;
            if rows.len() < 2 {
                continue;
            }
            let mut way = vec![0.0];
            for k in rows.clone().skip(1) {
                way.push(way[way.len() - 1] + (xs[k] - xs[k - 1]).hypot(ys[k] - ys[k - 1]));
            }
            let all = way[way.len() - 1];
            let mut line = Element::new("polyline", look.to_owned(), seconds);
            let points: Vec<String> = rows.clone().map(|k| self.points(k)).collect();
            line.attribute("points", points.join(" "));
            line.attribute("stroke-dasharray", format!("{all} {}", 2.0 * all));
            // Hidden before it begins, whole behind its end.
            let shares: Vec<f64> = [0.0]
                .into_iter()
                .chain(self.shares[rows].iter().copied())
                .collect();
            let hidden: Vec<f64> = [all]
                .into_iter()
                .chain(way.iter().map(|s| all - s))
                .collect();
            let (shares, hidden) = (
                [&shares[..], &[1.0]].concat(),
                [&hidden[..], &[0.0]].concat(),
            );
            line.values("stroke-dashoffset", &shares, &texts(&hidden));
            line.end(text);
        }
    }
}

/// The numbers of a shape: the angle of a disc is a point of its rim.
fn numbers(kind: DrawingKind, row: &[f64]) -> Vec<f64> {
    match (kind, row) {
        (DrawingKind::Disc, &[x, y, r, angle]) => {
            vec![x, y, r, x + r * angle.cos(), y + r * angle.sin()]
        }
        _ => row.to_vec(),
    }
}

/// The rows from which straight lines follow all, both of a jump among them.
fn followed(time: Vec<f64>, rows: &[Vec<f64>]) -> (Vec<f64>, Vec<Vec<f64>>) {
    let n = rows.first().map_or(0, Vec::len);
    let numbers = Series {
        name: String::new(),
        shape: vec![n],
        values: rows.concat(),
    };
    let inside: Vec<bool> = (0..rows.len())
        .map(|k| k > 0 && k + 1 < rows.len())
        .collect();
    let mut samples = Samples {
        time,
        outputs: vec![numbers],
        ..Samples::default()
    };
    thin(&mut samples, &inside);
    let rows = samples.outputs[0].values.chunks(n.max(1));
    let rows = rows.map(<[f64]>::to_vec).collect();
    (samples.time, rows)
}

/// Axes around all shapes.
fn axes(shapes: &[Moving]) -> [Axis; 2] {
    [0, 1].map(|from| Axis::around(shapes.iter().flat_map(move |shape| shape.corners(from))))
}

/// The axis around its middle, at least so long.
fn widened(axis: &Axis, least: f64) -> Axis {
    let missing = 0.5 * (least - (axis.hi - axis.lo)).max(0.0);
    Axis::new(axis.lo - missing, axis.hi + missing)
}

fn is_constant(column: &[f64]) -> bool {
    column.windows(2).all(|pair| pair[0] == pair[1])
}

fn texts(column: &[f64]) -> Vec<String> {
    column.iter().map(f64::to_string).collect()
}

fn hex(RGBColor(r, g, b): RGBColor) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// An element of SVG with attributes that change.
struct Element {
    name: &'static str,
    /// Its attributes, with their first values.
    start: String,
    /// How they change.
    changes: String,
    seconds: f64,
}

impl Element {
    fn new(name: &'static str, look: String, seconds: f64) -> Self {
        Element {
            name,
            start: look,
            changes: String::new(),
            seconds,
        }
    }

    /// One that stays.
    fn attribute(&mut self, name: &str, value: impl std::fmt::Display) {
        let _ = write!(self.start, " {name}=\"{value}\"");
    }

    /// One with values at shares of the period, or the only one.
    fn values(&mut self, name: &str, shares: &[f64], values: &[String]) {
        let Some(first) = values.first() else {
            return;
        };
        self.attribute(name, first);
        if values.iter().all(|value| value == first) {
            return;
        }
        // The period is that of the run: what has no place at an end of it stays where it is next to there.
        let (mut shares, mut values) = (shares.to_vec(), values.to_vec());
        if shares.first().is_some_and(|share| *share > 0.0) {
            shares.insert(0, 0.0);
            values.insert(0, values[0].clone());
        }
        if shares.last().is_some_and(|share| *share < 1.0) {
            shares.push(1.0);
            values.push(values[values.len() - 1].clone());
        }
        let _ = writeln!(
            self.changes,
            "  <animate attributeName=\"{name}\" dur=\"{}s\" repeatCount=\"indefinite\" keyTimes=\"{}\" values=\"{}\"/>",
            self.seconds,
            texts(&shares).join(";"),
            values.join(";"),
        );
    }

    fn end(self, text: &mut String) {
        let Element {
            name,
            start,
            changes,
            ..
        } = self;
        let _ = match changes.is_empty() {
            true => writeln!(text, "<{name} {start}/>"),
            false => writeln!(text, "<{name} {start}>\n{changes}</{name}>"),
        };
    }
}
