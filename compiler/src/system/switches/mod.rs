//! Nonsmooth terms become switch variables, bottom-up.
//!
//! Switching functions that are multiples of each other share one switch; α becomes 1 - α where
//! the multiple is negative. ψ of an outer term holds α of inner ones, as in `max(abs(x), y)`.
//!
//! How a switch enters decides how powers of it are read (see [`Entry`]), so until that is settled
//! each kind of entry has a variable of its own, merged into α afterwards.

pub(crate) mod affine;
pub(crate) mod continuity;
pub(crate) mod interaction;
pub(crate) mod known;
pub(crate) mod nonlinear;
pub(crate) mod reading;
pub(crate) mod relay;
pub mod roots;
pub mod smoothing;
#[cfg(test)]
mod smoothing_tests;
pub(crate) mod surface;
pub(crate) mod switched;
#[cfg(test)]
mod switches_tests;
pub(crate) mod terms;
pub(crate) mod words;
use std::cell::Cell;

use rustc_hash::{FxHashMap, FxHashSet};

use super::read::Readings;
use super::{NamedReading, Relay, Role};
use crate::expr::{Expr, Exprs, Substitution, Var, transform, variables_of};
use crate::source::Span;
use crate::system::switches::affine::{at, bent, multi_affine};
use crate::system::switches::known::Known;
use crate::system::switches::surface::Form;
use crate::system::switches::terms::{at_alpha, compared};

/// Switches that one expression may be nonlinear in: the interpolant between their corners doubles with each.
const MOST_BENT: usize = 8;

/// How a switching term stands in an expression.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Entry {
    /// A comparison or `step`: it chooses between values, so powers of it mean nothing.
    Condition,
    /// `sign`, or a named switch without a reading.
    Term,
    /// A named switch that is read linearly.
    Linear,
    /// A named switch that is read as it is written, for all values between its two.
    Nonlinear,
    /// `abs`, `min` or `max`.
    Kink,
}

/// A switch while it is collected.
pub(crate) struct Collected<'e> {
    /// The user's text of ψ or the name of the switch statement.
    pub name: Option<String>,
    pub alpha: Var,
    pub psi: Expr<'e>,
    /// ψ with the nonsmooth terms that became α.
    pub written: Expr<'e>,
    pub spans: Vec<Span>,
    /// The expression in which it was found.
    pub origin: Span,
    pub named: Vec<NamedReading>,
    /// What a relay remembers; none for the others.
    pub relay: Option<Relay>,
    /// Its α is a force that keeps ψ from being negative.
    pub unilateral: bool,
    /// What its α is; members of pairs name each other by number in this list.
    pub role: Role,
    /// ψ depends on time only.
    pub is_timed: bool,
    /// Some statement reads it nonlinearly: powers of its α are what they are.
    pub is_nonlinear: bool,
    /// Scale of ψ over its canonical form.
    scale: f64,
    /// Variables of its entries.
    entries: Vec<(Entry, Var)>,
}

impl<'e> Collected<'e> {
    /// A switch without a name.
    pub fn new(alpha: Var, psi: Expr<'e>, origin: Span) -> Self {
        Collected {
            name: None,
            alpha,
            psi,
            written: psi,
            spans: Vec::new(),
            origin,
            named: Vec::new(),
            relay: None,
            unilateral: false,
            role: Role::Step,
            is_timed: false,
            is_nonlinear: false,
            scale: 1.0,
            entries: Vec::new(),
        }
    }
}

/// A ψ that cannot be a switching function.
pub(crate) struct Refused<'e> {
    pub psi: Expr<'e>,
    pub form: Form<'e>,
    /// The term around it.
    pub span: Span,
}

/// All switches of a model.
pub(crate) struct Switches<'e> {
    pub list: Vec<Collected<'e>>,
    /// What was refused, each ψ once.
    pub refused: Vec<Refused<'e>>,
    exprs: &'e Exprs,
    /// Time, and data.
    given: Vec<Var>,
    /// What is known of parameters.
    pub params: Known,
    /// Canonical ψ to its switch.
    index: FxHashMap<Expr<'e>, usize>,
    /// Every entry variable to its α, or to what `choices` has.
    merge: Substitution<'e>,
    /// Of switches that are read nonlinearly, what stands for the α of entries that are read linearly all the
    /// same, as in conditions, to that α.
    choices: Substitution<'e>,
    choosing: Vec<Option<Var>>,
    /// [`Entry::Term`] variables to their α.
    strict: Substitution<'e>,
    here: Span,
    /// How many switches an expression is nonlinear in, and where it stands, if they are too many.
    entangled: Cell<Option<(usize, Span)>>,
}

impl<'e> Switches<'e> {
    /// No switches yet; `given` are time and data, and `params` decide the sign of constant factors.
    pub fn new(exprs: &'e Exprs, given: impl IntoIterator<Item = Expr<'e>>, params: Known) -> Self {
        Switches {
            list: Vec::new(),
            refused: Vec::new(),
            exprs,
            given: given.into_iter().filter_map(Expr::as_variable).collect(),
            params,
            index: FxHashMap::default(),
            merge: Substitution::new(),
            choices: Substitution::new(),
            choosing: Vec::new(),
            strict: Substitution::new(),
            here: Span::default(),
            entangled: Cell::new(None),
        }
    }

    /// Adds a function of time.
    pub fn give(&mut self, var: Expr<'e>) {
        self.given.extend(var.as_variable());
    }

    /// Replaces the nonsmooth terms of an expression that stands at `span` by entry variables.
    pub fn replace(&mut self, e: Expr<'e>, span: Span) -> Expr<'e> {
        self.here = span;
        transform(&[e], &mut |written, e| self.replace_node(written, e))[0]
    }

    /// Replaces a node, of which the terms below are replaced.
    fn replace_node(&mut self, written: Expr<'e>, e: Expr<'e>) -> Expr<'e> {
        let Some((psi, entry)) = compared(e) else {
            return e;
        };
        // A condition is decided there where the model states it; here is what controls make of it.
        if entry != Entry::Kink && self.merged(psi).cancels() {
            return at_alpha(e, self.exprs.constant(0.5));
        }
        let written = compared(written).map_or(psi, |(written, _)| written);
        at_alpha(e, self.enter(psi, written, entry))
    }

    /// The value of step(ψ): an entry variable, one minus it, or a number.
    pub fn enter(&mut self, psi: Expr<'e>, written: Expr<'e>, entry: Entry) -> Expr<'e> {
        let psi = self.merged(psi);
        if let Some(value) = self.decided_before(psi, entry) {
            return value;
        }
        let mut form = surface::form(psi, &self.params);
        if let (Form::Regular, Some(sign)) = (form, self.absolute_value(psi)) {
            form = Form::Definite(sign);
        }
        let psi = match (form, entry) {
            // A kink at a value of free parameters is a switch that does not move.
            (Form::Regular, _) | (Form::Free, Entry::Kink) => psi,
            // On a constant or definite ψ, both branches of a kink agree wherever ψ = 0.
            (Form::Constant(value) | Form::Definite(value), Entry::Kink) => {
                return self.exprs.constant(if value >= 0.0 { 1.0 } else { 0.0 });
            }
            (Form::OddPower(base), Entry::Kink) => base,
            (Form::Parameter(value), _) if value != 0.0 || entry == Entry::Kink => {
                return self.exprs.constant(if value >= 0.0 { 1.0 } else { 0.0 });
            }
            (form, _) => {
                if self.refused.iter().all(|refused| refused.psi != psi) {
                    self.refused.push(Refused {
                        psi,
                        form,
                        span: self.here,
                    });
                }
                return self.exprs.constant(1.0);
            }
        };
        let n_known = self.list.len();
        let (k, flipped) = self.switch(psi);
        if let (Form::Regular, true) = (form, k == n_known) {
            self.list[k].written = written;
        }
        if entry == Entry::Nonlinear {
            self.read_nonlinearly(k);
        }
        let tau = self.entry_variable(k, entry);
        if flipped { 1.0 - tau } else { tau }
    }

    /// The sign of a ψ that is a multiple of |ψ_k| = (2 α_k - 1) ψ_k for some switch k.
    fn absolute_value(&self, psi: Expr<'e>) -> Option<f64> {
        // Those of ψ_k are older.
        let alpha = self.alphas_of(psi).pop()?;
        let inner = &self.list[self.of_alpha(alpha)?];
        let (_, key) = surface::canonical(inner.psi, &self.params);
        let sign_at = |side: f64| {
            let (scale, at_side) = surface::canonical(at(psi, alpha, side), &self.params);
            (at_side == key).then_some((scale * inner.scale).signum())
        };
        let (above, below) = (sign_at(1.0)?, sign_at(0.0)?);
        (above == -below).then_some(above)
    }

    /// The switch of ψ, and whether ψ is a negative multiple of its switching function.
    fn switch(&mut self, psi: Expr<'e>) -> (usize, bool) {
        let (scale, key) = surface::canonical(psi, &self.params);
        let k = *self.index.entry(key).or_insert(self.list.len());
        if k == self.list.len() {
            let alpha = self
                .exprs
                .variable("alpha")
                .as_variable()
                .expect("a fresh variable is one");
            let mut switch = Collected::new(alpha, psi, self.here);
            switch.is_timed = self.is_timed(psi);
            switch.scale = scale;
            self.list.push(switch);
        }
        (k, scale * self.list[k].scale < 0.0)
    }

    /// Takes a positive or negative multiple of ψ as the switching function of a switch that occurs nowhere yet.
    pub fn orient(&mut self, k: usize, psi: Expr<'e>) {
        let switch = &mut self.list[k];
        (switch.psi, switch.written) = (psi, psi);
        switch.scale = surface::canonical(psi, &self.params).0;
    }

    /// Makes the switch of a gap, or of a constraint of a projection; gives the form of ψ where it is none, or another has it.
    pub fn unilateral(&mut self, gap: Expr<'e>, name: &str, span: Span) -> Result<usize, Form<'e>> {
        self.here = span;
        let form = surface::form(gap, &self.params);
        if form != Form::Regular || self.find(gap).is_some() {
            return Err(form);
        }
        let (k, _) = self.switch(gap);
        let switch = &mut self.list[k];
        switch.unilateral = true;
        switch.name = Some(name.to_owned());
        switch.spans.push(span);
        Ok(k)
    }

    /// Makes the switch of a slip velocity, an equation or a member of a pair, which no other term shares.
    pub fn keep(&mut self, psi: Expr<'e>, name: &str, span: Span) -> usize {
        let alpha = self.exprs.variable("alpha").as_variable();
        let alpha = alpha.expect("a fresh variable is one");
        let mut switch = Collected::new(alpha, psi, span);
        switch.name = Some(name.to_owned());
        switch.spans.push(span);
        self.list.push(switch);
        self.list.len() - 1
    }

    /// Makes the switch of a ψ that the user wrote as `name` at `span`.
    pub fn declare(&mut self, psi: Expr<'e>, name: &str, span: Span) {
        if surface::form(psi, &self.params) != Form::Regular || self.deciding(psi).is_some() {
            return;
        }
        let (k, flipped) = self.switch(psi);
        let switch = &mut self.list[k];
        if switch.spans.is_empty() && !flipped {
            switch.name = Some(name.to_owned());
        }
        switch.spans.push(span);
    }

    /// Gives the switch of ψ the name of a `switch` statement.
    pub fn name(
        &mut self,
        psi: Expr<'e>,
        name: &str,
        span: Span,
        reading: impl FnOnce(bool) -> NamedReading,
    ) {
        if let Some((k, flipped)) = self.find(psi) {
            let switch = &mut self.list[k];
            if switch.named.is_empty() && !flipped {
                switch.name = Some(name.to_owned());
            }
            if switch.spans.is_empty() {
                switch.spans.push(span);
            }
            switch.named.push(reading(flipped));
        }
    }

    /// How expressions of the model are read once only the switches `kept` are left.
    pub fn readings(
        &self,
        kept: &[usize],
        signals: Substitution<'e>,
        named: impl IntoIterator<Item = (Var, Expr<'e>, Expr<'e>)>,
    ) -> Readings<'e> {
        let alphas: FxHashSet<Var> = kept.iter().map(|&k| self.list[k].alpha).collect();
        let is_kept = |e: Expr<'e>| self.alphas_of(e).iter().all(|alpha| alphas.contains(alpha));
        let named = named.into_iter().map(|(var, value, direct)| {
            let value = self.merged(value);
            (
                var,
                if is_kept(value) {
                    value
                } else {
                    direct.substitute(&signals)
                },
            )
        });
        let index = self.index.iter().filter_map(|(&key, k)| {
            let place = kept.iter().position(|kept| kept == k)?;
            Some((key, (place, self.list[*k].scale)))
        });
        let alphas = kept.iter().map(|&k| self.exprs.expr(self.list[k].alpha));
        Readings {
            named: named.collect(),
            signals,
            index: index.collect(),
            alphas: alphas.collect(),
            params: self.params.clone(),
        }
    }

    /// The switch that belongs to ψ, if there is one: its number, and whether ψ is flipped.
    pub fn find(&self, psi: Expr<'e>) -> Option<(usize, bool)> {
        let (scale, key) = surface::canonical(self.merged(psi), &self.params);
        let k = *self.index.get(&key)?;
        Some((k, scale * self.list[k].scale < 0.0))
    }

    /// How many switches an expression is nonlinear in, and where it stands, if they are too many.
    pub fn entangled(&self) -> Option<(usize, Span)> {
        self.entangled.get()
    }

    /// The arena of all expressions.
    pub fn exprs(&self) -> &'e Exprs {
        self.exprs
    }

    /// The expression that is looked at.
    pub fn here(&self) -> Span {
        self.here
    }

    /// Whether a function depends on time only, through switches of time too.
    pub fn is_timed(&self, e: Expr<'e>) -> bool {
        variables_of(&[e]).into_iter().all(|var| {
            let timed = || self.of_alpha(var).is_some_and(|k| self.list[k].is_timed);
            self.given.contains(&var) || self.params.numbers.contains_key(&var) || timed()
        })
    }

    /// The switch that a variable is the α of.
    pub fn of_alpha(&self, var: Var) -> Option<usize> {
        let found = self.list.binary_search_by_key(&var, |switch| switch.alpha);
        found.ok()
    }

    /// The variable for one kind of entry of a switch.
    pub fn entry_variable(&mut self, k: usize, entry: Entry) -> Expr<'e> {
        if let Some(&(_, var)) = self.list[k].entries.iter().find(|known| known.0 == entry) {
            return self.exprs.expr(var);
        }
        let tau = self.exprs.variable("tau");
        let var = tau.as_variable().expect("a fresh variable is one");
        let alpha = self.exprs.expr(self.list[k].alpha);
        self.list[k].entries.push((entry, var));
        self.merge.insert(var, self.value_of(k, entry));
        if entry == Entry::Term {
            self.strict.insert(var, alpha);
        }
        tau
    }

    /// What an entry variable of a switch stands for.
    fn value_of(&self, k: usize, entry: Entry) -> Expr<'e> {
        let is_written = matches!(entry, Entry::Term | Entry::Nonlinear);
        let choosing = self.choosing.get(k).copied().flatten();
        let var = choosing.filter(|_| !is_written);
        self.exprs.expr(var.unwrap_or(self.list[k].alpha))
    }

    /// Keeps powers of the α of a switch, but where it chooses between values.
    fn read_nonlinearly(&mut self, k: usize) {
        if std::mem::replace(&mut self.list[k].is_nonlinear, true) {
            return;
        }
        let choosing = self.exprs.variable("tau").as_variable();
        let choosing = choosing.expect("a fresh variable is one");
        self.choosing.resize(self.list.len(), None);
        self.choosing[k] = Some(choosing);
        let alpha = self.exprs.expr(self.list[k].alpha);
        self.choices.insert(choosing, alpha);
        for (entry, var) in self.list[k].entries.clone() {
            self.merge.insert(var, self.value_of(k, entry));
        }
    }

    /// The expression in α, affine in each that is read linearly.
    pub fn merged(&self, e: Expr<'e>) -> Expr<'e> {
        let e = e.substitute(&self.merge);
        let mut linear = self.alphas_of(e);
        linear.retain(|&alpha| {
            self.of_alpha(alpha)
                .is_none_or(|k| !self.list[k].is_nonlinear)
        });
        linear.extend(self.choosing.iter().flatten());
        let bent = bent(e, &linear);
        if bent.len() > MOST_BENT {
            // The interpolant would have 2^n terms: this is refused, and e stands for it until then.
            self.entangled.set(Some((bent.len(), self.here)));
            return e.substitute(&self.choices);
        }
        multi_affine(e, &bent).substitute(&self.choices)
    }

    /// The expression in α, with powers of them as they stand.
    pub fn in_alphas(&self, e: Expr<'e>) -> Expr<'e> {
        e.substitute(&self.merge).substitute(&self.choices)
    }

    /// The expression in α where powers of a switch have no agreed meaning, in entry variables elsewhere.
    pub fn strict(&self, e: Expr<'e>) -> Expr<'e> {
        e.substitute(&self.strict)
    }

    /// The variable of the conditions on a switch.
    pub fn condition(&self, k: usize) -> Option<Var> {
        let entries = &self.list[k].entries;
        entries
            .iter()
            .find(|known| known.0 == Entry::Condition)
            .map(|known| known.1)
    }

    /// The switches whose entry variables or α occur in an expression, ascending.
    pub fn occurring(&self, e: Expr<'e>) -> Vec<usize> {
        let alpha_of = |var: Var| match self.merge.get(var) {
            Some(alpha) => {
                let alpha = alpha.substitute(&self.choices);
                alpha.as_variable().unwrap_or(var)
            }
            None => var,
        };
        let found = variables_of(&[e]).into_iter().filter_map(|var| {
            let alpha = alpha_of(var);
            let found = self
                .list
                .binary_search_by_key(&alpha, |switch| switch.alpha);
            found.ok()
        });
        let mut found: Vec<usize> = found.collect();
        found.sort_unstable();
        found.dedup();
        found
    }

    /// The entry variables of a switch and its α.
    pub fn variables_of_switch(&self, k: usize) -> impl Iterator<Item = Var> + '_ {
        self.list[k]
            .entries
            .iter()
            .map(|known| known.1)
            .chain([self.list[k].alpha])
    }

    /// The α that occur in an expression.
    pub fn alphas_of(&self, e: Expr<'e>) -> Vec<Var> {
        let mut vars = variables_of(&[e]);
        vars.retain(|var| {
            let found = self.list.binary_search_by_key(var, |switch| switch.alpha);
            found.is_ok()
        });
        vars
    }

    /// Whether the dynamics are continuous by construction: the switch enters through kinks only.
    pub fn is_kink(&self, k: usize) -> bool {
        self.list[k]
            .entries
            .iter()
            .all(|known| known.0 == Entry::Kink)
    }
}
