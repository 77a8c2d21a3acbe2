//! A complementarity system in one active set.
//!
//! The zero members are substituted. An equation in which an algebraic variable stands alone, with
//! a constant factor, then gives that variable:
//!
//! 0 = g(t, x, z) + c z_i,  z_i not in g   ->   z_i = -g/c everywhere
//!
//! In a region of Stewart's form this leaves x' = f_r(x), λ = g - g_r, and no unknown; on a surface
//! between two it leaves x' = F θ with one θ, and 0 = g_1 - g_2 in place of their λ and μ.

use std::collections::VecDeque;

use rustc_hash::{FxHashMap, FxHashSet};

use crate::expr::{Expr, Substitution, Var, variables_of};

/// What is left of the equations.
pub(super) struct Remainder<'e> {
    /// Variables that no equation gives, in order.
    pub unknowns: Vec<Var>,
    /// As many equations, 0 = r.
    pub residuals: Vec<Expr<'e>>,
    /// All other variables, in terms of unknowns, states and time.
    pub given: Substitution<'e>,
}

/// Solves equations for as many of the `variables` as stand alone; `fixed` are known already. None
/// where that contradicts an equation, or leaves another number of unknowns than equations.
pub(super) fn eliminate<'e>(
    equations: &[Expr<'e>],
    variables: &[Var],
    fixed: &Substitution<'e>,
) -> Option<Remainder<'e>> {
    let free: FxHashSet<Var> = variables
        .iter()
        .copied()
        .filter(|var| !fixed.contains(var))
        .collect();
    let mut rows: Vec<Option<Expr<'e>>> = fixed.apply(equations).into_iter().map(Some).collect();
    let mut holders: FxHashMap<Var, Vec<usize>> = FxHashMap::default();
    for (at, row) in rows.iter().enumerate() {
        for var in row.iter().flat_map(|row| variables_of(&[*row])) {
            if free.contains(&var) {
                holders.entry(var).or_default().push(at);
            }
        }
    }
    let mut solved: Vec<(Var, Expr<'e>)> = Vec::new();
    let mut queue: VecDeque<usize> = (0..rows.len()).collect();
    while let Some(at) = queue.pop_front() {
        let Some(row) = rows[at] else { continue };
        let Some((var, value)) = alone(row, &free, &holders) else {
            continue;
        };
        rows[at] = None;
        let one = Substitution::one(var, value);
        for other in holders.remove(&var).unwrap_or_default() {
            let Some(row) = rows[other] else { continue };
            let row = row.substitute(&one);
            for inner in variables_of(&[row]) {
                let known = holders.entry(inner).or_default();
                if free.contains(&inner) && !known.contains(&other) {
                    known.push(other);
                }
            }
            rows[other] = Some(row);
            queue.push_back(other);
        }
        solved.push((var, value));
    }

    // What was solved for later may occur in what was solved for earlier.
    let mut given = fixed.clone();
    for (var, value) in solved.into_iter().rev() {
        given.insert(var, value.substitute(&given));
    }
    let mut residuals = Vec::new();
    for row in rows.into_iter().flatten() {
        match row.as_constant() {
            Some(0.0) => {}
            Some(_) => return None,
            None => residuals.push(row),
        }
    }
    let mut unknowns: Vec<Var> = free
        .into_iter()
        .filter(|var| !given.contains(var))
        .collect();
    unknowns.sort_unstable();
    (unknowns.len() == residuals.len()).then_some(Remainder {
        unknowns,
        residuals,
        given,
    })
}

/// The variable that a row gives, and its value: one that occurs in the fewest other rows.
fn alone<'e>(
    row: Expr<'e>,
    free: &FxHashSet<Var>,
    holders: &FxHashMap<Var, Vec<usize>>,
) -> Option<(Var, Expr<'e>)> {
    let candidates = variables_of(&[row])
        .into_iter()
        .filter(|var| free.contains(var));
    let mut candidates: Vec<(usize, Var)> = candidates
        .map(|var| (holders.get(&var).map_or(0, Vec::len), var))
        .collect();
    candidates.sort_unstable();
    candidates.into_iter().find_map(|(_, var)| {
        let factor = row
            .diff(var)
            .as_constant()
            .filter(|factor| *factor != 0.0)?;
        let zero = row.exprs().constant(0.0);
        let rest = row.substitute(&Substitution::one(var, zero));
        Some((var, rest * (-1.0 / factor)))
    })
}
