//! Numbers of one experiment: parameters, initial values, controls and inputs.

pub(crate) mod limits;
pub(crate) mod rounding;
pub(crate) mod valuation;
use rustc_hash::{FxHashMap, FxHashSet};

use super::ExperimentError;
use super::experiment::with::Given;
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Interval, Substitution, Var, variables_of};
use crate::model::{Domain, Model, Quantity};
use crate::source::Span;
use crate::system::switches::terms::value_on_sides;
use crate::system::values::limits::Allowed;

/// What an experiment fixes.
#[derive(Clone, Debug)]
pub(crate) struct Values<'e> {
    /// Parameters and initial states, by variable: of free parameters, and of what is computed from them, guesses.
    pub numbers: FxHashMap<Var, f64>,
    /// Controls and inputs as functions of time, states and parameters, without controls that are decided; and
    /// parameters that are computed from free ones, as functions of these.
    pub signals: Substitution<'e>,
    /// What is computed from free parameters.
    pub free: FreeParams<'e>,
}

/// Free parameters, and what is computed from them.
#[derive(Clone, Debug, Default)]
pub(crate) struct FreeParams<'e> {
    /// p, with where each is freed.
    pub vars: FxHashMap<Var, Span>,
    /// Those of p that no experiment decides: they are inputs of runs.
    pub inputs: FxHashSet<Var>,
    /// Parameters q(p), as functions of p and of parameters that are numbers.
    derived: Substitution<'e>,
    /// Free parameters whose own definitions, which do not count then, hold others that are free, the first of these.
    following: FxHashMap<Var, Var>,
    /// Initial values x(0) = x_0(p), with where they are given.
    pub initial: Vec<(Var, Expr<'e>, Span)>,
}

impl<'e> FreeParams<'e> {
    /// Keeps a definition if it holds what is free: that of a parameter, or of an initial value.
    fn define(&mut self, var: Var, value: Expr<'e>, is_param: bool, span: Span) {
        let Some(first) = self.first_in(&[value]) else {
            return;
        };
        let value = value.substitute(&self.derived);
        match is_param {
            true if !self.vars.contains_key(&var) => self.derived.insert(var, value),
            true => _ = self.following.insert(var, first),
            false => self.initial.push((var, value, span)),
        }
    }

    /// The first free parameter that expressions depend on.
    pub fn first_in(&self, exprs: &[Expr<'e>]) -> Option<Var> {
        self.find_in(exprs, |_| true)
    }

    /// The first of those that are optimized.
    pub fn decided_in(&self, exprs: &[Expr<'e>]) -> Option<Var> {
        self.find_in(exprs, |var| !self.inputs.contains(var))
    }

    /// The first of those that are inputs of runs.
    pub fn input_in(&self, exprs: &[Expr<'e>]) -> Option<Var> {
        self.find_in(exprs, |var| self.inputs.contains(var))
    }

    fn find_in(&self, exprs: &[Expr<'e>], is_meant: impl Fn(&Var) -> bool) -> Option<Var> {
        if self.vars.is_empty() {
            return None;
        }
        let vars = variables_of(&self.derived.apply(exprs)).into_iter();
        let mut free = vars.filter(|var| self.vars.contains_key(var));
        free.find(is_meant)
    }

    /// What the definition of a free parameter holds that is free, too.
    pub fn follows(&self, param: Expr<'e>) -> Option<Var> {
        self.following.get(&param.as_variable()?).copied()
    }

    /// Whether a parameter is computed from free ones.
    pub fn derives(&self, var: Var) -> bool {
        self.derived.contains(&var)
    }
}

/// What bounds an entry of a quantity, or what its values are.
pub(crate) fn bounds<'e>(domain: &Domain<'e>, entry: usize) -> Vec<Expr<'e>> {
    match domain {
        Domain::Box(low, high) => vec![low.data[entry], high.data[entry]],
        Domain::Set(values) => values.clone(),
    }
}

impl<'e> Values<'e> {
    /// The number of a parameter, unless it is free or computed from what is.
    pub fn fixed(&self, var: Var) -> Option<f64> {
        let is_free = self.free.vars.contains_key(&var) || self.free.derives(var);
        self.numbers.get(&var).copied().filter(|_| !is_free)
    }

    /// Where parameters that stay open may be: where they were declared to be, and on their side of zero.
    pub fn open_ranges(&self, model: &Model<'e>) -> FxHashMap<Var, Interval> {
        let number = |e: Expr<'e>| {
            value_on_sides(e, &|var| {
                self.numbers.get(&var).copied().unwrap_or(f64::NAN)
            })
        };
        let entries = (model.quantities.params.iter())
            .flat_map(|param| (0..param.vars.len()).map(move |k| (param, k)));
        let open = entries.filter_map(|(param, k)| {
            let var = param.vars[k].as_variable()?;
            let value = self
                .numbers
                .get(&var)
                .filter(|_| self.free.inputs.contains(&var))?;
            let side = match *value >= 0.0 {
                true => [0.0, f64::INFINITY],
                false => [f64::NEG_INFINITY, 0.0],
            };
            let [low, high] = match Allowed::of(param, k, &number) {
                Some(Allowed::Between(low, high)) => [low.max(side[0]), high.min(side[1])],
                _ => side,
            };
            Some((var, Interval::new(low, high)))
        });
        open.collect()
    }

    /// Whether a parameter stays open.
    pub fn is_open(&self, param: Expr<'e>) -> bool {
        let var = param.as_variable();
        var.is_some_and(|var| self.free.inputs.contains(&var))
    }

    /// The first parameter whose values are bounded by what open parameters move, or that is open and in a finite set.
    pub fn moving_range(&self, model: &Model<'e>) -> Option<String> {
        let moves = |var: Expr<'e>, bounds: &[Expr<'e>], is_set: bool| {
            let follows = !self.is_open(var) && self.free.input_in(&[var]).is_some();
            follows || is_set && self.is_open(var) || self.free.input_in(bounds).is_some()
        };
        let entries =
            (model.quantities.params.iter()).flat_map(|p| (0..p.vars.len()).map(move |k| (p, k)));
        let mut found = entries.filter_map(|(param, k)| {
            let bounds = bounds(param.domain.as_ref()?, k);
            let is_set = matches!(param.domain, Some(Domain::Set(_)));
            let name = || param.shape.entry_name(&param.name, k);
            moves(param.vars[k], &bounds, is_set).then(name)
        });
        found.next()
    }

    /// x(0), of a state that is given as a function of free parameters.
    pub fn initial(&self, state: Expr<'e>) -> Option<Expr<'e>> {
        let var = state.as_variable()?;
        let mut given = self.free.initial.iter();
        given
            .find(|(known, ..)| *known == var)
            .map(|&(_, value, _)| value)
    }

    /// That something which must be known before the run depends on a free parameter.
    pub fn depends_on_free(
        &self,
        model: &Model<'e>,
        what: String,
        free: Var,
        span: Span,
    ) -> ExperimentError {
        ExperimentError::DependsOnFree {
            what,
            name: model.exprs.name(free),
            span,
            free: self.free.vars[&free],
        }
    }

    /// Expressions in parameters as numbers, free parameters at their guesses; else the name of what is no parameter.
    pub fn numbers_of(&self, model: &Model<'_>, exprs: &[Expr<'_>]) -> Result<Vec<f64>, String> {
        let params: FxHashSet<Var> = model
            .quantities
            .params
            .iter()
            .flat_map(|p| &p.vars)
            .filter_map(|var| var.as_variable())
            .collect();
        match variables_of(exprs)
            .into_iter()
            .find(|var| !params.contains(var))
        {
            Some(other) => Err(model.exprs.name(other)),
            None => Ok(exprs
                .iter()
                .map(|&e| value_on_sides(e, &|var| self.numbers[&var]))
                .collect()),
        }
    }
}

/// Evaluates the values of the model with those the experiment gives; `None` after an error.
pub(crate) fn evaluate<'e>(
    model: &Model<'e>,
    given: &Given<'e>,
    diags: &mut Diagnostics,
) -> Option<Values<'e>> {
    let mut free = FreeParams {
        vars: given.free.clone(),
        inputs: given.open.clone(),
        ..FreeParams::default()
    };
    let numbers = numbers(model, given, &mut free, diags);
    let signals = signals(model, given, diags);
    let (numbers, mut signals) = (numbers?, signals?);
    signals.then(&free.derived);
    signals.extend(free.derived.pairs());
    let values = Values {
        numbers,
        signals,
        free,
    };
    in_sets(model, given, &values, diags).then_some(values)
}

/// Every parameter and initial value, each once the parameters it depends on are known.
fn numbers<'e>(
    model: &Model<'e>,
    given: &Given<'e>,
    free: &mut FreeParams<'e>,
    diags: &mut Diagnostics,
) -> Option<FxHashMap<Var, f64>> {
    let quantities = (model.quantities.params.iter().map(|p| ("param", p)))
        .chain(model.quantities.states.iter().map(|s| ("state", s)))
        .chain(
            model
                .quantities
                .algebraics
                .iter()
                .map(|z| ("algebraic state", z)),
        );
    let (mut open, mut complete) = definitions(quantities, given, diags);
    let params: FxHashSet<Var> = (model.quantities.of_params())
        .filter_map(|var| var.as_variable())
        .collect();
    let mut numbers: FxHashMap<Var, f64> = FxHashMap::default();
    loop {
        let before = open.len();
        open.retain(|&(var, value, _, span)| {
            let ready = variables_of(&[value])
                .iter()
                .all(|var| params.contains(var) && numbers.contains_key(var));
            if ready {
                numbers.insert(var, value_on_sides(value, &|var| numbers[&var]));
                free.define(var, value, params.contains(&var), span);
            }
            !ready
        });
        if open.is_empty() || open.len() == before {
            break;
        }
    }
    for (_, value, name, span) in open {
        // What waits for a missing value is no mistake of its own.
        if complete {
            let below = variables_of(&[value]);
            let other = below.into_iter().find(|var| !params.contains(var));
            diags.push(match other {
                Some(other) => {
                    let (what, cause) = (format!("the value of `{name}`"), model.exprs.name(other));
                    ExperimentError::NotANumber { what, cause, span }
                }
                None => ExperimentError::SignalCycle { name, span },
            });
        }
        complete = false;
    }
    let multipliers = model.statements.multipliers.iter();
    numbers.extend(multipliers.filter_map(|m| Some((m.var.as_variable()?, m.guess))));
    complete &= is_finite(model, given, &numbers, diags);
    complete &= in_range(model, given, &numbers, diags);
    complete.then_some(numbers)
}

/// Whether every initial value is finite, and every parameter a number, be it infinite.
fn is_finite(
    model: &Model<'_>,
    given: &Given<'_>,
    numbers: &FxHashMap<Var, f64>,
    diags: &mut Diagnostics,
) -> bool {
    let mut fine = true;
    let states = model
        .quantities
        .states
        .iter()
        .chain(&model.quantities.algebraics);
    let states = states.map(|state| (state, true));
    let params = model.quantities.params.iter().map(|param| (param, false));
    for (quantity, is_state) in states.chain(params) {
        for (k, var) in quantity.vars.iter().enumerate() {
            let Some(var) = var.as_variable() else {
                continue;
            };
            let fits = |value: f64| value.is_finite() || !(is_state || value.is_nan());
            if let Some(value) = numbers.get(&var).filter(|&&value| !fits(value)) {
                let (kind, expected) = match is_state {
                    true => ("state", "finite"),
                    false => ("parameter", "a number"),
                };
                diags.push(ExperimentError::OutOfRange {
                    what: format!("{kind} `{}`", quantity.shape.entry_name(&quantity.name, k)),
                    expected: expected.to_owned(),
                    found: value.to_string(),
                    span: (given.values.get(&var)).map_or(quantity.span, |&(_, span)| span),
                });
                fine = false;
            }
        }
    }
    fine
}

/// Whether every parameter is where it was declared to be.
fn in_range<'e>(
    model: &Model<'e>,
    given: &Given<'e>,
    numbers: &FxHashMap<Var, f64>,
    diags: &mut Diagnostics,
) -> bool {
    let number =
        |e: Expr<'e>| value_on_sides(e, &|var| numbers.get(&var).copied().unwrap_or(f64::NAN));
    let mut fine = true;
    for param in &model.quantities.params {
        for (k, &var) in param.vars.iter().enumerate() {
            let Some(allowed) = Allowed::of(param, k, &number) else {
                continue;
            };
            let value = number(var);
            // What could not be computed is reported elsewhere.
            if value.is_finite() && !allowed.holds(value, 0.0) {
                diags.push(out_of_range("param", param, k, value, &allowed, given));
                fine = false;
            }
        }
    }
    fine
}

/// Whether controls and inputs that do not change are in the finite sets they were declared with.
fn in_sets<'e>(
    model: &Model<'e>,
    given: &Given<'e>,
    values: &Values<'e>,
    diags: &mut Diagnostics,
) -> bool {
    let numbers = &values.numbers;
    let number =
        |e: Expr<'e>| value_on_sides(e, &|var| numbers.get(&var).copied().unwrap_or(f64::NAN));
    let params: FxHashSet<Var> = (model.quantities.of_params())
        .filter_map(|var| var.as_variable())
        .collect();
    let mut fine = true;
    let quantities = (model.quantities.controls.iter().map(|c| ("control", c)))
        .chain(model.quantities.inputs.iter().map(|i| ("input", i)))
        .chain(model.quantities.connected.iter().map(|c| ("input", c)));
    for (kind, quantity) in quantities {
        for (k, var) in quantity.vars.iter().enumerate() {
            let Some(allowed @ Allowed::OneOf(_)) = Allowed::of(quantity, k, &number) else {
                continue;
            };
            let value = var.substitute(&values.signals);
            if let Some(free) = values.free.first_in(&[value]) {
                let what = format!(
                    "{kind} `{}`, which is in a finite set,",
                    quantity.shape.entry_name(&quantity.name, k)
                );
                diags.push(values.depends_on_free(model, what, free, quantity.span));
                fine = false;
                continue;
            }
            let changes = variables_of(&[value])
                .iter()
                .any(|var| !params.contains(var));
            let value = number(value);
            if !changes && !allowed.holds(value, 0.0) {
                diags.push(out_of_range(kind, quantity, k, value, &allowed, given));
                fine = false;
            }
        }
    }
    fine
}

fn out_of_range(
    kind: &str,
    quantity: &Quantity<'_>,
    entry: usize,
    value: f64,
    allowed: &Allowed,
    given: &Given<'_>,
) -> ExperimentError {
    let var = quantity.vars[entry].as_variable();
    let given_at = var.and_then(|var| given.values.get(&var));
    ExperimentError::OutOfRange {
        what: format!(
            "{kind} `{}`",
            quantity.shape.entry_name(&quantity.name, entry)
        ),
        expected: format!("in {allowed}"),
        found: value.to_string(),
        span: given_at.map_or(quantity.span, |&(_, span)| span),
    }
}

/// Controls and inputs, each expressed without the others.
fn signals<'e>(
    model: &Model<'e>,
    given: &Given<'e>,
    diags: &mut Diagnostics,
) -> Option<Substitution<'e>> {
    let controls = model.quantities.controls.iter().map(|c| ("control", c));
    let inputs = model.quantities.inputs.iter().map(|i| ("input", i));
    let (mut open, complete) = match given.decides {
        false => definitions(controls.chain(inputs), given, diags),
        true => {
            let (mut open, complete) = definitions(inputs, given, diags);
            open.extend(
                model
                    .quantities
                    .controls
                    .iter()
                    .flat_map(|control| given_entries(control, given)),
            );
            (open, complete)
        }
    };
    // A chain of n definitions is resolved after n rounds; what is left then is a cycle.
    for _ in 0..=open.len() {
        let all: Substitution<'e> = open.iter().map(|&(var, value, ..)| (var, value)).collect();
        let mut changed = false;
        for (_, value, ..) in &mut open {
            let resolved = value.substitute(&all);
            changed |= resolved != *value;
            *value = resolved;
        }
        if !changed
            && open
                .iter()
                .all(|&(_, value, ..)| open.iter().all(|&(var, ..)| !value.depends_on(var)))
        {
            return complete.then(|| open.iter().map(|&(var, value, ..)| (var, value)).collect());
        }
    }
    if let Some((.., name, span)) = open
        .into_iter()
        .find(|(var, value, ..)| value.depends_on(*var))
    {
        diags.push(ExperimentError::SignalCycle { name, span });
    }
    None
}

/// An entry of a quantity with what it is defined as, its name, and where that is said.
type Definition<'e> = (Var, Expr<'e>, String, Span);

/// The entries of all quantities that have values, and whether all have.
fn definitions<'m, 'e: 'm>(
    quantities: impl Iterator<Item = (&'static str, &'m Quantity<'e>)>,
    given: &Given<'e>,
    diags: &mut Diagnostics,
) -> (Vec<Definition<'e>>, bool) {
    let mut found = Vec::new();
    let mut complete = true;
    for (kind, quantity) in quantities {
        match entries(quantity, given) {
            Some(entries) => found.extend(entries),
            None => {
                complete = false;
                diags.push(ExperimentError::NoValue {
                    kind,
                    name: quantity.name.clone(),
                    span: quantity.span,
                    experiment: given.span,
                });
            }
        }
    }
    (found, complete)
}

/// The entries of a control that are given, and thus not decided.
fn given_entries<'e>(quantity: &Quantity<'e>, given: &Given<'e>) -> Vec<Definition<'e>> {
    let entries = quantity.vars.iter().enumerate().filter_map(|(k, var)| {
        let var = var.as_variable()?;
        let (value, span) = given.values.get(&var).copied()?;
        Some((
            var,
            value,
            quantity.shape.entry_name(&quantity.name, k),
            span,
        ))
    });
    entries.collect()
}

/// The entries of a quantity with their values; `None` when some entry has none.
fn entries<'e>(quantity: &Quantity<'e>, given: &Given<'e>) -> Option<Vec<Definition<'e>>> {
    let entries = quantity.vars.iter().enumerate().map(|(k, var)| {
        let var = var.as_variable()?;
        let name = quantity.shape.entry_name(&quantity.name, k);
        let default = || Some((*quantity.value.as_ref()?.data.get(k)?, quantity.span));
        let (value, span) = given.values.get(&var).copied().or_else(default)?;
        Some((var, value, name, span))
    });
    entries.collect()
}
