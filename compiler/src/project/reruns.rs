//! What one experiment is compiled to for any values of some of its parameters and initial values.
//!
//! A compilation serves all values on the same sides of zero, within the ranges that are declared: a zero takes terms out,
//! and a sign turns sides of surfaces round. It is made at the experiment's own values; where these are on other sides, at
//! their opposites, and else at ones. Which of them a run takes follows from its own values alone, so that what comes of it
//! does not depend on what was run before.

use std::cmp::Ordering;

use crate::expr::Exprs;
use crate::project::Project;
use crate::project::ensemble::Source;
use crate::project::rerun::{NoRerun, Rerun};
use crate::syntax::{Bind, Experiment, ExprKind, Path};

/// Sides of zero of values that are kept; beyond, those that were met first are compiled again.
const MOST: usize = 64;

/// The values at which an experiment is compiled, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Base {
    Own,
    Opposite,
    Ones,
}

const BASES: [Base; 3] = [Base::Own, Base::Opposite, Base::Ones];

/// Compilations of one experiment, on one thread.
pub(crate) struct Reruns<'e> {
    exprs: &'e Exprs,
    project: &'e Project,
    experiment: Experiment,
    overrides: Vec<Bind>,
    /// A binding of each name, whose value is replaced.
    names: Vec<Bind>,
    /// The entries of all states.
    states: Vec<String>,
    kept: Vec<Kept<'e>>,
}

/// Compilations for values on some sides of zero.
struct Kept<'e> {
    sides: Vec<Option<Ordering>>,
    /// At each base, where it was tried.
    at: [Option<Result<Rerun<'e>, NoRerun>>; BASES.len()],
}

impl<'e> Reruns<'e> {
    /// An experiment with overrides, of which the values of some names change; `states` are the entries of all states.
    pub fn new(
        exprs: &'e Exprs,
        project: &'e Project,
        experiment: Experiment,
        [overrides, names]: [Vec<Bind>; 2],
        states: Vec<String>,
    ) -> Self {
        Reruns {
            exprs,
            project,
            experiment,
            overrides,
            names,
            states,
            kept: Vec::new(),
        }
    }

    /// How many sides of values are kept.
    pub fn kept(&self) -> usize {
        self.kept.len()
    }

    /// A compilation that takes these values, in the order of the names; `adapted` changes a new one. None where the
    /// experiment has to be compiled for them.
    pub fn of(
        &mut self,
        values: &[f64],
        adapted: impl Fn(Rerun<'e>) -> Option<Rerun<'e>>,
    ) -> Option<&mut Rerun<'e>> {
        if values.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let sides = || values.iter().map(|value| value.partial_cmp(&0.0));
        let known = self.kept.iter();
        let place = { known }.position(|kept| sides().eq(kept.sides.iter().copied()));
        let place = place.unwrap_or_else(|| {
            if self.kept.len() == MOST {
                self.kept.remove(0);
            }
            self.kept.push(Kept {
                sides: sides().collect(),
                at: [const { None }; BASES.len()],
            });
            self.kept.len() - 1
        });
        let takes = |&base: &usize| {
            if self.kept[place].at[base].is_none() {
                let made = self.at(&self.kept[place], BASES[base], values);
                let made = made.and_then(|rerun| adapted(rerun).ok_or(NoRerun::Ever));
                self.kept[place].at[base] = Some(made);
            }
            let found = &self.kept[place].at[base];
            matches!(found, Some(Ok(rerun)) if rerun.takes(values))
        };
        let base = (0..BASES.len()).find(takes)?;
        self.kept[place].at[base].as_mut()?.as_mut().ok()
    }

    /// The compilation at a base, for values on these sides.
    fn at(&self, kept: &Kept<'e>, base: Base, values: &[f64]) -> Result<Rerun<'e>, NoRerun> {
        let own = match &kept.at[0] {
            Some(Err(NoRerun::Ever)) => return Err(NoRerun::Ever),
            Some(Ok(rerun)) => Some(rerun),
            _ => None,
        };
        let fixed = |(k, &value): (usize, &f64)| match (base, value) {
            (_, 0.0) => Some(0.0),
            (Base::Own, _) => None,
            (Base::Opposite, _) => own?.value(k).map(|own| own.abs().copysign(value)),
            (Base::Ones, _) => Some(value.signum()),
        };
        // Where all are on the sides of their own values, the opposites are these again.
        let turns = |own: &Rerun<'e>| {
            let mut signs = values.iter().enumerate();
            signs.any(|(k, value)| own.value(k).is_some_and(|own| own * value < 0.0))
        };
        if base == Base::Opposite && !own.is_some_and(turns) {
            return Err(NoRerun::Here);
        }
        let mut overrides = self.overrides.clone();
        for (name, value) in self.names.iter().zip(values.iter().enumerate().map(fixed)) {
            if let Some(value) = value {
                let mut bind = name.clone();
                bind.value.kind = ExprKind::Number(value);
                overrides.push(bind);
            }
        }
        let source = Source {
            file: &self.project.file,
            experiment: &self.experiment,
            overrides: &overrides,
        };
        // What is zero stays so.
        let names = self.names.iter().zip(values);
        let names = names.map(|(name, value)| (*value != 0.0).then(|| name.target.clone()));
        let names: Vec<Option<Path>> = names.collect();
        Rerun::new(self.exprs, self.project, source, &names, &self.states)
    }
}
