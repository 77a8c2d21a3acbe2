//! Switches in the words of the user.

use super::switches::Switches;
use crate::expr::{Expr, Substitution};

impl<'e> Switches<'e> {
    /// The name of a switch: the user's words, else ψ in terms of `step` instead of α.
    pub fn name_of(&self, k: usize) -> String {
        let switch = &self.list[k];
        if let Some(name) = &switch.name {
            return name.clone();
        }
        self.in_steps(switch.psi, k).to_string()
    }

    /// The expression as a user may write it, with `step` instead of α.
    pub fn written(&self, e: Expr<'e>) -> String {
        self.in_steps(self.merged(e), self.list.len()).to_string()
    }

    /// The first `count` α replaced by `step`.
    fn in_steps(&self, e: Expr<'e>, count: usize) -> Expr<'e> {
        // Outer ones first: ψ holds α of earlier switches only.
        let inner = self.list[..count].iter().rev();
        inner.fold(e, |e, inner| {
            let step = (inner.alpha, inner.psi.step());
            e.substitute(&Substitution::from_iter([step]))
        })
    }
}
