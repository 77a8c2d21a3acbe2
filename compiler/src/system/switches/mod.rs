//! Nonsmooth terms become switch variables, bottom-up.
//!
//! Switching functions that are multiples of each other share one switch; α becomes 1 - α where
//! the multiple is negative. ψ of an outer term holds α of inner ones, as in `max(abs(x), y)`.
//!
//! How a switch enters decides how powers of it are read (see [`Entry`]), so until that is settled
//! each kind of entry has a variable of its own, merged into α afterwards.

pub(crate) mod affine;
pub(crate) mod continuity;
pub(crate) mod entries;
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
use rustc_hash::{FxHashMap, FxHashSet};

use super::{NamedReading, Relay, Role};
use crate::expr::{Expr, Exprs, Var, transform, variables_of};
use crate::source::Span;
use crate::system::switches::affine::at;
use crate::system::switches::entries::{Entries, Entry};
use crate::system::switches::known::Known;
use crate::system::switches::surface::Form;
use crate::system::switches::terms::{at_alpha, beside_infinite, compared, in_law, plain};

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
    /// Scale of ψ over its canonical form.
    pub scale: f64,
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
            scale: 1.0,
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
    pub index: FxHashMap<Expr<'e>, usize>,
    /// What enters expressions.
    pub entries: Entries<'e>,
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
            entries: Entries::new(exprs),
        }
    }

    /// Adds a function of time.
    pub fn give(&mut self, var: Expr<'e>) {
        self.given.extend(var.as_variable());
    }

    /// Replaces the nonsmooth terms of an expression that stands at `span` by entry variables.
    pub fn replace(&mut self, e: Expr<'e>, span: Span) -> Expr<'e> {
        self.replace_with(e, span, &FxHashSet::default())
    }

    /// The same of an expression of a law.
    pub fn replace_in_law(&mut self, e: Expr<'e>, span: Span) -> Expr<'e> {
        self.replace_with(e, span, &plain(e))
    }

    /// The same, where some terms are read on their surface.
    fn replace_with(&mut self, e: Expr<'e>, span: Span, read: &FxHashSet<Expr<'e>>) -> Expr<'e> {
        self.entries.here = span;
        let mut replace = |written, e| self.replace_node(written, e, read);
        transform(&[e], &mut replace)[0]
    }

    /// Replaces a node, of which the terms below are replaced.
    fn replace_node(
        &mut self,
        written: Expr<'e>,
        e: Expr<'e>,
        read: &FxHashSet<Expr<'e>>,
    ) -> Expr<'e> {
        let Some((psi, entry)) = compared(e) else {
            return e;
        };
        if let Some(other) = beside_infinite(e, &self.params) {
            return other;
        }
        // A condition is decided there where the model states it; here is what controls make of it.
        if entry != Entry::Kink && self.entries.merged(psi).cancels() {
            return at_alpha(e, self.exprs.constant(0.5));
        }
        let entry = match read.contains(&written) {
            true => in_law(e, entry),
            false => entry,
        };
        let written = compared(written).map_or(psi, |(written, _)| written);
        at_alpha(e, self.enter(psi, written, entry))
    }

    /// The value of step(ψ): an entry variable, one minus it, or a number.
    pub fn enter(&mut self, psi: Expr<'e>, written: Expr<'e>, entry: Entry) -> Expr<'e> {
        let psi = self.entries.merged(psi);
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
            // A law compares numbers.
            (Form::Constant(_) | Form::Parameter(_), Entry::Above) => {
                return self.exprs.constant(0.0);
            }
            (Form::Constant(_) | Form::Parameter(_), Entry::NotBelow) => {
                return self.exprs.constant(1.0);
            }
            (form, _) => {
                if self.refused.iter().all(|refused| refused.psi != psi) {
                    self.refused.push(Refused {
                        psi,
                        form,
                        span: self.entries.here,
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
        let tau = match flipped {
            true => self.entries.variable(k, entry.flipped()),
            false => self.entries.variable(k, entry),
        };
        if flipped { 1.0 - tau } else { tau }
    }

    /// The sign of a ψ that is a multiple of |ψ_k| = (2 α_k - 1) ψ_k for some switch k.
    fn absolute_value(&self, psi: Expr<'e>) -> Option<f64> {
        // Those of ψ_k are older.
        let alpha = self.entries.alphas_of(psi).pop()?;
        let inner = &self.list[self.entries.of_alpha(alpha)?];
        let (_, key) = surface::canonical(inner.psi, &self.params);
        let sign_at = |side: f64| {
            let (scale, at_side) = surface::canonical(at(psi, alpha, side), &self.params);
            (at_side == key).then_some((scale * inner.scale).signum())
        };
        let (above, below) = (sign_at(1.0)?, sign_at(0.0)?);
        (above == -below).then_some(above)
    }

    /// A new switch at the end of the list.
    fn add(&mut self, psi: Expr<'e>, origin: Span) -> &mut Collected<'e> {
        self.list
            .push(Collected::new(self.entries.alpha(), psi, origin));
        self.list.last_mut().expect("it is there")
    }

    /// The switch of ψ, and whether ψ is a negative multiple of its switching function.
    fn switch(&mut self, psi: Expr<'e>) -> (usize, bool) {
        let (scale, key) = surface::canonical(psi, &self.params);
        let k = *self.index.entry(key).or_insert(self.list.len());
        if k == self.list.len() {
            let is_timed = self.is_timed(psi);
            let switch = self.add(psi, self.entries.here);
            (switch.is_timed, switch.scale) = (is_timed, scale);
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
        self.entries.here = span;
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
        let switch = self.add(psi, span);
        switch.name = Some(name.to_owned());
        switch.spans.push(span);
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

    /// The switch that belongs to ψ, if there is one: its number, and whether ψ is flipped.
    pub fn find(&self, psi: Expr<'e>) -> Option<(usize, bool)> {
        let (scale, key) = surface::canonical(self.entries.merged(psi), &self.params);
        let k = *self.index.get(&key)?;
        Some((k, scale * self.list[k].scale < 0.0))
    }

    /// The arena of all expressions.
    pub fn exprs(&self) -> &'e Exprs {
        self.exprs
    }

    /// Whether a function depends on time only, through switches of time too.
    pub fn is_timed(&self, e: Expr<'e>) -> bool {
        variables_of(&[e]).into_iter().all(|var| {
            let timed = || {
                self.entries
                    .of_alpha(var)
                    .is_some_and(|k| self.list[k].is_timed)
            };
            self.given.contains(&var) || self.params.numbers.contains_key(&var) || timed()
        })
    }
}
