//! Curves over two logarithmic axes, with their names beside them.

use plotters::style::RGBColor;

use super::axis::Axis;
use super::canvas::{Align, Canvas, INK, Point, Stroke, mixed, widest};
use super::frame::{FOOT, Frame, GAP, MARGIN, left_space, right_space};

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

impl LogLog<'_> {
    /// The SVG text.
    pub fn write(&self) -> String {
        let points = || self.curves.iter().flat_map(|curve| &curve.points);
        let points = || points().filter(|p| p.0 > 0.0 && p.1 > 0.0);
        let x = Axis::decades(points().map(|p| p.0));
        let y = Axis::decades(points().map(|p| p.1));
        let left = MARGIN + left_space(&y.ticks(0));
        let frame = Frame::new(x, y, (left, MARGIN), (WIDTH, HEIGHT));
        let ([bottom, top], right) = (frame.y.ends(), frame.x.end);
        let names = || self.curves.iter().map(|curve| curve.name.as_str());
        let remarks = widest(self.curves.iter().map(|curve| curve.remark.as_str()));
        let entries = (right_space(names()) + GAP + remarks).max(right_space([FLOOR_NAME]));
        let width = right + entries + MARGIN;

        Canvas::svg(width, bottom + FOOT + MARGIN, |canvas| {
            grid(canvas, &frame);
            let floor = frame.y.at(self.floor);
            let shows_floor = self.floor > 0.0 && (top..bottom).contains(&floor);
            if shows_floor {
                canvas.dashed(&frame.horizontal(floor), DOTS, FLOOR);
            }
            for curve in &self.curves {
                curve.draw(canvas, &frame);
            }
            frame.draw(canvas, [self.x_title, self.y_title], 0);
            let remark = right + right_space(names()) + GAP;
            for (k, curve) in self.curves.iter().enumerate() {
                let [from, to] = frame.sample(k);
                canvas.line(&[from, to], Stroke(1.2, curve.color()));
                curve.mark(canvas, (0.5 * (from.0 + to.0), from.1));
                frame.name(canvas, k, &curve.name);
                canvas.text((remark, from.1), &curve.remark, Align::Left, INK);
            }
            if shows_floor {
                let row = self.curves.len();
                canvas.dashed(&frame.sample(row), DOTS, FLOOR);
                frame.name(canvas, row, FLOOR_NAME);
            }
        })
    }
}

/// Fine lines, then those of decades above them.
fn grid(canvas: &Canvas<'_>, frame: &Frame) {
    let (x, y) = (&frame.x, &frame.y);
    for value in x.between_powers() {
        canvas.line(&frame.vertical(x.at(value)), BETWEEN);
    }
    for value in y.between_powers() {
        canvas.line(&frame.horizontal(y.at(value)), BETWEEN);
    }
    for value in x.powers() {
        canvas.line(&frame.vertical(x.at(value)), DECADE);
    }
    for value in y.powers() {
        canvas.line(&frame.horizontal(y.at(value)), DECADE);
    }
}

impl Curve {
    fn color(&self) -> RGBColor {
        let [first, last] = FAMILIES[self.place.0 % FAMILIES.len()];
        let share = (self.place.1 % MEMBERS) as f64 / (MEMBERS - 1) as f64;
        mixed(first, last, share)
    }

    fn draw(&self, canvas: &Canvas<'_>, frame: &Frame) {
        let positive = self.points.iter().filter(|p| p.0 > 0.0 && p.1 > 0.0);
        let places: Vec<Point> = positive
            .map(|p| (frame.x.at(p.0), frame.y.at(p.1)))
            .collect();
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
