//! The short report on the terminal.

use std::fmt::{self, Display, Write};

use crate::diagnostics::counted;
use crate::report::{
    Bands, Constraint, Decision, Event, EventKind, Fit, GridTried, History, MethodOption,
    ModeTexts, Samples, Search, Series, Stationarity, Stats, Status, Times, Trajectory,
};

/// Rows of a table before the rest is only counted.
const MAX_ROWS: usize = 12;
/// Characters of a mode before its switches are named by what they do.
const MAX_MODE: usize = 60;
/// Characters of a switching function without a name before its middle is left out.
const MAX_NAME: usize = 60;
/// Entries of a vector before the rest is left out.
const MAX_ENTRIES: usize = 8;

/// Multipliers below this share of the objective or of the largest of them are rounding; chosen by trial.
const FELT: f64 = 1e-6;

/// The report, plain text with a line break at the end.
pub fn write(trajectory: &Trajectory) -> String {
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = report(trajectory, &mut text);
    text
}

fn report(trajectory: &Trajectory, text: &mut String) -> fmt::Result {
    let (experiment, model) = (&trajectory.setup.experiment, &trajectory.setup.model);
    let status = trajectory.status.as_str();
    writeln!(text, "{experiment} of {model}: {status}")?;
    if let Some(failure) = &trajectory.failure {
        writeln!(text, "  {failure}")?;
    }
    if let Some(objective) = trajectory.objective {
        writeln!(text, "  objective {}", significant(objective, 12))?;
    }
    terms(trajectory, text)?;
    free(trajectory, text)?;
    constraints(trajectory, text)?;
    end(trajectory, text)?;
    events(&trajectory.history, text)?;
    modes(&trajectory.history, text)?;
    origin(trajectory, text)?;
    optimum(trajectory, text)?;
    ensemble(trajectory, text)?;
    fit(trajectory, text)?;
    closed_loop(trajectory, text)?;
    for skipped in &trajectory.setup.skipped {
        writeln!(text, "  skipped {skipped}")?;
    }
    for warning in &trajectory.warnings {
        writeln!(text, "  warning {}: {}", warning.code, warning.message)?;
    }
    Ok(())
}

/// Derivatives at the end.
fn sensitivities(end: &Samples, text: &mut String) -> fmt::Result {
    for by in &end.sensitivities {
        writeln!(text, "\n  sensitivity to {}", by.to)?;
        if let Some(until) = by.until {
            writeln!(text, "    not known from {} on", significant(until, 12))?;
            continue;
        }
        let all = by.states.iter().chain(&by.outputs);
        let width = all.clone().map(|series| chars(&series.name)).max();
        for series in all {
            let width = width.unwrap_or(0);
            writeln!(text, "    {:width$} = {}", series.name, Value(series))?;
        }
    }
    Ok(())
}

/// Free parameters at an optimum.
fn free(trajectory: &Trajectory, text: &mut String) -> fmt::Result {
    let free = trajectory
        .optimum
        .iter()
        .flat_map(|found| &found.values.free);
    let width = free.clone().map(|(name, _)| chars(name)).max();
    let Some(width) = width else {
        return Ok(());
    };
    writeln!(text, "\n  free parameters")?;
    for (name, value) in free {
        writeln!(text, "    {name:width$} = {}", significant(*value, 12))?;
    }
    Ok(())
}

/// Terms of an objective, where there are several.
fn terms(trajectory: &Trajectory, text: &mut String) -> fmt::Result {
    let terms = trajectory
        .optimum
        .iter()
        .flat_map(|found| &found.values.terms);
    let width = terms.clone().map(|term| chars(&term.text)).max();
    let Some(width) = width.filter(|_| terms.clone().count() > 1) else {
        return Ok(());
    };
    writeln!(text, "\n  terms of the objective")?;
    for term in terms {
        writeln!(
            text,
            "    {:width$} = {}",
            term.text,
            significant(term.value, 12)
        )?;
    }
    Ok(())
}

/// Bounds that the objective feels.
fn constraints(trajectory: &Trajectory, text: &mut String) -> fmt::Result {
    let all = trajectory
        .optimum
        .iter()
        .flat_map(|found| &found.values.constraints);
    let sizes = all.clone().filter_map(|one| one.multiplier);
    let sizes = sizes.chain(trajectory.objective);
    let largest = sizes.fold(0.0, |m: f64, size| m.max(size.abs()));
    let is_felt = |multiplier: f64| multiplier.abs() > FELT * largest;
    let felt = all.filter(|one| one.multiplier.is_none_or(is_felt));
    let line = |constraint: &Constraint| {
        let Constraint {
            value,
            relation,
            bound,
            at,
            ..
        } = constraint;
        let at = at.map_or_else(String::new, |at| format!(" at {at}"));
        format!("{value} {relation} {}{at}", significant(*bound, 12))
    };
    let lines: Vec<(String, Option<f64>)> = felt.map(|one| (line(one), one.multiplier)).collect();
    let width = lines.iter().map(|(line, _)| chars(line)).max();
    let Some(width) = width else {
        return Ok(());
    };
    writeln!(
        text,
        "\n  multipliers: derivatives of the objective by bounds"
    )?;
    for (line, multiplier) in lines.iter().take(MAX_ROWS) {
        let multiplier = multiplier.map(|multiplier| significant(multiplier, 6));
        let multiplier = multiplier.as_deref().unwrap_or("not unique");
        writeln!(text, "    {line:width$}  {multiplier}")?;
    }
    rest(text, lines.len())
}

/// The state at the last instant.
fn end(trajectory: &Trajectory, text: &mut String) -> fmt::Result {
    let end = trajectory.samples.end();
    let Some(&time) = end.time.first() else {
        return Ok(());
    };
    let reached = match (trajectory.status, trajectory.history.stop()) {
        (_, Some(stop)) => format!("stopped where {}", stop.surface),
        (Status::Solved, _) => "at the end".to_owned(),
        _ => "reached".to_owned(),
    };
    let time = significant(time, 12);
    writeln!(text, "\n  {reached}, time = {time}")?;
    let rows = end.states_and_outputs();
    let width = rows
        .clone()
        .map(|series| chars(&series.name))
        .max()
        .unwrap_or(0);
    for series in rows {
        writeln!(text, "    {:width$} = {}", series.name, Value(series))?;
    }
    sensitivities(&end, text)
}

fn events(history: &History, text: &mut String) -> fmt::Result {
    if history.events.is_empty() {
        return Ok(());
    }
    let (samples, events): (Vec<&Event>, Vec<&Event>) =
        (history.events.iter()).partition(|event| event.kind == EventKind::Sample);
    // Known before the run, and as many as there are periods.
    if !samples.is_empty() {
        writeln!(text, "\n  {}", counted(samples.len(), "sample"))?;
    }
    if events.is_empty() {
        return Ok(());
    }
    let texts = ModeTexts::new(history, MAX_MODE);
    let rows = events.iter().take(MAX_ROWS).map(|event| {
        [
            significant(event.time, 12),
            event.kind.as_str().to_owned(),
            shortened(history.surface(&event.surface)),
            texts.change(event),
        ]
    });
    let mut rows: Vec<_> = rows.collect();
    writeln!(text, "\n  {}", counted(events.len(), "event"))?;
    match rows.iter().all(|[.., change]| change.is_empty()) {
        true => {
            let rows = rows
                .into_iter()
                .map(|[time, kind, surface, _]| [time, kind, surface]);
            table(text, ["time", "kind", "surface"], rows.collect())?;
        }
        false => {
            for [.., change] in &mut rows {
                if change.is_empty() {
                    "unchanged".clone_into(change);
                }
            }
            table(text, ["time", "kind", "surface", "mode"], rows)?;
        }
    }
    rest(text, events.len())?;
    sliding_modes(history, text)
}

/// Where nonlinear switches had several ways to go on.
fn sliding_modes(history: &History, text: &mut String) -> fmt::Result {
    let told = |event: &&Event| matches!(event.kind, EventKind::Fold | EventKind::Branch);
    let shown = history.events.iter().take(MAX_ROWS).filter(told);
    let rows: Vec<[String; 5]> = shown
        .flat_map(|event| {
            event.sliding.iter().map(|mode| {
                let nature = match mode.stability {
                    s if s < 0.0 => "attracting",
                    s if s > 0.0 => "repelling",
                    _ => "fold",
                };
                [
                    significant(event.time, 12),
                    shortened(history.surface(&event.surface)),
                    significant(mode.value, 8),
                    significant(mode.stability, 4),
                    match mode.taken {
                        true => format!("{nature}, taken"),
                        false => nature.to_owned(),
                    },
                ]
            })
        })
        .collect();
    if rows.is_empty() {
        return Ok(());
    }
    writeln!(text, "\n  {}", counted(rows.len(), "sliding mode"))?;
    table(text, ["time", "switch", "value", "S", ""], rows)
}

fn modes(history: &History, text: &mut String) -> fmt::Result {
    let modes = &history.modes;
    if modes.is_empty() || modes.iter().all(|interval| interval.mode.is_empty()) {
        return Ok(());
    }
    let texts = ModeTexts::new(history, MAX_MODE);
    let rows = modes.iter().take(MAX_ROWS).map(|interval| {
        [
            significant(interval.from, 6),
            significant(interval.to, 6),
            texts.text(&interval.mode),
        ]
    });
    writeln!(text, "\n  {}", counted(modes.len(), "mode interval"))?;
    table(text, ["from", "to", "mode"], rows.collect())?;
    rest(text, modes.len())
}

/// Where the numbers came from.
fn origin(trajectory: &Trajectory, text: &mut String) -> fmt::Result {
    let method = &trajectory.setup.method;
    write!(text, "\n  method {}", method.name)?;
    for (name, value) in &method.options {
        match value {
            MethodOption::Number(number) => write!(text, ", {name} {}", significant(*number, 6))?,
            MethodOption::Text(word) => write!(text, ", {name} {word}")?,
        }
    }
    writeln!(text)?;
    match trajectory.quality.error_estimate {
        Some(_) if trajectory.quality.stats.steps == 0 => {}
        Some(_) | None if trajectory.optimum.is_some() => {}
        Some(error) => writeln!(
            text,
            "  error estimate {error:.1e}, relative, largest over the states"
        )?,
        None if trajectory.warnings.iter().any(|w| w.code == "W0738") => {
            writeln!(text, "  error estimate: none")?;
        }
        None => writeln!(text, "  error estimate: none with this method")?,
    }
    let Stats {
        steps,
        rhs_evaluations,
        newton_iterations,
        ..
    } = trajectory.quality.stats;
    write!(text, "  {}", counted(steps as usize, "step"))?;
    for (count, what) in [
        (rhs_evaluations, "evaluation"),
        (newton_iterations, "Newton iteration"),
    ] {
        if count > 0 {
            write!(text, ", {}", counted(count as usize, what))?;
        }
    }
    let seconds = trajectory.quality.stats.solve_s;
    writeln!(text, ", {}", duration(seconds))
}

/// What a controller has done.
fn closed_loop(trajectory: &Trajectory, text: &mut String) -> fmt::Result {
    let Some(found) = &trajectory.several.closed_loop else {
        return Ok(());
    };
    let n = counted(found.samples.len(), "plan");
    write!(
        text,
        "\n  {n} of {} every {}:",
        found.controller, found.sample
    )?;
    let ways = [
        (Decision::Warm, "solved from the last one"),
        (Decision::Cold, "solved anew"),
        (Decision::Feasible, "feasible"),
        (Decision::Kept, "none, and the last one went on"),
    ];
    let counts = ways.map(|(decision, what)| (found.count(decision), what));
    let told = counts.iter().filter(|(count, _)| *count > 0);
    let told: Vec<String> = told
        .map(|(count, what)| format!("{count} {what}"))
        .collect();
    writeln!(text, " {}", told.join(", "))?;
    let Times {
        first,
        median,
        upper,
        longest,
    } = found.times;
    let [first, median, upper, longest] = [first, median, upper, longest].map(duration);
    writeln!(
        text,
        "  solved in {median} (median), {upper} (95 %), {longest} (longest); the first in {first}"
    )
}

/// What the data say of parameters.
fn fit(trajectory: &Trajectory, text: &mut String) -> fmt::Result {
    let Some(fit) = &trajectory.several.fit else {
        return Ok(());
    };
    let count: usize = fit.data.iter().map(|data| data.time.len()).sum();
    let (found, free) = (
        counted(count, "measurement"),
        counted(fit.free.len(), "free number"),
    );
    writeln!(text, "\n  fit of {free} to {found}")?;
    measured(fit, text)?;
    estimates(fit, text)?;
    directions(fit, text)?;
    writeln!(
        text,
        "  residuals {} in norm, standard deviation {}, {} degrees of freedom",
        significant(fit.residual_norm, 6),
        known(fit.deviation),
        fit.degrees_of_freedom
    )?;
    search(&fit.search, text)
}

/// Columns of data.
fn measured(fit: &Fit, text: &mut String) -> fmt::Result {
    for data in &fit.data {
        write!(
            text,
            "    {} of {}{}: {}",
            data.quantity,
            data.file,
            data.run(),
            counted(data.time.len(), "value")
        )?;
        for (count, what) in [
            (data.missing, "missing"),
            (data.outside, "outside of the run"),
        ] {
            if count > 0 {
                write!(text, ", {count} {what}")?;
            }
        }
        writeln!(text)?;
    }
    Ok(())
}

fn known(value: Option<f64>) -> String {
    value.map_or("none".to_owned(), |value| significant(value, 6))
}

/// Free numbers, and how they hang together.
fn estimates(fit: &Fit, text: &mut String) -> fmt::Result {
    let rows = fit.estimates.iter().map(|estimate| {
        let interval = match (estimate.interval, estimate.at_bound, estimate.is_determined) {
            (Some([low, high]), ..) => {
                format!("{} to {}", significant(low, 8), significant(high, 8))
            }
            (None, Some(_), _) => "at a bound".to_owned(),
            (None, None, Some(false)) => "not determined".to_owned(),
            (None, None, _) => "none".to_owned(),
        };
        [
            estimate.name.clone(),
            significant(estimate.value, 10),
            known(estimate.standard_error),
            interval,
        ]
    });
    let heads = ["", "value", "standard error", "95 % interval"];
    table(text, heads, rows.collect())?;
    let names: Vec<&str> = fit.estimates.iter().map(|one| one.name.as_str()).collect();
    let pairs = (0..names.len()).flat_map(|j| (j + 1..names.len()).map(move |k| (j, k)));
    let rows = pairs.filter_map(|(j, k)| {
        let correlation = significant(fit.correlation[j][k]?, 4);
        Some([format!("{} and {}", names[j], names[k]), correlation])
    });
    let mut rows: Vec<[String; 2]> = rows.collect();
    let count = rows.len();
    if count == 0 {
        return Ok(());
    }
    rows.truncate(MAX_ROWS);
    table(text, ["", "correlation"], rows)?;
    rest(text, count)
}

/// What the data determine together.
fn directions(fit: &Fit, text: &mut String) -> fmt::Result {
    let rows = fit.directions.iter().take(MAX_ROWS).map(|one| {
        let said = match one.is_determined {
            true => "",
            false => "not determined",
        };
        let value = significant(one.singular_value, 6);
        [one.powers(), value, said.to_owned()]
    });
    let heads = ["determined together", "singular value", ""];
    table(text, heads, rows.collect())?;
    rest(text, fit.directions.len())
}

/// How a fit was looked for.
fn search(search: &Search, text: &mut String) -> fmt::Result {
    write!(
        text,
        "  {}, {}, {:.1e} standard errors from the minimum",
        counted(search.iterations, "iteration"),
        counted(search.runs, "run"),
        search.offset
    )?;
    if search.failed_steps > 0 {
        let steps = counted(search.failed_steps, "step");
        write!(text, ", {steps} rejected as their runs failed")?;
    }
    if search.starts > 1 {
        let (best, all) = (search.best_starts, search.starts);
        write!(text, ", {best} of {all} starts at the best")?;
        if search.failed_starts > 0 {
            write!(text, ", {} without a run", search.failed_starts)?;
        }
    }
    writeln!(text)
}

/// Quantiles at the last instant.
fn ensemble(trajectory: &Trajectory, text: &mut String) -> fmt::Result {
    let Some(ensemble) = &trajectory.several.ensemble else {
        return Ok(());
    };
    let last_seed = ensemble.first_seed + ensemble.runs as u64 - 1;
    let (first_seed, runs) = (ensemble.first_seed, counted(ensemble.runs, "run"));
    writeln!(
        text,
        "\n  {runs} with the seeds {first_seed} to {last_seed}; what is above is the first one"
    )?;
    let failed: Vec<String> = (ensemble.failed_seeds.iter())
        .take(MAX_ROWS)
        .map(u64::to_string)
        .collect();
    if !failed.is_empty() {
        let count = ensemble.failed_seeds.len();
        writeln!(
            text,
            "  {count} failed, with the seeds {}",
            failed.join(", ")
        )?;
        rest(text, count)?;
    }
    writeln!(text, "  quantiles at the end, of those that did not fail")?;
    let heads = (ensemble.levels).map(|level| format!("{} %", 100.0 * level));
    let [a, b, c, d, e] = &heads;
    let row = |bands: &Bands| {
        let last = |values: &Vec<f64>| values.last().copied().unwrap_or(f64::NAN);
        let mut cells: Vec<String> = vec![bands.name.clone()];
        cells.extend((bands.values.iter()).map(|values| significant(last(values), 8)));
        <[String; 6]>::try_from(cells).ok()
    };
    let rows = ensemble.bands.iter().take(MAX_ROWS).filter_map(row);
    table(text, ["", a, b, c, d, e], rows.collect())?;
    rest(text, ensemble.bands.len())
}

/// What is known about an optimum.
fn optimum(trajectory: &Trajectory, text: &mut String) -> fmt::Result {
    let Some(optimum) = &trajectory.optimum else {
        return Ok(());
    };
    let certificate = &trajectory.quality.certificate;
    match certificate.stationarity {
        Stationarity::None => writeln!(text, "  certificate: none")?,
        class => write!(text, "  certificate: {}-stationary", class.as_str())?,
    }
    if !matches!(
        certificate.stationarity,
        Stationarity::S | Stationarity::B | Stationarity::None
    ) {
        text.push_str(", descent to first order is not excluded");
    }
    match (certificate.stationarity, optimum.branches) {
        (Stationarity::None, _) => {}
        (_, 0) => writeln!(text)?,
        (_, 1) => writeln!(text, ", confirmed in a branch that it is in, too")?,
        (_, n) => writeln!(text, ", confirmed in {n} branches that it is in, too")?,
    }
    if let Some(reason) = optimum.confirmation.reason() {
        writeln!(
            text,
            "  the certificate is that of the program alone: {reason}"
        )?;
    }
    if optimum.ways.len() > 1 {
        // Of several points in a row that one way led to, the last one.
        let groups = optimum.ways.chunk_by(|a, b| a.way == b.way);
        let last = groups.filter_map(|group| group.last());
        let told = last.map(|found| {
            let objective = significant(found.objective, 9);
            format!("{} ({objective})", found.way.words())
        });
        let told: Vec<String> = told.collect();
        writeln!(text, "  found by {}", told.join(", then "))?;
    }
    for tried in &optimum.grids {
        let GridTried {
            elements,
            nodes,
            objective,
            error,
        } = tried;
        let error = match error.is_finite() {
            true => format!("off by {error:.1e}"),
            false => "without an end".to_owned(),
        };
        writeln!(
            text,
            "  grid of {elements} x {nodes} nodes per interval: objective {}, simulated {error}",
            significant(*objective, 9),
        )?;
    }
    if let Some(check) = &optimum.check {
        let (end, objective) = (check.terminal_error, check.objective_error.abs());
        writeln!(
            text,
            "  simulated by `event`: end off by {end:.1e}, objective by {objective:.1e}"
        )?;
    }
    if let (2.., Some(spread)) = (optimum.starts, &optimum.spread) {
        writeln!(
            text,
            "  {} starts: {} feasible, {} at the best, objectives {} to {}, median {}, {} each",
            optimum.starts,
            spread.n_feasible,
            spread.n_best,
            significant(spread.best, 8),
            significant(spread.worst, 8),
            significant(spread.median, 8),
            duration(optimum.median_s),
        )?;
    }
    Ok(())
}

/// Left-aligned columns under their titles.
fn table<const N: usize>(
    text: &mut String,
    titles: [&str; N],
    rows: Vec<[String; N]>,
) -> fmt::Result {
    let titles = titles.map(str::to_owned);
    let all = || std::iter::once(&titles).chain(&rows);
    let widths: [usize; N] =
        std::array::from_fn(|column| all().map(|row| chars(&row[column])).max().unwrap_or(0));
    for row in all() {
        let mut line = String::from("   ");
        for (cell, &width) in row.iter().zip(&widths) {
            write!(line, " {cell:width$} ")?;
        }
        writeln!(text, "{}", line.trim_end())?;
    }
    Ok(())
}

/// Says how many rows of a table are left out.
fn rest(text: &mut String, n_rows: usize) -> fmt::Result {
    match n_rows.checked_sub(MAX_ROWS) {
        Some(left_out @ 1..) => writeln!(text, "    and {left_out} more"),
        _ => Ok(()),
    }
}

fn chars(text: &str) -> usize {
    text.chars().count()
}

/// The beginning and the end of a long name.
fn shortened(name: &str) -> String {
    let place = |n: usize| name.char_indices().nth(n).map_or(0, |(at, _)| at);
    match chars(name).checked_sub(MAX_NAME) {
        None | Some(0..=2) => name.to_owned(),
        Some(excess) => {
            let half = MAX_NAME / 2;
            format!(
                "{}..{}",
                &name[..place(half)],
                &name[place(half + excess)..]
            )
        }
    }
}

/// A duration in the unit that reads best.
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 1e-3 => format!("{:.0} us", s * 1e6),
        s if s < 1.0 => format!("{:.1} ms", s * 1e3),
        s => format!("{s:.2} s"),
    }
}

/// The shortest text of a number rounded to so many significant digits.
pub fn significant(number: f64, digits: usize) -> String {
    if !number.is_finite() {
        return format!("{number}");
    }
    let rounded: f64 = format!("{number:.*e}", digits.saturating_sub(1))
        .parse()
        .unwrap_or(number);
    match rounded.abs() {
        0.0 => "0".to_owned(),
        size if (1e-4..1e9).contains(&size) => format!("{rounded}"),
        _ => format!("{rounded:e}"),
    }
}

/// The value of a series of one instant: a number, a column or rows of a matrix.
struct Value<'a>(&'a Series);

impl Display for Value<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let entries = &self.0.values;
        if self.0.shape.is_empty() {
            return f.write_str(&significant(entries[0], 12));
        }
        let n_columns = match self.0.shape[..] {
            [_, n] => n,
            _ => usize::MAX,
        };
        f.write_str("[")?;
        for (k, entry) in entries.iter().take(MAX_ENTRIES).enumerate() {
            let separator = match k {
                0 => "",
                k if k % n_columns == 0 => "; ",
                _ => ", ",
            };
            write!(f, "{separator}{}", significant(*entry, 12))?;
        }
        if entries.len() > MAX_ENTRIES {
            write!(f, ", ... {} entries", entries.len())?;
        }
        f.write_str("]")
    }
}

#[cfg(test)]
mod tests {
    use super::{significant, write};
    use crate::report::{Failure, Status, sample};

    #[test]
    fn a_run_that_went_well() {
        insta::assert_snapshot!(write(&sample::oscillator()), @"
crossing of oscillator: solved

  at the end, time = 1.5
    x = [-1.6487212707, 0.25]
    c = 1.7807818284

  1 event
    time  kind      surface  mode
    1     crossing  c        inside -> outside

  2 mode intervals
    from  to   mode
    0     1    inside
    1     1.5  outside

  method event, order 16, tolerance 1e-10
  error estimate 1.0e-11, relative, largest over the states
  12 steps, 204 evaluations, 1.0 ms
  warning W0501: a bound was left
");
    }

    #[test]
    fn long_tables_and_vectors_are_cut() {
        let mut trajectory = sample::oscillator();
        trajectory.history.events = vec![trajectory.history.events[0].clone(); 20];
        trajectory.history.modes.clear();
        trajectory.samples.states[0].shape = vec![12];
        trajectory.samples.states[0].values = vec![1.0; 36];
        insta::assert_snapshot!(write(&trajectory), @"
crossing of oscillator: solved

  at the end, time = 1.5
    x = [1, 1, 1, 1, 1, 1, 1, 1, ... 12 entries]
    c = 1.7807818284

  20 events
    time  kind      surface  mode
    1     crossing  c        inside -> outside
    1     crossing  c        inside -> outside
    1     crossing  c        inside -> outside
    1     crossing  c        inside -> outside
    1     crossing  c        inside -> outside
    1     crossing  c        inside -> outside
    1     crossing  c        inside -> outside
    1     crossing  c        inside -> outside
    1     crossing  c        inside -> outside
    1     crossing  c        inside -> outside
    1     crossing  c        inside -> outside
    1     crossing  c        inside -> outside
    and 8 more

  method event, order 16, tolerance 1e-10
  error estimate 1.0e-11, relative, largest over the states
  12 steps, 204 evaluations, 1.0 ms
  warning W0501: a bound was left
");
    }

    #[test]
    fn long_names_of_surfaces_are_cut() {
        let mut trajectory = sample::oscillator();
        trajectory.history.events[0].surface = format!("max({})", "ä + ".repeat(100));
        let text = write(&trajectory);
        let longest = text.lines().map(|line| line.chars().count()).max();
        assert!(longest.is_some_and(|longest| longest < 120), "{text}");
        assert!(text.contains("ä + ä .. ä + ä"), "{text}");
    }

    #[test]
    fn a_run_that_stopped_says_why_and_where() {
        let mut trajectory = sample::shapes();
        trajectory.status = Status::IterationLimit;
        trajectory.failure = Some(Failure::Limit {
            time: 1.0,
            what: "events",
            terms: Vec::new(),
        });
        insta::assert_snapshot!(write(&trajectory), @"
turn of body: iteration_limit
  at t = 1, the limit of events was reached

  reached, time = 1
    q = 2.5
    R = [5, 6; 7, 8]

  method 
  error estimate: none with this method
  0 steps, 0 us
");
    }

    #[test]
    fn numbers_are_rounded_to_significant_digits() {
        let shown = [1.0 / 3.0, 1e-17, 0.1 + 0.2, 123456789.123, 1e300, f64::NAN];
        let shown = shown.map(|number| significant(number, 12)).join(" ");
        insta::assert_snapshot!(shown, @"0.333333333333 1e-17 0.3 123456789.123 1e300 NaN");
    }
}
