//! What an optimum consists of: free parameters, terms of the objective, and multipliers of bounds.
//!
//! The solver's Lagrangian is F + yᵀ(g - b) with y >= 0 at upper bounds b and y <= 0 at lower ones, so that the least
//! objective changes by -y where b moves. A bound that holds at several instants moves at all of them alike, and its
//! multiplier is the sum of theirs. At a point that is S-stationary the multipliers are those of the program in which
//! all pairs keep the members that are zero; at others they belong to one branch, and are no derivatives. Where bounds
//! need each other, as two that hold the same value, the optimum has no derivative by one alone: then multipliers are
//! not unique, and other ones have other sums.

use nsd_solver::mpcc::{self, Class, Multipliers, Options, Solution};

use super::Problem;
use crate::report::{Constraint, Term, Values};
use crate::system::Allowed;
use crate::system::task::Free;

/// Multipliers that differ by more, relative to the larger of 1 and their size, are not the same.
const SAME: f64 = 1e-6;

/// A bound of a value.
struct Side {
    constraint: Constraint,
    /// The part of its multiplier that rows have.
    of_rows: f64,
    /// The variables that it bounds.
    variables: Vec<usize>,
}

/// A value with the bounds it has at some instants.
struct Bounded<'s> {
    value: &'s str,
    at: Option<&'static str>,
    variables: &'s [usize],
}

impl Bounded<'_> {
    fn side(&self, relation: &'static str, bound: f64, of_rows: f64) -> Side {
        Side {
            constraint: Constraint {
                value: self.value.to_owned(),
                relation,
                bound,
                at: self.at,
                multiplier: None,
            },
            of_rows,
            variables: self.variables.to_vec(),
        }
    }

    /// `>=` and `<=`, where these are finite, with the multipliers of rows.
    fn sides(&self, [lower, upper]: [f64; 2], y: &[f64]) -> impl Iterator<Item = Side> {
        let below: f64 = y.iter().map(|y| (-y).max(0.0)).sum();
        let above: f64 = y.iter().map(|y| -y.max(0.0)).sum();
        let lower = lower.is_finite().then(|| self.side(">=", lower, below));
        let upper = upper.is_finite().then(|| self.side("<=", upper, above));
        lower.into_iter().chain(upper)
    }
}

/// Which of several bounds that hold one variable at one number counts; where that matters, none has a multiplier.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Counts {
    First,
    Last,
}

/// What is declared to be in an interval.
struct Declared {
    value: String,
    at: Option<&'static str>,
    bounds: [f64; 2],
    variables: Vec<usize>,
}

impl Declared {
    /// One variable.
    fn once(value: String, free: &Free, variable: usize) -> Self {
        Declared {
            value,
            at: None,
            bounds: [free.lower, free.upper],
            variables: vec![variable],
        }
    }
}

impl Problem<'_, '_> {
    /// What a solution consists of.
    pub(super) fn values(&mut self, solution: &Solution, options: &Options) -> Values {
        let constraints = match solution.class {
            Class::S if solution.is_feasible() => self.unique(solution, options),
            _ => Vec::new(),
        };
        let free = self.dcs.task.iter().flat_map(|task| &task.params);
        let free = free.enumerate().map(|(i, free)| {
            let name = self.dcs.params[free.place].name.clone();
            (name, solution.w[self.layout.p(i)])
        });
        Values {
            free: free.collect(),
            terms: self.terms(&solution.w),
            constraints,
        }
    }

    /// Bounds with the multipliers that all multipliers of the program agree on.
    fn unique(&mut self, solution: &Solution, options: &Options) -> Vec<Constraint> {
        let others = mpcc::alternatives(&mut self.program, solution, options);
        let mut found = self.constraints(&solution.multipliers, Counts::First);
        let others = others.map(|[first, second]| {
            [
                self.constraints(&first, Counts::First),
                self.constraints(&second, Counts::Last),
            ]
        });
        for (k, constraint) in found.iter_mut().enumerate() {
            constraint.multiplier = constraint.multiplier.filter(|multiplier| {
                let agrees = |other: &Vec<Constraint>| {
                    let other = other[k].multiplier.unwrap_or(f64::NAN);
                    (multiplier - other).abs() <= SAME * multiplier.abs().max(1.0)
                };
                others
                    .as_ref()
                    .is_some_and(|others| others.iter().all(agrees))
            });
        }
        found
    }

    fn terms(&self, w: &[f64]) -> Vec<Term> {
        let texts = self.task.cost.terms.iter().map(|term| &term.text);
        let terms = texts.zip(&self.mpcc.terms);
        let terms = terms.map(|(text, blocks)| Term {
            text: text.clone(),
            value: self.mpcc.sum(blocks, w).expect("kernels are smooth"),
        });
        terms.collect()
    }

    /// Bounds with what some multipliers of the program say.
    fn constraints(&self, multipliers: &Multipliers, counts: Counts) -> Vec<Constraint> {
        let mut sides = self.sides(multipliers);
        let bounds = self.mpcc.bounds();
        let mut is_taken = vec![[false; 2]; bounds.len()];
        let all = sides.len();
        for k in 0..all {
            let place = match counts {
                Counts::First => k,
                Counts::Last => all - 1 - k,
            };
            let side = &mut sides[place];
            let mut sum = side.of_rows;
            for &i in &side.variables {
                let (is_upper, end, slope) = match side.constraint.relation {
                    ">=" => (false, bounds[i].lower, multipliers.lower[i]),
                    _ => (true, bounds[i].upper, -multipliers.upper[i]),
                };
                let taken = &mut is_taken[i][usize::from(is_upper)];
                if end == side.constraint.bound && !std::mem::replace(taken, true) {
                    sum += slope;
                }
            }
            // -0 becomes 0.
            side.constraint.multiplier = Some(sum + 0.0);
        }
        sides.into_iter().map(|side| side.constraint).collect()
    }

    /// The bounds of the experiment, then those that are declared.
    fn sides(&self, multipliers: &Multipliers) -> Vec<Side> {
        let mut sides = Vec::new();
        let rows = self.dcs.task.iter().flat_map(|task| &task.rows);
        for (row, stated) in rows.zip(&self.mpcc.stated) {
            let Some(value) = &row.name else {
                continue;
            };
            let blocks = stated.blocks.clone();
            let rows = blocks.flat_map(|block| self.mpcc.rows_of(&self.program, block));
            let y: Vec<f64> = rows.map(|row| multipliers.rows[row]).collect();
            let at = row.at.as_str();
            let bounded = Bounded {
                value,
                at: Some(at.strip_prefix("the ").unwrap_or(at)),
                variables: &stated.variables,
            };
            match row.lower == row.upper {
                true => sides.push(bounded.side("=", row.lower, -y.iter().sum::<f64>())),
                false => sides.extend(bounded.sides([row.lower, row.upper], &y)),
            }
        }
        for declared in self.declared() {
            let bounded = Bounded {
                value: &declared.value,
                at: declared.at,
                variables: &declared.variables,
            };
            sides.extend(bounded.sides(declared.bounds, &[]));
        }
        sides
    }

    /// Controls, free quantities and states with an interval of their own.
    fn declared(&self) -> Vec<Declared> {
        let (layout, dcs) = (&self.layout, &self.dcs);
        let Some(task) = &dcs.task else {
            return Vec::new();
        };
        let mut found = Vec::new();
        for (i, control) in task.controls.iter().enumerate() {
            if let Some(Allowed::Between(lower, upper)) = control.allowed {
                let variables = layout.control_instants().map(|(k, _)| layout.u(k) + i);
                found.push(Declared {
                    value: control.name.clone(),
                    at: None,
                    bounds: [lower, upper],
                    variables: variables.collect(),
                });
            }
        }
        for (i, free) in task.params.iter().enumerate() {
            let name = dcs.params[free.place].name.clone();
            found.push(Declared::once(name, free, layout.p(i)));
        }
        if let (Some((lower, upper)), Some(index)) = (task.horizon, layout.horizon()) {
            found.push(Declared {
                value: "horizon".to_owned(),
                at: None,
                bounds: [lower, upper],
                variables: vec![index],
            });
        }
        let name = |free: &Free| dcs.states[free.place].var.to_string();
        let start = |free: &Free| layout.before(1, 1) + free.place;
        for free in &task.initial {
            found.push(Declared {
                at: Some("start"),
                ..Declared::once(name(free), free, start(free))
            });
        }
        for bound in &task.bounds {
            let nodes = layout.all_elements().flat_map(|(k, j)| {
                let nodes = 1..=layout.end;
                nodes.map(move |m| layout.x(k, j, m) + bound.place)
            });
            let variables = nodes.chain([start(bound)]).collect();
            found.push(Declared {
                variables,
                ..Declared::once(name(bound), bound, 0)
            });
        }
        found
    }
}
