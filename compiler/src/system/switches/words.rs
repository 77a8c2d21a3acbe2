//! Switches in the words of the user.

use crate::expr::{Expr, Substitution};
use crate::system::switches::{Collected, Switches};

impl<'e> Switches<'e> {
    /// The name of a switch: the user's words, else ψ as it is written.
    pub fn name_of(&self, k: usize) -> String {
        let switch = &self.list[k];
        if let Some(name) = &switch.name {
            return name.clone();
        }
        self.in_steps(switch.written).to_string()
    }

    /// The expression as a user may write it, with `step` instead of α.
    pub fn written(&self, e: Expr<'e>) -> String {
        self.in_steps(self.entries.merged(e)).to_string()
    }

    /// Every α replaced by `step`.
    fn in_steps(&self, mut e: Expr<'e>) -> Expr<'e> {
        loop {
            e = self.entries.in_alphas(e);
            // ψ holds α of earlier switches only.
            let last = self.entries.alphas_of(e).pop();
            let Some(inner) = last.and_then(|alpha| self.entries.of_alpha(alpha)) else {
                return e;
            };
            let Collected { alpha, written, .. } = self.list[inner];
            e = e.substitute(&Substitution::one(alpha, written.step()));
        }
    }
}
