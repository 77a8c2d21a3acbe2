//! Branches of sliding modes over a state: solid where they attract, dashed where they repel, with their folds.

use plotters::style::RGBColor;

use super::axis::Axis;
use super::canvas::{Align, Canvas, INK, Point, Stroke};
use super::frame::{FOOT, Frame, MARGIN, left_space, right_space};
use crate::model::Units;
use crate::report::{Change, Map, Sample};

const WIDTH: f64 = 380.0;
const HEIGHT: f64 = 240.0;
/// Above the frame: numbers of modes.
const HEAD: f64 = 16.0;
const N_TICKS: usize = 6;
/// Distinct to colour-blind readers.
const ATTRACTING: Stroke = Stroke(1.8, RGBColor(0, 65, 130));
const REPELLING: Stroke = Stroke(1.4, RGBColor(200, 90, 0));
const DASHES: (f64, f64) = (5.0, 3.0);
const GRID: Stroke = Stroke(0.5, RGBColor(205, 205, 205));

/// The SVG text.
pub fn write(map: &Map, units: &Units) -> String {
    let ends = [map.samples.first(), map.samples.last()];
    let [lo, hi] = ends.map(|sample| sample.map_or(0.0, |sample| sample.at));
    let (x, y) = (Axis::new(lo, hi), Axis::around(map.sides));
    let corner = (MARGIN + left_space(&y.ticks(N_TICKS)), MARGIN + HEAD);
    let frame = Frame::new(x, y, corner, (WIDTH, HEIGHT));
    let legend = [("attracting", ATTRACTING), ("repelling", REPELLING)];
    let names = legend.map(|(name, _)| name);
    let width = frame.x.end + right_space(names) + MARGIN;
    Canvas::svg(width, frame.y.start + FOOT + MARGIN, |canvas| {
        for boundary in &map.boundaries {
            canvas.line(&frame.vertical(frame.x.at(boundary.at)), GRID);
        }
        let starts = std::iter::once(lo).chain(map.boundaries.iter().map(|b| b.at));
        let stops = map.boundaries.iter().map(|b| b.at).chain([hi]);
        for (from, to) in starts.zip(stops) {
            let inside: Vec<&Sample> = (map.samples.iter())
                .filter(|sample| from <= sample.at && sample.at <= to)
                .collect();
            draw(canvas, &inside, 0.5 * (from + to), &frame);
        }
        for boundary in &map.boundaries {
            if let (Change::Fold, Some(value)) = (boundary.change, boundary.value) {
                let place = (frame.x.at(boundary.at), frame.y.at(value));
                canvas.disc(place, 3.2, INK);
            }
        }
        frame.draw(canvas, [&units.title(&map.state), &map.switch], N_TICKS);
        for (k, (name, stroke)) in legend.into_iter().enumerate() {
            match k {
                0 => canvas.line(&frame.sample(k), stroke),
                _ => canvas.dashed(&frame.sample(k), DASHES, stroke),
            }
            frame.name(canvas, k, name);
        }
    })
}

/// The branches in an interval without a change, with their number above them.
fn draw(canvas: &Canvas<'_>, samples: &[&Sample], middle: f64, Frame { x, y }: &Frame) {
    let distance = |sample: &&&Sample| (sample.at - middle).abs();
    let nearest = samples
        .iter()
        .min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let Some(attracts) = nearest.and_then(|sample| sample.pattern()) else {
        return;
    };
    let count = attracts.len().to_string();
    canvas.text((x.at(middle), y.end - 8.0), &count, Align::Centre, INK);
    let usual = samples
        .iter()
        .filter(|sample| sample.pattern().as_ref() == Some(&attracts));
    let usual: Vec<&&Sample> = usual.collect();
    for (k, attracts) in attracts.iter().enumerate() {
        let points = usual.iter().filter_map(|sample| {
            let mode = sample.modes.as_ref()?.get(k)?;
            Some((x.at(sample.at), y.at(mode.value)))
        });
        let points: Vec<Point> = points.collect();
        match attracts {
            true => canvas.line(&points, ATTRACTING),
            false => canvas.dashed(&points, DASHES, REPELLING),
        }
    }
}
