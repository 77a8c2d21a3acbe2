//! The invariants of a [`Dcs`].

use std::collections::HashSet;

use crate::expr::{Expr, Var, rewrite_all, variables_of};

use super::Dcs;

impl<'e> Dcs<'e> {
    /// Checks the invariants in the documentation of [`super`]; the error says which one is broken.
    pub fn verify(&self) -> Result<(), String> {
        self.verify_counts()?;
        self.verify_variables()?;
        self.verify_pairs()?;
        self.verify_smooth()?;
        self.verify_impacts()?;
        self.verify_algebraics()
    }

    fn verify_counts(&self) -> Result<(), String> {
        let counts = [
            ("rates and states", self.rows.rates.len(), self.states.len()),
            (
                "rates and origins",
                self.rows.rates.len(),
                self.rows.origins.rates.len(),
            ),
            (
                "equations and origins",
                self.rows.equations.len(),
                self.rows.origins.equations.len(),
            ),
            (
                "pairs and origins",
                self.rows.pairs.len(),
                self.rows.origins.pairs.len(),
            ),
            (
                "rows and algebraic variables",
                self.rows.equations.len() + self.rows.pairs.len(),
                self.algebraics.len(),
            ),
        ];
        match counts.iter().find(|(_, left, right)| left != right) {
            Some((what, left, right)) => Err(format!("{what} differ in number: {left}, {right}")),
            None => Ok(()),
        }
    }

    fn verify_variables(&self) -> Result<(), String> {
        let params = self.params.iter().map(|param| param.var);
        let states = self.states.iter().map(|state| state.var);
        let algebraics = self.algebraics.iter().map(|algebraic| algebraic.var);
        let controls = self.task.iter().flat_map(|task| &task.controls);
        let mut declared: HashSet<Var> = HashSet::new();
        for var in [self.time]
            .into_iter()
            .chain(self.data.iter().map(|data| data.var))
            .chain(params)
            .chain(states)
            .chain(algebraics)
            .chain(controls.map(|control| control.var))
        {
            let Some(name) = var.as_variable() else {
                return Err(format!("`{var}` is declared and no variable"));
            };
            if !declared.insert(name) {
                return Err(format!("`{var}` is declared twice"));
            }
        }
        let occurring = variables_of(&self.exprs()).into_iter();
        match occurring.into_iter().find(|var| !declared.contains(var)) {
            Some(var) => Err(format!("`{}` is not declared", self.exprs.name(var))),
            None => Ok(()),
        }
    }

    fn verify_pairs(&self) -> Result<(), String> {
        let algebraic = self.algebraic_variables();
        let is_algebraic = |e: Expr| e.as_variable().is_some_and(|var| algebraic.contains(&var));
        let mut members = self.rows.members();
        match members.find(|&member| !is_algebraic(member) && !is_algebraic(1.0 - member)) {
            Some(member) => Err(format!("`{member}` stands in a pair")),
            None => Ok(()),
        }
    }

    fn verify_smooth(&self) -> Result<(), String> {
        let mut nonsmooth = None;
        rewrite_all(&self.exprs(), &mut |e| {
            if e.node().is_nonsmooth() {
                nonsmooth.get_or_insert(e);
            }
            e
        });
        nonsmooth.map_or(Ok(()), |e| Err(format!("`{e}` is not smooth")))
    }

    fn verify_impacts(&self) -> Result<(), String> {
        let algebraic = self.algebraic_variables();
        let known = self.impacts.iter().flat_map(|impact| impact.exprs());
        let occurring = variables_of(&known.collect::<Vec<_>>());
        match occurring.into_iter().find(|var| algebraic.contains(var)) {
            Some(var) => Err(format!("an impulse depends on `{}`", self.exprs.name(var))),
            None => Ok(()),
        }
    }

    fn verify_algebraics(&self) -> Result<(), String> {
        if let Some(z) = self.algebraics.iter().find(|z| !z.guess.is_finite()) {
            return Err(format!("the guess of `{}` is {}", z.var, z.guess));
        }
        let algebraic = self.algebraic_variables();
        match variables_of(&self.switches.alphas)
            .into_iter()
            .find(|var| !algebraic.contains(var))
        {
            Some(var) => Err(format!("a switch reads `{}`", self.exprs.name(var))),
            None => Ok(()),
        }
    }

    /// Everything in which a variable may occur.
    fn exprs(&self) -> Vec<Expr<'e>> {
        let members = self.rows.members();
        let rows = self.rows.rates.iter().chain(&self.rows.equations).copied();
        let task = self.task.iter().flat_map(crate::system::Task::exprs);
        let impacts = self.impacts.iter().flat_map(|impact| impact.exprs());
        let branches = self.switches.branches.iter().map(|branch| branch.stability);
        rows.chain(members)
            .chain(task)
            .chain(impacts)
            .chain(branches)
            .collect()
    }

    fn algebraic_variables(&self) -> HashSet<Var> {
        let vars = self.algebraics.iter().map(|algebraic| algebraic.var);
        vars.filter_map(Expr::as_variable).collect()
    }
}
