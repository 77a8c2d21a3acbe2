//! A branch of sliding modes by its own α in place of time.
//!
//! x' = f(t, x, α, w),   0 = φ(t, x, α),   0 = r(t, x, α, w)
//!
//! has, with σ = ±α and T = dt/dσ, along the branch
//!
//! dx/dσ = T f,   dt/dσ = T,   0 = φ,   0 = r,   where dφ/dσ = ±∂φ/∂α + T (∇φ·f + ∂φ/∂t) = 0 determines T
//!
//! It is smooth where T = 0: a sliding fold, at which α as a function of time is not.

use nsd_solver::fesd::{Reduced, Watched, Zero};
use nsd_solver::simulate::Partials;

use super::active::{sides, sliding};
use super::complementarity::{Complementarity, variable};
use super::reduce::{Remainder, eliminate};
use crate::expr::{Expr, Substitution, Var, variables_of};

impl<'e> Complementarity<'e> {
    /// The functions while these members are zero, by the algebraic variable at place `i`; none where other unknowns
    /// occur in what determines it.
    pub(super) fn compile_branch(&self, zeros: &[Zero], i: usize, rises: bool) -> Option<Reduced> {
        let exprs = self.exprs;
        let fixed = self.fixed(zeros)?;
        let Remainder {
            unknowns,
            residuals,
            given,
        } = eliminate(&self.equations, &self.algebraics, &fixed)?;
        let rates = given.apply(&self.rates);
        let phi = self.differentiate(residuals, &unknowns, &rates).hidden;
        let followed = self.algebraics[i];
        let mut others = unknowns.clone();
        others.retain(|var| *var != followed);
        let determines = |row: &Expr<'e>| {
            let vars = variables_of(&[*row]);
            vars.contains(&followed) && !others.iter().any(|other| vars.contains(other))
        };
        let own = phi.iter().position(determines)?;

        let [sigma, speed, left] = <[Expr; 3]>::try_from(exprs.variables("branch", 3)).ok()?;
        let (value, sign) = if rises { (sigma, 1.0) } else { (-sigma, -1.0) };
        let by_sigma = Substitution::one(followed, value);
        let row = phi[own];
        let along = self.along(row, &variables_of(&[row]), &rates);
        let mut hidden = phi.clone();
        hidden[own] = row.diff(followed) * sign + speed * along;

        let mut functions: Vec<Expr> = rates.iter().map(|&rate| speed * rate).collect();
        functions.extend([speed, -speed]);
        functions.extend(&phi);
        let functions = by_sigma.apply(&functions);
        let algebraics = self.values(&given);
        let (mut watched, mut members) = self.members_of(zeros, &algebraics, &[])?;
        watched.extend(
            [Watched {
                pair: self.pairs.len(),
                stops: false,
            }; 2],
        );
        members.extend([speed, left]);
        let members = by_sigma.apply(&members);
        let alphas = given.apply(&self.alphas);
        let sides = sides(&alphas);
        let sliding = sliding(&alphas, &sides);

        let [sigma, speed, left] = [sigma, speed, left].map(variable);
        let states = self.states.iter().copied().chain([self.time, left]);
        let inputs: Vec<Var> = [sigma].into_iter().chain(states).chain([speed]).collect();
        let inputs = [&inputs[..], &others].concat();
        let hidden = by_sigma.apply(&hidden);
        let none = Partials::none(0);
        Some(Reduced {
            unknowns: [&[i][..], &self.places(&others)].concat(),
            equations: self.tape(&inputs, &functions),
            slopes: self.partials(&inputs, &functions, &inputs),
            hidden: self.tape(&inputs, &hidden),
            hidden_slopes: self.partials(&inputs, &hidden, &inputs),
            algebraics: none.tape,
            kept: None,
            members: self.tape(&inputs, &members),
            member_slopes: self.partials(&inputs, &members, &inputs),
            watched,
            sides,
            alphas: self.tape(&inputs, &by_sigma.apply(&sliding)),
            is_direct: false,
            has_branches: false,
            is_linear: false,
        })
    }
}
