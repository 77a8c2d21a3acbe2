//! The figures of a run: fine curves, switching curves in the phase plane, and shapes that move.

use std::collections::HashMap;

use crate::Compiled;
use crate::expr::{Expr, Var, variables_of};
use crate::model::Units;
use crate::report::plot::animation::Animation;
use crate::report::plot::{Figure, Phase, Surface};
use crate::report::{Dense, Samples, Series, Trajectory, refine};
use crate::system::experiment::Plot;
use crate::system::switches::terms::decided;

/// The SVG text: what the experiment asks for, or all that is reported.
pub fn draw(compiled: &Compiled<'_>, trajectory: &Trajectory) -> String {
    let system = &compiled.system;
    let (params, units) = (parameters(compiled), Units::of(&compiled.model));
    let plot = compiled.settings.recording.figures.plot.as_ref();
    let sheet = plot.map(|plot| plot.sheet.clone()).unwrap_or_default();
    let (title, width) = (sheet.title.as_deref(), sheet.width);
    if let Some(plot) = plot.filter(|plot| !plot.is_empty()) {
        let fine = drawn(compiled, trajectory, plot);
        return Figure {
            title,
            width,
            ..arranged(compiled, plot, (trajectory, &fine), (&units, &params))
        }
        .write();
    }
    // Switching curves are drawn over the states as the system has them.
    let states = trajectory.samples.states.iter();
    let names = states.flat_map(Series::entry_names);
    let is_whole = names.eq(system.states.iter().map(|state| state.name.clone()));
    let surfaces = match &system.states[..] {
        [x, y] if is_whole => surfaces(compiled, &params, [x.var, y.var]),
        _ => Vec::new(),
    };
    let fine = curves(compiled, trajectory);
    Figure {
        title,
        width,
        ..Figure::of(trajectory, &fine, &units, surfaces)
    }
    .write()
}

/// The SVG text of the animation that the experiment asks for.
pub fn animate(compiled: &Compiled<'_>, trajectory: &Trajectory) -> Option<String> {
    let animation = compiled.settings.recording.figures.animation.as_ref()?;
    let units = Units::of(&compiled.model);
    let shapes = &animation.shapes;
    let series = shapes.iter().map(|shape| Series {
        name: String::new(),
        shape: vec![shape.entries.len()],
        values: Vec::new(),
    });
    let exprs = shapes.iter().flat_map(|shape| &shape.entries);
    let fine = evaluated(compiled, trajectory, series.collect(), exprs);
    let named = shapes.iter().flat_map(|shape| shape.lengths());
    let figure = Animation {
        samples: &fine,
        kinds: shapes.iter().map(|shape| shape.kind).collect(),
        unit: named.filter_map(|name| units.unit(name)).next(),
        time: units.title("time"),
        title: animation.sheet.title.as_deref(),
        width: animation.sheet.width,
        speed: animation.speed,
    };
    Some(figure.write())
}

/// What a plot draws of a run, as outputs.
fn drawn<'e>(compiled: &Compiled<'e>, trajectory: &Trajectory, plot: &Plot<'e>) -> Samples {
    let series = plot.drawn().map(|drawn| Series {
        name: drawn.name.clone(),
        shape: drawn.shape.clone(),
        values: Vec::new(),
    });
    let exprs = plot.drawn().flat_map(|drawn| &drawn.entries);
    evaluated(compiled, trajectory, series.collect(), exprs)
}

/// These outputs alone of a run, of which expressions of the model are the entries in order.
fn evaluated<'s, 'e: 's>(
    compiled: &Compiled<'e>,
    trajectory: &Trajectory,
    outputs: Vec<Series>,
    exprs: impl Iterator<Item = &'s Expr<'e>>,
) -> Samples {
    let exprs: Vec<Expr<'_>> = exprs.map(|&e| compiled.system.read(e)).collect();
    let samples = Samples {
        time: trajectory.samples.time.clone(),
        outputs,
        ..Samples::default()
    };
    refined(compiled, samples, &trajectory.dense, &exprs)
}

/// Panels and planes of a plot, with what it draws in order.
fn arranged<'a, 'e>(
    compiled: &'a Compiled<'e>,
    plot: &Plot<'e>,
    (trajectory, samples): (&'a Trajectory, &'a Samples),
    (units, params): (&'a Units, &'a HashMap<Var, f64>),
) -> Figure<'a> {
    let mut series = samples.outputs.iter();
    let panels = plot.panels.iter();
    let panels = panels.map(|panel| series.by_ref().take(panel.len()).collect());
    let panels = panels.collect();
    let phases = plot.phases.iter().map(|axes| {
        let mut next = || {
            let series = series.next();
            series.map_or_else(Default::default, |series| {
                (series.name.clone(), series.values.clone())
            })
        };
        Phase {
            axes: [next(), next()],
            is_of_one: axes[0].whole.is_some() && axes[0].whole == axes[1].whole,
            surfaces: surfaces(
                compiled,
                params,
                axes.each_ref().map(|axis| axis.entries[0]),
            ),
        }
    });
    let phases = phases.collect();
    Figure {
        trajectory,
        samples,
        units,
        title: None,
        width: None,
        panels,
        phases,
    }
}

fn parameters(compiled: &Compiled<'_>) -> HashMap<Var, f64> {
    let params = compiled.system.exogenous.params.iter();
    params
        .filter_map(|param| Some((param.var.as_variable()?, param.value)))
        .collect()
}

/// What the experiment plots, where it says so, at as many instants as its curves need to look smooth.
pub fn plotted(compiled: &Compiled<'_>, trajectory: &Trajectory) -> Option<Samples> {
    let plot = compiled.settings.recording.figures.plot.as_ref();
    let plot = plot.filter(|plot| !plot.is_empty())?;
    Some(drawn(compiled, trajectory, plot))
}

/// All that is reported, at as many instants as its curves need to look smooth.
pub fn curves(compiled: &Compiled<'_>, trajectory: &Trajectory) -> Samples {
    let system = &compiled.system;
    let (recorded, signals) = (&system.recorded, system.recorded.signals());

    let states = recorded.groups.iter().flat_map(|group| &group.entries);
    let exprs: Vec<Expr<'_>> = states
        .map(|&entry| system.states[entry].var)
        .chain(signals.flat_map(|output| output.exprs.iter().copied()))
        .collect();
    let samples = Samples::clone(&trajectory.samples);
    refined(compiled, samples, &trajectory.dense, &exprs)
}

/// The samples where their curves need them, with the values of what is reported, in time, states and α.
fn refined(
    compiled: &Compiled<'_>,
    mut samples: Samples,
    dense: &Dense,
    exprs: &[Expr<'_>],
) -> Samples {
    let system = &compiled.system;
    let params = parameters(compiled);
    // The row of every variable: states, α, then data.
    let state_vars: Vec<Expr<'_>> = system.states.iter().map(|state| state.var).collect();
    let alphas = system.switches.iter().map(|switch| switch.alpha);
    let data = system.exogenous.data.iter().map(|data| data.var);
    let rows = state_vars.iter().copied().chain(alphas).chain(data);
    let rows = rows.enumerate();
    let rows: HashMap<Var, usize> = rows
        .filter_map(|(row, var)| Some((var.as_variable()?, row)))
        .collect();
    let time = system.time.as_variable();
    let n_states = system.states.len();
    refine(&mut samples, dense, &|t, row| {
        let mut row = row.to_vec();
        let (x, alpha) = row.split_at_mut(n_states);
        system.see(t, x, alpha);
        let number = |var: Var| match rows.get(&var) {
            Some(&place) => row[place],
            None if Some(var) == time => t,
            None => params.get(&var).copied().unwrap_or(f64::NAN),
        };
        let alphas = n_states..n_states + system.switches.len();
        let is_alpha = |var: Var| rows.get(&var).is_some_and(|place| alphas.contains(place));
        let on_sides = exprs.iter().map(|&expr| decided(expr, &number, &is_alpha));
        on_sides.map(|expr| expr.eval(&number)).collect()
    });
    samples
}

/// The switching functions of two axes alone, where these are the two states of the system.
fn surfaces<'c>(
    compiled: &'c Compiled<'_>,
    params: &'c HashMap<Var, f64>,
    [x, y]: [Expr<'_>; 2],
) -> Vec<Surface<'c>> {
    let system = &compiled.system;
    let states: Vec<Expr<'_>> = system.states.iter().map(|state| state.var).collect();
    if states != [x, y] && states != [y, x] {
        return Vec::new();
    }
    let (Some(x), Some(y)) = (x.as_variable(), y.as_variable()) else {
        return Vec::new();
    };
    let is_known = |var: &Var| *var == x || *var == y || params.contains_key(var);
    let fixed = system
        .switches
        .iter()
        .filter(move |switch| variables_of(&[switch.psi]).iter().all(is_known));
    fixed
        .map(|switch| Surface {
            name: (system.provenance.aliases.get(&switch.name))
                .unwrap_or(&switch.name)
                .clone(),
            psi: Box::new(move |u, v| {
                let number = |var: Var| match var {
                    var if var == x => u,
                    var if var == y => v,
                    var => params.get(&var).copied().unwrap_or(f64::NAN),
                };
                switch.psi.eval(&number)
            }),
        })
        .collect()
}
