//! What an `optimize` asks of a system.
//!
//! minimize φ(x(T), T, p)   over u, T, free p and free x(0),   subject to   l <= c(t, x(t), u(t), p) <= h at instants
//!
//! An integral of the cost is a state of the system that starts at 0 and nothing reads: φ contains its value at the
//! end. What the user wrote with switches contains α here, as rates do.

use std::fmt;

use super::experiment::Tied;
use super::lower::Lowering;
use super::{Contact, State, System};
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Substitution, Var, variables_of};
use crate::model::{Domain, Quantity};
use crate::source::Span;
use crate::system::values::limits::Allowed;

pub use super::experiment::{At, Cost, Shape, Term};

/// The problem of an `optimize`, in terms of a system.
#[derive(Clone, Debug)]
pub struct Task<'e> {
    /// u.
    pub controls: Vec<Control<'e>>,
    /// What controls are within an interval.
    pub shape: Shape,
    /// Bounds of T, where it is free.
    pub horizon: Option<(f64, f64)>,
    /// Parameters that are optimized, by their place in the system.
    pub params: Vec<Free>,
    /// States with a free initial value, by their place in the system.
    pub initial: Vec<Free>,
    /// Bounds of states, by their place in the system.
    pub bounds: Vec<Free>,
    /// How many of the last states are integrals.
    pub integrals: usize,
    /// The state that is physical time, where the system is in numerical time.
    pub clock: Option<usize>,
    /// φ, at the end.
    pub cost: Cost<'e>,
    /// Constraints.
    pub rows: Vec<TaskRow<'e>>,
}

/// A scalar control.
#[derive(Clone, Debug)]
pub struct Control<'e> {
    /// Name with index: `u[2]`.
    pub name: String,
    /// Its variable.
    pub var: Expr<'e>,
    /// Where it may be.
    pub allowed: Option<Allowed>,
    /// Its default, or zero.
    pub default: f64,
    /// The declaration.
    pub span: Span,
}

impl Control<'_> {
    /// What is allowed and near to its default.
    pub fn guess(&self) -> f64 {
        let allowed = self.allowed.as_ref();
        allowed.map_or(self.default, |allowed| allowed.nearest(self.default))
    }
}

/// A quantity with bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Free {
    /// Its place.
    pub place: usize,
    /// Lower bound, or minus infinity.
    pub lower: f64,
    /// Upper bound, or infinity.
    pub upper: f64,
}

/// lower <= value <= upper at some instants.
#[derive(Clone, Debug)]
pub struct TaskRow<'e> {
    /// What it bounds, in the names of the model; none where it only states what follows from something else.
    pub name: Option<String>,
    /// In time, parameters, states, controls and α.
    pub value: Expr<'e>,
    /// A number or minus infinity.
    pub lower: f64,
    /// A number or infinity.
    pub upper: f64,
    /// When.
    pub at: At,
    /// The row.
    pub span: Span,
}

impl<'e> Task<'e> {
    /// Everything that contains variables of the system.
    pub fn exprs(&self) -> impl Iterator<Item = Expr<'e>> + '_ {
        let rows = self.rows.iter().map(|row| row.value);
        [self.cost.value].into_iter().chain(rows)
    }

    /// The same in other variables.
    pub fn map(&self, f: impl Fn(Expr<'e>) -> Expr<'e>) -> Self {
        let mut task = self.clone();
        task.cost = task.cost.map(&f);
        for row in &mut task.rows {
            row.value = f(row.value);
        }
        task
    }
}

/// The cost and the constraints, one per line.
impl fmt::Display for Task<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.write(f, true)
    }
}

impl Task<'_> {
    /// With the numbers of bounds, or only which bounds there are.
    pub(super) fn write(&self, f: &mut impl fmt::Write, with_numbers: bool) -> fmt::Result {
        let number = |value: f64, instead: &str| match with_numbers {
            true => value.to_string(),
            false => instead.to_owned(),
        };
        for control in &self.controls {
            write!(f, "control {}", control.name)?;
            match &control.allowed {
                Some(allowed) if with_numbers => writeln!(f, " in {allowed}")?,
                Some(Allowed::Between(..)) => writeln!(f, " in bounds")?,
                Some(Allowed::OneOf(_)) => writeln!(f, " in a finite set")?,
                None => writeln!(f)?,
            }
        }
        writeln!(f, "minimize {} at the end", self.cost.value)?;
        for row in &self.rows {
            let value = row.value;
            let (lower, upper) = (number(row.lower, "lower"), number(row.upper, "upper"));
            match (row.lower.is_finite(), row.upper.is_finite()) {
                _ if row.lower == row.upper => {
                    write!(f, "{value} = {}", number(row.lower, "number"))?;
                }
                (true, true) => write!(f, "{lower} <= {value} <= {upper}")?,
                (true, false) => write!(f, "{value} >= {lower}")?,
                _ => write!(f, "{value} <= {upper}")?,
            }
            writeln!(f, " at {}", row.at.as_str())?;
        }
        Ok(())
    }
}

impl<'e> System<'e> {
    /// Whether a parameter is optimized.
    pub fn is_free(&self, param: usize) -> bool {
        let mut free = self.task.iter().flat_map(|task| &task.params);
        free.any(|free| free.place == param)
    }

    /// The values of the parameters at these places.
    pub(crate) fn values_of(&self, places: &[usize]) -> Vec<f64> {
        let values = places.iter().map(|&place| self.params[place].value);
        values.collect()
    }

    /// The values of some parameters, by place.
    pub(super) fn params_as_numbers(&self, holds: impl Fn(usize) -> bool) -> Substitution<'e> {
        let params = self.params.iter().enumerate();
        let numbers = params
            .filter(|(place, _)| holds(*place))
            .map(|(_, param)| param);
        numbers
            .filter_map(|param| Some((param.var.as_variable()?, self.exprs.constant(param.value))))
            .collect()
    }
}

impl<'e> Lowering<'_, 'e> {
    /// The rates of the integrals, in α.
    pub(super) fn integrals(&mut self, diags: &mut Diagnostics) -> Vec<Expr<'e>> {
        let settings = self.settings;
        let integrals = settings.optimize.iter().flat_map(|task| &task.integrals);
        let rates = integrals.map(|integral| {
            let value = self.replace(integral.value, integral.span);
            self.check(value, integral.span, diags);
            self.switches.merged(value)
        });
        rates.collect()
    }

    /// The task in α; states and parameters have their places in the system.
    pub(super) fn task(&mut self, diags: &mut Diagnostics) -> Option<Task<'e>> {
        let asked = self.settings.optimize.as_ref()?;
        let merged = |lowering: &mut Self, e: Expr<'e>, span: Span| {
            let e = lowering.replace(e, span);
            lowering.switches.merged(e)
        };
        let cost = (asked.cost).map(|value| merged(self, value, asked.cost.span));
        let rows = asked.rows.iter().map(|row| TaskRow {
            name: Some(row.name.clone()),
            value: merged(self, row.value, row.span),
            lower: row.lower,
            upper: row.upper,
            at: row.at,
            span: row.span,
        });
        let mut rows: Vec<TaskRow<'e>> = rows.collect();
        rows.extend(self.algebraic_bounds());
        let is_number = |var: &Expr<'e>| {
            let var = var.as_variable();
            var.is_none_or(|var| !self.values.free.derives(var))
        };
        let params: Vec<Expr<'e>> = (self.model.params.iter())
            .flat_map(|param| param.vars.iter().copied().filter(is_number))
            .collect();
        let states: Vec<Expr<'e>> = self.kept_states().map(|(_, var)| var).collect();
        let (tied, starts) = self.tied(&states, diags);
        rows.extend(starts);
        let places = |freed: &[super::experiment::Freed], list: &[Expr<'e>]| -> Vec<Free> {
            let free = freed.iter().filter_map(|freed| {
                let place = list
                    .iter()
                    .position(|var| var.as_variable() == Some(freed.var))?;
                Some(Free {
                    place,
                    lower: freed.lower,
                    upper: freed.upper,
                })
            });
            free.collect()
        };
        Some(Task {
            controls: self.decided(),
            shape: asked.discretization.controls,
            horizon: asked.horizon,
            params: places(&asked.params, &params),
            initial: [places(&asked.initial, &states), tied].concat(),
            bounds: self.state_bounds(&states),
            integrals: asked.integrals.len(),
            clock: None,
            cost,
            rows,
        })
    }

    /// x(0) = x_0(p) with free p: x(0) is free, and the equation is a row at the start.
    fn tied(
        &mut self,
        states: &[Expr<'e>],
        diags: &mut Diagnostics,
    ) -> (Vec<Free>, Vec<TaskRow<'e>>) {
        let settings = self.settings;
        let tied = settings.optimize.iter().flat_map(|task| &task.tied);
        let (mut freed, mut rows) = (Vec::new(), Vec::new());
        for &Tied { var, value, span } in tied {
            let mut places = states.iter().enumerate();
            let Some((place, &x)) = places.find(|(_, x)| x.as_variable() == Some(var)) else {
                continue;
            };
            freed.push(Free {
                place,
                lower: f64::NEG_INFINITY,
                upper: f64::INFINITY,
            });
            let row = self.replace(x - value, span);
            let row = self.switches.merged(row);
            // Switches have no values at t = 0 in a program.
            let free = self.values.free.first_in(&[value]);
            if let Some(free) = free.filter(|_| !self.switches.alphas_of(row).is_empty()) {
                let name = self.model.exprs.name(var);
                let what = format!("the initial value of `{name}`, which has a switching term,");
                diags.push(self.values.depends_on_free(self.model, what, free, span));
                continue;
            }
            rows.push(TaskRow {
                name: None,
                value: row,
                lower: 0.0,
                upper: 0.0,
                at: At::Start,
                span,
            });
        }
        (freed, rows)
    }

    fn number(&self, e: Expr<'e>) -> f64 {
        let numbers = &self.values.numbers;
        e.eval(&|var| numbers.get(&var).copied().unwrap_or(f64::NAN))
    }

    fn moves(&self, e: Expr<'e>) -> bool {
        self.values.free.first_in(&[e]).is_some()
    }

    /// Where an entry of a quantity may be, without bounds that move, which are constraints.
    fn allowed(
        &self,
        quantity: &Quantity<'e>,
        entry: usize,
        moves: impl Fn(Expr<'e>) -> bool,
    ) -> Option<Allowed> {
        let allowed = Allowed::of(quantity, entry, &|e| self.number(e))?;
        let (Allowed::Between(lower, upper), Some(Domain::Box(lo, hi))) =
            (&allowed, &quantity.domain)
        else {
            return Some(allowed);
        };
        let open = |e: Expr<'e>, number: f64, open: f64| if moves(e) { open } else { number };
        let lower = open(lo.data[entry], *lower, f64::NEG_INFINITY);
        let upper = open(hi.data[entry], *upper, f64::INFINITY);
        Some(Allowed::Between(lower, upper))
    }

    /// The controls that are not given.
    pub(super) fn decided(&self) -> Vec<Control<'e>> {
        let mut controls = Vec::new();
        if self.settings.optimize.is_none() {
            return controls;
        }
        for quantity in &self.model.controls {
            for (k, &var) in quantity.vars.iter().enumerate() {
                let is_given = |var: Var| self.values.signals.get(var).is_some();
                if var.as_variable().is_none_or(is_given) || !self.needs.holds_all(var) {
                    continue;
                }
                let moves = |e: Expr<'e>| self.values.free.decided_in(&[e]).is_some();
                let allowed = self.allowed(quantity, k, moves);
                let default = quantity.value.as_ref().and_then(|value| value.data.get(k));
                let default = default.map_or(0.0, |&e| self.number(e));
                controls.push(Control {
                    name: quantity.shape.entry_name(&quantity.name, k),
                    var,
                    default: if default.is_finite() { default } else { 0.0 },
                    allowed,
                    span: quantity.span,
                });
            }
        }
        controls
    }

    fn state_bounds(&self, states: &[Expr<'e>]) -> Vec<Free> {
        let entries = self.model.states.iter().flat_map(|state| {
            let entries = state.vars.iter().enumerate();
            entries.map(move |(k, &var)| (state, k, var))
        });
        let bounds = entries.filter_map(|(state, k, var)| {
            let place = states.iter().position(|known| *known == var)?;
            match self.allowed(state, k, |e| self.moves(e))? {
                Allowed::Between(lower, upper) => Some(Free {
                    place,
                    lower,
                    upper,
                }),
                Allowed::OneOf(_) => None,
            }
        });
        bounds.collect()
    }

    /// 0 <= e <= 1 and 0 <= μ of contacts, where free parameters are in them.
    pub(super) fn coefficient_rows(&self, contacts: &[Contact<'e>]) -> Vec<TaskRow<'e>> {
        let free = &self.values.free;
        let is_free = |var: &Var| free.vars.contains_key(var) && !free.inputs.contains(var);
        let is_param = |var: &Var| self.switches.params.numbers.contains_key(var);
        let coefficients = contacts.iter().flat_map(|contact| {
            let friction = contact.friction.as_ref();
            let friction = friction.map(|friction| (friction.coefficient, f64::INFINITY));
            let both = [(contact.restitution.coefficient, 1.0)]
                .into_iter()
                .chain(friction);
            both.map(|(value, upper)| (value, upper, contact.span))
        });
        let rows = coefficients.filter_map(|(value, upper, span)| {
            let vars = variables_of(&[value]);
            vars.iter().any(is_free).then(|| TaskRow {
                name: None,
                value,
                lower: 0.0,
                upper,
                at: match vars.iter().all(is_param) {
                    true => At::Start,
                    false => At::Nodes,
                },
                span,
            })
        });
        rows.collect()
    }

    /// Bounds of algebraic states, which hold at the ends of elements.
    fn algebraic_bounds(&mut self) -> Vec<TaskRow<'e>> {
        let mut rows = Vec::new();
        for z in &self.model.algebraics {
            for (k, &var) in z.vars.iter().enumerate() {
                if let Some(Allowed::Between(lower, upper)) = self.allowed(z, k, |e| self.moves(e))
                    && (lower.is_finite() || upper.is_finite())
                {
                    let value = self.replace(var, z.span);
                    rows.push(TaskRow {
                        name: Some(z.shape.entry_name(&z.name, k)),
                        value: self.switches.merged(value),
                        lower,
                        upper,
                        at: At::Elements,
                        span: z.span,
                    });
                }
            }
        }
        rows
    }

    /// The states that stand for integrals.
    pub(super) fn integral_states(&self, rates: &[Expr<'e>]) -> Vec<State<'e>> {
        let integrals = self
            .settings
            .optimize
            .iter()
            .flat_map(|task| &task.integrals);
        let states = integrals.zip(rates).map(|(integral, &rate)| State {
            name: integral.var.to_string(),
            var: integral.var,
            initial: 0.0,
            rate,
            span: integral.span,
        });
        states.collect()
    }
}
