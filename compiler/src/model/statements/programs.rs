//! `z in argmin F subject to { .. };` and `z in variational K solves F;` by their optimality conditions.
//!
//! z ∈ argmin F(z) over { H(z) ≥ 0, G(z) = 0 }   becomes   0 = ∇F - ∇H μ - ∇G ν,  0 ≤ μ ⟂ H ≥ 0,  0 = G
//!
//! which is what z solves where F is convex, H concave and G affine, and some z satisfies H > 0 or H is affine (Boyd &
//! Vandenberghe 2004). A variational inequality has its map in the place of ∇F (Facchinei & Pang 2003). A ball r - |z| ≥ 0 has no derivative in its centre, and r² - |z|² ≥ 0 takes its place.

use super::cones::Cone;
use super::dynamics::Walk;
use crate::expr::{Expr, Function, Node, Var, rewrite};
use crate::model::expressions::{Lowering, rows};
use crate::model::names::scope::{Meaning, Reported};
use crate::model::{Complementarity, DynamicsError, Equation, TargetKind, Tensor};
use crate::source::Span;
use crate::syntax::{self, ProgramKind, Relation};

/// A multiplier of a row of a program, or another number that says how a row holds.
#[derive(Clone, Debug)]
pub struct Multiplier<'e> {
    /// Its variable.
    pub var: Expr<'e>,
    /// `z.multiplier[2]`
    pub name: String,
    /// Where Newton's method starts.
    pub guess: f64,
    /// The row.
    pub span: Span,
}

/// `z in argmin F subject to { .. }` or `z in variational K solves F`.
#[derive(Clone, Debug)]
pub struct Program<'e> {
    /// z.
    pub unknowns: Vec<Expr<'e>>,
    /// ∇F, or the map of a variational inequality.
    pub map: Vec<Expr<'e>>,
    /// F of a minimization, and where it stands.
    pub objective: Option<(Expr<'e>, Span)>,
    /// The set.
    pub rows: Vec<ProgramRow<'e>>,
    /// What says how each row holds: its multiplier, or that and more.
    pub multipliers: Vec<Vec<Expr<'e>>>,
}

/// H >= 0 or G = 0.
#[derive(Clone, Debug)]
pub struct ProgramRow<'e> {
    /// H or G.
    pub value: Expr<'e>,
    /// True for G = 0.
    pub is_equation: bool,
    /// H as a second-order cone.
    pub cone: Option<Cone<'e>>,
    /// r of a ball, H = r² - |z|², which is not negative.
    pub radius: Option<Expr<'e>>,
    /// The row.
    pub span: Span,
}

impl<'e> Walk<'e> {
    /// One program: its conditions become equations and complementarities.
    pub(crate) fn program(
        &mut self,
        lowering: &mut Lowering<'_, 'e>,
        program: &syntax::Program,
    ) -> Result<(), Reported> {
        let Some(Meaning::Value(value, TargetKind::Algebraic(_))) =
            lowering.names.scope.get(&program.name.name)
        else {
            return Err(Reported);
        };
        let z = value.tensor.clone();
        let vars: Vec<Var> = z.data.iter().filter_map(|e| e.as_variable()).collect();
        let (map, objective, rows) = match &program.kind {
            ProgramKind::Argmin { objective, rows } => {
                let what = "what is minimized";
                let value = lowering.scalar(objective, what)?;
                smooth(lowering, value, &vars, what, objective.span)?;
                let gradient = vars.iter().map(|&var| value.diff(var)).collect();
                let rows = constraints(lowering, &vars, rows)?;
                (gradient, Some((value, objective.span)), rows)
            }
            ProgramKind::VariationalRows { rows, map } => {
                let map = self.map(lowering, &z, &vars, map)?;
                (map, None, constraints(lowering, &vars, rows)?)
            }
            ProgramKind::VariationalBox { lower, upper, map } => {
                let map = self.map(lowering, &z, &vars, map)?;
                let what = "a bound";
                let lo = lowering.numbers_as(lower, z.shape, what)?;
                let hi = lowering.numbers_as(upper, z.shape, what)?;
                (map, None, bounds(&z, (&lo, lower.span), (&hi, upper.span)))
            }
        };
        let mut stationary = map.clone();
        let mut multipliers = Vec::new();
        let name = format!("{}{}", lowering.names.scope.prefix, program.name.name);
        for (k, row) in (1..).zip(&rows) {
            multipliers.push(self.conditions(&name, k, row, &vars, &mut stationary));
        }
        let span = objective.map_or(program.span, |(_, span)| span);
        self.found.equations.extend(
            stationary
                .into_iter()
                .map(|residual| Equation { residual, span }),
        );
        self.found.programs.push(Program {
            unknowns: z.data,
            map,
            objective,
            rows,
            multipliers,
        });
        Ok(())
    }

    /// Adds the conditions of the k-th row, and takes ∇H μ from ∇F; returns μ, or that and more of a cone.
    fn conditions(
        &mut self,
        program: &str,
        k: usize,
        row: &ProgramRow<'e>,
        vars: &[Var],
        stationary: &mut [Expr<'e>],
    ) -> Vec<Expr<'e>> {
        let (value, span) = (row.value, row.span);
        if let Some(cone) = &row.cone {
            let of_row = cone.conditions(program, k, span);
            let (along, across) = of_row.dual;
            for (sum, &var) in stationary.iter_mut().zip(vars) {
                let across = cone.entries.iter().zip(&across);
                let across = across.map(|(p, &q)| q * p.diff(var));
                let forces = across.chain([along * cone.radius.diff(var)]);
                *sum = *sum - value.exprs().sum(forces);
            }
            let multipliers = of_row.multipliers.iter().map(|m| m.var).collect();
            self.found.multipliers.extend(of_row.multipliers);
            self.found.equations.extend(of_row.equations);
            self.found
                .complementarities
                .extend(of_row.complementarities);
            return multipliers;
        }
        let name = format!("{program}.multiplier[{k}]");
        let multiplier = value.exprs().variable(&name);
        for (sum, &var) in stationary.iter_mut().zip(vars) {
            *sum = *sum - multiplier * value.diff(var);
        }
        self.found.multipliers.push(Multiplier {
            var: multiplier,
            name,
            guess: 0.0,
            span,
        });
        if row.is_equation {
            let residual = value;
            self.found.equations.push(Equation { residual, span });
        } else {
            self.found.complementarities.push(Complementarity {
                members: [multiplier, value],
                spans: [span, span],
                span,
            });
        }
        vec![multiplier]
    }

    fn map(
        &self,
        lowering: &mut Lowering<'_, 'e>,
        z: &Tensor<'e>,
        vars: &[Var],
        map: &syntax::Expr,
    ) -> Result<Vec<Expr<'e>>, Reported> {
        let value = lowering.numbers_as(map, z.shape, "the map")?;
        for &e in &value.data {
            smooth(lowering, e, vars, "the map", map.span)?;
        }
        Ok(value.data)
    }
}

/// H ≥ 0 and G = 0 of all rows.
fn constraints<'e>(
    lowering: &mut Lowering<'_, 'e>,
    vars: &[Var],
    rows: &[syntax::Row],
) -> Result<Vec<ProgramRow<'e>>, Reported> {
    let mut comparisons = Vec::new();
    rows::all(lowering, rows, &mut comparisons)?;
    let mut found = Vec::new();
    for comparison in &comparisons {
        let span = comparison.span;
        for (pair, relation) in comparison.members.windows(2).zip(&comparison.relations) {
            let (value, is_equation) = match relation {
                Relation::GreaterEqual | Relation::Greater => (pair[0] - pair[1], false),
                Relation::LessEqual | Relation::Less => (pair[1] - pair[0], false),
                Relation::Equal => (pair[0] - pair[1], true),
                Relation::Perp => {
                    let what = "a row is a complementarity, which stands in a model by itself";
                    let what = what.to_owned();
                    return lowering.error(DynamicsError::ProgramForm { what, span });
                }
            };
            if !vars.iter().any(|&var| value.depends_on(var)) {
                let what = "a row holds nothing that the program solves for".to_owned();
                return lowering.error(DynamicsError::ProgramForm { what, span });
            }
            let ball = (!is_equation).then(|| ball(value, vars)).flatten();
            let radius = ball.map(|(radius, _)| radius);
            let value = ball.map_or(value, |(_, value)| value);
            smooth(lowering, value, vars, "a row", span)?;
            found.push(ProgramRow {
                value,
                is_equation,
                cone: Cone::of(value, vars).filter(|_| !is_equation),
                radius,
                span,
            });
        }
    }
    Ok(found)
}

/// z - lo ≥ 0 and hi - z ≥ 0 where these are bounds.
fn bounds<'e>(
    z: &Tensor<'e>,
    (lo, lo_span): (&Tensor<'e>, Span),
    (hi, hi_span): (&Tensor<'e>, Span),
) -> Vec<ProgramRow<'e>> {
    let row = |value: Expr<'e>, span: Span| ProgramRow {
        value,
        is_equation: false,
        cone: None,
        radius: None,
        span,
    };
    let is_bound = |e: Expr<'e>| e.as_constant().is_none_or(f64::is_finite);
    let mut rows = Vec::new();
    for (k, &z) in z.data.iter().enumerate() {
        if is_bound(lo.data[k]) {
            rows.push(row(z - lo.data[k], lo_span));
        }
        if is_bound(hi.data[k]) {
            rows.push(row(hi.data[k] - z, hi_span));
        }
    }
    rows
}

/// r and r² - q where a row is r - √q in which r holds nothing of z.
fn ball<'e>(value: Expr<'e>, vars: &[Var]) -> Option<(Expr<'e>, Expr<'e>)> {
    let Node::Sum { terms, .. } = value.node() else {
        return None;
    };
    let holds_z = |e: Expr<'e>| vars.iter().any(|&var| e.depends_on(var));
    let mut moving = terms.into_iter().filter(|(_, term)| holds_z(*term));
    let (c, root) = moving.next()?;
    let Node::Unary(Function::Sqrt, square) = root.node() else {
        return None;
    };
    if c >= 0.0 || moving.next().is_some() {
        return None;
    }
    let radius = (value - c * root) * (-1.0 / c);
    (!holds_z(radius)).then(|| (radius, radius * radius - square))
}

/// Reports a kink in what is differentiated by z.
fn smooth<'e>(
    lowering: &mut Lowering<'_, 'e>,
    e: Expr<'e>,
    vars: &[Var],
    what: &str,
    span: Span,
) -> Result<(), Reported> {
    let mut bent = false;
    rewrite(e, &mut |node| {
        bent |= node.node().is_nonsmooth() && vars.iter().any(|&var| node.depends_on(var));
        node
    });
    match bent {
        true => {
            let what = format!("{what} has a kink or a jump in what the program solves for");
            lowering.error(DynamicsError::ProgramForm { what, span })
        }
        false => Ok(()),
    }
}
