//! The invariants of an [`Mpcc`].

use std::collections::HashSet;

use super::{Block, Kind, Mpcc, n_places};
use crate::expr::{Var, rewrite_all, variables_of};

impl Mpcc<'_> {
    /// Checks the invariants in the documentation of [`super`]; the error says which one is broken.
    pub fn verify(&self) -> Result<(), String> {
        self.verify_variables()?;
        let params = self.params.iter();
        let params: HashSet<Var> = params.filter_map(|param| param.var.as_variable()).collect();
        self.blocks.iter().try_for_each(|block| {
            let verified = block.verify(self.n_variables(), &params);
            verified.map_err(|error| format!("{}: {error}", block.name))
        })
    }

    fn verify_variables(&self) -> Result<(), String> {
        let mut start = 0;
        for block in &self.variables {
            let expected = block.components.len() * n_places(&block.ranges);
            if block.start != start || block.bounds.len() != expected {
                return Err(format!(
                    "`{}` starts at {} with {} variables, not at {start} with {expected}",
                    block.name,
                    block.start,
                    block.bounds.len()
                ));
            }
            start += expected;
            let between = |b: &&super::Bounds| {
                b.lower <= b.guess && b.guess <= b.upper && b.guess.is_finite()
            };
            if let Some(bounds) = block.bounds.iter().find(|bounds| !between(bounds)) {
                return Err(format!("the bounds of `{}` are {bounds:?}", block.name));
            }
        }
        Ok(())
    }
}

impl Block<'_> {
    fn verify(&self, n_variables: usize, params: &HashSet<Var>) -> Result<(), String> {
        let kernel = &self.kernel;
        let n = self.n_places();
        if self.arguments.len() != kernel.variables.len() * n
            || self.numbers.len() != kernel.numbers.len() * n
        {
            return Err(format!("there are {n} places, and not as many arguments"));
        }
        if let Some(index) = self.arguments.iter().find(|i| **i as usize >= n_variables) {
            return Err(format!("there is no variable {index}"));
        }
        if let Some(number) = self.numbers.iter().find(|number| !number.is_finite()) {
            return Err(format!("a number is {number}"));
        }

        let mut formals = params.clone();
        let mut arguments = kernel.variables.iter().chain(&kernel.numbers);
        if !arguments.all(|&formal| formals.insert(formal)) {
            return Err("an argument is named twice".to_owned());
        }
        let occurring = variables_of(&kernel.outputs).into_iter();
        if let Some(var) = occurring.into_iter().find(|var| !formals.contains(var)) {
            let exprs = kernel.outputs[0].exprs();
            return Err(format!("`{}` is no argument", exprs.name(var)));
        }

        let mut nonsmooth = None;
        rewrite_all(&kernel.outputs, &mut |e| {
            if e.node().is_nonsmooth() {
                nonsmooth.get_or_insert(e);
            }
            e
        });
        if let Some(e) = nonsmooth {
            return Err(format!("`{e}` is not smooth"));
        }

        let bounded = match self.kind {
            Kind::Inequality => kernel.outputs.len(),
            _ => 0,
        };
        let is_bound = |&(lower, upper): &(f64, f64)| {
            lower <= upper && (lower.is_finite() || upper.is_finite())
        };
        if self.bounds.len() != bounded || !self.bounds.iter().all(is_bound) {
            return Err(format!("the bounds of its outputs are {:?}", self.bounds));
        }
        let per_source = if self.kind == Kind::Pair { 2 } else { 1 };
        if kernel.outputs.len() != per_source * self.sources.len() {
            return Err(format!(
                "{} outputs have {} sources",
                kernel.outputs.len(),
                self.sources.len()
            ));
        }
        Ok(())
    }
}
