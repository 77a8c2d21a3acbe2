//! All cases of the stress families, as a Markdown table: what was promised, and what came out.
//!
//! Those that are not as accurate as promised are named on standard error.

#![allow(
    clippy::print_stderr,
    reason = "what is named is not part of the table"
)]

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
    for family in families(Extent::Long) {
        if chosen
            .as_ref()
            .is_none_or(|part| family.name.contains(part.as_str()))
        {
            section(&family, cases.clone().unwrap_or(0..usize::MAX), &mut tally);
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
fn section(family: &Family, numbers: Range<usize>, tally: &mut Tally) {
    let mut methods: Vec<&str> = Vec::new();
    let mut rows: Vec<(&str, String)> = Vec::new();
    let cases = || {
        let numbered = family.cases.iter().enumerate();
        numbered.filter(|(number, _)| numbers.contains(number))
    };
    for (_, case) in cases() {
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
            let of = |case: &Case| case.hardness == hardness && case.method == *method;
            let cases = cases().filter(|(_, case)| of(case));
            let outcomes: Vec<Outcome> = cases
                .map(|(number, case)| tally.run(case, &format!("{}, {number}", family.name)))
                .collect();
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
    /// Names the case on standard error where it is not as accurate as promised.
    fn run(&mut self, case: &Case, name: &str) -> Outcome {
        let outcome = case.run();
        let is_kept = case.keeps(&outcome);
        let count = match &outcome {
            _ if !is_kept => &mut self.broken,
            Outcome::Met { .. } => &mut self.met,
            _ => &mut self.reported,
        };
        *count += 1;
        if !is_kept {
            eprintln!("{name}: {outcome}, promised {}", case.promised());
        } else if !matches!(outcome, Outcome::Met { .. }) {
            eprintln!("{name}: {outcome}");
        }
        outcome
    }
}

/// Of each kind of outcome the largest error, and how often it came out where not always; what was promised first.
fn cell(outcomes: &[Outcome]) -> String {
    let mut kinds: Vec<(Outcome, usize)> = Vec::new();
    for outcome in outcomes {
        match kinds.iter_mut().find(|(kind, _)| kind.is_like(outcome)) {
            Some((worst, count)) => {
                *worst = worst.clone().worse(outcome.clone());
                *count += 1;
            }
            None => kinds.push((outcome.clone(), 1)),
        }
    }
    kinds.sort_by_key(|(kind, _)| !matches!(kind, Outcome::Met { .. }));
    let parts = kinds.iter().map(|(worst, count)| {
        let is_met = matches!(worst, Outcome::Met { .. });
        match is_met || *count == outcomes.len() {
            true => worst.to_string(),
            false => format!("{count} of {}: {worst}", outcomes.len()),
        }
    });
    parts.collect::<Vec<_>>().join("; ")
}
