//! Where the solver starts.
//!
//! States stay at their initial values and controls at their defaults, unless the experiment says otherwise: by values
//! in time, or by a trajectory, stretched to the horizon. Multipliers and the rest are what the switching functions
//! say at the states.

use crate::expr::{Expr, Var};
use crate::lowering::dcs::solve_pointwise;
use crate::lowering::discretize::Grid;
use crate::optimize::Problem;
use crate::report::{Samples, Series};

/// Values in time to start from, by the names of entries.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sampled {
    /// Instants, ascending.
    pub time: Vec<f64>,
    /// Names with values at the instants.
    pub values: Vec<(String, Vec<f64>)>,
}

impl Sampled {
    /// The states and controls of a run.
    pub fn of(samples: &Samples) -> Self {
        let entries = |series: &Series| {
            let (n, names) = (series.n_entries(), series.entry_names());
            let values = series.values.clone();
            let columns = names.into_iter().enumerate().map(move |(i, name)| {
                let column = values.iter().skip(i).step_by(n.max(1)).copied();
                (name, column.collect())
            });
            columns.collect::<Vec<_>>()
        };
        let series = samples.states.iter().chain(&samples.controls);
        Sampled {
            time: samples.time.clone(),
            values: series.flat_map(entries).collect(),
        }
    }

    /// A value at a share of the time, linear between instants.
    fn at(&self, values: &[f64], share: f64) -> f64 {
        let (Some(&first), Some(&last)) = (self.time.first(), self.time.last()) else {
            return f64::NAN;
        };
        let t = first + share * (last - first);
        let after = self
            .time
            .partition_point(|&other| other <= t)
            .min(self.time.len() - 1);
        let before = after.saturating_sub(1);
        let length = self.time[after] - self.time[before];
        let share = if length > 0.0 {
            (t - self.time[before]) / length
        } else {
            1.0
        };
        values[before] + share.clamp(0.0, 1.0) * (values[after] - values[before])
    }
}

/// The point to start from.
pub(crate) fn start(problem: &Problem, sampled: &[Sampled]) -> Vec<f64> {
    let Problem {
        task,
        layout,
        mpcc,
        dcs,
        ..
    } = problem;
    let bounds = mpcc.bounds();
    let mut w: Vec<f64> = bounds.iter().map(|bounds| bounds.guess).collect();
    let horizon = problem.settings.horizon;
    let known = Known {
        problem,
        sampled,
        horizon,
    };
    let set = |w: &mut [f64], index: usize, value: Option<f64>| {
        if let Some(value) = value.filter(|value| value.is_finite()) {
            w[index] = value.max(bounds[index].lower).min(bounds[index].upper);
        }
    };
    let Some(decided) = &dcs.task else {
        return w;
    };
    for (i, free) in decided.params.iter().enumerate() {
        let param = &dcs.params[free.place];
        let value = known.value(param.var, &param.name, 0.0);
        set(&mut w, layout.p(i), value);
    }
    let place = problem.at(&w).places();
    for (i, control) in decided.controls.iter().enumerate() {
        for (k, share) in layout.control_instants() {
            let share = match layout.decided.share(k) {
                Some(_) => place((k, 1), 0.5 * layout.elements as f64),
                None => share,
            };
            let value = known.value(control.var, &control.name, share);
            set(&mut w, layout.u(k) + i, value);
        }
    }
    let system = problem.lowered();
    let is_moved = !sampled.is_empty() || !task.guess.is_empty() || decided.clock.is_some();
    let (steps, elements) = (layout.steps, layout.elements);
    for (k, j) in (1..=steps).flat_map(|k| (1..=elements).map(move |j| (k, j))) {
        for (m, &c) in layout.points.iter().enumerate() {
            let begins = (k, j) == (1, 1) || layout.impulses(k, j).is_some();
            let share = place((k, j), c);
            let restarts = (m, j) == (0, 1) && (k == 1 || layout.algebraics.restarts);
            for i in 0..layout.n_states() {
                if let Some(index) = layout.started(k, i).filter(|_| restarts) {
                    let state = &system.states[i];
                    set(&mut w, index, known.value(state.var, &state.name, share));
                }
            }
            if m == 0 && !begins {
                if restarts && is_moved {
                    known.multipliers(&mut w, k, j, m, share, &bounds);
                }
                continue;
            }
            for i in 0..layout.n_states() {
                let state = &system.states[i];
                let index = layout.x(k, j, m) + i;
                let value = match decided.clock == Some(i) {
                    true => Some(share * horizon),
                    false => known.value(state.var, &state.name, share),
                };
                set(&mut w, index, value);
                if (k, j, m) == (1, 1, 0) {
                    set(&mut w, layout.before(1, 1) + i, value);
                }
            }
            if is_moved {
                known.multipliers(&mut w, k, j, m, share, &bounds);
            }
        }
    }
    mpcc.slacken(&mut w);
    w
}

struct Known<'k, 'e> {
    problem: &'k Problem<'e>,
    sampled: &'k [Sampled],
    horizon: f64,
}

impl Known<'_, '_> {
    /// What the experiment says about a quantity at a share of the horizon.
    fn value(&self, var: Expr, name: &str, share: f64) -> Option<f64> {
        let system = &self.problem.system;
        let var = var.as_variable()?;
        let mut guesses = self.problem.task.guess.iter().rev();
        if let Some((_, guess)) = guesses.find(|(known, _)| *known == var) {
            let time = system.time.as_variable();
            let number = |other: Var| {
                if Some(other) == time {
                    return share * self.horizon;
                }
                let mut params = system.exogenous.params.iter();
                let param = params.find(|param| param.var.as_variable() == Some(other));
                param.map_or(f64::NAN, |param| param.value)
            };
            return Some(guess.eval(&number));
        }
        let sampled = self.sampled.iter().rev();
        let mut found = sampled.filter_map(|sampled| {
            let (_, values) = sampled.values.iter().find(|(known, _)| known == name)?;
            Some(sampled.at(values, share))
        });
        found.next()
    }

    /// z at a node, from the states there.
    fn multipliers(
        &self,
        w: &mut [f64],
        k: usize,
        j: usize,
        m: usize,
        share: f64,
        bounds: &[crate::lowering::mpcc::Bounds],
    ) {
        let Problem { layout, dcs, .. } = self.problem;
        let system = self.problem.lowered();
        let middle = Grid::new(self.horizon, layout.steps).middle_of(k);
        let mut values = system.valuation_around([share * self.horizon, middle], &[], &[]);
        for (i, state) in system.states.iter().enumerate() {
            let started = layout.started(k, i).filter(|_| (j, m) == (1, 0));
            let value = match i < layout.n_states() {
                true => w[started.unwrap_or(layout.x(k, j, m) + i)],
                false => 0.0,
            };
            values.set(state.var, value);
        }
        for (i, control) in dcs
            .task
            .iter()
            .flat_map(|task| task.controls.iter().enumerate())
        {
            values.set(control.var, w[layout.u(k) + i]);
        }
        let found = solve_pointwise(system, dcs, &|var| values.number(var));
        for (i, &z) in found.algebraics.iter().enumerate() {
            let index = layout.z(k, j, m, i);
            if let Some(index) = index.filter(|&index| z.is_finite() && !bounds[index].is_fixed()) {
                w[index] = z.max(bounds[index].lower).min(bounds[index].upper);
            }
        }
    }
}
