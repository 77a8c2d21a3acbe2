//! Programs: whether they are convex, and whether they have a solution where a run starts.
//!
//! A second derivative that holds parameters alone decides. One that holds states is looked at where the run starts, and
//! one that holds what the program solves for at sample points of its feasible set: there a negative curvature is an
//! error, and none is no proof, which is told as a warning.

use nalgebra::DMatrix;
use nsd_solver::optimization::qp;
use nsd_solver::optimization::qp::HalfSpace;

use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Var, variables_of};
use crate::model::{Data, Program, ProgramRow};
use crate::source::Span;
use crate::system::SystemError;
use crate::system::lower::instance::Instance;

/// Curvatures below this fraction of the largest entry are rounding.
const FLAT: f64 = 1e-9;

/// Points that are looked at.
const SAMPLES: usize = 60;

/// Violations of rows below this are none.
const FEASIBLE: f64 = 1e-7;

/// What is known of a curvature.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Curvature {
    /// Nowhere negative.
    Proven,
    /// Not negative where it was looked at.
    Sampled,
    /// Negative somewhere.
    Negative,
}

/// The programs of a model where a run starts.
pub(crate) struct Programs<'s, 'm, 'e> {
    pub instance: &'s Instance<'m, 'e>,
    /// Functions of time.
    pub data: &'s [Data<'e>],
}

impl<'e> Programs<'_, '_, 'e> {
    /// Checks all programs; returns where convexity was sampled only.
    pub(crate) fn check(&self, diags: &mut Diagnostics) -> Vec<Span> {
        let mut sampled = Vec::new();
        if !self.instance.needs.algebraic {
            return sampled;
        }
        let signals = &self.instance.values().signals;
        for program in &self.instance.model.statements.programs {
            let before = diags.errors().count();
            let rows: Vec<ProgramRow<'e>> = (program.rows.iter())
                .map(|row| ProgramRow {
                    value: row.value.substitute(signals),
                    ..row.clone()
                })
                .collect();
            let objective = program.objective.iter();
            let objective =
                objective.map(|&(e, span)| (e.substitute(signals), 1.0, span, "what is minimized"));
            let concave = rows
                .iter()
                .filter(|row| !row.is_equation && row.cone.is_none());
            let concave = concave.map(|row| (row.value, -1.0, row.span, "the set"));
            for (e, sign, span, what) in objective.chain(concave) {
                match self.curvature(program, &rows, e, sign) {
                    Curvature::Proven => {}
                    Curvature::Sampled => sampled.push(span),
                    Curvature::Negative => diags.push(SystemError::NotConvex { what, span }),
                }
            }
            for row in rows.iter().filter(|row| row.is_equation) {
                let up = self.curvature(program, &rows, row.value, 1.0);
                let down = self.curvature(program, &rows, row.value, -1.0);
                if (up, down) != (Curvature::Proven, Curvature::Proven) {
                    let (what, span) = ("the set", row.span);
                    diags.push(SystemError::NotConvex { what, span });
                }
            }
            if diags.errors().count() == before {
                check_repeated(&rows, diags);
                self.infeasible(program, &rows, diags);
            }
        }
        sampled
    }

    /// The curvature of sign·e in what a program solves for.
    fn curvature(
        &self,
        program: &Program<'e>,
        rows: &[ProgramRow<'e>],
        e: Expr<'e>,
        sign: f64,
    ) -> Curvature {
        let vars = unknowns(program);
        let n = vars.len();
        let gradient: Vec<Expr<'e>> = vars.iter().map(|&var| e.diff(var)).collect();
        let hessian: Vec<Expr<'e>> = (gradient.iter())
            .flat_map(|g| vars.iter().map(|&var| sign * g.diff(var)))
            .collect();
        if hessian.iter().all(|entry| entry.is_zero()) {
            return Curvature::Proven;
        }
        let inside = variables_of(&hessian);
        let holds_z = inside.iter().any(|var| vars.contains(var));
        let is_param = |var: &Var| self.instance.params.fixed(*var).is_some();
        let at = |z: &[f64]| -> Vec<f64> {
            let value = |var: Var| self.start_value(program, z, var);
            hessian.iter().map(|entry| entry.eval(&value)).collect()
        };
        if !holds_z {
            return match is_semidefinite(&at(&vec![0.0; n]), n) {
                Some(true) if inside.iter().all(is_param) => Curvature::Proven,
                Some(false) => Curvature::Negative,
                _ => Curvature::Sampled,
            };
        }
        for sample in 0..SAMPLES {
            let z = point(sample, n);
            let value = |var: Var| self.start_value(program, &z, var);
            let is_inside = |row: &ProgramRow<'e>| row.is_equation || row.value.eval(&value) >= 0.0;
            if rows.iter().all(is_inside) && is_semidefinite(&at(&z), n) == Some(false) {
                return Curvature::Negative;
            }
        }
        Curvature::Sampled
    }

    /// The value of a variable where a run starts.
    pub(crate) fn start_value(&self, program: &Program<'e>, z: &[f64], var: Var) -> f64 {
        let place = program.unknowns.iter();
        let place = place.map(|z| z.as_variable()).position(|z| z == Some(var));
        match place {
            Some(place) => z[place],
            None if var == self.instance.time() => 0.0,
            None => (self.instance.values().numbers.get(&var).copied())
                .or_else(|| {
                    let is_meant = |data: &&Data<'e>| data.var.as_variable() == Some(var);
                    let data = self.data.iter().find(is_meant)?;
                    Some(data.table.value(0.0))
                })
                .unwrap_or(f64::NAN),
        }
    }

    /// Reports rows, affine in z, that no z satisfies where a run starts, and balls of a negative radius.
    fn infeasible(&self, program: &Program<'e>, rows: &[ProgramRow<'e>], diags: &mut Diagnostics) {
        let vars = unknowns(program);
        let n = vars.len();
        let origin = vec![0.0; n];
        let value = |e: Expr<'e>| e.eval(&|var| self.start_value(program, &origin, var));
        let negative = |row: &&ProgramRow<'e>| row.radius.is_some_and(|r| value(r) < 0.0);
        if let Some(row) = rows.iter().find(negative) {
            diags.push(SystemError::Infeasible {
                rows: vec![labelled(row.span)],
            });
            return;
        }
        // a·z + s + b ≥ 0 with s as small as possible, and no smaller than -1.
        let mut spaces = vec![HalfSpace {
            normal: vec![(n, 1.0)],
            offset: 1.0,
        }];
        let mut spans = Vec::new();
        for row in rows {
            let slopes: Vec<Expr<'e>> = vars.iter().map(|&var| row.value.diff(var)).collect();
            let moving = variables_of(&slopes);
            if moving.iter().any(|var| vars.contains(var)) {
                continue;
            }
            let numbers: Vec<f64> = slopes.iter().map(|&slope| value(slope)).collect();
            let offset = value(row.value);
            let signs: &[f64] = if row.is_equation {
                &[1.0, -1.0]
            } else {
                &[1.0]
            };
            for sign in signs {
                let entries = numbers.iter().enumerate().filter(|(_, a)| **a != 0.0);
                let mut normal: Vec<(usize, f64)> = entries.map(|(j, a)| (j, sign * a)).collect();
                normal.push((n, 1.0));
                let offset = sign * offset;
                let finite = offset.is_finite() && normal.iter().all(|(_, a)| a.is_finite());
                if finite {
                    spaces.push(HalfSpace { normal, offset });
                    spans.push(row.span);
                }
            }
        }
        let mut cost = vec![0.0; n + 1];
        cost[n] = 1.0;
        let Some(solution) = qp::solve(&vec![0.0; n + 1], &cost, &spaces) else {
            return;
        };
        let size = spaces
            .iter()
            .fold(1.0_f64, |m, row| m.max(row.offset.abs()));
        if solution.x[n] > FEASIBLE * size {
            let weights = solution.multipliers[1..].iter().zip(spans);
            let mut rows: Vec<Span> = weights
                .filter(|(weight, _)| **weight > 1e-6)
                .map(|(_, span)| span)
                .collect();
            rows.dedup();
            diags.push(SystemError::Infeasible {
                rows: rows.into_iter().map(labelled).collect(),
            });
        }
    }
}

/// Reports rows that are multiples of each other.
fn check_repeated(rows: &[ProgramRow<'_>], diags: &mut Diagnostics) {
    for (k, row) in rows.iter().enumerate() {
        let (scale, form) = row.value.split_scale();
        let same = rows[..k].iter().find(|other| {
            let (factor, other_form) = other.value.split_scale();
            let alike = factor * scale > 0.0 || row.is_equation || other.is_equation;
            other_form == form && alike
        });
        if let Some(other) = same {
            diags.push(SystemError::RepeatedRow {
                first: other.span,
                second: row.span,
            });
        }
    }
}

fn labelled(span: Span) -> miette::LabeledSpan {
    miette::LabeledSpan::new_with_span(None, span)
}

pub(crate) fn unknowns(program: &Program<'_>) -> Vec<Var> {
    let unknowns = program.unknowns.iter();
    unknowns.filter_map(|z| z.as_variable()).collect()
}

/// Points of several sizes without special relations.
fn point(sample: usize, n: usize) -> Vec<f64> {
    let size = [0.1, 1.0, 10.0][sample % 3];
    let angle = |k: usize| 1.7 * (sample as f64 + 1.0) * (k as f64 + 1.3);
    (0..n).map(|k| size * angle(k).sin()).collect()
}

/// Whether a symmetric matrix has no negative eigenvalue; nothing where it holds what is no number.
fn is_semidefinite(a: &[f64], n: usize) -> Option<bool> {
    if a.iter().any(|entry| !entry.is_finite()) {
        return None;
    }
    let matrix = DMatrix::from_row_slice(n, n, a);
    let size = matrix.amax();
    let least = (n > 0).then(|| matrix.symmetric_eigenvalues().min());
    Some(least.is_none_or(|least| least >= -FLAT * size))
}

#[cfg(test)]
mod tests {
    use super::is_semidefinite;

    #[test]
    fn signs_of_eigenvalues_are_seen() {
        assert_eq!(is_semidefinite(&[2.0, 1.0, 1.0, 2.0], 2), Some(true));
        assert_eq!(is_semidefinite(&[1.0, 2.0, 2.0, 1.0], 2), Some(false));
        assert_eq!(is_semidefinite(&[1.0, 1.0, 1.0, 1.0], 2), Some(true));
        assert_eq!(is_semidefinite(&[0.0, 1.0, 1.0, 0.0], 2), Some(false));
        assert_eq!(is_semidefinite(&[0.0, 0.0, 0.0, -1.0], 2), Some(false));
        assert_eq!(is_semidefinite(&[f64::NAN], 1), None);
    }
}
