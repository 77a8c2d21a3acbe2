//! Several runs and measured data over one axis of time, a panel for each quantity.

use plotters::style::RGBColor;

use super::TIME_TICKS;
use super::axis::{Axis, range};
use super::canvas::{Canvas, Stroke, shade};
use super::frame::{FOOT, Frame, MARGIN, left_space, right_space};
use super::marks::LINES;
use super::panel::{MANY, interrupted};
use crate::model::Units;

/// A run, or what was measured.
pub struct Source {
    /// What the legend says.
    pub name: String,
    /// Instants; those of runs ascend.
    pub time: Vec<f64>,
    /// Scalar quantities by name.
    pub columns: Vec<(String, Vec<f64>)>,
    /// Their units; those of what was measured are not known.
    pub units: Units,
    /// Whether it is points, without a line through them.
    pub is_measured: bool,
}

const WIDTH: f64 = 400.0;
const HEIGHT: f64 = 110.0;
/// Between panels.
const GAP: f64 = 10.0;
const N_TICKS: usize = 4;
const LINE: f64 = 1.3;
/// Radius of a point.
const DOT: f64 = 2.0;

/// The SVG text, with a panel for every quantity that some run has, in order.
pub fn write(sources: &[Source]) -> String {
    let mut names: Vec<&str> = Vec::new();
    for source in sources.iter().filter(|source| !source.is_measured) {
        for (name, _) in &source.columns {
            if !names.contains(&name.as_str()) {
                names.push(name);
            }
        }
    }
    let time = range(
        sources
            .iter()
            .flat_map(|source| source.time.iter().copied()),
    );
    let time = match time {
        Some((first, last)) if last > first => Axis::new(first, last),
        Some((only, _)) => Axis::new(only, only + 1.0),
        None => Axis::new(0.0, 1.0),
    };
    let vertical = names.iter().map(|name| {
        let values = sources.iter().flat_map(|source| source.column(name));
        Axis::around(values.copied())
    });
    let vertical: Vec<Axis> = vertical.collect();
    let spaces = vertical.iter().map(|y| left_space(&y.ticks(N_TICKS)));
    let left = MARGIN + spaces.fold(0.0, f64::max);
    let frames = vertical.into_iter().enumerate().map(|(k, y)| {
        let corner = (left, MARGIN + k as f64 * (HEIGHT + GAP));
        Frame::new(time.clone(), y, corner, (WIDTH, HEIGHT))
    });
    let frames: Vec<Frame> = frames.collect();
    let bottom = frames.last().map_or(MARGIN, |frame| frame.y.start);
    let beside = right_space(sources.iter().map(|source| source.name.as_str()));
    let size = (left + WIDTH + beside + MARGIN, bottom + FOOT + MARGIN);
    Canvas::svg(size.0, size.1, |canvas| {
        for (frame, name) in frames.iter().zip(&names) {
            for (source, color) in sources.iter().zip(colours(sources.len())) {
                source.draw(canvas, frame, name, color);
            }
            frame.border(canvas);
            frame.ticks_below(canvas, &frame.x.ticks(TIME_TICKS));
            let title = title(sources, name, |source| !source.column(name).is_empty());
            frame.beside(canvas, &frame.y.ticks(N_TICKS), &title, MARGIN);
        }
        if let Some(last) = frames.last() {
            let title = title(sources, "time", |_| true);
            last.labels_below(canvas, &last.x.ticks(TIME_TICKS), &title);
        }
        if let Some(first) = frames.first() {
            for (row, (source, color)) in sources.iter().zip(colours(sources.len())).enumerate() {
                let [from, to] = first.sample(row);
                match source.is_measured {
                    true => canvas.disc((0.5 * (from.0 + to.0), from.1), DOT, color),
                    false => canvas.line(&[from, to], Stroke(LINE, color)),
                }
                first.name(canvas, row, &source.name);
            }
        }
    })
}

/// The name of a quantity, with its unit where it is one in all runs that have it.
fn title(sources: &[Source], name: &str, has: impl Fn(&Source) -> bool) -> String {
    let runs = (sources.iter()).filter(|source| !source.is_measured && has(source));
    let mut titles = runs.map(|source| source.units.title(name));
    let first = titles.next();
    let common = first.filter(|first| titles.all(|title| title == *first));
    common.unwrap_or_else(|| name.to_owned())
}

/// Colours that are told apart, or a scale of them.
fn colours(n: usize) -> Vec<RGBColor> {
    if n <= LINES.len() {
        return LINES[..n].to_vec();
    }
    let share = |k: usize| k as f64 / (n - 1) as f64;
    (0..n).map(|k| shade(&MANY, share(k))).collect()
}

impl Source {
    fn column(&self, name: &str) -> &[f64] {
        let mut columns = self.columns.iter();
        let found = columns.find(|(known, _)| known == name);
        found.map_or(&[], |(_, values)| values)
    }

    fn draw(&self, canvas: &Canvas<'_>, frame: &Frame, name: &str, color: RGBColor) {
        let points = self.time.iter().zip(self.column(name));
        let points = points.map(|(&t, &value)| (frame.x.at(t), frame.y.at(value)));
        match self.is_measured {
            true => points
                .filter(|point| point.1.is_finite())
                .for_each(|point| canvas.disc(point, DOT, color)),
            false => canvas.line(&interrupted(points), Stroke(LINE, color)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Source, write};
    use crate::model::Units;

    #[test]
    fn quantities_of_runs_have_panels_with_what_was_measured_of_them() {
        let source = |name: &str, columns: &[&str], is_measured: bool| Source {
            name: name.to_owned(),
            time: vec![0.0, 1.0, 2.0],
            columns: (columns.iter())
                .map(|name| ((*name).to_owned(), vec![0.5, f64::NAN, 1.5]))
                .collect(),
            units: Units::default(),
            is_measured,
        };
        let sources = [
            source("first", &["x", "v"], false),
            source("second", &["x", "w"], false),
            source("data.csv", &["x", "unknown"], true),
        ];
        let svg = write(&sources);
        for text in ["x", "v", "w", "first", "second", "data.csv", "time"] {
            assert_eq!(svg.matches(&format!(">\n{text}\n<")).count(), 1, "{text}");
        }
        assert!(!svg.contains("unknown") && !svg.contains("NaN"));
        // Two points of x, and one in the legend.
        assert_eq!(svg.matches("<circle").count(), 3);
    }
}
