//! The frame of a chart: its border, its axes with ticks, labels and titles, and a legend on its right.

use plotters::style::RGBColor;

use super::axis::{Axis, Ticks};
use super::canvas::{Align, Canvas, INK, Point, Stroke, TEXT_SIZE, widest};

/// Space at the border of the sheet.
pub const MARGIN: f64 = 12.0;
/// Below a frame: labels of the ticks and the title of the axis.
pub const FOOT: f64 = 34.0;
/// Between a frame and its legend.
pub const GAP: f64 = 14.0;
/// Length of a sample in the legend, and height of its row.
const SAMPLE: f64 = 24.0;
const ROW: f64 = 16.0;
const BORDER: Stroke = Stroke(0.7, INK);

/// A rectangle on the sheet, from where its axes start to where they end.
pub struct Frame {
    /// From left to right.
    pub x: Axis,
    /// From the bottom to the top.
    pub y: Axis,
}

/// Space left of a frame for labels and title of its vertical axis.
pub fn left_space(ticks: &Ticks) -> f64 {
    widest(ticks.marks.iter().map(|(_, label)| label.as_str())) + 9.0 + 1.8 * TEXT_SIZE
}

/// Space right of a frame for a legend with these names.
pub fn right_space<'n>(names: impl IntoIterator<Item = &'n str>) -> f64 {
    GAP + SAMPLE + 6.0 + widest(names)
}

impl Frame {
    /// A frame so wide and high, with its upper left corner at `corner`.
    pub fn new(x: Axis, y: Axis, (left, top): Point, (width, height): Point) -> Self {
        Frame {
            x: x.placed(left, left + width),
            y: y.placed(top + height, top),
        }
    }

    /// The thin line around it.
    pub fn border(&self, canvas: &Canvas<'_>) {
        let ([left, right], [bottom, top]) = (self.x.ends(), self.y.ends());
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
        canvas.line(&[&corners[..], &corners[..1]].concat(), BORDER);
    }

    /// The line across it at a place of the horizontal axis.
    pub fn vertical(&self, x: f64) -> [Point; 2] {
        [(x, self.y.end), (x, self.y.start)]
    }

    /// The line across it at a place of the vertical axis.
    pub fn horizontal(&self, y: f64) -> [Point; 2] {
        self.x.ends().map(|x| (x, y))
    }

    /// Ticks on its lower side.
    pub fn ticks_below(&self, canvas: &Canvas<'_>, ticks: &Ticks) {
        let bottom = self.y.start;
        for (value, _) in &ticks.marks {
            let x = self.x.at(*value);
            canvas.line(&[(x, bottom), (x, bottom - 3.0)], BORDER);
        }
    }

    /// Labels of these ticks below it, and the title of the axis.
    pub fn labels_below(&self, canvas: &Canvas<'_>, ticks: &Ticks, name: &str) {
        let bottom = self.y.start;
        for (value, label) in &ticks.marks {
            let place = (self.x.at(*value), bottom + 11.0);
            canvas.text(place, label, Align::Centre, INK);
        }
        let middle = (self.x.middle(), bottom + 27.0);
        canvas.text(middle, &ticks.title(name), Align::Centre, INK);
    }

    /// Ticks, labels and title of the vertical axis, of which the title begins at `left`.
    pub fn beside(&self, canvas: &Canvas<'_>, ticks: &Ticks, name: &str, left: f64) {
        let x = self.x.start;
        for (value, label) in &ticks.marks {
            let y = self.y.at(*value);
            canvas.line(&[(x, y), (x + 3.0, y)], BORDER);
            // Labels in the corners would meet those of the next frame.
            let [bottom, top] = self.y.ends();
            if (y - bottom).abs().min((y - top).abs()) > 3.5 {
                canvas.text((x - 5.0, y), label, Align::Right, INK);
            }
        }
        let title = (left + 0.5 * TEXT_SIZE, self.y.middle());
        canvas.text(title, &ticks.title(name), Align::Upwards, INK);
    }

    /// The border and both axes of a frame that stands alone, with about `n` ticks along each.
    pub fn draw(&self, canvas: &Canvas<'_>, [x, y]: [&str; 2], n: usize) {
        self.border(canvas);
        let ticks = self.x.ticks(n);
        self.ticks_below(canvas, &ticks);
        self.labels_below(canvas, &ticks, x);
        self.beside(canvas, &self.y.ticks(n), y, MARGIN);
    }

    /// Where a row of the legend has its sample, from left to right.
    pub fn sample(&self, row: usize) -> [Point; 2] {
        let y = self.y.end + (row as f64 + 0.5) * ROW;
        let left = self.x.end + GAP;
        [(left, y), (left + SAMPLE, y)]
    }

    /// The name in a row of the legend.
    pub fn name(&self, canvas: &Canvas<'_>, row: usize, name: &str) {
        let [_, (x, y)] = self.sample(row);
        canvas.text((x + 6.0, y), name, Align::Left, INK);
    }
}

/// A sample of a colour that fills areas, between these ends.
pub fn swatch(canvas: &Canvas<'_>, [from, to]: [Point; 2], color: RGBColor) {
    for (inset, color) in [(0.0, INK), (0.5, color)] {
        let [half, y] = [4.5 - inset, from.1];
        canvas.rect((from.0 + inset, y - half), (to.0 - inset, y + half), color);
    }
}
