//! Curves over two logarithmic axes, with their names beside them.

use plotters::style::RGBColor;

use super::MARGIN;
use super::axis::superscripts;
use super::canvas::{Align, Canvas, INK, Point, Stroke, TEXT_SIZE, text_width};
use super::panel::frame;

/// Points in the positive quadrant.
pub struct Curve {
    /// Its name in the legend.
    pub name: String,
    /// What stands behind the name.
    pub remark: String,
    /// A family, which has a colour, and a member of it, which has a shade and a mark.
    pub place: (usize, usize),
    /// What is not positive is left out.
    pub points: Vec<Point>,
}

/// A figure with logarithmic axes.
pub struct LogLog<'a> {
    /// Title of the horizontal axis.
    pub x_title: &'a str,
    /// Title of the vertical axis.
    pub y_title: &'a str,
    /// The curves.
    pub curves: Vec<Curve>,
    /// Errors below it are not about the methods.
    pub floor: f64,
}

const WIDTH: f64 = 380.0;
const HEIGHT: f64 = 330.0;
/// Below the frame: labels of the ticks and the title of the axis.
const FOOT: f64 = 36.0;
/// Between the frame and the legend, and between name and remark in it.
const GAP: f64 = 14.0;
/// Length of a sample in the legend, and height of its row.
const SAMPLE: f64 = 24.0;
const ROW: f64 = 16.0;
/// Labels of decades along an axis.
const MOST_LABELS: i32 = 9;
/// Decades of an axis that has lines between them.
const MOST_DIVIDED: f64 = 4.5;
const DECADE: Stroke = Stroke(0.5, RGBColor(205, 205, 205));
const BETWEEN: Stroke = Stroke(0.35, RGBColor(233, 233, 233));
const DOTS: (f64, f64) = (1.5, 2.5);
const FLOOR_NAME: &str = "accuracy of the reference";
const FLOOR: Stroke = Stroke(0.7, RGBColor(120, 120, 120));

/// Colours of families, from the first member to the last; distinct to colour-blind readers.
const FAMILIES: [[RGBColor; 2]; 6] = [
    [RGBColor(30, 30, 30), RGBColor(110, 110, 110)],
    [RGBColor(120, 185, 230), RGBColor(0, 65, 130)],
    [RGBColor(240, 165, 80), RGBColor(165, 50, 0)],
    [RGBColor(110, 195, 160), RGBColor(0, 100, 75)],
    [RGBColor(205, 140, 190), RGBColor(120, 40, 100)],
    [RGBColor(200, 180, 60), RGBColor(120, 100, 0)],
];
/// Members with shades of their own.
const MEMBERS: usize = 4;

/// A logarithmic axis.
pub(super) struct Decades {
    /// Logarithms to base 10.
    lo: f64,
    hi: f64,
    start: f64,
    end: f64,
}

impl Decades {
    /// Covers all positive values with a margin.
    pub(super) fn around(values: impl Iterator<Item = f64>) -> Self {
        let logs = values.filter(|v| *v > 0.0 && v.is_finite()).map(f64::log10);
        let (lo, hi) = logs.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| {
            (lo.min(v), hi.max(v))
        });
        let (lo, hi) = if lo > hi { (-1.0, 0.0) } else { (lo, hi) };
        // A decade at least has its line in the frame.
        let margin = (0.04 * (hi - lo)).max(0.5 * (1.1 - (hi - lo)));
        Decades {
            lo: lo - margin,
            hi: hi + margin,
            start: 0.0,
            end: 1.0,
        }
    }

    pub(super) fn placed(self, start: f64, end: f64) -> Self {
        Decades { start, end, ..self }
    }

    pub(super) fn at(&self, value: f64) -> f64 {
        let share = (value.log10() - self.lo) / (self.hi - self.lo);
        self.start + share * (self.end - self.start)
    }

    /// Powers of ten in the range.
    fn decades(&self) -> std::ops::RangeInclusive<i32> {
        self.lo.ceil() as i32..=self.hi.floor() as i32
    }

    /// Powers of ten with labels: every one, every second one, ..
    pub(super) fn labels(&self) -> Vec<(f64, String)> {
        let n = self.decades().count() as i32;
        let every = (n + MOST_LABELS - 1) / MOST_LABELS;
        let shown = self
            .decades()
            .filter(|decade| decade.rem_euclid(every.max(1)) == 0);
        shown
            .map(|decade| {
                let label = format!("10{}", superscripts(decade));
                (10f64.powi(decade), label)
            })
            .collect()
    }

    /// 2, 3, .., 9 times powers of ten, where there is room for them.
    fn between(&self) -> Vec<f64> {
        if self.hi - self.lo > MOST_DIVIDED {
            return Vec::new();
        }
        let decades = self.lo.floor() as i32..=self.hi.ceil() as i32;
        let all =
            decades.flat_map(|decade| (2..10).map(move |k| f64::from(k) * 10f64.powi(decade)));
        all.filter(|value| (self.lo..=self.hi).contains(&value.log10()))
            .collect()
    }
}

impl LogLog<'_> {
    /// The SVG text.
    pub fn write(&self) -> String {
        let points = || self.curves.iter().flat_map(|curve| &curve.points);
        let points = || points().filter(|p| p.0 > 0.0 && p.1 > 0.0);
        let x = Decades::around(points().map(|p| p.0));
        let y = Decades::around(points().map(|p| p.1));
        let widest = |texts: &mut dyn Iterator<Item = &str>| {
            texts
                .map(|text| text_width(text, TEXT_SIZE))
                .fold(0.0, f64::max)
        };
        let labels = y.labels();
        let labels = widest(&mut labels.iter().map(|(_, label)| label.as_str()));
        let names = widest(&mut self.curves.iter().map(|curve| curve.name.as_str()));
        let remarks = widest(&mut self.curves.iter().map(|curve| curve.remark.as_str()));
        let left = MARGIN + 1.8 * TEXT_SIZE + labels + 7.0;
        let (top, right) = (MARGIN, left + WIDTH);
        let bottom = top + HEIGHT;
        let legend = right + GAP;
        let entries = (names + GAP + remarks).max(text_width(FLOOR_NAME, TEXT_SIZE));
        let width = legend + SAMPLE + 6.0 + entries + MARGIN;
        let (x, y) = (x.placed(left, right), y.placed(bottom, top));

        Canvas::svg(width, bottom + FOOT + MARGIN, |canvas| {
            grid(canvas, &x, &y);
            let floor = y.at(self.floor);
            let shows_floor = self.floor > 0.0 && (top..bottom).contains(&floor);
            if shows_floor {
                canvas.dashed(&[(left, floor), (right, floor)], DOTS, FLOOR);
            }
            for curve in &self.curves {
                curve.draw(canvas, &x, &y);
            }
            frame(canvas, (left, top), (right, bottom));
            for (value, label) in x.labels() {
                canvas.text((x.at(value), bottom + 11.0), &label, Align::Centre, INK);
            }
            for (value, label) in y.labels() {
                canvas.text((left - 6.0, y.at(value)), &label, Align::Right, INK);
            }
            let middle = (0.5 * (left + right), bottom + 28.0);
            canvas.text(middle, self.x_title, Align::Centre, INK);
            let middle = (MARGIN + 0.5 * TEXT_SIZE, 0.5 * (top + bottom));
            canvas.text(middle, self.y_title, Align::Upwards, INK);
            for (k, curve) in self.curves.iter().enumerate() {
                let y = top + (k as f64 + 0.5) * ROW;
                let sample = [(legend, y), (legend + SAMPLE, y)];
                canvas.line(&sample, Stroke(1.2, curve.color()));
                curve.mark(canvas, (legend + 0.5 * SAMPLE, y));
                let name = legend + SAMPLE + 6.0;
                canvas.text((name, y), &curve.name, Align::Left, INK);
                let remark = name + names + GAP;
                canvas.text((remark, y), &curve.remark, Align::Left, INK);
            }
            if shows_floor {
                let y = top + (self.curves.len() as f64 + 0.5) * ROW;
                canvas.dashed(&[(legend, y), (legend + SAMPLE, y)], DOTS, FLOOR);
                canvas.text((legend + SAMPLE + 6.0, y), FLOOR_NAME, Align::Left, INK);
            }
        })
    }
}

/// Fine lines, then those of decades above them.
fn grid(canvas: &Canvas<'_>, x: &Decades, y: &Decades) {
    let vertical = |value: f64| [(x.at(value), y.start), (x.at(value), y.end)];
    let horizontal = |value: f64| [(x.start, y.at(value)), (x.end, y.at(value))];
    for value in x.between() {
        canvas.line(&vertical(value), BETWEEN);
    }
    for value in y.between() {
        canvas.line(&horizontal(value), BETWEEN);
    }
    for decade in x.decades() {
        canvas.line(&vertical(10f64.powi(decade)), DECADE);
    }
    for decade in y.decades() {
        canvas.line(&horizontal(10f64.powi(decade)), DECADE);
    }
}

impl Curve {
    fn color(&self) -> RGBColor {
        let [RGBColor(r, g, b), last] = FAMILIES[self.place.0 % FAMILIES.len()];
        let share = (self.place.1 % MEMBERS) as f64 / (MEMBERS - 1) as f64;
        let mix = |a: u8, b: u8| (f64::from(a) + share * (f64::from(b) - f64::from(a))) as u8;
        RGBColor(mix(r, last.0), mix(g, last.1), mix(b, last.2))
    }

    fn draw(&self, canvas: &Canvas<'_>, x: &Decades, y: &Decades) {
        let positive = self.points.iter().filter(|p| p.0 > 0.0 && p.1 > 0.0);
        let places: Vec<Point> = positive.map(|p| (x.at(p.0), y.at(p.1))).collect();
        canvas.line(&places, Stroke(1.2, self.color()));
        for place in places {
            self.mark(canvas, place);
        }
    }

    fn mark(&self, canvas: &Canvas<'_>, (x, y): Point) {
        let color = self.color();
        let shape = |corners: &[Point]| {
            let corners: Vec<Point> = corners.iter().map(|c| (x + c.0, y + c.1)).collect();
            canvas.polygon(&corners, color);
        };
        match self.place.1 % MEMBERS {
            0 => canvas.disc((x, y), 2.5, color),
            1 => shape(&[(-2.3, -2.3), (2.3, -2.3), (2.3, 2.3), (-2.3, 2.3)]),
            2 => shape(&[(-2.9, 2.2), (2.9, 2.2), (0.0, -3.0)]),
            _ => shape(&[(0.0, -3.3), (3.3, 0.0), (0.0, 3.3), (-3.3, 0.0)]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Curve, LogLog};

    fn figure(points: Vec<(f64, f64)>) -> String {
        let curve = Curve {
            name: "gauss(2)".into(),
            remark: "h^4.0".into(),
            place: (2, 0),
            points,
        };
        LogLog {
            x_title: "step size",
            y_title: "error",
            curves: vec![curve],
            floor: 1e-9,
        }
        .write()
    }

    #[test]
    fn decades_have_labels_and_curves_a_legend() {
        let svg = figure(vec![(0.1, 1e-4), (0.01, 1e-8), (0.001, 1e-12)]);
        for text in ["10⁻⁴", "10⁻¹²", "10⁻²", "gauss(2)", "h^4.0", "step size"] {
            assert!(svg.contains(&format!(">\n{text}\n<")), "{text} is missing");
        }
    }

    #[test]
    fn what_has_no_logarithm_is_left_out() {
        for points in [
            vec![],
            vec![(0.1, 0.0)],
            vec![(0.1, 1e-3), (0.05, f64::NAN)],
            vec![(0.0, 1e-3), (0.05, -1.0)],
        ] {
            let svg = figure(points);
            assert!(svg.contains("gauss(2)") && !svg.contains("NaN"), "{svg}");
        }
    }
}
