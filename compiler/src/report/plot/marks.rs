//! Marks of events, colours of modes, and the legend that explains both.

use plotters::style::RGBColor;

use super::canvas::{Align, Canvas, INK, Point, Stroke, TEXT_SIZE, text_width, widest};
use super::frame::swatch;
use super::panel::{SHADES, SINGLE, pale};
use crate::report::{Ensemble, EventKind, History, ModeTexts};

/// Lines on the pale bands, distinct to colour-blind readers (Okabe and Ito).
pub const LINES: [RGBColor; 4] = [
    RGBColor(0, 90, 160),
    RGBColor(200, 80, 0),
    RGBColor(0, 130, 95),
    RGBColor(165, 70, 130),
];
/// Bands of modes: the pale scheme of Tol.
const BANDS: [RGBColor; 5] = [
    RGBColor(226, 234, 246),
    RGBColor(251, 232, 214),
    RGBColor(222, 240, 226),
    RGBColor(246, 240, 205),
    RGBColor(244, 226, 236),
];
/// The band of all modes without a colour of their own.
const OTHER: RGBColor = RGBColor(236, 236, 236);
/// Characters of a mode in the legend before its switches are named by what they do.
const MAX_MODE: usize = 44;

/// Which colour the band of each mode has.
pub struct Bands {
    /// Named modes with their colours, in order of appearance.
    named: Vec<(String, RGBColor)>,
    /// How many modes share the colour of the rest.
    n_others: usize,
}

impl Bands {
    /// Colours for the modes that last longest; none if there is nothing to tell apart.
    pub fn new(history: &History) -> Self {
        let mut modes: Vec<(String, f64)> = Vec::new();
        for interval in &history.modes {
            let duration = interval.to - interval.from;
            match modes.iter_mut().find(|(name, _)| *name == interval.mode) {
                Some((_, total)) => *total += duration,
                None => modes.push((interval.mode.clone(), duration)),
            }
        }
        if modes.len() < 2 {
            return Bands {
                named: Vec::new(),
                n_others: 0,
            };
        }
        let mut durations: Vec<f64> = modes.iter().map(|(_, duration)| *duration).collect();
        durations.sort_by(|a, b| b.total_cmp(a));
        let shortest = durations[(BANDS.len() - 1).min(durations.len() - 1)];
        let n_modes = modes.len();
        let named: Vec<_> = modes
            .into_iter()
            .filter(|(_, duration)| *duration >= shortest)
            .zip(BANDS)
            .map(|((name, _), color)| (name, color))
            .collect();
        Bands {
            n_others: n_modes - named.len(),
            named,
        }
    }

    /// The colour of a mode, if modes are told apart.
    pub fn color(&self, mode: &str) -> Option<RGBColor> {
        let own = self.named.iter().find(|(name, _)| name == mode);
        match own {
            Some((_, color)) => Some(*color),
            None => (self.n_others > 0).then_some(OTHER),
        }
    }
}

/// Draws the mark of an event.
pub fn mark(canvas: &Canvas<'_>, kind: EventKind, (x, y): Point, r: f64) {
    use EventKind::*;
    // Filled marks begin something, open ones end it.
    let open = matches!(kind, LeaveSliding | ContactOpen | Slip | Deactivate);
    let hole = RGBColor(255, 255, 255);
    let shape = |corners: &[Point]| {
        let scaled = |f: f64| {
            corners
                .iter()
                .map(|c| (x + f * r * c.0, y + f * r * c.1))
                .collect::<Vec<_>>()
        };
        canvas.polygon(&scaled(1.0), INK);
        if open {
            canvas.polygon(&scaled(0.55), hole);
        }
    };
    let stroke = Stroke(0.9, INK);
    match kind {
        Crossing => shape(&[(-0.95, -0.8), (0.95, -0.8), (0.0, 0.9)]),
        EnterSliding | LeaveSliding => {
            canvas.disc((x, y), r * 0.95, INK);
            if open {
                canvas.disc((x, y), r * 0.6, hole);
            }
        }
        Jump => shape(&[(0.0, -1.1), (0.9, 0.0), (0.0, 1.1), (-0.9, 0.0)]),
        ContactClose | ContactOpen => {
            shape(&[(-0.85, -0.85), (0.85, -0.85), (0.85, 0.85), (-0.85, 0.85)])
        }
        Stick | Slip => shape(&[(-0.8, 0.95), (-0.8, -0.95), (0.95, 0.0)]),
        Activate | Deactivate => shape(&[(-0.95, 0.8), (0.95, 0.8), (0.0, -0.9)]),
        Relay => shape(&[(-1.0, -0.4), (1.0, -0.4), (1.0, 0.4), (-1.0, 0.4)]),
        Fold | Zeno => {
            canvas.line(&[(x - r, y - r), (x + r, y + r)], stroke);
            canvas.line(&[(x - r, y + r), (x + r, y - r)], stroke);
            if kind == Zeno {
                canvas.line(&[(x, y - r), (x, y + r)], stroke);
            }
        }
        Sample => {}
        Stop => canvas.line(&[(x, y - 1.6 * r), (x, y + 1.6 * r)], Stroke(2.0, INK)),
        Branch => {
            canvas.line(&[(x, y - r), (x, y + r)], stroke);
            canvas.line(&[(x - r, y), (x + r, y)], stroke);
        }
    }
}

/// An entry of a [`Legend`].
enum Entry {
    Band(RGBColor),
    Event(EventKind),
    Curve { dash: (f64, f64) },
    Line(f64),
    Start,
    End,
}

/// Samples with names, laid out in rows.
#[derive(Default)]
pub struct Legend {
    entries: Vec<(Entry, String)>,
}

const SAMPLE: f64 = 16.0;
const ROW: f64 = TEXT_SIZE + 5.0;

impl Legend {
    /// The legend of modes and events.
    pub fn new(history: &History, bands: &Bands) -> Self {
        let mut entries: Vec<(Entry, String)> = Vec::new();
        let texts = ModeTexts::new(history, MAX_MODE);
        for (name, color) in &bands.named {
            entries.push((Entry::Band(*color), texts.text(name)));
        }
        match bands.n_others {
            0 => {}
            1 => entries.push((Entry::Band(OTHER), "1 other mode".into())),
            n => entries.push((Entry::Band(OTHER), format!("{n} other modes"))),
        }
        let marked = |kind: &EventKind| *kind != EventKind::Sample;
        for kind in EventKind::ALL.into_iter().filter(marked) {
            if history.events.iter().any(|event| event.kind == kind) {
                entries.push((Entry::Event(kind), kind.as_str().replace('_', " ")));
            }
        }
        Legend { entries }
    }

    /// The legend of many runs, with their quantiles where some are drawn.
    pub fn of_ensemble(ensemble: &Ensemble, has_quantiles: bool) -> Self {
        let [lowest, low, _, high, highest] =
            (ensemble.levels).map(|level| format!("{}", 100.0 * level));
        let [outer, inner] = SHADES.map(|share| Entry::Band(pale(LINES[0], share)));
        let median = format!("median of {} runs", ensemble.runs);
        let quantiles = [
            (Entry::Line(1.6), median),
            (inner, format!("{low} to {high} %")),
            (outer, format!("{lowest} to {highest} %")),
        ];
        let one = format!("run with seed {}", ensemble.first_seed);
        let quantiles = quantiles.into_iter().filter(|_| has_quantiles);
        let entries = quantiles.chain([(Entry::Line(SINGLE), one)]).collect();
        Legend { entries }
    }

    /// The legend of a phase plane.
    pub fn of_phase_plane(curves: &[(String, (f64, f64))]) -> Self {
        let mut entries = vec![
            (Entry::Start, "start".to_owned()),
            (Entry::End, "end".to_owned()),
        ];
        for (name, dash) in curves {
            entries.push((Entry::Curve { dash: *dash }, format!("{name} = 0")));
        }
        Legend { entries }
    }

    /// How high it is when it may be `width` wide.
    pub fn height(&self, width: f64) -> f64 {
        let ends = self.layout(width).into_iter();
        ends.map(|((_, y), lines)| y + ROW * lines.len() as f64)
            .fold(0.0, f64::max)
    }

    /// Draws it with its upper left corner at `corner`.
    pub fn draw(&self, canvas: &Canvas<'_>, corner: Point, width: f64) {
        for ((entry, _), ((x, y), lines)) in self.entries.iter().zip(self.layout(width)) {
            let (x, y) = (corner.0 + x, corner.1 + y + ROW / 2.0);
            let middle = (x + SAMPLE / 2.0, y);
            match entry {
                Entry::Band(color) => {
                    swatch(canvas, [(x, y), (x + SAMPLE - 1.0, y)], *color);
                }
                Entry::Event(kind) => mark(canvas, *kind, middle, 3.6),
                Entry::Curve { dash } => canvas.dashed(&[(x, y), (x + SAMPLE, y)], *dash, CURVE),
                Entry::Line(width) => {
                    let stroke = Stroke(*width, LINES[0]);
                    canvas.line(&[(x, y), (x + SAMPLE, y)], stroke);
                }
                Entry::Start => start(canvas, middle),
                Entry::End => end(canvas, middle),
            }
            for (k, line) in lines.iter().enumerate() {
                let place = (x + SAMPLE + 4.0, y + k as f64 * ROW);
                canvas.text(place, line, Align::Left, INK);
            }
        }
    }

    /// The corner and the lines of every entry; a row is broken when it is full, and a name that is wider than one.
    fn layout(&self, width: f64) -> Vec<(Point, Vec<&str>)> {
        let (mut x, mut y, mut high) = (0.0, 0.0, 0.0);
        let mut places = Vec::new();
        for (_, name) in &self.entries {
            let lines = broken(name, width - SAMPLE - 4.0);
            let needed = SAMPLE + 4.0 + widest(lines.iter().copied());
            if x > 0.0 && x + needed > width {
                (x, y, high) = (0.0, y + high, 0.0);
            }
            high = ROW.max(high).max(ROW * lines.len() as f64);
            places.push(((x, y), lines));
            x += needed + 14.0;
        }
        places
    }
}

/// The line of a switching curve.
pub const CURVE: Stroke = Stroke(0.9, RGBColor(110, 110, 110));

/// Marks the start of a trajectory.
pub fn start(canvas: &Canvas<'_>, at: Point) {
    canvas.disc(at, 4.0, LINES[0]);
    canvas.disc(at, 2.6, RGBColor(255, 255, 255));
}

/// Marks the end of a trajectory.
pub fn end(canvas: &Canvas<'_>, at: Point) {
    canvas.disc(at, 4.0, LINES[0]);
}

/// The lines of a text that are at most so wide, broken behind commas or at spaces, and within words where these are wider.
pub fn broken(text: &str, width: f64) -> Vec<&str> {
    let mut lines = Vec::new();
    let mut rest = text;
    while text_width(rest, TEXT_SIZE) > width {
        let ends = rest.char_indices().map(|(at, c)| at + c.len_utf8());
        let fit = ends.take_while(|&end| text_width(&rest[..end], TEXT_SIZE) <= width);
        let first = rest.chars().next().map_or(0, char::len_utf8);
        let fit = fit.last().unwrap_or(first).max(first);
        // Between words of a mode first, in all but very short lines.
        let comma = rest[..fit].rfind(", ").filter(|at| 2 * at >= fit);
        let space = comma.map(|at| at + 1).or_else(|| rest[..fit].rfind(' '));
        let end = match space {
            Some(space) if space > 0 => space + 1,
            _ => fit,
        };
        lines.push(rest[..end].trim_end());
        rest = rest[end..].trim_start();
    }
    lines.push(rest);
    lines
}

#[cfg(test)]
mod tests {
    use super::{TEXT_SIZE, broken, text_width};

    #[test]
    fn wide_names_are_broken_and_lose_nothing() {
        let name = "below((q - [1, -1])[1]), above(a_name_without_any_space_in_it)";
        for width in [5.0, 60.0, 150.0, 1000.0] {
            let lines = broken(name, width);
            let is_narrow = |line: &&str| text_width(line, TEXT_SIZE) <= width.max(9.0);
            assert!(lines.iter().all(is_narrow), "{lines:?}");
            let without = |text: &str| text.replace(' ', "");
            assert_eq!(without(&lines.concat()), without(name));
        }
        assert_eq!(broken(name, 1000.0), [name]);
        assert_eq!(broken("a b", 8.0), ["a", "b"]);
        assert_eq!(broken("active(a, v + b)", 68.0), ["active(a,", "v + b)"]);
    }
}
