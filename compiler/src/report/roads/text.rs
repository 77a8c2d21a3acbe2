//! Runs side by side as tables.

use std::fmt::{self, Write};

use super::{Difference, Road, Roads, Sensed, times};
use crate::report::forms::text::duration;

/// The table of the runs and that of their differences.
pub fn text(roads: &Roads) -> String {
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = write(roads, &mut text);
    text
}

fn write(all: &Roads, text: &mut String) -> fmt::Result {
    let Roads {
        experiment,
        model,
        roads,
        ..
    } = all;
    writeln!(text, "{experiment} of {model}: {}\n", verdict(all))?;
    let width = roads.iter().map(|road| road.name.len()).max();
    let width = width.unwrap_or(0).max("road".len());
    writeln!(
        text,
        "     {:width$}  {:>17}  {:>6}  {:>9}  {:>9}  {:>9}",
        "road", "status", "events", "residual", "estimate", "time"
    )?;
    for (number, road) in (1..).zip(roads) {
        write!(text, "  {number}  {:width$}  ", road.name)?;
        match &road.run {
            Err(refusal) => writeln!(text, "{:>17}  {refusal}", "not applicable")?,
            Ok(run) => {
                let estimate = run.quality.error_estimate;
                let estimate = estimate.map_or("-".to_owned(), |error| format!("{error:.1e}"));
                writeln!(
                    text,
                    "{:>17}  {:>6}  {:>9.1e}  {estimate:>9}  {:>9}",
                    run.status.as_str(),
                    run.history.events.len(),
                    Road::residual(run),
                    duration(run.quality.stats.solve_s)
                )?;
                if let Some(failure) = &run.failure {
                    writeln!(text, "     {:width$}  {failure}", "")?;
                }
                if let Some(doubt) = road.doubt() {
                    writeln!(text, "     {:width$}  {doubt}: confirms nothing", "")?;
                }
            }
        }
    }
    if all.n_sound() < 2 {
        return Ok(());
    }
    writeln!(
        text,
        "\n  differences of last states and along the way, relative to their sizes, and of events, to the horizon"
    )?;
    let n = roads.len();
    let pairs = (1..n).flat_map(|b| (0..b).map(move |a| (a, b)));
    let pairs = pairs.filter_map(|(a, b)| Some((a, b, all.difference(a, b)?)));
    let pairs: Vec<(usize, usize, Difference)> = pairs.collect();
    if pairs
        .iter()
        .any(|(_, _, difference)| difference.sensed.is_some())
    {
        writeln!(
            text,
            "  behind them those of derivatives, relative to the sizes of these"
        )?;
    }
    for (a, b, difference) in pairs {
        let times = match difference.times {
            Some(times) => format!("{times:.1e}"),
            None => "other events".to_owned(),
        };
        let sensed = difference.sensed.map_or(String::new(), |sensed| {
            let Sensed { end, along, times } = sensed;
            format!("  {end:>9.1e}  {along:>9.1e}  {times:>9.1e}")
        });
        let mark = mark(&difference);
        writeln!(
            text,
            "  {} - {}  {:>9.1e}  {:>9.1e}  {times:>12}{sensed}{mark}",
            a + 1,
            b + 1,
            difference.end,
            difference.along
        )?;
    }
    times::write(all, text)
}

/// That a difference is not explained.
fn mark(difference: &Difference) -> String {
    if difference.is_explained() {
        return String::new();
    }
    let explained = format!("{:.1e} are explained", difference.allowed);
    match difference.alone.filter(|_| difference.locates) {
        Some(time) => {
            format!("  DIFFERS, {explained}; at {time:.9} something happens in one alone")
        }
        None if !difference.has_derivatives_explained() => {
            let allowed = difference.allowed_of_derivatives();
            format!("  DIFFERS, {explained}, and {allowed:.1e} of derivatives")
        }
        None => format!("  DIFFERS, {explained}"),
    }
}

/// What there is to say in a line.
fn verdict(all: &Roads) -> String {
    let (n, written) = (all.n_sound(), &all.roads[0]);
    let found = match (all.disagreements().len(), n) {
        (0, 0) => "no road comes to the end".to_owned(),
        (0, n) if n > 0 && all.is_alone() => "one road alone, no other one takes it".to_owned(),
        (0, 1) => "one road alone, nothing confirms it".to_owned(),
        (0, n) if n > 1 && written.sound().is_some() && all.n_confirming() == 0 => {
            "nothing confirms it but its own method".to_owned()
        }
        (0, n) => format!("{n} roads agree"),
        (1, n) => format!("{n} roads, 1 pair of them differs"),
        (pairs, n) => format!("{n} roads, {pairs} pairs of them differ"),
    };
    let found = match all.n_missing() {
        0 => found,
        1 => format!("{found}, 1 misses its own equations"),
        n => format!("{found}, {n} miss their own equations"),
    };
    match (written.doubt(), written.solved()) {
        (Some(doubt), _) => format!("as written it {doubt}; {found}"),
        (None, None) if n > 0 => format!("as written it does not come to the end; {found}"),
        _ => found,
    }
}
