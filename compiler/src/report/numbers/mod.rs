//! The numbers of a run, each with its tolerance: what is kept in a golden file, and compared with another run.
//!
//! ```text
//! // Numbers of crossing of oscillator. Tolerances are yours to change.
//! status is solved
//! x[1] at end = -1.602076545 within 1e-8
//! crossing of c = 1 within 2e-8
//! ```
//!
//! The status, the states at the end, the objective and what happened when. A tolerance is what the experiment asks for,
//! or ten times the estimate of the error where that is more, relative to the size of the quantity: of a state
//! its largest value, of an instant the length of the run. What is decided by an optimum, which is flat, is known to the
//! square root of that; its objective is not.
//!
//! A run agrees with a file where [`renewed`] gives the same lines: a line whose number is close enough stays as it is
//! written, with its tolerance and its comments. So a file changes only where a number has moved.

use std::fmt::Write;

use super::{Kind, Setup, Trajectory};

/// Estimates of errors are right to about this factor (chosen by trial).
const SAFETY: f64 = 10.0;
/// No number is asked for more closely than this, relative to its size: other machines round differently.
const CLOSEST: f64 = 1e-10;
/// The least tolerance of all: what is smaller is rounding, or has a tolerance that somebody wrote.
const LEAST: f64 = 1e-12;
/// Events of one kind on one surface that are kept: the first ones.
const MOST: usize = 20;

/// A number with its name and tolerance.
#[derive(Debug, PartialEq)]
struct Line {
    name: String,
    value: f64,
    within: f64,
}

/// A line of a file, with the comments before it.
struct Kept {
    text: String,
    line: Option<Line>,
    is_used: bool,
}

/// The text of a file for this run, of an experiment with this `tolerance`: lines of the one that is there stay where
/// they hold.
pub fn renewed(kept: Option<&str>, trajectory: &Trajectory, tolerance: f64) -> String {
    let header = header(&trajectory.setup);
    let mut kept = kept.map_or_else(Vec::new, |text| parsed(text, &header));
    let mut text = format!("{header}\n");
    let mut keep = |line: &str, number: Option<&Line>| {
        let place = kept.iter().position(|known| match (number, &known.line) {
            _ if known.is_used => false,
            (Some(number), Some(line)) => line.name == number.name,
            (None, None) => without_comment(known.text.lines().next_back().unwrap_or("")) == line,
            _ => false,
        });
        // The first of its name that is left is the one that is meant, whatever its value is.
        let known = place.map(|place| {
            kept[place].is_used = true;
            &kept[place]
        });
        let holds = known.filter(|known| match (number, &known.line) {
            (Some(number), Some(line)) => holds(line, number.value),
            _ => true,
        });
        let shown = holds.map_or(line, |known| &known.text);
        // Writing to a string does not fail.
        let _ = writeln!(text, "{shown}");
    };
    keep(&format!("status is {}", trajectory.status.as_str()), None);
    for number in numbers(trajectory, tolerance) {
        let Line {
            name,
            value,
            within,
        } = &number;
        let line = format!(
            "{name} = {} within {}",
            shown(*value, *within),
            tidy(*within)
        );
        keep(&line, Some(&number));
    }
    text
}

fn header(setup: &Setup) -> String {
    let (experiment, model) = (&setup.experiment, &setup.model);
    format!("// Numbers of {experiment} of {model}. Tolerances are yours to change.")
}

/// Whether a number is as close as its line asks for.
fn holds(line: &Line, value: f64) -> bool {
    match value.is_finite() && line.value.is_finite() {
        true => (value - line.value).abs() <= line.within,
        false => value.to_string() == line.value.to_string(),
    }
}

/// All numbers, in the order of the file.
fn numbers(trajectory: &Trajectory, tolerance: f64) -> Vec<Line> {
    let estimate = trajectory.quality.error_estimate.unwrap_or(0.0);
    let objective = tolerance.max(CLOSEST);
    let close = match trajectory.setup.kind {
        Kind::Simulate | Kind::Mpc => tolerance.max(SAFETY * estimate).max(CLOSEST),
        Kind::Optimize | Kind::Fit => objective.sqrt(),
    };
    let mut lines = Vec::new();
    let mut add = |name: String, value: f64, within: f64| {
        // A tolerance that is no number would say nothing.
        let within = if within.is_finite() {
            rounded(within)
        } else {
            LEAST
        };
        lines.push(Line {
            name,
            value,
            within: within.max(LEAST),
        });
    };
    if let Some(value) = trajectory.objective {
        add("objective".into(), value, objective * value.abs().max(1.0));
    }
    let Some(last) = trajectory.samples.time.len().checked_sub(1) else {
        return lines;
    };
    let length = trajectory.samples.time[last] - trajectory.samples.time[0];
    if trajectory.setup.kind == Kind::Optimize {
        add("end".into(), trajectory.samples.time[last], close * length);
    }
    for state in &trajectory.samples.states {
        let values = state.values.iter().filter(|value| value.is_finite());
        let size = values.fold(0.0, |size: f64, value| size.max(value.abs()));
        for (name, &value) in state.entry_names().into_iter().zip(state.at(last)) {
            add(format!("{name} at end"), value, close * size);
        }
    }
    let mut known: Vec<(String, usize)> = Vec::new();
    for event in &trajectory.history.events {
        let name = format!("{} of {}", event.kind.as_str(), event.surface);
        let place = known.iter().position(|(other, _)| *other == name);
        let place = place.unwrap_or_else(|| {
            known.push((name.clone(), 0));
            known.len() - 1
        });
        known[place].1 += 1;
        if known[place].1 <= MOST {
            add(name, event.time, close * length);
        }
    }
    lines
}

/// The lines of a file, without its header.
fn parsed(text: &str, header: &str) -> Vec<Kept> {
    let mut kept = Vec::new();
    let mut comments = String::new();
    for line in text.lines().map(str::trim_end) {
        if line == header {
            continue;
        }
        if without_comment(line).is_empty() {
            comments.push_str(line);
            comments.push('\n');
            continue;
        }
        kept.push(Kept {
            text: std::mem::take(&mut comments) + line,
            line: number(without_comment(line)),
            is_used: false,
        });
    }
    kept
}

fn without_comment(line: &str) -> &str {
    line.split("//").next().unwrap_or("").trim()
}

/// `x[1] at end = -1.6 within 1e-8`
fn number(line: &str) -> Option<Line> {
    let (rest, within) = line.rsplit_once(" within ")?;
    let (name, value) = rest.rsplit_once(" = ")?;
    // Anything is within an infinite tolerance: a line with one is none.
    let within: f64 = within.parse().ok()?;
    (within.is_finite() && within >= 0.0).then_some(())?;
    Some(Line {
        name: name.to_owned(),
        value: value.parse().ok()?,
        within,
    })
}

/// A tolerance as 1, 2 or 5 times a power of ten, not below it.
fn rounded(within: f64) -> f64 {
    if within <= 0.0 {
        return 0.0;
    }
    let power = within.log10().floor() as i32;
    let candidates =
        [1, 2, 5, 10].map(|digit| format!("{digit}e{power}").parse().unwrap_or(within));
    // Powers of ten are not exact.
    let is_enough = |candidate: &f64| *candidate >= within * (1.0 - 1e-9);
    candidates.into_iter().find(is_enough).unwrap_or(within)
}

/// A tolerance as it is written.
fn tidy(within: f64) -> String {
    match (1e-3..1e4).contains(&within) {
        true => within.to_string(),
        false => format!("{within:e}"),
    }
}

/// A number with one digit more than its tolerance has.
fn shown(value: f64, within: f64) -> String {
    if !value.is_finite() {
        return value.to_string();
    }
    let digits = 1 - within.log10().floor() as i32;
    let size = match value.abs() >= within {
        true => value.abs().log10().floor() as i32,
        false => -digits,
    };
    if !(-5..15).contains(&size) && value.abs() >= within {
        let significant = (size + digits).clamp(0, 16) as usize;
        return format!("{value:.significant$e}");
    }
    let digits = digits.clamp(0, 16) as usize;
    let text = format!("{value:.digits$}");
    let text = match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.'),
        false => &text,
    };
    match text {
        "-0" => "0".to_owned(),
        text => text.to_owned(),
    }
}

pub mod difference;
#[cfg(test)]
#[path = "numbers_tests.rs"]
mod tests;
