//! Optima side by side as a table.

use std::fmt::{self, Write};

use super::optima::Verdict;
use super::{Optima, Road};
use crate::report::forms::text::duration;
use crate::report::{Status, Trajectory};

/// The table.
pub fn text(all: &Optima) -> String {
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = write(all, &mut text);
    text
}

fn write(all: &Optima, text: &mut String) -> fmt::Result {
    let Optima {
        experiment, model, ..
    } = all;
    writeln!(text, "{experiment} of {model}: {}\n", summary(all))?;
    let width = all.found.iter().map(|found| found.name.len()).max();
    let width = width.unwrap_or(0).max("lowering".len());
    writeln!(
        text,
        "     {:width$}  {:>17}  {:>5}  {:>16}  {:>8}  {:>9}  {:>16}  {:>9}",
        "lowering",
        "status",
        "class",
        "objective",
        "residual",
        "by events",
        "from the best",
        "time"
    )?;
    for (number, found) in all.found.iter().enumerate() {
        write!(text, "  {}  {:width$}  ", number + 1, found.name)?;
        let run = match &found.run {
            Err(code) => {
                writeln!(text, "{:>17}  {code}", "not applicable")?;
                continue;
            }
            Ok(run) => run,
        };
        let by_events = run.quality.error_estimate;
        let by_events = by_events.map_or("-".to_owned(), |error| format!("{error:.1e}"));
        let again = match &found.resumed {
            Some(resumed) => objective(&resumed.run),
            None => "-".to_owned(),
        };
        writeln!(
            text,
            "{:>17}  {:>5}  {:>16}  {:>8.1e}  {by_events:>9}  {again:>16}  {:>9}{}",
            run.status.as_str(),
            run.quality.certificate.stationarity.as_str(),
            objective(run),
            Road::residual(run),
            duration(run.quality.stats.solve_s),
            mark(all, number)
        )?;
        if let Some(failure) = &run.failure {
            writeln!(text, "     {:width$}  {failure}", "")?;
        }
    }
    let elsewhere: Vec<String> = (all.elsewhere().iter())
        .map(|number| (number + 1).to_string())
        .collect();
    if !elsewhere.is_empty() {
        writeln!(
            text,
            "\n  simulations with the controls of {} end elsewhere: the grid is coarse, or the motion unstable",
            elsewhere.join(", ")
        )?;
    }
    Ok(())
}

fn objective(run: &Trajectory) -> String {
    let objective = run.objective;
    objective.map_or("-".to_owned(), |objective| format!("{objective:.9}"))
}

/// What is to be seen in a row.
fn mark(all: &Optima, number: usize) -> String {
    match all.verdict(number) {
        Verdict::Silent | Verdict::Itself | Verdict::Confirms => String::new(),
        Verdict::Another(_) => "  another optimum".to_owned(),
        Verdict::Differs(difference) => format!(
            "  DIFFERS by {difference:.1e}, {:.1e} is allowed",
            all.allowed()
        ),
    }
}

/// What there is to say in a line.
fn summary(all: &Optima) -> String {
    let differing = all.n_differing();
    let found = match (all.objective(), all.n_agreeing()) {
        (None, _) => "no lowering finds an optimum".to_owned(),
        (Some(_), 0 | 1) if all.is_alone() => {
            "one lowering alone, no other one takes it".to_owned()
        }
        (Some(_), 0 | 1) if differing == 0 => "one lowering alone, nothing confirms it".to_owned(),
        (Some(objective), 1) => format!("one lowering has the objective {objective:.6e}"),
        (Some(objective), n) => format!("{n} lowerings have the objective {objective:.6e}"),
    };
    let differ = match differing {
        0 => String::new(),
        1 => ", 1 differs".to_owned(),
        n => format!(", {n} differ"),
    };
    let written = all.found[0].run.as_ref();
    let is_solved = written.is_ok_and(|run| run.status == Status::Solved);
    match (is_solved, all.objective(), all.excess()) {
        (false, Some(_), _) => format!("as written it has no optimum; {found}{differ}"),
        (true, _, Some(excess)) => {
            format!("as written it stops {excess:.1e} above another optimum; {found}{differ}")
        }
        _ => format!("{found}{differ}"),
    }
}
