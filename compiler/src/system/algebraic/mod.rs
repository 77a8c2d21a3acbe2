//! Algebraic states: 0 = F(t, x, z) and 0 ≤ a(t, x, z) ⟂ b(t, x, z) ≥ 0, with as many rows as entries of z.
//!
//! 1. Every row is matched with an entry of z that it holds, and the rows are put in block-triangular order
//!    ([`crate::system::algebraic::matching`]). Where that is not possible, or one member of a pair alone would leave nothing to
//!    match, the index is above one.
//! 2. A block of one equation that is c z + r, c a number or a parameter, is z = -r/c, and z is no unknown any more.
//! 3. What is left becomes states with z' = Σ α, one α for each equation, which keeps ψ = F at zero, and two for each
//!    pair, which keep ψ = -a or ψ = -b there.
//!
//! On F = 0 the rates z' solve F_z z' = -(F_x x' + F_t); the solution is that of the equations as long as F_z is
//! regular and the start satisfies them (Hairer & Wanner 1996, section VI.1).

pub(crate) mod cones;
pub mod following;
pub(crate) mod matching;
pub(crate) mod programs;
pub(crate) mod projections;
use miette::LabeledSpan;
use rustc_hash::FxHashMap;

use super::lower::instance::Instance;
use super::lower::translation::Translation;
use super::{Role, State, SystemError};
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Node, Substitution, Var, variables_of};
use crate::model::{Model, SwitchKind};
use crate::source::Span;
use crate::system::algebraic::matching::Matching;
use crate::system::switches::known::Known;
use crate::system::switches::surface;

/// An equation or a pair.
struct Row<'e> {
    /// F, or a and b, in the variables of the model.
    exprs: Vec<Expr<'e>>,
    /// Unknowns in each of them.
    unknowns: Vec<Vec<usize>>,
    /// Where they stand.
    spans: Vec<Span>,
    span: Span,
}

impl Row<'_> {
    fn is_pair(&self) -> bool {
        self.exprs.len() == 2
    }

    /// All unknowns.
    fn all(&self) -> Vec<usize> {
        let mut all = self.unknowns.concat();
        all.sort_unstable();
        all.dedup();
        all
    }
}

/// An entry of z that is computed with the states.
#[derive(Clone)]
pub(crate) struct Unknown<'e> {
    pub var: Expr<'e>,
    pub name: String,
    pub span: Span,
}

/// Rows and unknowns that are left where what equations give explicitly is replaced, in pairs of a matching.
#[derive(Default)]
pub(crate) struct Implicit<'e> {
    rows: Vec<ImplicitRow<'e>>,
}

struct ImplicitRow<'e> {
    /// F, or a and b, and where they stand.
    members: Vec<(Expr<'e>, Span)>,
    unknown: Unknown<'e>,
}

impl<'e> Implicit<'e> {
    /// Adds what equations give explicitly to `given`.
    pub fn of(
        instance: &Instance<'_, 'e>,
        given: &mut Substitution<'e>,
        diags: &mut Diagnostics,
    ) -> Self {
        let mut implicit = Implicit::default();
        if !instance.needs.algebraic {
            return implicit;
        }
        let entries = instance.model.algebraic_entries();
        let unknowns: Vec<Unknown<'e>> = entries
            .map(|(var, name, span)| Unknown { var, name, span })
            .collect();
        let rows = rows_of(instance, given, &unknowns);
        let incidence: Vec<Vec<usize>> = rows.iter().map(Row::all).collect();
        let Some(matching) = matched(&rows, &incidence, &unknowns, diags) else {
            return implicit;
        };
        let mut explicit = Substitution::new();
        for block in matching.blocks(&incidence) {
            for &row in &block {
                let Some(z) = matching.of_row[row] else {
                    continue;
                };
                let var = unknowns[z].var.as_variable();
                let solved = match block.len() {
                    1 if !rows[row].is_pair() => {
                        var.and_then(|var| solved(rows[row].exprs[0], var, &instance.params))
                    }
                    _ => None,
                };
                match (solved, var) {
                    (Some(value), Some(var)) => explicit.insert(var, value.substitute(&explicit)),
                    _ => implicit.rows.push(ImplicitRow {
                        members: rows[row]
                            .exprs
                            .iter()
                            .copied()
                            .zip(rows[row].spans.iter().copied())
                            .collect(),
                        unknown: unknowns[z].clone(),
                    }),
                }
            }
        }
        given.then(&explicit);
        for z in unknowns.iter().filter_map(|z| z.var.as_variable()) {
            if let Some(value) = explicit.get(z) {
                given.insert(z, value);
            }
        }
        implicit
    }

    /// The variables that stay unknown.
    pub fn vars(&self) -> impl Iterator<Item = Expr<'e>> + '_ {
        self.rows.iter().map(|row| row.unknown.var)
    }

    /// Makes switches of what is left, whose α are the rates of its unknowns.
    pub fn states(
        &self,
        translation: &mut Translation<'_, 'e>,
        guesses: &FxHashMap<Var, f64>,
        diags: &mut Diagnostics,
    ) -> Vec<State<'e>> {
        let instance = translation.instance;
        let exprs = instance.model.exprs;
        let mut states = Vec::new();
        for row in &self.rows {
            let mut alphas = Vec::new();
            for &(e, span) in &row.members {
                let e = translation.replace(e, span);
                translation.check(e, span, diags);
                let e = translation.switches.entries.merged(e);
                let (name, psi) = match row.members.len() {
                    2 => (e.to_string(), -e),
                    _ => (format!("0 = {e}"), e),
                };
                alphas.push(translation.switches.keep(psi, &name, span));
            }
            match alphas[..] {
                [a, b] => {
                    translation.switches.list[a].role = Role::Member(b);
                    translation.switches.list[b].role = Role::Member(a);
                }
                _ => translation.switches.list[alphas[0]].role = Role::Equation,
            }
            let alpha = |&k: &usize| exprs.expr(translation.switches.list[k].alpha);
            let guess = row.unknown.var.as_variable();
            let known = |var: Var| guesses.get(&var).or(instance.values().numbers.get(&var));
            let guess = guess.and_then(|var| known(var).copied());
            states.push(State {
                name: row.unknown.name.clone(),
                var: row.unknown.var,
                initial: guess.unwrap_or(f64::NAN),
                rate: exprs.sum(alphas.iter().map(alpha)),
                span: row.unknown.span,
            });
        }
        states
    }
}

fn rows_of<'e>(
    instance: &Instance<'_, 'e>,
    given: &Substitution<'e>,
    unknowns: &[Unknown<'e>],
) -> Vec<Row<'e>> {
    let place = unknowns.iter().enumerate();
    let place: FxHashMap<Var, usize> = place
        .filter_map(|(k, z)| Some((z.var.as_variable()?, k)))
        .collect();
    let direct = direct_switches(instance.model, given);
    let occurring = |e: Expr<'e>| {
        let vars = variables_of(&[e.substitute(&direct)]);
        let mut found: Vec<usize> = vars.iter().filter_map(|v| place.get(v).copied()).collect();
        found.sort_unstable();
        found
    };
    let row = |exprs: &[Expr<'e>], spans: &[Span], span: Span| {
        let exprs: Vec<Expr<'e>> = exprs.iter().map(|e| e.substitute(given)).collect();
        Row {
            unknowns: exprs.iter().map(|&e| occurring(e)).collect(),
            exprs,
            spans: spans.to_vec(),
            span,
        }
    };
    let equations = instance.model.statements.equations.iter();
    let equations = equations.map(|e| row(&[e.residual], &[e.span], e.span));
    let pairs = instance.model.statements.complementarities.iter();
    equations
        .chain(pairs.map(|pair| row(&pair.members, &pair.spans, pair.span)))
        .collect()
}

/// Named switches as the functions they are.
fn direct_switches<'e>(model: &Model<'e>, given: &Substitution<'e>) -> Substitution<'e> {
    let switches = model.switches.iter();
    let named = switches.flat_map(|switch| {
        let entries = switch.vars.iter().zip(&switch.psi);
        entries.filter_map(|(var, &psi)| {
            let value = match switch.kind {
                SwitchKind::Sign => psi.sign(),
                SwitchKind::Step | SwitchKind::Relay(_) => psi.step(),
            };
            Some((var.as_variable()?, value.substitute(given)))
        })
    });
    let mut direct: Substitution<'e> = named.collect();
    // Switches inside others come out after as many rounds as there are switches.
    for _ in 0..model.switches.len().min(8) {
        let inner = direct.clone();
        direct.then(&inner);
    }
    direct
}

/// A matching of all rows, also where either member of a pair stands alone.
fn matched(
    rows: &[Row<'_>],
    incidence: &[Vec<usize>],
    unknowns: &[Unknown<'_>],
    diags: &mut Diagnostics,
) -> Option<Matching> {
    let mut matching = Matching::of(incidence, unknowns.len());
    let name = |z: usize| format!("`{}`", unknowns[z].name);
    if let Some(row) = (0..rows.len()).find(|&row| matching.of_row[row].is_none()) {
        let reached = matching.augment(incidence, row).err().unwrap_or_default();
        let mut held: Vec<usize> = reached.iter().flat_map(|&r| incidence[r].clone()).collect();
        held.sort_unstable();
        held.dedup();
        let free = (0..unknowns.len()).filter(|&z| matching.of_unknown[z].is_none());
        let label = |&r: &usize| {
            LabeledSpan::new_with_span(
                Some(listed(incidence[r].iter().copied().map(name))),
                rows[r].span,
            )
        };
        diags.push(SystemError::HighIndex {
            held: match held.is_empty() {
                true => "this equation holds no algebraic state".to_owned(),
                false => format!(
                    "these equations hold {} only",
                    listed(held.into_iter().map(name))
                ),
            },
            free: listed(free.map(name)),
            rows: reached.iter().map(label).collect(),
        });
        return None;
    }
    for (r, row) in rows.iter().enumerate().filter(|(_, row)| row.is_pair()) {
        for side in 0..2 {
            let mut alone = incidence.to_vec();
            alone[r].clone_from(&row.unknowns[side]);
            let is_matched = matching.of_row[r].is_some_and(|z| alone[r].contains(&z));
            if is_matched {
                continue;
            }
            let mut other = matching.clone();
            other.release(r);
            if other.augment(&alone, r).is_err() {
                diags.push(SystemError::HighIndexPair {
                    span: row.spans[side],
                    other: row.spans[1 - side],
                });
                return None;
            }
        }
    }
    Some(matching)
}

fn listed(names: impl Iterator<Item = String>) -> String {
    let names: Vec<String> = names.collect();
    match names.is_empty() {
        true => "no algebraic state".to_owned(),
        false => names.join(", "),
    }
}

/// -r/c where e is c z + r, and c a number or a parameter that is not zero.
fn solved<'e>(e: Expr<'e>, z: Var, params: &Known) -> Option<Expr<'e>> {
    let terms = match e.node() {
        Node::Sum { terms, .. } => terms,
        _ => vec![(1.0, e)],
    };
    let exprs = e.exprs();
    let mut slope = exprs.constant(0.0);
    for (c, term) in terms.into_iter().filter(|(_, term)| term.depends_on(z)) {
        let factor = match term.node() {
            Node::Variable(_) => exprs.constant(1.0),
            Node::Product(factors) => {
                let own = factors.iter().filter(|(factor, _)| factor.depends_on(z));
                let own: Vec<_> = own.collect();
                let [(factor, 1)] = own[..] else {
                    return None;
                };
                factor.as_variable()?;
                term.diff(z)
            }
            _ => return None,
        };
        slope = slope + c * factor;
    }
    let size = surface::parameter(slope, params).unwrap_or(f64::NAN);
    let rest = e.substitute(&Substitution::one(z, exprs.constant(0.0)));
    (size.is_finite() && size != 0.0).then(|| -rest / slope)
}
