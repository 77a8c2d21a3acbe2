//! The road without switches: an adaptive method of high order sees a field that jumps.
//!
//! α_i is 0 or 1 by the sign of ψ_i wherever the method looks, and nothing locates where it changes.
//! A second run with a hundredth of the tolerance gives the estimate of the error.

use std::sync::Arc;

use crate::lowering::hybrid;
use crate::lowering::hybrid::{Polynomials, Pulses, data_of, tape, variable};
use nsd_solver::hybrid::{Piecewise, write_pieces};

use nsd_solver::adaptive::{self, Field, Simulator};
use nsd_solver::event::Observer;
use nsd_solver::hybrid::{Side, Sided};
use nsd_solver::tape::{Scratch, Tape};

use super::branching::Branching;
use crate::expr::{Expr, Substitution, Var, variables_of};
use crate::limit::Limit;
use crate::report::{Method, Trajectory, Warning};
use crate::simulate::driver::{Accuracy, Ended, Problem, REFINEMENT, Run};
use crate::simulate::estimate::{Estimate, Estimator};
use crate::simulate::record::schedule::{follows_data, scheduled};
use crate::system::System;
use crate::system::experiment::{MethodKind, Settings};
use crate::system::switches::roots::Vanishing;

/// A system as if it had no switches.
pub(crate) struct Adaptive {
    field: Jumping,
    /// The parameters that stay open, by their numbers.
    open: Vec<usize>,
    /// Whether data decide when switches of time change, which is data itself.
    follows_data: bool,
    branching: Branching,
}

impl Adaptive {
    /// Compiles a system, with some parameters open, by their numbers; none that moves a switch of time which leads.
    pub fn new(system: &System, settings: &Settings, open: &[usize]) -> Self {
        Adaptive {
            field: prepared(system, settings, open),
            open: open.to_vec(),
            follows_data: follows_data(system),
            branching: Branching::new(open),
        }
    }
}

/// A system for runs to the horizon, or to an earlier one.
pub(crate) fn prepared(system: &System, settings: &Settings, open: &[usize]) -> Jumping {
    let pulses = Pulses::of(system, settings.horizon);
    let stepping = scheduled(system, settings.horizon);
    Jumping::of(&stepping, &Inputs::new(&stepping, open), pulses)
}

/// The settings of the first run of an experiment.
pub(crate) fn first_settings(settings: &Settings) -> adaptive::Settings {
    settings_of(Accuracy::of(settings), Limit::default())
}

fn settings_of(accuracy: Accuracy, limit: Limit) -> adaptive::Settings {
    let refinement = if accuracy.is_finer { REFINEMENT } else { 1.0 };
    adaptive::Settings {
        tolerance: refinement * accuracy.tolerance,
        limit,
        ..adaptive::Settings::default()
    }
}

impl<'e> Run<'e> for Adaptive {
    fn march(
        &mut self,
        problem: &Problem<'_, 'e>,
        accuracy: Accuracy,
        observer: &mut dyn Observer,
    ) -> Ended {
        if !accuracy.is_finer {
            self.branching.begin(problem);
        }
        let (system, field) = (problem.system, &mut self.field);
        field.set_parameters(&system.values_of(&self.open));
        field.set_data(&data_of(system));
        let settings = settings_of(accuracy, problem.limit.clone());
        let mut simulator = Simulator::new(field.clone(), settings);
        let horizon = problem.settings.horizon;
        Ended::by(simulator.run(0.0, horizon, &problem.x0, observer))
    }

    fn takes_numbers(&self) -> bool {
        !self.follows_data
    }

    fn describe(&self, problem: &Problem<'_, 'e>, _: &Ended) -> Method {
        Method::of(MethodKind::Adaptive).number("tolerance", problem.settings.numerics.tolerance)
    }

    fn estimator(&self, _: &Settings<'e>) -> Estimator {
        Estimator::Tolerance
    }

    fn compares(&self, ended: &Ended) -> bool {
        ended.is_solved()
    }

    /// What switches do to an error no tolerance mends.
    fn refined(
        &mut self,
        _: &Settings<'e>,
        _: Accuracy,
        _: &Ended,
        _: Option<&Estimate>,
    ) -> Option<Accuracy> {
        None
    }

    fn tell(&mut self, problem: &Problem<'_, 'e>, _: &Ended, trajectory: &mut Trajectory) {
        // The sides at the points say which modes there are; no instant was looked for.
        trajectory.history.events.clear();
        let several = self.branching.warning(problem.system);
        trajectory.warnings.extend(several);
        if !problem.system.switches.is_empty() {
            trajectory.warnings.push(Warning {
                code: "W0708".into(),
                message: "switches were not located: instants of modes are ends of steps".into(),
                span: Some(problem.settings.span),
            });
        }
    }
}

/// f(t, x, step(ψ(t, x))) as one function of time and state.
#[derive(Clone, Debug)]
pub(crate) struct Jumping {
    /// (t, x, α) to f and to ψ.
    rates: Sided,
    switching: Tape,
    switching_scratch: Scratch,
    /// Whether there is an α in f; others matter for what is recorded alone.
    rates_switch: bool,
    /// How deep the α of switches are in the ψ of others: as many rounds, and one more, settle all.
    rounds: usize,
    n: usize,
    m: usize,
    data: Vec<Arc<Piecewise>>,
    pulses: Pulses,
    /// t, x, α, the coefficients of data, and the parameters that stay open.
    inputs: Vec<f64>,
    psi: Vec<f64>,
}

/// What functions of a system depend on, once parameters are numbers, unless they stay open, and data polynomials.
pub(crate) struct Inputs<'e> {
    /// t, x, α, the coefficients of data, and the parameters that stay open.
    pub vars: Vec<Var>,
    /// What takes the place of parameters and data.
    pub numbers: Substitution<'e>,
    data: Vec<Arc<Piecewise>>,
    /// The values of the parameters that stay open.
    parameters: Vec<f64>,
}

impl<'e> Inputs<'e> {
    /// Of a system with some parameters open, by their numbers.
    pub(crate) fn new(system: &System<'e>, open: &[usize]) -> Self {
        let mut numbers = hybrid::numbers(system, open);
        let Polynomials {
            coefficients,
            instead,
        } = Polynomials::of(system);
        numbers.extend(instead.pairs());
        let mut vars = vec![variable(system.time)];
        vars.extend(system.states.iter().map(|state| variable(state.var)));
        vars.extend(system.switches.iter().map(|switch| variable(switch.alpha)));
        vars.extend(&coefficients);
        let params = system.exogenous.chosen(open);
        vars.extend(params.map(|param| variable(param.var)));
        Inputs {
            vars,
            numbers,
            data: data_of(system),
            parameters: system.values_of(open),
        }
    }

    /// Whether functions depend on nothing but parameters.
    pub(crate) fn are_constant(&self, functions: &[Expr]) -> bool {
        let (_, open) = self.vars.split_at(self.vars.len() - self.parameters.len());
        let mut inside = variables_of(functions).into_iter();
        inside.all(|var| open.contains(&var))
    }
}

impl Jumping {
    /// Lets no step pass over the pulses.
    pub(crate) fn of<'e>(system: &System<'e>, inputs: &Inputs<'e>, pulses: Pulses) -> Self {
        let (numbers, n) = (&inputs.numbers, system.states.len());
        let rates: Vec<Expr> = system.states.iter().map(|state| state.rate).collect();
        let switching: Vec<Expr> = system.switches.iter().map(|switch| switch.psi).collect();
        let (rates, switching) = (numbers.apply(&rates), numbers.apply(&switching));
        let rates = Vanishing::of(system, &switching).extended(&rates);
        let alphas: Vec<Var> = (system.switches.iter())
            .map(|switch| variable(switch.alpha))
            .collect();
        let mut depth: Vec<usize> = Vec::new();
        for &psi in &switching {
            let inside = variables_of(&[psi]);
            let deeper = alphas.iter().zip(&depth);
            let deeper = deeper.filter(|(alpha, _)| inside.contains(alpha));
            depth.push(deeper.map(|(_, depth)| depth + 1).max().unwrap_or(0));
        }
        let in_rates = variables_of(&rates);
        let rates_switch = alphas.iter().any(|alpha| in_rates.contains(alpha));
        let (rates, switching) = (tape(&inputs.vars, &rates), tape(&inputs.vars, &switching));
        Jumping {
            switching_scratch: switching.scratch(),
            rates: Sided::new(rates, |input| {
                (1 + n..1 + n + alphas.len()).contains(&input)
            }),
            switching,
            rates_switch,
            rounds: depth.into_iter().max().map_or(0, |depth| depth + 1),
            n,
            m: alphas.len(),
            data: inputs.data.clone(),
            pulses,
            inputs: {
                let others = inputs.vars.len() - inputs.parameters.len();
                [&vec![0.0; others], &inputs.parameters[..]].concat()
            },
            psi: vec![0.0; alphas.len()],
        }
    }

    /// Gives the open parameters other values.
    pub(crate) fn set_parameters(&mut self, values: &[f64]) {
        let first = self.inputs.len() - values.len();
        self.inputs[first..].copy_from_slice(values);
    }

    /// Takes other data, of the same fits; those behind them stay.
    pub(crate) fn set_data(&mut self, data: &[Arc<Piecewise>]) {
        self.data[..data.len()].clone_from_slice(data);
    }

    /// All inputs at a point; α where f has one.
    pub(crate) fn at(&mut self, t: f64, x: &[f64]) -> &[f64] {
        if self.rates_switch {
            self.set(t, x);
        } else {
            self.inputs[0] = t;
            self.inputs[1..=self.n].copy_from_slice(x);
        }
        &self.inputs
    }

    /// The coefficients of data that hold at present, and the parameters that stay open.
    pub(crate) fn coefficients(&self) -> &[f64] {
        &self.inputs[1 + self.n + self.m..]
    }

    /// Sets all inputs at a point.
    fn set(&mut self, t: f64, x: &[f64]) {
        let n = self.n;
        self.inputs[0] = t;
        self.inputs[1..=n].copy_from_slice(x);
        for _ in 0..self.rounds {
            let scratch = &mut self.switching_scratch;
            self.switching.eval(&self.inputs, &mut self.psi, scratch);
            for (alpha, psi) in self.inputs[1 + n..].iter_mut().zip(&self.psi) {
                // What is no number is on no side.
                *alpha = match *psi {
                    psi if psi < 0.0 => 0.0,
                    psi if psi >= 0.0 => 1.0,
                    _ => f64::NAN,
                };
            }
        }
    }
}

impl Field for Jumping {
    fn n_states(&self) -> usize {
        self.n
    }

    fn n_switches(&self) -> usize {
        self.m
    }

    fn sides(&mut self, t: f64, x: &[f64], sides: &mut [Side]) {
        self.set(t, x);
        for (side, alpha) in sides.iter_mut().zip(&self.inputs[1 + self.n..]) {
            *side = if *alpha == 0.0 {
                Side::Minus
            } else {
                Side::Plus
            };
        }
    }

    fn load(&mut self, t: f64) -> f64 {
        let first = 1 + self.n + self.m;
        let breakpoint = write_pieces(&self.data, t, &mut self.inputs[first..]);
        breakpoint.min(self.pulses.after(t))
    }

    fn rates(&mut self, t: f64, x: &[f64], rates: &mut [f64]) {
        self.at(t, x);
        self.rates.eval(&self.inputs, rates);
    }
}
