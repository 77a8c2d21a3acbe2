//! Laws by which states jump, and the contacts that some of them are.
//!
//! A law x⁺ = x + Δ(x) whose guard is c < 0, or c < 0 and ċ < 0, is a *contact* where it changes nothing that c
//! depends on and Δ = -ċ d: it bounces off the surface c = 0 with ċ⁺ = -e ċ, e = ∇ċ·d - 1 ≥ 0. Where its jumps
//! accumulate, c = ċ = 0, and the limit of small bounces is a force in the direction of d that keeps it there,
//!
//! x' = f(x) + d (1 - α),   α ≤ 1,   c ≥ 0,   α < 1 ⇒ c = 0,
//!
//! for a jump by Δ takes the place of the time -Δ/(d c̈). Any other law is a guard and a reset, no more.

use rustc_hash::FxHashMap;

use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Substitution, Var, variables_of};
use crate::model::Jump;
use crate::system::lower::Lowering;
use crate::system::regions::conjunction;
use crate::system::regions::partitions::Regions;
use crate::system::values::limits::Limit;
use crate::system::{Law, Output, SystemError};

/// A law in α of the switches that have been collected.
pub(crate) struct Lowered<'e> {
    /// Index into the jumps of the model.
    pub jump: usize,
    pub guard: Expr<'e>,
    /// The switch of c, where the law is a contact.
    pub strikes: Option<usize>,
    /// New values by state entry.
    pub resets: Vec<(usize, Expr<'e>)>,
}

impl<'e> Lowered<'e> {
    /// What it depends on; a contact looks at the surface that it strikes and at nothing else.
    pub fn reads(&self) -> impl Iterator<Item = Expr<'e>> + '_ {
        let guard = self.strikes.is_none().then_some(self.guard);
        let resets = self.resets.iter().map(|reset| reset.1);
        resets.chain(guard)
    }
}

/// c and d of a law that is a contact.
struct Contact<'e> {
    switch: usize,
    gap: Expr<'e>,
    direction: Vec<(usize, Expr<'e>)>,
}

impl<'e> Lowering<'_, 'e> {
    /// All laws that set a state that is kept.
    pub(crate) fn laws(&mut self) -> Vec<Lowered<'e>> {
        let model = self.model;
        let mut laws = Vec::new();
        for (j, jump) in model.statements.jumps.iter().enumerate() {
            let kept = |entry: usize| self.needs.entries[entry];
            if !jump.resets.iter().any(|reset| kept(reset.entry)) && !jump.resets.is_empty() {
                continue;
            }
            let resets: Vec<_> = jump.resets.iter().filter(|r| kept(r.entry)).collect();
            let resets = resets.into_iter().map(|reset| {
                let value = self.replace(reset.value, reset.span);
                (reset.entry, self.switches.merged(value))
            });
            let resets = resets.collect();
            laws.push(Lowered {
                jump: j,
                guard: self.weight(jump.guard, jump.guard_span),
                strikes: None,
                resets,
            });
        }
        laws
    }

    /// Finds the laws that are contacts, and lets these push.
    pub(crate) fn find_contacts(
        &mut self,
        laws: &mut [Lowered<'e>],
        rates: &mut [Expr<'e>],
        regions: &Regions<'e>,
        (outputs, limits): (&[Output<'e>], &[Limit<'e>]),
        diags: &mut Diagnostics,
    ) {
        let places: FxHashMap<usize, usize> = (self.kept_states().enumerate())
            .map(|(place, (entry, _))| (entry, place))
            .collect();
        let recorded = outputs
            .iter()
            .flat_map(|output| output.exprs.iter().copied());
        let used: Vec<Expr<'e>> = (regions.weights.iter().chain(&regions.guards).copied())
            .chain(recorded)
            .chain(limits.iter().map(|limit| limit.value))
            .collect();
        for at in 0..laws.len() {
            let jump = &self.model.statements.jumps[laws[at].jump];
            let guards = laws.iter().enumerate().filter(|(other, _)| *other != at);
            let elsewhere: Vec<Expr<'e>> = (used.iter().copied().chain(rates.iter().copied()))
                .chain(guards.map(|(_, law)| law.guard))
                .chain(
                    laws.iter()
                        .flat_map(|law| law.resets.iter().map(|reset| reset.1)),
                )
                .collect();
            if self.stays(&laws[at], rates) {
                diags.push(stays_in_guard(jump));
                continue;
            }
            let Some(contact) = self.contact(&laws[at], rates, &places, &elsewhere) else {
                continue;
            };
            let collected = &mut self.switches.list[contact.switch];
            collected.unilateral = true;
            collected.name = Some(jump.name.clone());
            let open = self.model.exprs.expr(collected.alpha);
            self.switches.orient(contact.switch, contact.gap);
            for (entry, d) in contact.direction {
                let rate = &mut rates[places[&entry]];
                *rate = *rate + d * (1.0 - open);
            }
            laws[at].strikes = Some(contact.switch);
        }
    }

    /// The contact that a law is.
    fn contact(
        &self,
        law: &Lowered<'e>,
        rates: &[Expr<'e>],
        places: &FxHashMap<usize, usize>,
        elsewhere: &[Expr<'e>],
    ) -> Option<Contact<'e>> {
        let (switch, gap) = self.struck(law.guard, rates)?;
        let alpha = self.switches.list[switch].alpha;
        let shared = |e: &Expr<'e>| variables_of(&[*e]).contains(&alpha);
        let relay = self.switches.list[switch].relay.is_some();
        if relay || elsewhere.iter().any(shared) {
            return None;
        }
        let speed = self.rate_of(gap, rates);
        if !self.switches.alphas_of(speed).is_empty() || !self.switches.alphas_of(gap).is_empty() {
            return None;
        }
        let direction = self.direction(law, (gap, speed), places)?;
        // 1 + e
        let gain = direction
            .iter()
            .map(|&(entry, d)| self.slope(speed, entry) * d);
        let gain = self.model.exprs.sum(gain);
        if !self.at_samples(gain, |gain| gain >= 1.0 - 1e-9) {
            return None;
        }
        Some(Contact {
            switch,
            gap,
            direction,
        })
    }

    /// The comparisons of a guard that is a conjunction, as switches with their sides.
    pub(crate) fn literals(&self, guard: Expr<'e>) -> Option<Vec<(usize, bool)>> {
        let alphas = self.switches.list.iter().map(|switch| switch.alpha);
        conjunction(guard, &alphas.collect::<Vec<Var>>())
    }

    /// c with its switch, where a guard is c < 0, or c < 0 and ċ < 0.
    fn struck(&self, guard: Expr<'e>, rates: &[Expr<'e>]) -> Option<(usize, Expr<'e>)> {
        let literals = self.literals(guard)?;
        // The guard says that these are negative.
        let negative: Vec<(usize, Expr<'e>)> = (literals.iter())
            .map(|&(k, on)| {
                let psi = self.switches.list[k].psi;
                (k, if on { -1.0 * psi } else { psi })
            })
            .collect();
        let is_multiple = |e: Expr<'e>, of: Expr<'e>| {
            let (e, of) = (self.in_numbers(e), self.in_numbers(of));
            let ((a, e), (b, of)) = (e.split_scale(), of.split_scale());
            e == of && a * b > 0.0
        };
        match negative[..] {
            [only] => Some(only),
            [a, b] if is_multiple(b.1, self.rate_of(a.1, rates)) => Some(a),
            [a, b] if is_multiple(a.1, self.rate_of(b.1, rates)) => Some(b),
            _ => None,
        }
    }

    /// d = -∂Δ/∂ċ, along the gradient of ċ by what the law sets.
    fn direction(
        &self,
        law: &Lowered<'e>,
        (gap, speed): (Expr<'e>, Expr<'e>),
        places: &FxHashMap<usize, usize>,
    ) -> Option<Vec<(usize, Expr<'e>)>> {
        let vars: Vec<Expr<'e>> = self.model.state_vars().collect();
        let slopes: Vec<Expr<'e>> = law
            .resets
            .iter()
            .map(|&(entry, _)| self.slope(speed, entry))
            .collect();
        let square = self.model.exprs.sum(slopes.iter().map(|&s| s * s));
        if square.is_zero() {
            return None;
        }
        let mut direction = Vec::new();
        for &(entry, value) in &law.resets {
            if !self.slope(gap, entry).is_zero() || !places.contains_key(&entry) {
                return None;
            }
            if !self.switches.alphas_of(value).is_empty() {
                return None;
            }
            let change = value - vars[entry];
            let along = law.resets.iter().zip(&slopes);
            let along = along.map(|(&(other, _), &slope)| self.slope(change, other) * slope);
            let d = -1.0 * self.model.exprs.sum(along) / square;
            if !self.vanishes(change + speed * d) {
                return None;
            }
            direction.push((entry, d));
        }
        Some(direction)
    }

    /// Whether every comparison of a guard and its rate are the same after the jump, up to positive factors.
    fn stays(&self, law: &Lowered<'e>, rates: &[Expr<'e>]) -> bool {
        let Some(literals) = self.literals(law.guard) else {
            return false;
        };
        let vars: Vec<Expr<'e>> = self.model.state_vars().collect();
        let after = law
            .resets
            .iter()
            .filter_map(|&(entry, value)| Some((vars[entry].as_variable()?, value)));
        let after: Substitution<'e> = after.collect();
        let is_kept = |e: Expr<'e>| {
            let (a, before) = self.in_numbers(e).split_scale();
            let (b, after) = self.in_numbers(e.substitute(&after)).split_scale();
            self.switches.alphas_of(e).is_empty() && before == after && a * b > 0.0
        };
        literals.iter().all(|&(k, _)| {
            let switch = &self.switches.list[k];
            let rate = self.rate_of(switch.psi, rates);
            switch.relay.is_none() && is_kept(switch.psi) && (rate.is_zero() || is_kept(rate))
        })
    }

    /// dc/dt = ∇c·f + ∂c/∂t
    fn rate_of(&self, c: Expr<'e>, rates: &[Expr<'e>]) -> Expr<'e> {
        let along = self
            .kept_states()
            .zip(rates)
            .filter_map(|((_, var), &rate)| {
                let slope = c.diff(var.as_variable()?);
                (!slope.is_zero()).then(|| slope * rate)
            });
        let by_time = self.model.time.as_variable().map(|time| c.diff(time));
        self.model.exprs.sum(along.chain(by_time))
    }

    pub(crate) fn slope(&self, e: Expr<'e>, entry: usize) -> Expr<'e> {
        let var = self
            .model
            .state_vars()
            .nth(entry)
            .and_then(Expr::as_variable);
        var.map_or(self.model.exprs.constant(0.0), |var| e.diff(var))
    }

    /// With the numbers of parameters that are not free; only of those that occur, as there may be many of both.
    pub(crate) fn in_numbers(&self, e: Expr<'e>) -> Expr<'e> {
        if e.as_constant().is_some() {
            return e;
        }
        let numbers = variables_of(&[e]).into_iter().filter_map(|var| {
            let value = self.switches.params.fixed(var)?;
            Some((var, self.model.exprs.constant(value)))
        });
        e.substitute(&numbers.collect())
    }

    /// Whether an expression is zero wherever its variables are: by its form, or else at points without special
    /// relations.
    pub(crate) fn vanishes(&self, e: Expr<'e>) -> bool {
        e.is_zero() || self.at_samples(e, |value| value.abs() < 1e-9)
    }

    /// Whether values at points without special relations have a property.
    pub(crate) fn at_samples(&self, e: Expr<'e>, holds: impl Fn(f64) -> bool) -> bool {
        let e = self.in_numbers(e);
        (1..=5).all(|point| {
            let point = f64::from(point);
            let at =
                |var: Var| 0.3 + 0.618 * point + 0.7 * (point * 1.7 * var.index() as f64).sin();
            holds(e.eval(&at))
        })
    }
}

fn stays_in_guard(jump: &Jump) -> SystemError {
    SystemError::StaysInGuard {
        name: jump.name.clone(),
        guard: jump.guard_span,
        span: jump.resets.first().map_or(jump.span, |reset| reset.span),
    }
}

impl<'e> Lowering<'_, 'e> {
    /// The laws, once only the switches `kept` are left.
    pub(crate) fn finished_laws(&self, laws: Vec<Lowered<'e>>, kept: &[usize]) -> Vec<Law<'e>> {
        let places: FxHashMap<usize, usize> = (self.kept_states().enumerate())
            .map(|(place, (entry, _))| (entry, place))
            .collect();
        let finish = |law: Lowered<'e>| {
            let jump = &self.model.statements.jumps[law.jump];
            let strikes = law
                .strikes
                .and_then(|k| kept.iter().position(|&other| other == k));
            let resets = law.resets.into_iter();
            let closed = |k: usize| 1.0 - self.model.exprs.expr(self.switches.list[k].alpha);
            Law {
                name: jump.name.clone(),
                guard: law.strikes.map_or(law.guard, closed),
                strikes,
                resets: resets
                    .map(|(entry, value)| (places[&entry], value))
                    .collect(),
                span: jump.span,
            }
        };
        laws.into_iter().map(finish).collect()
    }
}
