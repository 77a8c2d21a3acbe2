//! Branches of sliding modes over a state: solid where they attract, dashed where they repel, with their folds.

use plotters::style::RGBColor;

use super::MARGIN;
use super::axis::Axis;
use super::canvas::{Align, Canvas, INK, Point, Stroke, TEXT_SIZE, text_width};
use super::panel::{frame, vertical_ticks};
use crate::report::{Change, Map, Sample};

const WIDTH: f64 = 380.0;
const HEIGHT: f64 = 240.0;
/// Below the frame: labels of the ticks and the title of the axis.
const FOOT: f64 = 34.0;
/// Left of it: the same.
const SIDE: f64 = 48.0;
/// Above it: numbers of modes.
const HEAD: f64 = 16.0;
const N_TICKS: usize = 6;
/// Distinct to colour-blind readers.
const ATTRACTING: Stroke = Stroke(1.8, RGBColor(0, 65, 130));
const REPELLING: Stroke = Stroke(1.4, RGBColor(200, 90, 0));
const DASHES: (f64, f64) = (5.0, 3.0);
const GRID: Stroke = Stroke(0.5, RGBColor(205, 205, 205));

/// The SVG text.
pub fn write(map: &Map) -> String {
    let (left, top) = (MARGIN + SIDE, MARGIN + HEAD);
    let (right, bottom) = (left + WIDTH, top + HEIGHT);
    let ends = [map.samples.first(), map.samples.last()];
    let [lo, hi] = ends.map(|sample| sample.map_or(0.0, |sample| sample.at));
    let x = Axis::new(lo, hi).placed(left, right);
    let y = Axis::around(map.sides).placed(bottom, top);
    let legend = [("attracting", ATTRACTING), ("repelling", REPELLING)];
    let names = legend.map(|(name, _)| text_width(name, TEXT_SIZE));
    let width = right + 40.0 + names.into_iter().fold(0.0, f64::max) + MARGIN;
    Canvas::svg(width, bottom + FOOT + MARGIN, |canvas| {
        for boundary in &map.boundaries {
            let at = x.at(boundary.at);
            canvas.line(&[(at, top), (at, bottom)], GRID);
        }
        let starts = std::iter::once(lo).chain(map.boundaries.iter().map(|b| b.at));
        let stops = map.boundaries.iter().map(|b| b.at).chain([hi]);
        for (from, to) in starts.zip(stops) {
            let inside: Vec<&Sample> = (map.samples.iter())
                .filter(|sample| from <= sample.at && sample.at <= to)
                .collect();
            draw(canvas, &inside, 0.5 * (from + to), [&x, &y], top);
        }
        for boundary in &map.boundaries {
            if let (Change::Fold, Some(value)) = (boundary.change, boundary.value) {
                canvas.disc((x.at(boundary.at), y.at(value)), 3.2, INK);
            }
        }
        frame(canvas, (left, top), (right, bottom));
        let ticks = x.ticks(N_TICKS);
        for (value, label) in &ticks.marks {
            let at = x.at(*value);
            canvas.line(&[(at, bottom), (at, bottom - 3.0)], Stroke(0.7, INK));
            canvas.text((at, bottom + 9.0), label, Align::Centre, INK);
        }
        let title = ticks.title(&map.state);
        canvas.text(
            (0.5 * (left + right), bottom + 24.0),
            &title,
            Align::Centre,
            INK,
        );
        let ticks = y.ticks(N_TICKS);
        vertical_ticks(canvas, &y, &ticks, left);
        let title = ticks.title(&map.switch);
        canvas.text(
            (MARGIN + 6.0, 0.5 * (top + bottom)),
            &title,
            Align::Upwards,
            INK,
        );
        for (k, (name, stroke)) in legend.into_iter().enumerate() {
            let at = top + 10.0 + 16.0 * k as f64;
            let sample = [(right + 10.0, at), (right + 32.0, at)];
            match k {
                0 => canvas.line(&sample, stroke),
                _ => canvas.dashed(&sample, DASHES, stroke),
            }
            canvas.text((right + 38.0, at), name, Align::Left, INK);
        }
    })
}

/// The branches in an interval without a change, with their number above them.
fn draw(canvas: &Canvas<'_>, samples: &[&Sample], middle: f64, [x, y]: [&Axis; 2], top: f64) {
    let distance = |sample: &&&Sample| (sample.at - middle).abs();
    let nearest = samples
        .iter()
        .min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let Some(attracts) = nearest.and_then(|sample| sample.pattern()) else {
        return;
    };
    let count = attracts.len().to_string();
    canvas.text((x.at(middle), top - 8.0), &count, Align::Centre, INK);
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
