//! Performance profiles: which share of problems a solver solves within a multiple of the best time.
//!
//! Dolan & Moré 2002, *Benchmarking optimization software with performance profiles*. One solver alone has no best
//! time to be compared with; its curve is over seconds.

use plotters::style::RGBColor;

use super::axis::{Axis, Ticks};
use super::canvas::{Canvas, Point, Stroke};
use super::frame::{FOOT, Frame, MARGIN, left_space, right_space};

const WIDTH: f64 = 380.0;
const HEIGHT: f64 = 280.0;
const GRID: Stroke = Stroke(0.5, RGBColor(215, 215, 215));
/// Distinct to colour-blind readers; a solver and its second curve have one colour.
const COLORS: [RGBColor; 2] = [RGBColor(0, 65, 130), RGBColor(200, 90, 0)];
/// The second pair of curves.
const DASHES: (f64, f64) = (5.0, 3.0);

/// The SVG text. Each curve has a name and its seconds for every problem, none where it failed.
///
/// Curves 0 and 2 are of one solver, 1 and 3 of another; 2 and 3 are dashed.
pub fn write(curves: &[(String, Vec<Option<f64>>)]) -> String {
    let n = curves.iter().map(|curve| curve.1.len()).max().unwrap_or(0);
    let is_alone = curves.len() < 2 || !curves.iter().any(|curve| curve.0.starts_with("peer"));
    let costs: Vec<Vec<f64>> = curves
        .iter()
        .map(|(_, times)| costs(times, curves, is_alone))
        .collect();
    let all = costs.iter().flatten().copied();
    let quarters = (0..=4).map(|k| (0.25 * f64::from(k), format!("{} %", 25 * k)));
    let shares = Ticks {
        marks: quarters.collect(),
        exponent: 0,
    };
    let left = MARGIN + left_space(&shares);
    let (x, y) = (Axis::decades(all), Axis::new(0.0, 1.0));
    let frame = Frame::new(x, y, (left, MARGIN), (WIDTH, HEIGHT));
    let names = curves.iter().map(|curve| curve.0.as_str());
    let width = frame.x.end + right_space(names) + MARGIN;
    let title = match is_alone {
        true => "seconds",
        false => "time, as a multiple of the best time of both",
    };
    Canvas::svg(width, frame.y.start + FOOT + MARGIN, |canvas| {
        for (share, _) in &shares.marks {
            canvas.line(&frame.horizontal(frame.y.at(*share)), GRID);
        }
        let ticks = frame.x.ticks(0);
        for (value, _) in &ticks.marks {
            canvas.line(&frame.vertical(frame.x.at(*value)), GRID);
        }
        for (k, costs) in costs.iter().enumerate() {
            let (x, y) = (|cost| frame.x.at(cost), |share| frame.y.at(share));
            let ends = (frame.x.start, frame.x.end);
            stroke(canvas, k, &steps(costs, n, x, y, ends));
        }
        frame.border(canvas);
        frame.labels_below(canvas, &ticks, title);
        frame.beside(canvas, &shares, "share of problems", MARGIN);
        for (k, (name, _)) in curves.iter().enumerate() {
            stroke(canvas, k, &frame.sample(k));
            frame.name(canvas, k, name);
        }
    })
}

fn stroke(canvas: &Canvas<'_>, curve: usize, points: &[Point]) {
    let stroke = Stroke(1.4, COLORS[curve % COLORS.len()]);
    match curve / COLORS.len() {
        0 => canvas.line(points, stroke),
        _ => canvas.dashed(points, DASHES, stroke),
    }
}

/// Seconds, or multiples of the least seconds of any solver, ascending.
fn costs(times: &[Option<f64>], curves: &[(String, Vec<Option<f64>>)], is_alone: bool) -> Vec<f64> {
    /// Clocks tell nothing apart below it.
    const LEAST: f64 = 1e-6;
    let mut costs: Vec<f64> = Vec::new();
    for (problem, time) in times.iter().enumerate() {
        let Some(time) = time.map(|time| time.max(LEAST)) else {
            continue;
        };
        let others = curves.iter().filter_map(|curve| *curve.1.get(problem)?);
        let best = others.fold(f64::INFINITY, f64::min).max(LEAST);
        costs.push(if is_alone { time } else { time / best });
    }
    costs.retain(|cost| cost.is_finite());
    costs.sort_by(f64::total_cmp);
    costs
}

/// The staircase of the share of problems with at most a cost.
fn steps(
    costs: &[f64],
    n: usize,
    x: impl Fn(f64) -> f64,
    y: impl Fn(f64) -> f64,
    (left, right): (f64, f64),
) -> Vec<Point> {
    let share = |count: usize| y(count as f64 / n.max(1) as f64);
    let mut points = vec![(left, share(0))];
    for (i, &cost) in costs.iter().enumerate() {
        points.push((x(cost), share(i)));
        points.push((x(cost), share(i + 1)));
    }
    points.push((right, share(costs.len())));
    points
}

#[cfg(test)]
mod tests {
    use super::{costs, steps, write};

    fn curves() -> Vec<(String, Vec<Option<f64>>)> {
        vec![
            ("nsdc".into(), vec![Some(1.0), Some(2.0), None]),
            ("peer".into(), vec![Some(4.0), Some(1.0), None]),
        ]
    }

    #[test]
    fn costs_are_multiples_of_the_best_time() {
        let curves = curves();
        assert_eq!(costs(&curves[0].1, &curves, false), [1.0, 2.0]);
        assert_eq!(costs(&curves[1].1, &curves, false), [1.0, 4.0]);
        assert_eq!(costs(&curves[0].1, &curves[..1], true), [1.0, 2.0]);
    }

    #[test]
    fn a_problem_that_nobody_solves_lowers_all_curves() {
        let points = steps(&[1.0, 2.0], 3, |x| x, |y| 3.0 * y, (0.0, 9.0));
        let exact = [
            (0.0, 0.0),
            (1.0, 0.0),
            (1.0, 1.0),
            (2.0, 1.0),
            (2.0, 2.0),
            (9.0, 2.0),
        ];
        assert_eq!(points, exact);
    }

    #[test]
    fn the_figure_names_its_curves_and_axes() {
        let svg = write(&curves());
        for text in [
            "nsdc",
            "peer",
            "share of problems",
            "multiple of the best time",
        ] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(write(&curves()[..1]).contains("seconds"));
        assert!(!write(&[]).is_empty());
    }
}
