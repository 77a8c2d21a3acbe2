//! What an experiment needs of its model.
//!
//! With an `output` list, an experiment keeps what the listed quantities, its `plot` and its expectations reach:
//! a state needs its rates and the guards around them, a named switch its ψ, a control what it is
//! given as. An optimization also keeps what its cost and constraints reach, bounds of states among them. Everything
//! else is skipped before any switch is collected. Without a list, all is kept.

pub(crate) mod effort;
pub(crate) mod skipped;
use rustc_hash::{FxHashMap, FxHashSet};

use super::experiment::Settings;
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Reach, Var, variables_of};
use crate::model::{Model, Projection, Region, Tensor};
use crate::syntax::{self, Arg, Expect, ExprKind};

/// How much of a model is lowered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// What the outputs and expectations of the experiment need.
    Needed,
    /// Everything, so that every mistake is found.
    Whole,
}

/// What is kept of a model.
pub(crate) struct Needs<'e> {
    /// By state entry.
    pub entries: Vec<bool>,
    /// By region.
    pub regions: Vec<bool>,
    /// Algebraic states, all or none of them.
    pub algebraic: bool,
    /// Named switches and switching functions that expectations name.
    pub surfaces: Vec<Expr<'e>>,
    /// The variables that are reached; all of them where everything is kept.
    reached: Option<FxHashSet<Var>>,
}

impl<'e> Needs<'e> {
    /// What reaches no output and no expectation is left out, unless everything is asked for.
    pub fn of(model: &Model<'e>, settings: &Settings<'e>, extent: Extent) -> Self {
        let mut named = Named::default();
        for (expect, _) in &settings.expects {
            named.expectation(model, expect);
        }
        let outputs = settings.recording.outputs.as_ref();
        let listed = outputs.into_iter().flatten();
        // What decides on controls may read every state.
        let is_fed_back = settings.numerics.closed_loop.is_some();
        let everything =
            extent == Extent::Whole || outputs.is_none() || named.everything || is_fed_back;
        if everything {
            return Needs {
                entries: vec![true; model.state_vars().count()],
                regions: vec![true; model.statements.regions.len()],
                algebraic: true,
                surfaces: named.surfaces,
                reached: None,
            };
        }
        let mut closure = Closure::new(model, settings);
        let listed = listed.flat_map(|kept| &kept.entries);
        let listed = listed.chain(&named.exprs).chain(&named.surfaces);
        let stops = settings.numerics.stops.iter().map(|stop| stop.guard);
        let drawn = settings.recording.figures.entries();
        for e in listed.copied().chain(drawn).chain(stops) {
            closure.reach(e);
        }
        if let Some(task) = &settings.optimize {
            let bounded = model
                .quantities
                .states
                .iter()
                .chain(&model.quantities.algebraics);
            let bounded = bounded.filter(|state| state.domain.is_some());
            let bounded = bounded.flat_map(|state| state.vars.iter().copied());
            let integrals = task.integrals.iter().map(|integral| integral.value);
            let rows = task.rows.iter();
            let rows = rows.flat_map(|row| [row.value].into_iter().chain(row.holds.exprs()));
            for e in integrals
                .chain(rows)
                .chain([task.cost.value])
                .chain(bounded)
            {
                closure.reach(e);
            }
        }
        for region in named.regions {
            closure.name_region(region);
        }
        closure.finish(named.surfaces)
    }

    /// Whether a variable of the model is reached.
    pub fn holds(&self, var: Option<Var>) -> bool {
        let reached = self.reached.as_ref().zip(var);
        reached.is_none_or(|(reached, var)| reached.contains(&var))
    }

    /// Whether all variables of an expression are reached.
    pub fn holds_all(&self, e: Expr<'e>) -> bool {
        let Some(reached) = &self.reached else {
            return true;
        };
        variables_of(&[e]).iter().all(|var| reached.contains(var))
    }
}

/// What expectations are about.
#[derive(Default)]
struct Named<'e> {
    exprs: Vec<Expr<'e>>,
    surfaces: Vec<Expr<'e>>,
    regions: Vec<usize>,
    /// Some expectation is about the system as a whole.
    everything: bool,
}

impl<'e> Named<'e> {
    fn expectation(&mut self, model: &Model<'e>, expect: &Expect) {
        match expect {
            Expect::LoweringGolden
            | Expect::NumbersGolden
            | Expect::Warning(_)
            | Expect::Status(_) => {}
            Expect::Mode { mode, .. } => self.mode(model, mode),
            Expect::Relation(relation) => {
                self.value(model, &relation.left);
                self.value(model, &relation.right);
            }
        }
    }

    /// One side of a relation, with the words that only a run gives a meaning to.
    fn value(&mut self, model: &Model<'e>, side: &syntax::Expr) {
        let whole = std::cell::Cell::new(false);
        let surfaces = std::cell::RefCell::new(Vec::new());
        let list = || Some(Tensor::vector(vec![model.exprs.constant(0.0); MANY]));
        let hook = |e: &syntax::Expr| match &e.kind {
            ExprKind::Name(name) if name == "switches" => {
                whole.set(true);
                list()
            }
            // The error is that of all states.
            ExprKind::Name(name) if name == "order" && !model.scope.names().any(|n| n == name) => {
                whole.set(true);
                Some(Tensor::scalar(model.exprs.constant(1.0)))
            }
            ExprKind::Name(name) if name == "end" => {
                Some(Tensor::scalar(model.exprs.constant(0.0)))
            }
            ExprKind::Call(function, args) if is_name(function, "events") => {
                match &args[..] {
                    [_, Arg::Positional(surface, _)] => {
                        surfaces.borrow_mut().push(surface.clone());
                    }
                    _ => whole.set(true),
                }
                list()
            }
            _ => None,
        };
        let value = model.scope.expr(side, Some(&hook), &mut Diagnostics::new());
        // What is wrong with an expectation is said elsewhere, about the whole system.
        self.everything |= whole.get() || value.is_none();
        self.exprs.extend(value.into_iter().flat_map(|v| v.data));
        for surface in surfaces.into_inner() {
            self.surface(model, &surface);
        }
    }

    /// A named switch or a switching function.
    fn surface(&mut self, model: &Model<'e>, surface: &syntax::Expr) {
        let value = model.scope.expr(surface, None, &mut Diagnostics::new());
        self.everything |= value.is_none();
        self.surfaces.extend(value.into_iter().flat_map(|v| v.data));
    }

    fn mode(&mut self, model: &Model<'e>, mode: &syntax::Expr) {
        match &mode.kind {
            ExprKind::And(parts) | ExprKind::Or(parts) => {
                parts.iter().for_each(|part| self.mode(model, part));
            }
            ExprKind::Not(part) => self.mode(model, part),
            ExprKind::Call(_, args) => {
                for arg in args {
                    match arg {
                        Arg::Positional(surface, _) => self.surface(model, surface),
                        Arg::Named(..) => self.everything = true,
                    }
                }
            }
            _ => {
                let name = mode.to_string().split_whitespace().collect::<String>();
                let found = model
                    .statements
                    .regions
                    .iter()
                    .position(|region| region.name == name);
                self.everything |= found.is_none();
                self.regions.extend(found);
            }
        }
    }
}

/// Entries that a list has whose length only a run knows, so that any index is good.
const MANY: usize = 10_000;

fn is_name(expr: &syntax::Expr, name: &str) -> bool {
    matches!(&expr.kind, ExprKind::Name(found) if found == name)
}

/// By state entry: what its motion needs.
struct Needed<'e>(Vec<Vec<Expr<'e>>>);

impl<'e> Needed<'e> {
    fn of(model: &Model<'e>) -> Self {
        let mut needed = Needed(vec![Vec::new(); model.state_vars().count()]);
        needed.add_rates(model);
        needed.add_bodies(model);
        for projection in &model.statements.projections {
            needed.add_projection(model, projection);
        }
        for jump in &model.statements.jumps {
            for reset in &jump.resets {
                needed.add(reset.entry, &[reset.value]);
                needed.add(reset.entry, jump.when.guard().as_slice());
            }
        }
        needed
    }

    fn add(&mut self, entry: usize, exprs: &[Expr<'e>]) {
        if let Some(needed) = self.0.get_mut(entry) {
            needed.extend_from_slice(exprs);
        }
    }

    /// Rates, and the guards around them.
    fn add_rates(&mut self, model: &Model<'e>) {
        let hidden = model
            .statements
            .hidden
            .iter()
            .flat_map(|hidden| &hidden.rates);
        for rate in model.statements.dynamics.iter().chain(hidden) {
            self.add(rate.entry, &[rate.value]);
        }
        for region in &model.statements.regions {
            for rate in &region.rates {
                self.add(rate.entry, &[rate.value, region.guard]);
            }
        }
    }

    /// Velocities that a mass couples, and contacts of the bodies that they touch.
    fn add_bodies(&mut self, model: &Model<'e>) {
        let vars: Vec<Expr<'e>> = model.state_vars().collect();
        let mut body_of = FxHashMap::default();
        for (b, body) in model.statements.bodies.iter().enumerate() {
            let n = body.velocities.len();
            let entries = body.positions.iter().chain(&body.velocities);
            body_of.extend(entries.filter_map(|&entry| Some((vars[entry].as_variable()?, b))));
            let coupled = (0..n * n).any(|k| k / n != k % n && !body.inverse[k].is_zero());
            let all: Vec<Expr<'e>> = body.velocities.iter().map(|&entry| vars[entry]).collect();
            for &entry in body.velocities.iter().filter(|_| coupled) {
                self.add(entry, &all);
            }
        }
        for contact in &model.statements.contacts {
            let exprs: Vec<Expr<'e>> = contact.exprs().collect();
            let touched = variables_of(&exprs).into_iter();
            let mut touched: Vec<usize> = touched
                .filter_map(|var| body_of.get(&var).copied())
                .collect();
            touched.sort_unstable();
            touched.dedup();
            let bodies = touched.into_iter().map(|b| &model.statements.bodies[b]);
            for &entry in bodies.flat_map(|body| &body.velocities) {
                self.add(entry, &exprs);
            }
        }
    }

    /// The constraints of a projection, in the entries that they push, with the metric there.
    fn add_projection(&mut self, model: &Model<'e>, projection: &Projection<'e>) {
        let vars: Vec<Expr<'e>> = model.state_vars().collect();
        let n = projection.entries.len();
        for row in &projection.constraints {
            let inside = variables_of(&[row.c]);
            let moved = |i: &usize| {
                let var = vars[projection.entries[*i]].as_variable();
                var.is_some_and(|x| inside.contains(&x))
            };
            let pushed = |i: &usize| match &projection.metric {
                None => moved(i),
                Some(metric) => (0..n).any(|j| moved(&j) && !metric[i * n + j].is_zero()),
            };
            for i in (0..n).filter(pushed) {
                let metric = projection.metric.iter();
                let metric = metric.flat_map(|m| &m[i * n..(i + 1) * n]);
                let exprs: Vec<Expr<'e>> = metric.copied().chain([row.c]).collect();
                self.add(projection.entries[i], &exprs);
            }
        }
    }
}

/// Follows what needs what.
struct Closure<'m, 'e> {
    model: &'m Model<'e>,
    /// The entry of every state variable.
    entry: FxHashMap<Var, usize>,
    /// What a switch, control or input stands for.
    stands_for: FxHashMap<Var, Expr<'e>>,
    /// By state entry: its rates, and the guards around them.
    rates: Vec<Vec<Expr<'e>>>,
    entries: Vec<bool>,
    /// Algebraic states, with what their equations and pairs need; none once that is reached.
    algebraics: Vec<Var>,
    equations: Option<Vec<Expr<'e>>>,
    /// Regions that are kept for their own sake.
    named: Vec<bool>,
    below: Reach,
    reached: FxHashSet<Var>,
}

impl<'m, 'e> Closure<'m, 'e> {
    fn new(model: &'m Model<'e>, settings: &Settings<'e>) -> Self {
        let states: Vec<Option<Var>> = model.state_vars().map(Expr::as_variable).collect();
        let entry = (0..).zip(&states).filter_map(|(k, var)| Some(((*var)?, k)));
        let switches = model.switches.iter();
        let switches = switches.flat_map(|switch| switch.vars.iter().zip(&switch.psi));
        let switches = switches.filter_map(|(var, &psi)| Some((var.as_variable()?, psi)));
        let given = (model
            .quantities
            .controls
            .iter()
            .chain(&model.quantities.inputs))
        .flat_map(|quantity| &quantity.vars)
        .filter_map(|var| var.as_variable())
        .filter_map(|var| Some((var, settings.values.signals.get(var)?)));
        Closure {
            model,
            entry: entry.collect(),
            stands_for: switches.chain(given).collect(),
            rates: Needed::of(model).0,
            entries: vec![false; states.len()],
            algebraics: (model.algebraic_entries())
                .filter_map(|(z, ..)| z.as_variable())
                .collect(),
            equations: Some({
                let pairs = model
                    .statements
                    .complementarities
                    .iter()
                    .flat_map(|pair| pair.members);
                let equations = model
                    .statements
                    .equations
                    .iter()
                    .map(|equation| equation.residual);
                let all = model.algebraic_entries().map(|(z, ..)| z);
                equations.chain(pairs).chain(all).collect()
            }),
            named: vec![false; model.statements.regions.len()],
            below: Reach::default(),
            reached: FxHashSet::default(),
        }
    }

    /// Adds an expression and all that it needs.
    fn reach(&mut self, e: Expr<'e>) {
        let mut open = vec![e];
        while let Some(e) = open.pop() {
            for var in self.below.new_variables(e) {
                self.reached.insert(var);
                open.extend(self.stands_for.get(&var));
                if self.algebraics.contains(&var) {
                    open.extend(self.equations.take().into_iter().flatten());
                }
                if let Some(&entry) = self.entry.get(&var) {
                    self.entries[entry] = true;
                    open.append(&mut self.rates[entry]);
                }
            }
        }
    }

    /// Adds a region: with all that its partition sets, or alone where it only adds.
    fn name_region(&mut self, region: usize) {
        let model = self.model;
        let holds = |partition: &&crate::model::Partition| partition.regions.contains(&region);
        match model.partitions.iter().find(holds) {
            Some(partition) => {
                let vars: Vec<Expr<'e>> = model.state_vars().collect();
                for &entry in &partition.entries {
                    self.reach(vars[entry]);
                }
            }
            None => {
                self.named[region] = true;
                self.reach(model.statements.regions[region].guard);
            }
        }
    }

    fn finish(mut self, surfaces: Vec<Expr<'e>>) -> Needs<'e> {
        let params = self.model.quantities.of_params();
        let given = params.chain([&self.model.time]);
        self.reached
            .extend(given.filter_map(|var| var.as_variable()));
        let is_needed = |(region, &named): (&Region<'e>, &bool)| {
            named || region.rates.iter().any(|rate| self.entries[rate.entry])
        };
        let regions = self.model.statements.regions.iter().zip(&self.named);
        Needs {
            regions: regions.map(is_needed).collect(),
            algebraic: self.equations.is_none(),
            entries: self.entries,
            surfaces,
            reached: Some(self.reached),
        }
    }
}
