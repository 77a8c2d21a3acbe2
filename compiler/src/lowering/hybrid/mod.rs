//! Lowering to a [`HybridSystem`]: blocks of rates and surfaces, as plain data for the solver.
//!
//! Parameters are numbers, functions of time from data are polynomials whose coefficients are inputs, and so are α: what
//! a run needs of functions on certain sides the solver makes of these.

mod blocks;
mod data;
mod forms;
mod instants;
mod laws;
mod structure;
mod substituted;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use nsd_solver::hybrid::{
    Argument, Block, Form, HybridSystem, Input, Instance, Piecewise, Side, Switch, SwitchKind,
};
use nsd_solver::tape::Tape;
use rustc_hash::{FxHashMap, FxHashSet};

use crate::expr::{self, BinaryFunction, Expr, Node, Var, variables_of};
use crate::system::{self, Role, System};
pub(crate) use data::Polynomials;
pub(crate) use forms::{Copy, ExprForm, share};
pub(crate) use instants::Pulses;
use instants::narrowing;
use structure::Structure;
use substituted::{functions, with_directions, with_roots};
pub(crate) use substituted::{numbers, variable, with_numbers};

/// A system with the values of its parameters.
pub fn lower(system: &System) -> Arc<HybridSystem> {
    lower_at(system, &[])
}

/// The same for a single instant, with some parameters, by their numbers, as inputs.
pub(crate) fn lower_at(system: &System, open: &[usize]) -> Arc<HybridSystem> {
    Arc::new(Lowering::of(system, open).finish(system, open))
}

/// The same for runs from 0 to the horizon, of which no step passes over where functions of time are narrow.
pub fn lower_over(system: &System, horizon: f64) -> Arc<HybridSystem> {
    lower_open(system, horizon, &[])
}

/// The same with some parameters, by their numbers, as inputs in this order: runs may have others. They are among
/// those that [`may_be_open`].
pub fn lower_open(system: &System, horizon: f64, open: &[usize]) -> Arc<HybridSystem> {
    let mut lowered = Lowering::of(system, open).finish(system, open);
    lowered.stops = Pulses::of(system, horizon).instants();
    Arc::new(lowered)
}

/// The pieces of all data.
pub(crate) fn data_of(system: &System) -> Vec<Arc<Piecewise>> {
    let tables = system.exogenous.data.iter().map(|data| &data.table);
    tables.map(|table| table.pieces.clone()).collect()
}

/// Why another value of a parameter is another system: it is compiled in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Structural {
    /// Its terms are gone.
    #[error("is zero")]
    Zero,
    /// It decides how a power is computed.
    #[error("is in an exponent")]
    Exponent,
    /// It may decide where no step passes over.
    #[error("may make a function of time narrow")]
    Narrow,
    /// It decides at which instants states jump.
    #[error("decides at which instants states jump")]
    Sampling,
    /// Its values are listed, or bounded by other parameters, or it has bounds and follows from others.
    #[error("is in a set, or in a range that moves")]
    Range,
    /// It may decide which combinations of the sides of switches there are.
    #[error("decides which regions there are")]
    Regions,
    /// It decides how contacts are frozen.
    #[error("decides how impacts become motion")]
    Frozen,
    /// It decides when switches of time change, which is data of a run in steps.
    #[error("decides when switches of time change")]
    Instants,
}

/// For each parameter, why it may be no input.
pub fn structural(system: &System) -> Vec<Option<Structural>> {
    let laws = system.jumps.laws.iter().flat_map(system::Law::exprs);
    let instants = (system.jumps.laws.iter()).filter(|law| law.when.guard().is_none());
    let instants: Vec<Expr> = instants.flat_map(|law| law.when.exprs()).collect();
    let sampling: FxHashSet<Var> = variables_of(&instants).into_iter().collect();
    let jumps = &system.jumps;
    let contacts = jumps.contacts.iter().flat_map(system::Contact::exprs);
    let impulsive = (jumps.impulsive.iter()).flat_map(system::Impulsive::exprs);
    let masses = jumps.bodies.iter().flat_map(|body| &body.mass).copied();
    let contacts = contacts.chain(impulsive).chain(masses);
    let all = functions(system).concat().into_iter();
    let all: Vec<Expr> = all.chain(laws).chain(contacts).collect();
    let exponents: FxHashSet<Var> = variables_of(&exponents(&all)).into_iter().collect();
    let narrowing = narrowing(system);
    let why = |param: &system::Param| match variable(param.var) {
        var if exponents.contains(&var) => Some(Structural::Exponent),
        var if narrowing.contains(&var) => Some(Structural::Narrow),
        var if sampling.contains(&var) => Some(Structural::Sampling),
        _ if param.value == 0.0 => Some(Structural::Zero),
        _ => None,
    };
    system.exogenous.params.iter().map(why).collect()
}

/// The parameters that may be inputs, by their numbers.
pub fn may_be_open(system: &System) -> Vec<usize> {
    let why = structural(system).into_iter().enumerate();
    why.filter_map(|(place, why)| why.is_none().then_some(place))
        .collect()
}

/// What stands in the exponent of a power.
fn exponents<'e>(functions: &[Expr<'e>]) -> Vec<Expr<'e>> {
    let (mut found, mut seen) = (Vec::new(), FxHashSet::default());
    let mut left = functions.to_vec();
    while let Some(e) = left.pop() {
        if !seen.insert(e) {
            continue;
        }
        if let Node::Binary(BinaryFunction::Pow, _, exponent) = e.node() {
            found.push(exponent);
        }
        left.extend(expr::children(e));
    }
    found
}

/// A tape of functions of some variables.
pub(crate) fn tape(inputs: &[Var], outputs: &[Expr]) -> Tape {
    expr::compile(inputs, outputs)
        .expect("a verified system holds smooth functions of time, states and α only")
}

/// Functions of time, states, α and coefficients, and what their variables stand for.
struct Lowering<'e> {
    /// Rates, without and with directions of slip in place of their switches.
    folded: Vec<Expr<'e>>,
    rates: Vec<Expr<'e>>,
    switching: Vec<Expr<'e>>,
    polynomials: Polynomials<'e>,
    /// What every variable stands for.
    inputs: FxHashMap<Var, Input>,
    /// σ of switches.
    sticking: Vec<(usize, Var)>,
    /// σ of those of which rates contain roots.
    rooted: Vec<(usize, Var)>,
    /// Of each switch the switches on whose upper side it is in no rate.
    idle_above: Vec<Vec<usize>>,
}

impl<'e> Lowering<'e> {
    /// Puts numbers in place of parameters that are not open, and polynomials in place of data.
    fn of(system: &System<'e>, open: &[usize]) -> Self {
        let numbers = numbers(system, open);
        let [folded, switching] = functions(system).map(|functions| numbers.apply(&functions));
        let idle_above = structure::idle_above(system, &folded);
        let (folded, mut sticking) = with_directions(system, folded, &switching);
        let (folded, rooted) = with_roots(system, folded, &switching);
        sticking.extend(&rooted);
        let polynomials = Polynomials::of(system);
        let mut inputs = FxHashMap::default();
        inputs.insert(variable(system.time), Input::Time);
        for (i, state) in system.states.iter().enumerate() {
            inputs.insert(variable(state.var), Input::State(i));
        }
        for (i, switch) in system.switches.iter().enumerate() {
            inputs.insert(variable(switch.alpha), Input::Alpha(i));
        }
        let comparisons = system.jumps.comparisons.iter();
        inputs.extend(comparisons.map(|known| (known.var, Input::Alpha(known.switch))));
        inputs.extend(sticking.iter().map(|&(i, sigma)| (sigma, Input::Alpha(i))));
        for (i, param) in system.exogenous.chosen(open).enumerate() {
            inputs.insert(variable(param.var), Input::Parameter(i));
        }
        for (i, &coefficient) in polynomials.coefficients.iter().enumerate() {
            inputs.insert(coefficient, Input::Coefficient(i));
        }
        Lowering {
            rates: polynomials.instead.apply(&folded),
            switching: polynomials.instead.apply(&switching),
            folded,
            polynomials,
            inputs,
            sticking,
            rooted,
            idle_above,
        }
    }

    fn finish(self, system: &System<'e>, open: &[usize]) -> HybridSystem {
        let structure = Structure::of(
            system,
            &self.inputs,
            [&self.rates, &self.switching],
            &self.rooted,
        );
        let alphas = system.switches.iter().map(|switch| variable(switch.alpha));
        let alphas: Vec<Var> = alphas.collect();
        // To have data in common is no reason to be in one block.
        let blocks = blocks::cut(&self.folded, &structure.in_rates, &alphas);
        let instead = [&numbers(system, open), &self.polynomials.instead];
        let mut lowered = HybridSystem {
            algebraics: system.algebraic_states(),
            laws: laws::compile(system, &self.inputs, &instead),
            parameters: (system.exogenous.chosen(open)).map(|p| p.value).collect(),
            data: data_of(system),
            ..HybridSystem::default()
        };
        let functions = Functions::of(system, &self);
        lowered.rates = functions.share(&mut lowered.forms, &rates_of(&blocks, &self.rates));
        let chains = structure.chains.iter().flatten();
        let surfaces: Vec<_> = (self.switching.iter().chain(chains))
            .map(|&psi| vec![psi])
            .collect();
        lowered.surfaces = functions.share(&mut lowered.forms, &surfaces);
        lowered.blocks = blocks;
        lowered.switches = self.switches(system, structure);
        debug_assert_eq!(lowered.check(), Ok(()));
        lowered
    }

    fn switches(self, system: &System<'e>, structure: Structure<'e>) -> Vec<Switch> {
        let Structure {
            inside,
            timed,
            couplings,
            chains,
            with_data: [in_psi, in_rate],
            ..
        } = structure;
        let mut end = system.switches.len();
        let mut switches = Vec::with_capacity(end);
        let lists = couplings.into_iter().zip(inside).zip(self.idle_above);
        for (i, ((couplings, inside), idle_above)) in lists.enumerate() {
            let first = end;
            end += chains[i].len();
            let switch = &system.switches[i];
            switches.push(Switch {
                kind: kind(switch),
                is_continuous: switch.continuity.is_continuous(),
                is_timed: timed[i],
                is_nonlinear: switch.is_nonlinear,
                has_root: self.rooted.iter().any(|&(rooted, _)| rooted == i),
                has_data: [in_psi[i], in_rate[i]],
                couplings,
                inside,
                derivatives: first..end,
                idle_above,
            });
        }
        switches
    }
}

fn kind(switch: &system::Switch) -> SwitchKind {
    match (&switch.relay, switch.role) {
        (Some(relay), _) if relay.start => SwitchKind::Relay(Side::Plus),
        (Some(_), _) => SwitchKind::Relay(Side::Minus),
        (None, Role::Equation) => SwitchKind::Equation,
        (None, Role::Member(other)) => SwitchKind::Member(other),
        (None, Role::Step) if switch.unilateral => SwitchKind::Unilateral,
        (None, Role::Step) => match (switch.slip_of, switch.across) {
            (None, None) => SwitchKind::Step,
            (of, across) => SwitchKind::Slip { of, across },
        },
    }
}

fn rates_of<'e>(blocks: &[Block], rates: &[Expr<'e>]) -> Vec<Vec<Expr<'e>>> {
    let of = |block: &Block| block.states.iter().map(|&state| rates[state]).collect();
    blocks.iter().map(of).collect()
}

/// What functions are made of.
struct Functions<'s, 'e> {
    system: &'s System<'e>,
    inputs: &'s FxHashMap<Var, Input>,
    continuous: Vec<bool>,
    /// σ of switches.
    sticking: FxHashSet<Var>,
    /// α of switches on whose surface nothing depends on it.
    resting: FxHashSet<Var>,
}

impl<'s, 'e> Functions<'s, 'e> {
    fn of(system: &'s System<'e>, lowering: &'s Lowering<'e>) -> Self {
        let continuous = system.switches.iter();
        let continuous: Vec<bool> = continuous
            .map(|switch| switch.continuity.is_continuous())
            .collect();
        let resting = lowering.rooted.iter().filter(|(i, _)| continuous[*i]);
        Functions {
            system,
            inputs: &lowering.inputs,
            sticking: lowering.sticking.iter().map(|&(_, sigma)| sigma).collect(),
            resting: resting
                .map(|&(i, _)| variable(system.switches[i].alpha))
                .collect(),
            continuous,
        }
    }

    fn argument(&self, var: Var) -> Argument {
        match self.inputs[&var] {
            Input::Time => Argument::Time,
            Input::Coefficient(_) => Argument::Coefficient,
            Input::Parameter(_) => Argument::Parameter,
            Input::Alpha(_) if self.sticking.contains(&var) => Argument::Sticking,
            Input::Alpha(_) if self.resting.contains(&var) => Argument::Resting,
            Input::Alpha(_) => Argument::Alpha,
            _ => Argument::State,
        }
    }

    /// Variables of different kinds do not stand for each other; only continuous switches stay inputs of ψ.
    fn kind(&self, var: Var) -> u64 {
        let argument = self.argument(var) as u64;
        match self.inputs[&var] {
            Input::Alpha(switch) => 8 * u64::from(self.continuous[switch]) + argument,
            _ => argument,
        }
    }

    /// Groups of functions as instances of forms, which are added to others.
    fn share(&self, forms: &mut Vec<Form>, groups: &[Vec<Expr<'e>>]) -> Vec<Instance> {
        let first = forms.len();
        let (new, copies) = share(self.system.exprs, groups, |var| self.kind(var));
        forms.extend(new.iter().map(|form| {
            let inputs: Vec<Var> = form.vars.iter().chain(&form.holes).copied().collect();
            let arguments = form.vars.iter().map(|&var| self.argument(var));
            let numbers = form.holes.iter().map(|_| Argument::Number);
            Form {
                tape: tape(&inputs, &form.functions),
                arguments: arguments.chain(numbers).collect(),
            }
        }));
        let instance = |copy: Copy| {
            let variables = copy.vars.iter().map(|var| self.inputs[var]);
            let numbers = copy.numbers.iter().map(|&number| Input::Number(number));
            Instance {
                form: first + copy.form,
                inputs: variables.chain(numbers).collect(),
            }
        };
        copies.into_iter().map(instance).collect()
    }
}
