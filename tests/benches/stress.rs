//! All cases of the stress families, as a Markdown table: what was promised, and what came out.

#[allow(dead_code, reason = "other benchmarks use all of it")]
mod support;

use std::ops::Range;
use std::process::ExitCode;
use std::time::Instant;

use nsd_tests::stress::{Case, Extent, Family, Outcome, families, free};
use support::print;

/// A first argument chooses families by a part of their name, a second one, like 20..40, cases by their numbers.
fn main() -> ExitCode {
    let mut words = std::env::args()
        .skip(1)
        .filter(|word| !word.starts_with('-'));
    let (chosen, cases) = (words.next(), words.next());
    let cases = cases.map(|range| numbers(&range).expect("a range of cases is like 20..40"));
    let started = Instant::now();
    let mut tally = Tally::default();
    for mut family in families(Extent::Long) {
        if let Some(Range { start, end }) = cases {
            family.cases.truncate(end);
            family.cases.drain(..start.min(family.cases.len()));
        }
        if chosen
            .as_ref()
            .is_none_or(|part| family.name.contains(part.as_str()))
        {
            section(&family, &mut tally);
        }
    }
    if chosen
        .as_ref()
        .is_none_or(|part| "free parameters".contains(part.as_str()))
    {
        free_parameters(&mut tally);
    }
    let Tally {
        met,
        reported,
        broken,
    } = tally;
    print(&format!(
        "\n{} runs in {:.0} s: {met} as accurate as promised, {reported} that say that they are not or end early, \
         {broken} that break their promise.",
        met + reported + broken,
        started.elapsed().as_secs_f64()
    ));
    if broken == 0 {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

fn numbers(range: &str) -> Option<Range<usize>> {
    let (start, end) = range.split_once("..")?;
    Some(start.parse().ok()?..end.parse().ok()?)
}

/// Optimizations against simulations beside the optimum.
fn free_parameters(tally: &mut Tally) {
    print("\n## free parameters\n");
    for instance in free::instances(Extent::Long) {
        match instance.judge() {
            Ok(()) => tally.met += 1,
            Err(reason) => {
                tally.broken += 1;
                print(&format!("{}: **{reason}**", instance.name));
            }
        }
    }
}

#[derive(Default)]
struct Tally {
    met: usize,
    reported: usize,
    broken: usize,
}

/// A table with one line for each hardness and one column for each method.
fn section(family: &Family, tally: &mut Tally) {
    let mut methods: Vec<&str> = Vec::new();
    let mut rows: Vec<(&str, String)> = Vec::new();
    for case in &family.cases {
        if !methods.contains(&case.method.as_str()) {
            methods.push(&case.method);
        }
        if rows.iter().all(|(hardness, _)| *hardness != case.hardness) {
            rows.push((&case.hardness, case.promised()));
        }
    }
    let lines = "| --- ".repeat(methods.len() + 2);
    let head = methods.join(" | ");
    print(&format!(
        "\n## {}\n\n{}\n\n| {} | promised | {head} |\n{lines}|",
        family.name, family.about, family.hardness
    ));
    for (hardness, promised) in rows {
        let cells = methods.iter().map(|method| {
            let of = |case: &&Case| case.hardness == hardness && case.method == *method;
            let cases = family.cases.iter().filter(of);
            let outcomes: Vec<Outcome> = cases.map(|case| tally.run(case)).collect();
            cell(&outcomes)
        });
        let cells: Vec<String> = cells.collect();
        print(&format!(
            "| {hardness} | {promised} | {} |",
            cells.join(" | ")
        ));
    }
}

impl Tally {
    fn run(&mut self, case: &Case) -> Outcome {
        let outcome = case.run();
        *match &outcome {
            outcome if !case.keeps(outcome) => &mut self.broken,
            Outcome::Met { .. } => &mut self.met,
            _ => &mut self.reported,
        } += 1;
        outcome
    }
}

/// The largest error that was promised, then what else came out, and how often where not always.
fn cell(outcomes: &[Outcome]) -> String {
    let is_met = |outcome: &&Outcome| matches!(outcome, Outcome::Met { .. });
    let met = outcomes
        .iter()
        .filter(is_met)
        .cloned()
        .reduce(Outcome::worse);
    let others: Vec<String> = outcomes
        .iter()
        .filter(|o| !is_met(o))
        .map(Outcome::to_string)
        .collect();
    let mut parts: Vec<String> = met.iter().map(Outcome::to_string).collect();
    for (at, other) in others.iter().enumerate() {
        if others[..at].contains(other) {
            continue;
        }
        let count = others.iter().filter(|o| *o == other).count();
        parts.push(match count == outcomes.len() {
            true => other.clone(),
            false => format!("{count} of {}: {other}", outcomes.len()),
        });
    }
    parts.join("; ")
}
