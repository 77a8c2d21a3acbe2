//! A [`Dcs`] as the solver of finite elements sees it, as plain data.
//!
//! Parameters are numbers by now, but for those that stay open, and data polynomials whose coefficients are inputs.

use nsd_solver::fesd::{
    ComplementaritySystem, Disc, Full, Kinds, Leading, Member, Pair, Surfaces, Switch, Units, Zero,
};
use nsd_solver::tape::Tape;
use rustc_hash::FxHashMap;

use crate::expr::{self, Expr, Exprs, Substitution, Var, variables_of};
use crate::lowering::dcs;
use crate::lowering::dcs::{Cause, Dcs, Origin};
use crate::lowering::hybrid::{Polynomials, data_of, numbers, variable};
use crate::system::{self, Role, System};

/// x' = f(t, x, z), 0 = g(t, x, z), 0 <= a ⟂ b >= 0 with the parameters of one experiment, and what functions of it are
/// made of.
pub(crate) struct Lowering<'e> {
    pub exprs: &'e Exprs,
    pub time: Var,
    pub states: Vec<Var>,
    pub algebraics: Vec<Var>,
    pub rates: Vec<Expr<'e>>,
    pub equations: Vec<Expr<'e>>,
    /// Coefficients of data, and then parameters that stay open: the last inputs of all functions.
    coefficients: Vec<Var>,
    /// The values of these parameters.
    open: FxHashMap<Var, f64>,
}

/// A lowering of `system` with the values of its parameters.
pub fn complementarity<'e>(system: &System<'e>, dcs: &Dcs<'e>) -> ComplementaritySystem {
    complementarity_open(system, dcs, &[])
}

/// The same with some parameters, by their numbers, as inputs in this order.
pub(crate) fn complementarity_open<'e>(
    system: &System<'e>,
    dcs: &Dcs<'e>,
    open: &[usize],
) -> ComplementaritySystem {
    let exprs = dcs.exprs;
    let numbers = numbers(system, open);
    let opened = open.iter().map(|&place| &system.exogenous.params[place]);
    let opened: Vec<(Var, f64)> = opened
        .map(|param| (variable(param.var), param.value))
        .collect();
    let polynomials = Polynomials::of(system);
    let mut instead = numbers.clone();
    instead.extend(polynomials.instead.pairs());
    let lowering = Lowering {
        exprs,
        time: variable(dcs.time),
        states: dcs.states.iter().map(|state| variable(state.var)).collect(),
        algebraics: dcs.algebraics.iter().map(|z| variable(z.var)).collect(),
        rates: instead.apply(&dcs.rows.rates),
        equations: instead.apply(&dcs.rows.equations),
        coefficients: (polynomials.coefficients.iter().copied())
            .chain(opened.iter().map(|&(var, _)| var))
            .collect(),
        open: opened.iter().copied().collect(),
    };
    let discs: Vec<Disc> = (dcs.switches.discs.iter())
        .map(|disc| lowering.stated(disc, dcs))
        .collect();
    let continuous: Vec<bool> = dcs.algebraics.iter().map(|z| z.continuous).collect();
    let rows = dcs.rows.origins.equations.iter();
    let determines_state: Vec<bool> = rows.map(|row| determines_state(system, row)).collect();
    let kinds = Kinds {
        continuous: &continuous,
        determines_state: &determines_state,
        discs: &discs,
    };
    let psi: Vec<Expr<'e>> = system.switches.iter().map(|switch| switch.psi).collect();
    let lowered = ComplementaritySystem {
        full: lowering.full(&instead.apply(&dcs.switches.alphas), kinds),
        algebraic_states: system.algebraic_states(),
        pairs: lowering.pairs(system, dcs),
        switches_of: (dcs.rows.origins.pairs.iter())
            .map(|origin| switches_of(system, origin))
            .collect(),
        switches: switches(system, dcs),
        surfaces: lowering.surfaces(system, dcs, &numbers, &polynomials),
        followers: lowering.followers(&numbers.apply(&psi)),
        data: data_of(system),
        parameters: opened.iter().map(|&(_, value)| value).collect(),
        stops: Vec::new(),
        continuous,
        discs,
    };
    debug_assert_eq!(lowered.check(), Ok(()));
    lowered
}

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

/// What is known of the switches: whether they are nonlinear, and the pairs that members of complementarities are in.
fn switches(system: &System, dcs: &Dcs) -> Vec<Switch> {
    let switch = |switch: &system::Switch| Switch {
        is_nonlinear: switch.is_nonlinear,
        member: None,
    };
    let mut switches: Vec<Switch> = system.switches.iter().map(switch).collect();
    for (pair, origin) in dcs.rows.origins.pairs.iter().enumerate() {
        if let Cause::Switch(second) = origin.cause
            && let Role::Member(first) = system.switches[second].role
        {
            switches[first].member = Some((pair, Zero::Left));
            switches[second].member = Some((pair, Zero::Right));
        }
    }
    switches
}

impl<'e> Lowering<'e> {
    /// The pair and the rows that state a disc.
    fn stated(&self, disc: &dcs::Disc, dcs: &Dcs) -> Disc {
        let slip = dcs.algebraics[disc.slip].var;
        let pair = dcs.rows.pairs.iter().position(|pair| pair.left == slip);
        let row = |inside: &[usize]| {
            let holds = |row: &Expr| inside.iter().all(|&z| row.depends_on(self.algebraics[z]));
            let place = dcs.rows.equations.iter().position(holds);
            place.expect("a disc has its equations")
        };
        let mut stated = Disc {
            pair: pair.expect("a disc has a pair"),
            rows: disc.alphas.map(|alpha| row(&[disc.slip, alpha])),
            alphas: disc.alphas,
            slip: disc.slip,
            stick: disc.stick,
            inside: row(&[disc.stick]),
            switches: disc.switches,
            friction: 0.0,
        };
        stated.friction = self.friction(&stated);
        stated
    }

    /// How fast friction moves w, while contacts act.
    fn friction(&self, disc: &Disc) -> f64 {
        let zero = |var: Var| match self.algebraics.contains(&var) {
            true => 0.0,
            false => self.open.get(&var).copied().unwrap_or(1.0),
        };
        let speed = |(row, z): (usize, usize)| {
            let row = self.equations[row];
            let rate = self.along(row, &variables_of(&[row]));
            0.5 * rate.diff(self.algebraics[z]).eval(&zero).abs()
        };
        let speeds = disc.rows.into_iter().zip(disc.alphas).map(speed);
        let speed = speeds.filter(|speed| speed.is_finite()).fold(0.0, f64::max);
        if speed > 0.0 { speed } else { 1.0 }
    }

    fn pairs(&self, system: &System, dcs: &Dcs) -> Vec<Pair> {
        let places = self.algebraics.iter().enumerate();
        let place: FxHashMap<Var, usize> = places.map(|(i, &z)| (z, i)).collect();
        let groups = groups(&self.equations, &place);
        let pair = |(pair, origin): (&dcs::Pair<'_>, &Origin)| {
            let (left, right) = (member(pair.left, &place), member(pair.right, &place));
            Pair {
                left,
                right,
                group: groups[left.variable],
                is_bounded: !is_force(system, origin),
            }
        };
        dcs.rows
            .pairs
            .iter()
            .zip(&dcs.rows.origins.pairs)
            .map(pair)
            .collect()
    }

    /// ψ of all switches, and what follows from it.
    fn surfaces(
        &self,
        system: &System<'e>,
        dcs: &Dcs<'e>,
        numbers: &Substitution<'e>,
        polynomials: &Polynomials<'e>,
    ) -> Surfaces {
        let psi: Vec<Expr<'e>> = system.switches.iter().map(|switch| switch.psi).collect();
        let all = numbers.apply(&[&psi[..], &dcs::indicators(system)].concat());
        let all = polynomials.instead.apply(&all);
        let alphas = system.switches.iter().map(|switch| variable(switch.alpha));
        let inputs = self.inputs(&alphas.collect::<Vec<_>>());
        let clock = system.clock.map_or(self.time, |clock| self.states[clock]);
        let data = system.exogenous.data.iter().map(|data| variable(data.var));
        let moves: Vec<Var> = [clock].into_iter().chain(data).collect();
        let leading = |switch: usize| {
            let psi = psi[switch].substitute(numbers);
            let terms = moves
                .iter()
                .map(|&var| psi.diff(var) * self.exprs.expr(var));
            let terms: Vec<Expr<'e>> = [psi].into_iter().chain(terms).collect();
            Leading {
                switch,
                terms: self.tape(&inputs, &polynomials.instead.apply(&terms)),
            }
        };
        let unilateral = |k: &usize| system.switches[*k].unilateral;
        Surfaces {
            psi: self.tape(&inputs, &all),
            rules: dcs::rules(system, dcs),
            units: Units::default(),
            gaps: (0..psi.len()).filter(unilateral).collect(),
            leading: system.leading().into_iter().map(leading).collect(),
        }
    }

    /// The tape of functions of these inputs, of the coefficients of data, and of open parameters.
    fn tape(&self, inputs: &[Var], outputs: &[Expr<'e>]) -> Tape {
        let all: Vec<Var> = inputs.iter().chain(&self.coefficients).copied().collect();
        expr::compile(&all, outputs)
            .expect("a verified DCS holds smooth functions of its own variables only")
    }

    /// Time, states, and some more variables.
    fn inputs(&self, more: &[Var]) -> Vec<Var> {
        let mut inputs = vec![self.time];
        inputs.extend_from_slice(&self.states);
        inputs.extend_from_slice(more);
        inputs
    }

    /// All functions, with every z an input.
    fn full(&self, alphas: &[Expr<'e>], kinds: Kinds) -> Full {
        let inputs = self.inputs(&self.algebraics);
        let equations = [&self.rates[..], &self.equations].concat();
        let [equations, alphas] = [&equations, alphas].map(|all| self.tape(&inputs, all));
        Full::new(equations, alphas, kinds)
    }

    /// Whether another value of a variable is another value of a number of runs.
    pub(crate) fn is_open(&self, var: Var) -> bool {
        self.open.contains_key(&var)
    }

    /// ∂e/∂t + Σ ∂e/∂x_i f_i, for an expression in these variables.
    pub(crate) fn along(&self, e: Expr<'e>, vars: &[Var]) -> Expr<'e> {
        let states = self.states.iter().zip(&self.rates);
        let states = states.filter(|(state, _)| vars.contains(state));
        let by_state = states.map(|(&state, &rate)| e.diff(state) * rate);
        self.exprs.sum(by_state.chain([e.diff(self.time)]))
    }
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
fn switches_of(system: &System, origin: &Origin) -> Vec<usize> {
    match origin.cause {
        Cause::Switch(switch) => {
            let across = system.switches[switch].across;
            [switch].into_iter().chain(across).collect()
        }
        Cause::Region { partition, .. } => system.coupling.partitions[partition].switches.clone(),
        Cause::Subsystem(subsystem) | Cause::Product(subsystem) => {
            system.coupling.subsystems[subsystem].switches.clone()
        }
        Cause::State(_) => Vec::new(),
    }
}
