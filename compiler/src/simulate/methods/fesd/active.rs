//! The functions of a complementarity system in one active set.

use nsd_solver::fesd::{Disc, Reduced, Watched, Zero};
use nsd_solver::simulate::Side;

use super::complementarity::Complementarity;
use super::reduce::{Remainder, eliminate};
use crate::expr::{self, Expr, Substitution, Var, variables_of};

/// Derivatives that are looked at for one that contains an unknown.
const MAX_DERIVATIVES: usize = 6;

/// Residuals as a finite element takes them.
pub(super) struct Differentiated<'e> {
    pub at_nodes: Vec<Expr<'e>>,
    pub hidden: Vec<Expr<'e>>,
    /// Whether none was differentiated.
    pub is_direct: bool,
}

impl<'e> Complementarity<'e> {
    /// The members that are zero, with their values.
    pub(super) fn fixed(&self, zeros: &[Zero]) -> Option<Substitution<'e>> {
        let mut fixed = Substitution::new();
        for (pair, &zero) in self.pairs.iter().zip(zeros) {
            let (member, _) = pair.split(zero);
            let value = if member.complement { 1.0 } else { 0.0 };
            let var = self.algebraics[member.variable];
            match fixed.get(var).and_then(Expr::as_constant) {
                Some(other) if other != value => return None,
                _ => fixed.insert(var, self.exprs.constant(value)),
            }
        }
        Some(fixed)
    }

    /// The last derivatives of residuals before an unknown appears in one, and those in which it does.
    pub(super) fn differentiate(
        &self,
        residuals: Vec<Expr<'e>>,
        unknowns: &[Var],
        rates: &[Expr<'e>],
    ) -> Differentiated<'e> {
        let contains_unknown =
            |vars: &[Var]| vars.iter().any(|var| unknowns.binary_search(var).is_ok());
        let (mut at_nodes, mut hidden) = (Vec::new(), Vec::new());
        let mut is_direct = true;
        for mut residual in residuals {
            let mut next = residual;
            let mut vars = variables_of(&[next]);
            for _ in 0..MAX_DERIVATIVES {
                if contains_unknown(&vars) {
                    break;
                }
                is_direct &= residual == next;
                residual = next;
                next = self.along(next, &vars, rates);
                vars = variables_of(&[next]);
            }
            at_nodes.push(residual);
            hidden.push(next);
        }
        Differentiated {
            at_nodes,
            hidden,
            is_direct,
        }
    }

    /// What must not be negative, with every z given; none where a member is. Discs that are idle bound nothing.
    pub(super) fn members_of(
        &self,
        zeros: &[Zero],
        algebraics: &[Expr<'e>],
        idle: &[Disc],
    ) -> Option<(Vec<Watched>, Vec<Expr<'e>>)> {
        let (mut watched, mut members) = (Vec::new(), Vec::new());
        for (at, (pair, &zero)) in self.pairs.iter().zip(zeros).enumerate() {
            let (_, member) = pair.split(zero);
            let disc = self.discs.iter().find(|disc| disc.pair == at);
            if disc.is_some_and(|disc| idle.contains(disc)) {
                continue;
            }
            let z = algebraics[member.variable];
            let value = if member.complement { 1.0 - z } else { z };
            match value.as_constant() {
                Some(constant) if constant < 0.0 => return None,
                Some(_) => {}
                None => {
                    watched.push(Watched {
                        pair: at,
                        stops: disc.is_some_and(|disc| disc.slip == member.variable),
                    });
                    members.push(value);
                }
            }
        }
        Some((watched, members))
    }

    /// Every z, by what is given.
    pub(super) fn values(&self, given: &Substitution<'e>) -> Vec<Expr<'e>> {
        let value = |&z: &Var| given.get(z).unwrap_or_else(|| self.exprs.expr(z));
        self.algebraics.iter().map(value).collect()
    }

    /// The functions while these members are zero.
    pub(super) fn compile(&self, zeros: &[Zero]) -> Option<Reduced> {
        let fixed = self.fixed(zeros)?;
        let idle = self.idle(&fixed);
        let equations = self.without(&idle);
        let shown = self.at_rest(&idle, fixed.clone(), true);
        let fixed = self.at_rest(&idle, fixed, false);
        let Remainder {
            unknowns,
            residuals,
            given,
        } = eliminate(&equations, &self.algebraics, &fixed)?;
        let inputs = self.inputs(&unknowns);
        let rates = given.apply(&self.rates);
        let Differentiated {
            at_nodes,
            hidden,
            is_direct,
        } = self.differentiate(residuals, &unknowns, &rates);
        let functions: Vec<Expr> = rates.iter().chain(&at_nodes).copied().collect();
        let shown = match idle.is_empty() {
            true => given,
            false => eliminate(&equations, &self.algebraics, &shown)?.given,
        };
        let algebraics = self.values(&shown);
        let (watched, members) = self.members_of(zeros, &algebraics, &idle)?;
        let alphas = shown.apply(&self.alphas);
        let mut sides = sides(&alphas);
        for (side, member) in sides.iter_mut().zip(&self.members) {
            if let Some((pair, zero)) = *member {
                *side = match zeros[pair] == zero {
                    true => Side::Slide,
                    false => Side::Minus,
                };
            }
        }
        for (disc, switches) in self.discs.iter().zip(&self.switches_of_discs) {
            for &switch in switches {
                sides[switch] = match zeros[disc.pair] {
                    Zero::Left if !idle.contains(disc) => Side::Slide,
                    _ => Side::Plus,
                };
            }
        }
        let kept = self.kept_on(&sides);
        let both = watched.into_iter().zip(members);
        let both = both.filter(|(watched, _)| !self.is_kept(watched, &kept));
        let (watched, members): (Vec<Watched>, Vec<Expr>) = both.unzip();
        let sliding = sliding(&alphas, &sides);
        let slopes = self.partials(&inputs, &functions, &inputs);
        let constant = expr::jacobian(&functions, &inputs[1..]).entries;
        Some(Reduced {
            unknowns: self.places(&unknowns),
            equations: self.tape(&inputs, &functions),
            slopes,
            hidden: self.tape(&inputs, &hidden),
            hidden_slopes: self.partials(&inputs, &hidden, &inputs),
            algebraics: self.tape(&inputs, &algebraics),
            kept: self.compile_kept(&kept),
            members: self.tape(&inputs, &members),
            member_slopes: self.partials(&inputs, &members, &inputs),
            watched,
            has_branches: (sides.iter().zip(&self.nonlinear))
                .any(|(side, nonlinear)| *nonlinear && *side == Side::Slide),
            sides,
            alphas: self.tape(&inputs, &sliding),
            is_direct,
            is_linear: constant
                .iter()
                .all(|(.., slope)| slope.as_constant().is_some()),
        })
    }
}

/// Sides of switches whose α are these; one that is no number slides.
pub(super) fn sides(alphas: &[Expr]) -> Box<[Side]> {
    let side = |alpha: &Expr| match alpha.as_constant() {
        Some(alpha) if alpha > 0.5 => Side::Plus,
        Some(_) => Side::Minus,
        None => Side::Slide,
    };
    alphas.iter().map(side).collect()
}

/// α of those that slide.
pub(super) fn sliding<'e>(alphas: &[Expr<'e>], sides: &[Side]) -> Vec<Expr<'e>> {
    let all = alphas.iter().zip(sides);
    let slide = all.filter(|(_, side)| **side == Side::Slide);
    slide.map(|(&alpha, _)| alpha).collect()
}
