//! What an optimum consists of: free parameters, terms of the objective, and multipliers of bounds.
//!
//! The solver's Lagrangian is F + yᵀ(g - b) with y >= 0 at upper bounds b and y <= 0 at lower ones, so that the least
//! objective changes by -y where b moves. A bound that holds at several instants moves at all of them alike, and its
//! multiplier is the sum of theirs. At a point that is S-stationary the multipliers are those of the program in which
//! all pairs keep the members that are zero; at others they belong to one branch, and are no derivatives. Where bounds
//! need each other, as two that hold the same value, the optimum has no derivative by one alone: then multipliers are
//! not unique, and other ones have other sums.

use nsd_solver::optimization::mpcc;
use nsd_solver::optimization::mpcc::{Class, Multipliers, Options, Solution};
use nsd_solver::optimization::problem::{Bounds, Nlp};

use super::Problem;
use crate::lowering::dcs::Dcs;
use crate::lowering::discretize::Layout;
use crate::lowering::mpcc::{Block, Program};
use crate::report::{Constraint, Term, Values};
use crate::system::Allowed;
use crate::system::task::{Free, Holds};

/// Multipliers that differ by more, relative to the larger of 1 and their size, are not the same.
const SAME: f64 = 1e-6;

/// A bound of a value, with the rows and the variables that hold it.
struct Side {
    constraint: Constraint,
    rows: Vec<usize>,
    variables: Vec<usize>,
}

/// A value with the rows and the variables that hold its bounds at some instants.
struct Bounded {
    value: String,
    at: Option<&'static str>,
    rows: Vec<usize>,
    variables: Vec<usize>,
}

impl Bounded {
    fn side(&self, relation: &'static str, bound: f64) -> Side {
        Side {
            constraint: Constraint {
                value: self.value.clone(),
                relation,
                bound,
                at: self.at,
                multiplier: None,
            },
            rows: self.rows.clone(),
            variables: self.variables.clone(),
        }
    }

    /// `=`, or `>=` and `<=` where these are finite.
    fn sides(&self, [lower, upper]: [f64; 2]) -> Vec<Side> {
        if lower == upper {
            return vec![self.side("=", lower)];
        }
        let lower = lower.is_finite().then(|| self.side(">=", lower));
        let upper = upper.is_finite().then(|| self.side("<=", upper));
        lower.into_iter().chain(upper).collect()
    }
}

/// Which of several bounds that hold one variable at one number counts; where that matters, none has a multiplier.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Counts {
    First,
    Last,
}

/// Whether a value is at its lower and at its upper bound.
#[derive(Clone, Copy)]
struct Active([bool; 2]);

impl Active {
    /// Those of several values, within a share of their sizes.
    fn of(values: &[f64], bounds: &Bounds<'_>, within: f64) -> Vec<Self> {
        let bounds = bounds.lower.iter().zip(bounds.upper);
        let active = values.iter().zip(bounds).map(|(value, (lower, upper))| {
            let reach = within * value.abs().max(1.0);
            Active([value - lower <= reach, upper - value <= reach])
        });
        active.collect()
    }

    /// What of a derivative of the objective belongs to a bound.
    fn share(self, relation: &str, slope: f64) -> f64 {
        match (relation, self.0) {
            ("=", _) | (">=", [true, false]) | ("<=", [false, true]) => slope,
            (">=", [true, true]) => slope.max(0.0),
            ("<=", [true, true]) => slope.min(0.0),
            _ => 0.0,
        }
    }
}

/// The active bounds of a program at a point.
struct ActiveBounds {
    rows: Vec<Active>,
    variables: Vec<Active>,
}

impl ActiveBounds {
    /// Those that hold within a share of the sizes of values.
    fn of(program: &mut Program, w: &[f64], within: f64) -> Self {
        let mut rows = vec![0.0; program.n_rows()];
        program.rows(w, &mut rows);
        ActiveBounds {
            rows: Active::of(&rows, &program.row_bounds(), within),
            variables: Active::of(w, &program.variable_bounds(), within),
        }
    }

    /// Derivatives by bounds, as some multipliers of the program have them: at a bound that is active they may have any
    /// sign, at others they are zero.
    fn slopes(
        &self,
        sides: &[Side],
        bounds: &Bounds<'_>,
        multipliers: &Multipliers,
        counts: Counts,
    ) -> Vec<f64> {
        let mut is_taken = vec![[false; 2]; bounds.lower.len()];
        let mut slopes = vec![0.0; sides.len()];
        for k in 0..sides.len() {
            let place = match counts {
                Counts::First => k,
                Counts::Last => sides.len() - 1 - k,
            };
            let Side {
                constraint,
                rows,
                variables,
            } = &sides[place];
            let relation = constraint.relation;
            let of_rows = rows.iter().map(|&row| {
                let y = multipliers.rows[row];
                self.rows[row].share(relation, -y)
            });
            let mut sum: f64 = of_rows.sum();
            for &i in variables {
                let (end, taken) = match relation {
                    ">=" => (bounds.lower[i], &mut is_taken[i][0]),
                    _ => (bounds.upper[i], &mut is_taken[i][1]),
                };
                if end == constraint.bound && !std::mem::replace(taken, true) {
                    let r = multipliers.lower[i] - multipliers.upper[i];
                    sum += self.variables[i].share(relation, r);
                }
            }
            slopes[place] = sum;
        }
        slopes
    }
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

/// What a solution consists of.
pub(super) fn values(problem: &mut Problem, solution: &Solution, options: &Options) -> Values {
    let constraints = match solution.class {
        Class::S if solution.is_feasible() => unique(problem, solution, options),
        _ => Vec::new(),
    };
    let free = problem.dcs.task.iter().flat_map(|task| &task.params);
    let free = free.enumerate().map(|(i, free)| {
        let name = problem.dcs.params[free.place].name.clone();
        (name, solution.w[problem.layout.p(i)])
    });
    Values {
        free: free.collect(),
        terms: terms(problem, &solution.w),
        constraints,
    }
}

/// Bounds with the multipliers that all multipliers of the program agree on.
fn unique(problem: &mut Problem, solution: &Solution, options: &Options) -> Vec<Constraint> {
    let others = mpcc::alternatives(&mut problem.program, solution, options);
    let sides = sides(problem);
    let active = ActiveBounds::of(
        &mut problem.program,
        &solution.w,
        options.certificate.active,
    );
    let bounds = problem.program.variable_bounds();
    let slopes =
        |multipliers: &Multipliers, counts| active.slopes(&sides, &bounds, multipliers, counts);
    let found = slopes(&solution.multipliers, Counts::First);
    let others = others
        .map(|[first, second]| [slopes(&first, Counts::First), slopes(&second, Counts::Last)]);
    let constraints = sides.into_iter().enumerate().map(|(k, side)| {
        let agrees =
            |other: &Vec<f64>| (found[k] - other[k]).abs() <= SAME * found[k].abs().max(1.0);
        let is_unique = others
            .as_ref()
            .is_some_and(|others| others.iter().all(agrees));
        Constraint {
            // -0 becomes 0.
            multiplier: is_unique.then_some(found[k] + 0.0),
            ..side.constraint
        }
    });
    constraints.collect()
}

/// The terms of the objective at a point, and what soft constraints add to it.
fn terms(problem: &Problem, w: &[f64]) -> Vec<Term> {
    let (task, stated) = (&problem.task, &problem.mpcc.stated);
    let value = |blocks: &[Block]| problem.mpcc.sum(blocks, w).expect("kernels are smooth");
    let penalty = |row: usize| {
        let block = stated[row].slack.as_ref()?.penalty;
        Some(value(&problem.mpcc.blocks[block..=block]))
    };
    let written = task.cost.terms.iter().zip(&problem.mpcc.terms);
    let written = written.map(|(term, blocks)| {
        let soft = term.soft.iter();
        let soft = soft.filter_map(|&(row, share)| Some(share * penalty(row)?));
        Term {
            text: term.text.clone(),
            value: value(blocks) + soft.sum::<f64>(),
        }
    });
    let rows = task.rows.iter().enumerate();
    let others = rows.filter(|(_, row)| !row.name.is_empty());
    let others = others.filter_map(|(number, row)| {
        Some(Term {
            text: format!("soft {row}"),
            value: penalty(number)?,
        })
    });
    written.chain(others).collect()
}

/// The bounds of the experiment, then those that are declared.
fn sides(problem: &Problem) -> Vec<Side> {
    let rows = problem.dcs.task.iter().flat_map(|task| &task.rows);
    let stated = rows.zip(&problem.mpcc.stated).filter_map(|(row, stated)| {
        // Soft ones are terms of the objective, and a pair has no bound by which it moves.
        if !matches!(row.holds, Holds::Strictly) {
            return None;
        }
        let blocks = stated.blocks.clone();
        let rows = blocks.flat_map(|block| problem.mpcc.rows_of(&problem.program, block));
        let bounded = Bounded {
            value: row.name.clone()?,
            at: Some(row.at.word()),
            rows: rows.collect(),
            variables: stated.variables.clone(),
        };
        Some(bounded.sides([row.lower, row.upper]))
    });
    let declared = declared(&problem.layout, &problem.dcs)
        .into_iter()
        .map(|declared| {
            let bounded = Bounded {
                value: declared.value,
                at: declared.at,
                rows: Vec::new(),
                variables: declared.variables,
            };
            bounded.sides(declared.bounds)
        });
    stated.chain(declared).flatten().collect()
}

/// Controls, free quantities and states with an interval of their own.
fn declared(layout: &Layout, dcs: &Dcs) -> Vec<Declared> {
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
        // Where x(0) is given, it is no bound that holds it.
        let is_free = task.initial.iter().any(|free| free.place == bound.place);
        let variables = nodes.chain(is_free.then(|| start(bound))).collect();
        found.push(Declared {
            variables,
            ..Declared::once(name(bound), bound, 0)
        });
    }
    found
}
