//! Number and stability of sliding modes over two states, with the curves on which they change.

use plotters::style::RGBColor;

use super::MARGIN;
use super::axis::Axis;
use super::canvas::{Align, Canvas, INK, Point, Stroke, TEXT_SIZE, text_width};
use super::panel::{frame, vertical_ticks};
use crate::report::{Change, Plane, words_of};

const WIDTH: f64 = 340.0;
const HEIGHT: f64 = 280.0;
/// Below the frame: labels of the ticks and the title of the axis.
const FOOT: f64 = 34.0;
/// Left of it: the same.
const SIDE: f64 = 48.0;
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
pub fn write(plane: &Plane) -> String {
    let (left, top) = (MARGIN + SIDE, MARGIN);
    let (right, bottom) = (left + WIDTH, top + HEIGHT);
    let ends = |k: usize| {
        let (first, last) = (plane.at[k].first(), plane.at[k].last());
        (first.copied().unwrap_or(0.0), last.copied().unwrap_or(1.0))
    };
    let ((x0, x1), (y0, y1)) = (ends(0), ends(1));
    let x = Axis::new(x0, x1).placed(left, right);
    let y = Axis::new(y0, y1).placed(bottom, top);
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
    let widest = names.iter().map(|name| text_width(name, TEXT_SIZE));
    let widest = widest.fold(text_width("mode at a side", TEXT_SIZE), f64::max);
    Canvas::svg(
        right + 40.0 + widest + MARGIN,
        bottom + FOOT + MARGIN,
        |canvas| {
            fill(canvas, plane, &legend, [&x, &y]);
            for curve in &plane.curves {
                let points = curve.points.iter();
                let points: Vec<Point> = points.map(|[a, b]| (x.at(*a), y.at(*b))).collect();
                match curve.change {
                    Change::Fold => canvas.line(&points, FOLD),
                    Change::Bound | Change::Other => canvas.dashed(&points, DASHES, BOUND),
                }
            }
            frame(canvas, (left, top), (right, bottom));
            let ticks = x.ticks(N_TICKS);
            for (value, label) in &ticks.marks {
                let at = x.at(*value);
                canvas.line(&[(at, bottom), (at, bottom - 3.0)], Stroke(0.7, INK));
                canvas.text((at, bottom + 9.0), label, Align::Centre, INK);
            }
            let middle = 0.5 * (left + right);
            let title = ticks.title(&plane.states[0]);
            canvas.text((middle, bottom + 24.0), &title, Align::Centre, INK);
            let ticks = y.ticks(N_TICKS);
            vertical_ticks(canvas, &y, &ticks, left);
            let title = ticks.title(&plane.states[1]);
            let middle = 0.5 * (top + bottom);
            canvas.text((MARGIN + 6.0, middle), &title, Align::Upwards, INK);
            let row = |k: usize| top + 10.0 + 16.0 * k as f64;
            for (k, (name, (_, color))) in names.iter().zip(&legend).enumerate() {
                let at = row(k);
                canvas.rect((right + 10.0, at - 5.0), (right + 32.0, at + 5.0), INK);
                canvas.rect((right + 10.5, at - 4.5), (right + 31.5, at + 4.5), *color);
                canvas.text((right + 38.0, at), name, Align::Left, INK);
            }
            let sample = |at: f64| [(right + 10.0, at), (right + 32.0, at)];
            let at = row(names.len());
            canvas.line(&sample(at), FOLD);
            canvas.text((right + 38.0, at), "fold", Align::Left, INK);
            let at = row(names.len() + 1);
            canvas.dashed(&sample(at), DASHES, BOUND);
            canvas.text((right + 38.0, at), "mode at a side", Align::Left, INK);
        },
    )
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
    [x, y]: [&Axis; 2],
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
