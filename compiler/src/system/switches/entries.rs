//! Entry variables of switches, and the α that they stand for.
//!
//! How a switch enters an expression decides how powers of it are read, so until that is settled each kind of entry has
//! a variable τ of its own, merged into α afterwards: e(τ) -> the multi-affine form of e(α).

use std::cell::Cell;

use crate::expr::{Expr, Exprs, Substitution, Var, variables_of};
use crate::source::Span;
use crate::system::switches::affine::{bent, multi_affine};

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
    /// ψ > 0 in a law.
    Above,
    /// ψ >= 0 in a law.
    NotBelow,
    /// `step` or `sign` in a law, 1/2 or 0 where ψ is zero.
    Between,
}

impl Entry {
    /// That of -ψ, as one minus which ψ enters.
    pub fn flipped(self) -> Self {
        match self {
            Entry::Above => Entry::NotBelow,
            Entry::NotBelow => Entry::Above,
            other => other,
        }
    }
}

/// α of a switch and its entry variables.
struct Symbols {
    alpha: Var,
    vars: Vec<(Entry, Var)>,
    /// Of a switch that is read nonlinearly, what stands for the α of entries that are read linearly all the same, as
    /// in conditions.
    choosing: Option<Var>,
}

/// The entries of all switches, by their numbers.
pub(crate) struct Entries<'e> {
    exprs: &'e Exprs,
    list: Vec<Symbols>,
    /// Every entry variable to its α, or to what chooses.
    merge: Substitution<'e>,
    /// What chooses, to its α.
    choices: Substitution<'e>,
    /// [`Entry::Term`] variables to their α, of switches that no statement reads linearly.
    strict: Substitution<'e>,
    /// [`Entry::Above`] and [`Entry::NotBelow`] variables to what stands for them in laws.
    compared: Substitution<'e>,
    /// What stands for comparisons in laws.
    in_laws: Vec<Var>,
    /// The expression that is looked at.
    pub here: Span,
    /// How many switches an expression is nonlinear in, and where it stands, if they are too many.
    entangled: Cell<Option<(usize, Span)>>,
}

impl<'e> Entries<'e> {
    /// No switches yet.
    pub fn new(exprs: &'e Exprs) -> Self {
        Entries {
            exprs,
            list: Vec::new(),
            merge: Substitution::new(),
            choices: Substitution::new(),
            strict: Substitution::new(),
            compared: Substitution::new(),
            in_laws: Vec::new(),
            here: Span::default(),
            entangled: Cell::new(None),
        }
    }

    /// α of a new switch.
    pub fn alpha(&mut self) -> Var {
        let alpha = self.fresh("alpha");
        self.list.push(Symbols {
            alpha,
            vars: Vec::new(),
            choosing: None,
        });
        alpha
    }

    fn fresh(&self, name: &str) -> Var {
        let var = self.exprs.variable(name).as_variable();
        var.expect("a fresh variable is one")
    }

    /// Whether some statement reads a switch nonlinearly: powers of its α are what they are.
    pub fn is_nonlinear(&self, k: usize) -> bool {
        self.list[k].choosing.is_some()
    }

    /// How many switches an expression is nonlinear in, and where it stands, if they are too many.
    pub fn entangled(&self) -> Option<(usize, Span)> {
        self.entangled.get()
    }

    /// The switch that a variable is the α of.
    pub fn of_alpha(&self, var: Var) -> Option<usize> {
        let found = self.list.binary_search_by_key(&var, |switch| switch.alpha);
        found.ok()
    }

    /// The variable for one kind of entry of a switch.
    pub fn variable(&mut self, k: usize, entry: Entry) -> Expr<'e> {
        if entry == Entry::Nonlinear {
            self.read_nonlinearly(k);
        }
        if let Some(&(_, var)) = self.list[k].vars.iter().find(|known| known.0 == entry) {
            return self.exprs.expr(var);
        }
        let var = self.fresh("tau");
        let alpha = self.exprs.expr(self.list[k].alpha);
        self.list[k].vars.push((entry, var));
        self.merge.insert(var, self.value_of(k, entry));
        let of = |wanted: Entry| {
            let mut vars = self.list[k].vars.iter();
            Some(vars.find(|known| known.0 == wanted)?.1)
        };
        match entry {
            Entry::Term if of(Entry::Linear).is_none() => self.strict.insert(var, alpha),
            // The statement reads its switching function wherever that stands.
            Entry::Linear => {
                if let Some(term) = of(Entry::Term) {
                    self.strict.insert(term, self.exprs.expr(term));
                }
            }
            Entry::Above | Entry::NotBelow | Entry::Between => {
                let known = self.fresh("alpha");
                self.in_laws.push(known);
                self.compared.insert(var, self.exprs.expr(known));
            }
            _ => {}
        }
        self.exprs.expr(var)
    }

    /// What an entry variable of a switch stands for.
    fn value_of(&self, k: usize, entry: Entry) -> Expr<'e> {
        let is_written = matches!(entry, Entry::Term | Entry::Nonlinear);
        let var = self.list[k].choosing.filter(|_| !is_written);
        self.exprs.expr(var.unwrap_or(self.list[k].alpha))
    }

    /// Keeps powers of the α of a switch, but where it chooses between values.
    fn read_nonlinearly(&mut self, k: usize) {
        if self.is_nonlinear(k) {
            return;
        }
        let choosing = self.fresh("tau");
        self.list[k].choosing = Some(choosing);
        let alpha = self.exprs.expr(self.list[k].alpha);
        self.choices.insert(choosing, alpha);
        for (entry, var) in self.list[k].vars.clone() {
            self.merge.insert(var, self.value_of(k, entry));
        }
    }

    /// The expression in α, affine in each that is read linearly.
    pub fn merged(&self, e: Expr<'e>) -> Expr<'e> {
        let e = e.substitute(&self.merge);
        let mut linear = self.alphas_of(e);
        linear.retain(|&alpha| self.of_alpha(alpha).is_none_or(|k| !self.is_nonlinear(k)));
        if !self.choices.is_empty() {
            linear.extend(self.list.iter().filter_map(|switch| switch.choosing));
        }
        let bent = bent(e, &linear);
        if bent.len() > MOST_BENT {
            // The interpolant would have 2^n terms: this is refused, and e stands for it until then.
            self.entangled.set(Some((bent.len(), self.here)));
            return e.substitute(&self.choices);
        }
        multi_affine(e, &bent).substitute(&self.choices)
    }

    /// An expression of a law, whose comparisons have variables of their own: 0 or 1 as α off the surface, and what they say on
    /// it.
    pub fn in_law(&self, e: Expr<'e>) -> Expr<'e> {
        let e = self.merged(e.substitute(&self.compared));
        let bent = bent(e, &self.in_laws);
        match bent.len() > MOST_BENT {
            // Powers of what is 0 or 1 are what they are.
            true => e,
            false => multi_affine(e, &bent),
        }
    }

    /// What stands for comparisons with the surface of a switch in laws, with their values on it.
    pub fn compared(&self, k: usize) -> impl Iterator<Item = (Var, f64)> + '_ {
        let vars = self.list[k].vars.iter();
        vars.filter_map(|&(entry, var)| {
            let known = self.compared.get(var)?.as_variable()?;
            let on_surface = match entry {
                Entry::NotBelow => 1.0,
                Entry::Between => 0.5,
                _ => 0.0,
            };
            Some((known, on_surface))
        })
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
        let entries = &self.list[k].vars;
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
        let found = variables_of(&[e])
            .into_iter()
            .filter_map(|var| self.of_alpha(alpha_of(var)));
        let mut found: Vec<usize> = found.collect();
        found.sort_unstable();
        found.dedup();
        found
    }

    /// The entry variables of a switch and its α.
    pub fn variables_of(&self, k: usize) -> impl Iterator<Item = Var> + '_ {
        self.list[k]
            .vars
            .iter()
            .map(|known| known.1)
            .chain([self.list[k].alpha])
    }

    /// The α that occur in an expression.
    pub fn alphas_of(&self, e: Expr<'e>) -> Vec<Var> {
        let mut vars = variables_of(&[e]);
        vars.retain(|&var| self.of_alpha(var).is_some());
        vars
    }

    /// Whether the dynamics are continuous by construction: the switch enters through kinks only.
    pub fn is_kink(&self, k: usize) -> bool {
        self.list[k].vars.iter().all(|known| known.0 == Entry::Kink)
    }
}
