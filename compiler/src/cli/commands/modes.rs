//! `nsdc modes`

use std::ops::Range;

use crate::cli::args::ModesArgs;
use crate::cli::files::Sink;
use crate::cli::project::Project;
use crate::cli::{Exit, Streams, files, io, project};
use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::model::Units;
use crate::project::clock::Clock;
use crate::report::plot;
use crate::study::modes;
use crate::syntax::{Bind, Experiment};
use crate::system::System;
use crate::{Compiled, compile};

/// Maps the sliding modes of a nonlinear switch.
pub fn run(args: &ModesArgs, streams: &mut Streams<'_>) -> io::Result<Exit> {
    if !files::foresee(args.plot.as_deref(), streams)? {
        return Ok(Exit::Wrong);
    }
    let Some((project, overrides)) = project::open(&args.file, &args.set, streams)? else {
        return Ok(Exit::Wrong);
    };
    let Some(experiments) = project::selected(&project, args.experiment.as_deref(), streams)?
    else {
        return Ok(Exit::Wrong);
    };
    let wrong = |streams: &mut Streams<'_>, what: &str, help: &str| {
        writeln!(streams.err, "error: {what}\n  help: {help}")?;
        Ok(Exit::Wrong)
    };
    let exprs = Exprs::new();
    let asked = (&project, &overrides[..]);
    let (compiled, diags) = nonlinear(&exprs, asked, &experiments, args.experiment.is_some());
    project::print(&diags, &project.sources, streams)?;
    let Some(compiled) = compiled else {
        return wrong(
            streams,
            "no experiment reads a switch nonlinearly",
            "`switch s = sign(y) sliding nonlinear;`",
        );
    };
    let system = &compiled.system;
    let mut switches = system.switches.iter().enumerate();
    let is_asked = |name: &str| args.switch.as_deref().is_none_or(|asked| asked == name);
    let found = switches.find(|(_, switch)| switch.is_nonlinear && is_asked(&switch.name));
    let Some((switch, _)) = found else {
        return wrong(
            streams,
            "no switch of this name is read nonlinearly",
            "name another one",
        );
    };
    let lines: Option<Vec<_>> = args.over.iter().map(|over| line(system, over)).collect();
    let names: Vec<&str> = system
        .states
        .iter()
        .map(|state| state.name.as_str())
        .collect();
    let units = Units::of(&compiled.model);
    let (text, svg) = match lines.as_deref() {
        Some([(state, range)]) => {
            let map = modes::map(system, switch, *state, range.clone());
            (modes::text(&map), plot::branches::write(&map, &units))
        }
        Some([(x, along), (y, up)]) if x != y => {
            let ranges = [along.clone(), up.clone()];
            let plane = modes::plane(system, switch, [*x, *y], ranges);
            (
                modes::plane_text(&plane),
                plot::plane::write(&plane, &units),
            )
        }
        _ => {
            let help = format!(
                "`--over {}=-1:1`, once or for two states, of the states {}",
                names[0],
                names.join(", ")
            );
            return wrong(streams, "`--over` names a state and its range", &help);
        }
    };
    streams.out.write_all(text.as_bytes())?;
    let mut written = true;
    if let Some(path) = &args.plot {
        written = Sink::with(path, svg).finish(streams)?;
    }
    Ok(if written { Exit::Success } else { Exit::Wrong })
}

/// The first of some experiments that reads a switch nonlinearly; where it is named, with what there is to say about it.
fn nonlinear<'e>(
    exprs: &'e Exprs,
    (project, overrides): (&Project, &[Bind]),
    experiments: &[Experiment],
    is_named: bool,
) -> (Option<Compiled<'e>>, Diagnostics) {
    let (mut diags, mut clock) = (Diagnostics::new(), Clock::default());
    let compiled = experiments.iter().find_map(|experiment| {
        let mut found = Diagnostics::new();
        let file = &project.file;
        let compiled = compile(exprs, file, experiment, overrides, &mut clock, &mut found);
        let failed = found.has_errors();
        if is_named {
            diags = found;
        }
        let compiled = compiled.filter(|_| !failed)?;
        let mut switches = compiled.system.switches.iter();
        (switches.any(|switch| switch.is_nonlinear)).then_some(compiled)
    });
    (compiled, diags)
}

/// `x=-1:4`
fn line(system: &System, over: &str) -> Option<(usize, Range<f64>)> {
    let (name, range) = over.split_once('=')?;
    let (from, to) = range.split_once(':')?;
    let [from, to] = [from, to].map(|number| number.trim().parse::<f64>().ok());
    let (from, to) = (from?, to?);
    let state = system
        .states
        .iter()
        .position(|state| state.name == name.trim())?;
    let fits = from.is_finite() && to.is_finite() && from < to;
    fits.then_some((state, from..to))
}
