//! A [`Dcs`] as the solver of finite elements sees it.
//!
//! Parameters are numbers by now. What all active sets share is compiled at once, the functions of
//! one active set when it is met first.

use crate::hybrid::{Polynomials, Pulses, data_of};
use nsd_solver::simulate::{Piecewise, write_pieces};
use std::cell::RefCell;
use std::sync::Arc;

use nsd_solver::fesd::{ComplementaritySystem, Disc, Full, Member, Pair, Reduced, Zero};
use nsd_solver::simulate::{Partials, Side};
use nsd_solver::tape::Tape;
use rustc_hash::FxHashMap;

use crate::dcs::{self, Cause, Dcs, Origin};
use crate::expr::{self, Expr, Exprs, Substitution, Var, variables_of};
use crate::system::{Role, System};

/// x' = f(t, x, z), 0 = g(t, x, z), 0 <= a ⟂ b >= 0 with the parameters of one experiment.
pub struct Complementarity<'e> {
    pub(super) exprs: &'e Exprs,
    pub(super) time: Var,
    pub(super) states: Vec<Var>,
    algebraic_states: Vec<usize>,
    pub(super) algebraics: Vec<Var>,
    continuous: Vec<bool>,
    start: Vec<f64>,
    pub(super) rates: Vec<Expr<'e>>,
    pub(super) equations: Vec<Expr<'e>>,
    /// Whether an equation determines an algebraic state, by equation.
    determines_state: Vec<bool>,
    pub(super) alphas: Vec<Expr<'e>>,
    pub(super) pairs: Vec<Pair>,
    pub(super) switches_of: Vec<Vec<usize>>,
    full: Full,
    /// Coefficients of data, the last inputs of all functions.
    coefficients: Vec<Var>,
    data: Vec<Arc<Piecewise>>,
    /// Where functions of time are narrow.
    pulses: Pulses,
    /// ψ of all switches.
    pub(super) surfaces: Vec<Expr<'e>>,
    /// Which of them follow which.
    pub(super) followers: Vec<(usize, usize)>,
    /// ψ of unilateral switches.
    gaps: Vec<(usize, Expr<'e>)>,
    /// Whether rates contain the α of a switch in another way than affine.
    pub(super) nonlinear: Vec<bool>,
    /// The pairs that members of complementarities are in, by switch.
    pub(super) members: Vec<Option<(usize, Zero)>>,
    /// The discs, and the switches of each.
    pub(super) discs: Vec<Disc>,
    pub(super) switches_of_discs: Vec<[usize; 2]>,
    /// Switches of time with which other ψ jump.
    leading: Vec<usize>,
    /// What z follows from where ψ jump with data or with these; none without any.
    at_breakpoints: Option<(System<'e>, Dcs<'e>)>,
    known: RefCell<FxHashMap<Vec<Zero>, Option<Arc<Reduced>>>>,
}

/// |ψ| of a switch of time below this share of |ψ'| t is its surface.
const SURFACE: f64 = 1e-12;

/// A gap below this is no rounding.
const OUTSIDE: f64 = 1e-10;

/// Whether a multiplier has no bound: a force, or a member of an equation or a complementarity.
fn is_force(system: &System, origin: &Origin) -> bool {
    let Cause::Switch(switch) = origin.cause else {
        return false;
    };
    let switch = &system.switches[switch];
    switch.unilateral || switch.role != Role::Step
}

/// Whether an equation determines an algebraic state.
fn determines_state(system: &System, origin: &Origin) -> bool {
    let switch = |k: usize| &system.switches[k];
    matches!(origin.cause, Cause::Switch(k) if switch(k).role == Role::Equation)
}

/// The pairs that members of complementarities are in, by switch.
fn members(system: &System, dcs: &Dcs) -> Vec<Option<(usize, Zero)>> {
    let mut members = vec![None; system.switches.len()];
    for (pair, origin) in dcs.origins.pairs.iter().enumerate() {
        if let Cause::Switch(second) = origin.cause
            && let Role::Member(first) = system.switches[second].role
        {
            members[first] = Some((pair, Zero::Left));
            members[second] = Some((pair, Zero::Right));
        }
    }
    members
}

/// The pair and the rows that state a disc, without its friction.
fn stated(disc: &dcs::Disc, dcs: &Dcs) -> Disc {
    let slip = dcs.algebraics[disc.slip].var;
    let pair = dcs.pairs.iter().position(|pair| pair.left == slip);
    let row = |alpha: usize| {
        let both = [disc.slip, alpha].map(|z| variable(dcs.algebraics[z].var));
        let holds = |row: &Expr| both.iter().all(|var| row.depends_on(*var));
        let place = dcs.equations.iter().position(holds);
        place.expect("a disc states its slip velocity")
    };
    Disc {
        pair: pair.expect("a disc has a pair"),
        rows: disc.alphas.map(row),
        alphas: disc.alphas,
        slip: disc.slip,
        friction: 0.0,
    }
}

/// What stands for the functions until they are compiled.
fn no_functions() -> Full {
    let empty = || Tape::builder(0).finish(&[]);
    Full {
        equations: empty(),
        slopes: Partials::none(0),
        directional: empty(),
        directional_slopes: Partials::none(0),
        rates: empty(),
        alphas: empty(),
        is_affine: true,
    }
}

impl<'e> Complementarity<'e> {
    /// Substitutes the parameters of a lowering of `system`.
    pub fn new(system: &System<'e>, dcs: &Dcs<'e>) -> Self {
        let exprs = dcs.exprs;
        let params = dcs.params.iter();
        let mut numbers: Substitution = params
            .map(|param| (variable(param.var), exprs.constant(param.value)))
            .collect();
        let surfaces = system.switches.iter();
        let surfaces = surfaces.map(|switch| switch.psi.substitute(&numbers));
        let surfaces: Vec<Expr<'e>> = surfaces.collect();
        let gaps = surfaces.iter().copied().enumerate();
        let gaps = gaps
            .filter(|(k, _)| system.switches[*k].unilateral)
            .collect();
        let Polynomials {
            coefficients,
            instead,
        } = Polynomials::of(system);
        numbers.extend(instead.pairs());
        let (rates, equations) = (numbers.apply(&dcs.rates), numbers.apply(&dcs.equations));
        let leading = system.leading();
        let jumps = !coefficients.is_empty() || !leading.is_empty();
        let at_breakpoints = jumps.then(|| (system.clone(), dcs.clone()));
        let algebraics: Vec<Var> = dcs.algebraics.iter().map(|z| variable(z.var)).collect();
        let places = algebraics.iter().enumerate();
        let place: FxHashMap<Var, usize> = places.map(|(i, &z)| (z, i)).collect();
        let groups = groups(&equations, &place);
        let pair = |(pair, origin): (&dcs::Pair<'e>, &Origin)| {
            let (left, right) = (member(pair.left, &place), member(pair.right, &place));
            Pair {
                left,
                right,
                group: groups[left.variable],
                is_bounded: !is_force(system, origin),
            }
        };
        let discs = dcs.discs.iter().map(|disc| stated(disc, dcs)).collect();
        let switches_of_discs = dcs.discs.iter().map(|disc| disc.switches).collect();
        let mut system = Complementarity {
            exprs,
            time: variable(dcs.time),
            states: dcs.states.iter().map(|state| variable(state.var)).collect(),
            algebraic_states: system.algebraic_states(),
            continuous: dcs.algebraics.iter().map(|z| z.continuous).collect(),
            start: dcs.algebraics.iter().map(|z| z.guess).collect(),
            determines_state: (dcs.origins.equations.iter())
                .map(|origin| determines_state(system, origin))
                .collect(),
            alphas: numbers.apply(&dcs.alphas),
            pairs: dcs.pairs.iter().zip(&dcs.origins.pairs).map(pair).collect(),
            switches_of: (dcs.origins.pairs.iter())
                .map(|origin| switches(system, origin))
                .collect(),
            full: no_functions(),
            algebraics,
            rates,
            equations,
            coefficients,
            data: data_of(system),
            pulses: Pulses::default(),
            surfaces,
            followers: Vec::new(),
            gaps,
            nonlinear: (system.switches.iter())
                .map(|switch| switch.is_nonlinear)
                .collect(),
            members: members(system, dcs),
            discs,
            switches_of_discs,
            leading,
            at_breakpoints,
            known: RefCell::default(),
        };
        for at in 0..system.discs.len() {
            system.discs[at].friction = system.friction(&system.discs[at]);
        }
        system.full = system.compile_full();
        system.followers = system.followers();
        system
    }

    /// Lets no element whose length is free pass over pulses.
    pub(in crate::simulate) fn over(mut self, pulses: Pulses) -> Self {
        self.pulses = pulses;
        self
    }

    /// Names of z, in order.
    pub fn names(&self) -> Vec<String> {
        self.algebraics
            .iter()
            .map(|&z| self.exprs.name(z))
            .collect()
    }

    /// The tape of functions of these inputs, and of the coefficients of data.
    pub(super) fn tape(&self, inputs: &[Var], outputs: &[Expr<'e>]) -> Tape {
        let all: Vec<Var> = inputs.iter().chain(&self.coefficients).copied().collect();
        expr::compile(&all, outputs)
            .expect("a verified DCS holds smooth functions of its own variables only")
    }

    /// The derivatives of functions of `inputs` by some of these.
    pub(super) fn partials(&self, inputs: &[Var], functions: &[Expr<'e>], by: &[Var]) -> Partials {
        let entries = expr::jacobian(functions, by).entries;
        let values: Vec<Expr> = entries.iter().map(|&(.., value)| value).collect();
        let place: FxHashMap<Var, usize> = inputs
            .iter()
            .enumerate()
            .map(|(i, &var)| (var, i))
            .collect();
        Partials {
            tape: self.tape(inputs, &values),
            entries: (entries.iter())
                .map(|&(function, column, _)| (function, place[&by[column]]))
                .collect(),
        }
    }

    /// Where variables stand among the algebraic ones.
    pub(super) fn places(&self, vars: &[Var]) -> Vec<usize> {
        let place = |var| self.algebraics.iter().position(|z| z == var);
        vars.iter().filter_map(place).collect()
    }

    /// Time, states, and some more variables.
    pub(super) fn inputs(&self, more: &[Var]) -> Vec<Var> {
        let mut inputs = vec![self.time];
        inputs.extend_from_slice(&self.states);
        inputs.extend_from_slice(more);
        inputs
    }

    fn compile_full(&self) -> Full {
        let exprs = self.exprs;
        let inputs = self.inputs(&self.algebraics);
        let all: Vec<Expr> = self.rates.iter().chain(&self.equations).copied().collect();

        // u is z of what jumps and z' of what is continuous.
        let u = exprs.variables("u", self.algebraics.len());
        let jumps = self.algebraics.iter().zip(&u).zip(&self.continuous);
        let jumps: Substitution = jumps
            .filter(|(_, continuous)| !**continuous)
            .map(|((&z, &u), _)| (z, u))
            .collect();
        let rates = jumps.apply(&self.rates);
        let rows = self.equations.iter().zip(&self.determines_state);
        let directional = rows.map(|(&row, determines_state)| {
            let vars = variables_of(&[row]);
            let inside = self.algebraics.iter().zip(&u).zip(&self.continuous);
            let inside = inside.filter(|((z, _), continuous)| **continuous && vars.contains(z));
            let along: Vec<Expr> = inside.map(|((&z, &u), _)| row.diff(z) * u).collect();
            let holds_z = vars.iter().any(|var| self.algebraics.contains(var));
            // What jumps has no part in an equation for a state where it does so: the state is continuous.
            if along.is_empty() && holds_z && !determines_state {
                return row.substitute(&jumps);
            }
            let along = exprs.sum(along.into_iter().chain([self.drift(row, &vars)]));
            along.substitute(&jumps)
        });
        let mut directional: Vec<Expr> = directional.collect();
        for disc in &self.discs {
            self.direct(disc, &jumps, &mut directional);
        }
        let u: Vec<Var> = u.into_iter().map(variable).collect();
        let mut with_u = inputs.clone();
        with_u.extend_from_slice(&u);
        let by_u = expr::jacobian(&directional, &u).entries;
        let slopes: Vec<Expr> = by_u.iter().map(|&(.., slope)| slope).collect();
        let in_slopes = variables_of(&slopes);
        Full {
            equations: self.tape(&inputs, &all),
            slopes: self.partials(&inputs, &all, &inputs),
            directional: self.tape(&with_u, &directional),
            directional_slopes: self.partials(&with_u, &directional, &u),
            is_affine: !u.iter().any(|u| in_slopes.contains(u)),
            rates: self.tape(&with_u, &rates),
            alphas: self.tape(&inputs, &self.alphas),
        }
    }

    /// ∂e/∂t + Σ ∂e/∂x_i f_i, for an expression in these variables.
    fn drift(&self, e: Expr<'e>, vars: &[Var]) -> Expr<'e> {
        self.along(e, vars, &self.rates)
    }

    pub(super) fn along(&self, e: Expr<'e>, vars: &[Var], rates: &[Expr<'e>]) -> Expr<'e> {
        let states = self.states.iter().zip(rates);
        let states = states.filter(|(state, _)| vars.contains(state));
        let by_state = states.map(|(&state, &rate)| e.diff(state) * rate);
        self.exprs.sum(by_state.chain([e.diff(self.time)]))
    }
}

impl ComplementaritySystem for Complementarity<'_> {
    fn n_states(&self) -> usize {
        self.states.len()
    }

    fn algebraic_states(&self) -> &[usize] {
        &self.algebraic_states
    }

    fn n_switches(&self) -> usize {
        self.alphas.len()
    }

    fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    fn discs(&self) -> &[Disc] {
        &self.discs
    }

    fn switches_of(&self, pair: usize) -> &[usize] {
        &self.switches_of[pair]
    }

    fn full(&self) -> &Full {
        &self.full
    }

    fn reduced(&self, zeros: &[Zero]) -> Option<Arc<Reduced>> {
        let mut known = self.known.borrow_mut();
        let compile = || self.compile(zeros).map(Arc::new);
        known.entry(zeros.to_vec()).or_insert_with(compile).clone()
    }

    fn branch(&self, zeros: &[Zero], i: usize, rises: bool) -> Option<Arc<Reduced>> {
        self.compile_branch(zeros, i, rises).map(Arc::new)
    }

    fn n_numbers(&self) -> usize {
        self.coefficients.len()
    }

    fn numbers(&self, t: f64, numbers: &mut [f64]) -> f64 {
        write_pieces(&self.data, t, numbers)
    }

    fn stop(&self, t: f64) -> f64 {
        self.pulses.after(t)
    }

    fn leading(&self) -> &[usize] {
        &self.leading
    }

    fn meets(&self, t: f64, x: &[f64], led: &[(usize, Side)]) -> Vec<bool> {
        let Some((system, _)) = &self.at_breakpoints else {
            return Vec::new();
        };
        let (clock, now) = match system.clock {
            Some(clock) => (self.states[clock], x[clock]),
            None => (self.time, t),
        };
        let value = |var: Var| {
            let mut all = led.iter();
            let is_it = |switch: usize| variable(system.switches[switch].alpha) == var;
            let side = all.find(|(switch, _)| is_it(*switch));
            let data = || system.data.iter().find(|data| variable(data.var) == var);
            match side {
                _ if var == clock => now,
                Some((_, side)) => 0.5 + 0.5 * side.sign(),
                None => data().map_or(f64::NAN, |data| data.table.value(t)),
            }
        };
        let is_met = |(switch, _): &(usize, Side)| {
            let psi = self.surfaces[*switch];
            let data = system.data.iter().map(|data| variable(data.var));
            let moves = [clock].into_iter().chain(data);
            let terms = moves.map(|var| (psi.diff(var).eval(&value) * value(var)).abs());
            let size: f64 = terms.sum();
            psi.eval(&value).abs() <= SURFACE * size.max(f64::MIN_POSITIVE)
        };
        led.iter().map(is_met).collect()
    }

    fn z_at(&self, t: f64, x: &[f64], led: &[(usize, Side)]) -> Vec<f64> {
        let Some((system, dcs)) = &self.at_breakpoints else {
            return self.start.clone();
        };
        let params = system.params.iter().map(|p| (variable(p.var), p.value));
        let data = system.data.iter();
        let data = data.map(|data| (variable(data.var), data.table.value(t)));
        let states = self.states.iter().copied().zip(x.iter().copied());
        let known: FxHashMap<Var, f64> = params
            .chain(data)
            .chain(states)
            .chain([(self.time, t)])
            .collect();
        let value = |var: Var| known.get(&var).copied().unwrap_or(f64::NAN);
        let led: Vec<(usize, f64)> = (led.iter())
            .map(|&(switch, side)| (switch, 0.5 + 0.5 * side.sign()))
            .collect();
        dcs::solve_led(system, dcs, &led, &value).algebraics
    }

    fn below(&self, t: f64, x: &[f64]) -> Option<usize> {
        let data = self.at_breakpoints.as_ref();
        let data = data.map_or(&[][..], |(system, _)| &system.data);
        let value = |var: Var| {
            if var == self.time {
                return t;
            }
            let place = self.states.iter().position(|&state| state == var);
            let table = data.iter().find(|data| variable(data.var) == var);
            let table = table.map(|data| data.table.value(t));
            place.map(|place| x[place]).or(table).unwrap_or(f64::NAN)
        };
        let is_below = |(_, gap): &&(usize, Expr<'_>)| gap.eval(&value) < -OUTSIDE;
        self.gaps.iter().find(is_below).map(|(switch, _)| *switch)
    }

    fn start(&self) -> &[f64] {
        &self.start
    }

    fn is_continuous(&self, algebraic: usize) -> bool {
        self.continuous[algebraic]
    }
}

pub(super) fn variable(e: Expr) -> Var {
    e.as_variable().expect("what a DCS declares is a variable")
}

/// z_i or 1 - z_i.
fn member(e: Expr, place: &FxHashMap<Var, usize>) -> Member {
    let var = variables_of(&[e])[0];
    Member {
        variable: place[&var],
        complement: e.as_variable().is_none(),
    }
}

/// A number for each z, the same for those that share an equation.
fn groups(equations: &[Expr], place: &FxHashMap<Var, usize>) -> Vec<usize> {
    let mut sets = petgraph::unionfind::UnionFind::<usize>::new(place.len());
    for &row in equations {
        let vars = variables_of(&[row]).into_iter();
        let vars: Vec<usize> = vars.filter_map(|var| place.get(&var).copied()).collect();
        for pair in vars.windows(2) {
            sets.union(pair[0], pair[1]);
        }
    }
    sets.into_labeling()
}

/// The switches that a row is about.
fn switches(system: &System, origin: &Origin) -> Vec<usize> {
    match origin.cause {
        Cause::Switch(switch) => {
            let across = system.switches[switch].across;
            [switch].into_iter().chain(across).collect()
        }
        Cause::Region { partition, .. } => system.partitions[partition].switches.clone(),
        Cause::Subsystem(subsystem) | Cause::Product(subsystem) => {
            system.subsystems[subsystem].switches.clone()
        }
        Cause::State(_) => Vec::new(),
    }
}
