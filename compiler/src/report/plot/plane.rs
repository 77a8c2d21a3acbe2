//! Number and stability of sliding modes over two states, with the curves on which they change.

use plotters::style::RGBColor;

use super::axis::Axis;
use super::canvas::{Canvas, INK, Point, Stroke};
use super::frame::{FOOT, Frame, MARGIN, left_space, right_space, swatch};
use crate::model::Units;
use crate::report::{Change, Plane, words_of};

const WIDTH: f64 = 340.0;
const HEIGHT: f64 = 280.0;
const N_TICKS: usize = 6;
/// Where no mode is, and where the surface is not met.
const NONE: RGBColor = RGBColor(246, 246, 246);
const ELSEWHERE: RGBColor = RGBColor(255, 255, 255);
/// For patterns of modes by how often they occur; distinct to colour-blind readers.
const PATTERNS: [RGBColor; 6] = [
    RGBColor(166, 206, 227),
    RGBColor(253, 208, 152),
    RGBColor(178, 223, 188),
    RGBColor(222, 190, 222),
    RGBColor(240, 228, 140),
    RGBColor(200, 200, 200),
];
/// Of the colour before, for patterns beyond these.
const DARKER: f64 = 0.8;
const FOLD: Stroke = Stroke(1.8, INK);
const BOUND: Stroke = Stroke(1.0, RGBColor(90, 90, 90));
const DASHES: (f64, f64) = (4.0, 2.5);

/// The SVG text.
pub fn write(plane: &Plane, units: &Units) -> String {
    let ends = |k: usize| {
        let (first, last) = (plane.at[k].first(), plane.at[k].last());
        Axis::new(first.copied().unwrap_or(0.0), last.copied().unwrap_or(1.0))
    };
    let (x, y) = (ends(0), ends(1));
    let corner = (MARGIN + left_space(&y.ticks(N_TICKS)), MARGIN);
    let frame = Frame::new(x, y, corner, (WIDTH, HEIGHT));
    let shares = plane.shares();
    let mut colors = (0..).map(color);
    let legend: Vec<(Option<Vec<bool>>, RGBColor)> = shares
        .into_iter()
        .map(|(pattern, _)| {
            let color = match pattern.as_deref() {
                None => ELSEWHERE,
                Some([]) => NONE,
                Some(_) => colors.next().unwrap_or(INK),
            };
            (pattern, color)
        })
        .collect();
    let names = legend
        .iter()
        .map(|(pattern, _)| words_of(pattern.as_deref()));
    let names: Vec<String> = names.collect();
    let lines = ["fold", "mode at a side"];
    let entries = names.iter().map(String::as_str).chain(lines);
    let width = frame.x.end + right_space(entries.clone()) + MARGIN;
    Canvas::svg(width, frame.y.start + FOOT + MARGIN, |canvas| {
        fill(canvas, plane, &legend, &frame);
        for curve in &plane.curves {
            let points = curve.points.iter();
            let points = points.map(|[a, b]| (frame.x.at(*a), frame.y.at(*b)));
            let points: Vec<Point> = points.collect();
            match curve.change {
                Change::Fold => canvas.line(&points, FOLD),
                Change::Bound | Change::Other => canvas.dashed(&points, DASHES, BOUND),
            }
        }
        let [x, y] = plane.states.each_ref().map(|state| units.title(state));
        frame.draw(canvas, [&x, &y], N_TICKS);
        for (k, name) in entries.enumerate() {
            let sample = frame.sample(k);
            match k.checked_sub(legend.len()) {
                None => swatch(canvas, sample, legend[k].1),
                Some(0) => canvas.line(&sample, FOLD),
                Some(_) => canvas.dashed(&sample, DASHES, BOUND),
            }
            frame.name(canvas, k, name);
        }
    })
}

/// The colour of the k-th pattern.
fn color(k: usize) -> RGBColor {
    let RGBColor(red, green, blue) = PATTERNS[k % PATTERNS.len()];
    let share = DARKER.powi((k / PATTERNS.len()) as i32);
    let [red, green, blue] = [red, green, blue].map(|part| (share * f64::from(part)) as u8);
    RGBColor(red, green, blue)
}

/// One rectangle per run of nodes of a row that have one pattern.
fn fill(
    canvas: &Canvas<'_>,
    plane: &Plane,
    legend: &[(Option<Vec<bool>>, RGBColor)],
    Frame { x, y }: &Frame,
) {
    let n = plane.at[0].len();
    let half = |axis: &Axis, at: &[f64], k: usize, up: bool| {
        let other = if up { k + 1 } else { k.wrapping_sub(1) };
        let end = at.get(other).map_or(at[k], |other| 0.5 * (at[k] + other));
        axis.at(end)
    };
    for (j, row) in plane.patterns.chunks(n.max(1)).enumerate() {
        let mut first = 0;
        for i in 0..row.len() {
            if i + 1 < row.len() && row[i + 1] == row[first] {
                continue;
            }
            let color = legend.iter().find(|(pattern, _)| *pattern == row[first]);
            if let Some((_, color)) = color {
                let from = (
                    half(x, &plane.at[0], first, false),
                    half(y, &plane.at[1], j, true),
                );
                let to = (
                    half(x, &plane.at[0], i, true),
                    half(y, &plane.at[1], j, false),
                );
                // Rows overlap a little, so that no light is seen between them.
                canvas.rect(from, (to.0, to.1 + 0.3), *color);
            }
            first = i + 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{ELSEWHERE, NONE, color};

    #[test]
    fn patterns_have_colours_of_their_own() {
        let all: Vec<_> = (0..30).map(color).chain([NONE, ELSEWHERE]).collect();
        for (k, a) in all.iter().enumerate() {
            assert!(!all[..k].contains(a), "{k}");
        }
    }
}
