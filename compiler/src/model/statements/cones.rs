//! Second-order cones: rows r ≥ |p| with r and p affine in what a program solves for.
//!
//! (r, p) and the multiplier (s, q) of such a row are in the cone and at a right angle to each other, s r + q·p = 0. They
//! are the two parts into which Moreau's decomposition cuts (w, e) of the cone:
//!
//! (r, p) = (1 - μ) (w, e),  (s, q) = μ (w, -e),  w² - |e|² = ξ + η,  0 ≤ ξ ⟂ μ ≥ 0,  0 ≤ η ⟂ 1 - μ ≥ 0
//!
//! Inside of the cone μ is 0, on its surface 0 < μ < 1 with w = |e|, and at its apex 1. Unlike r - |p|, all of this has
//! derivatives on the axis of the cone and at its apex. w is a square, as -(w, e) would satisfy the rest, too. Where row and
//! multiplier vanish together, w = 0, there is no derivative.
//!
//! Moreau 1962.

use crate::expr::{Expr, Function, Node, Var};
use crate::model::{Complementarity, Equation, Multiplier};
use crate::source::Span;

/// Where Newton's method starts: on the axis.
const ROOT: f64 = 1.0;
const SHARE: f64 = 0.5;

/// A row r ≥ |p|.
#[derive(Clone, Debug)]
pub struct Cone<'e> {
    /// r.
    pub radius: Expr<'e>,
    /// p.
    pub entries: Vec<Expr<'e>>,
}

/// What states that a row holds, besides its part of the stationarity.
pub(crate) struct Conditions<'e> {
    pub multipliers: Vec<Multiplier<'e>>,
    pub equations: Vec<Equation<'e>>,
    pub complementarities: Vec<Complementarity<'e>>,
    /// s, and q entry by entry.
    pub dual: (Expr<'e>, Vec<Expr<'e>>),
}

impl<'e> Cone<'e> {
    /// r and p of a row `value` ≥ 0 that is r - √(Σ p²) with r and p affine in `vars`, and r not constant in these.
    pub fn of(value: Expr<'e>, vars: &[Var]) -> Option<Self> {
        let Node::Sum { terms, .. } = value.node() else {
            return None;
        };
        let holds_z = |e: Expr<'e>| vars.iter().any(|&var| e.depends_on(var));
        let is_root = |term: &Expr<'e>| matches!(term.node(), Node::Unary(Function::Sqrt, _));
        let mut roots = (terms.iter()).filter(|(_, term)| is_root(term) && holds_z(*term));
        let (&(c, root), None) = (roots.next()?, roots.next()) else {
            return None;
        };
        let Node::Unary(Function::Sqrt, square) = root.node() else {
            return None;
        };
        let Node::Sum { constant, terms } = square.node() else {
            return None;
        };
        let mut entries = Vec::new();
        for (weight, term) in terms {
            let Node::Product(factors) = term.node() else {
                return None;
            };
            if weight < 0.0 || factors.iter().any(|(_, power)| power % 2 != 0) {
                return None;
            }
            let bases = factors.iter().map(|(base, power)| base.powi(power / 2));
            entries.push(bases.fold(value.exprs().constant(-c * weight.sqrt()), |p, q| p * q));
        }
        if constant > 0.0 {
            entries.push(value.exprs().constant(-c * constant.sqrt()));
        }
        let radius = value - c * root;
        let is_affine = |e: &Expr<'e>| vars.iter().all(|&var| !holds_z(e.diff(var)));
        let is_cone = c < 0.0 && constant >= 0.0 && holds_z(radius);
        let affine = is_affine(&radius) && entries.iter().all(is_affine);
        (is_cone && affine).then_some(Cone { radius, entries })
    }

    /// What `conditions` declares, in that order, where row and multiplier have these values.
    pub fn split(row: &[f64], multiplier: &[f64]) -> Vec<f64> {
        let w = (row[0] + multiplier[0]).max(0.0);
        let share = if w > 0.0 { multiplier[0] / w } else { SHARE };
        let axis = || row[1..].iter().zip(&multiplier[1..]).map(|(p, q)| p - q);
        let rest = (w * w - axis().map(|e| e * e).sum::<f64>()).max(0.0);
        let (inside, beyond) = if share < SHARE {
            (rest, 0.0)
        } else {
            (0.0, rest)
        };
        [share, inside, beyond, w.sqrt()]
            .into_iter()
            .chain(axis())
            .collect()
    }

    /// The conditions of the k-th row, k from 1, of the program of this name.
    pub(crate) fn conditions(&self, program: &str, k: usize, span: Span) -> Conditions<'e> {
        let exprs = self.radius.exprs();
        let mut multipliers = Vec::new();
        let mut unknown = |name: String, guess: f64| {
            let name = format!("{program}.{name}");
            let var = exprs.variable(&name);
            multipliers.push(Multiplier {
                var,
                name,
                guess,
                span,
            });
            var
        };
        let share = unknown(format!("share[{k}]"), SHARE);
        let inside = unknown(format!("inside[{k}]"), 0.0);
        let beyond = unknown(format!("beyond[{k}]"), 0.0);
        let root = unknown(format!("root[{k}]"), ROOT);
        let axis: Vec<Expr<'e>> = (1..=self.entries.len())
            .map(|i| unknown(format!("axis[{k},{i}]"), 0.0))
            .collect();
        let w = root * root;
        let squares = exprs.sum(axis.iter().map(|&e| e * e));
        let radius = self.radius - (1.0 - share) * w;
        let entries = self.entries.iter().zip(&axis);
        let entries = entries.map(|(&p, &e)| p - (1.0 - share) * e);
        let surface = w * w - squares - inside - beyond;
        let pair = |a: Expr<'e>, b: Expr<'e>| Complementarity {
            members: [a, b],
            spans: [span, span],
            span,
        };
        Conditions {
            multipliers,
            equations: (entries.chain([radius, surface]))
                .map(|residual| Equation { residual, span })
                .collect(),
            complementarities: vec![pair(inside, share), pair(beyond, 1.0 - share)],
            dual: (share * w, axis.iter().map(|&e| -(share * e)).collect()),
        }
    }
}
