//! Costs and constraints at instants: the start, the end, ends of intervals and elements, all nodes.
//!
//! A constraint on one variable alone becomes a bound of that variable, unless it fixes it: then it stays a row, so
//! that what cannot be met has a name.

use super::quadrature::Quadrature;
use crate::expr::Expr;
use crate::lowering::discretize::DiscretizeError;
use crate::lowering::discretize::formals::Formals;
use crate::lowering::discretize::formals::block::Builder;
use crate::lowering::mpcc::{Block, Bounds, Kind, Mpcc, Source, Stated};
use crate::source::Span;
use crate::system::task::{At, Holds, Shape, Task, TaskRow};

/// The cost and the constraints of a task.
pub(crate) struct Points<'p, 'e> {
    pub formals: &'p Formals<'p, 'e>,
    pub task: &'p Task<'e>,
    /// b_m.
    pub weights: &'p [f64],
}

impl<'e> Points<'_, 'e> {
    /// φ at the end.
    pub fn cost(&self, mpcc: &mut Mpcc<'e>) -> Result<(), DiscretizeError> {
        mpcc.blocks.extend(self.at_horizon(self.task.cost.value)?);
        Ok(())
    }

    /// The terms of φ each by itself, which are no part of the program.
    pub fn terms(
        &self,
        quadrature: &Quadrature<'_, 'e>,
        mpcc: &mut Mpcc<'e>,
    ) -> Result<(), DiscretizeError> {
        for (number, term) in self.task.cost.terms.iter().enumerate() {
            let at_end = self.at_horizon(term.value)?;
            let blocks = at_end.into_iter().chain(quadrature.shares(number));
            mpcc.terms.push(blocks.collect());
        }
        Ok(())
    }

    /// A term of the objective from values at the end.
    fn at_horizon(&self, value: Expr<'e>) -> Result<Option<Block<'e>>, DiscretizeError> {
        if value.is_zero() {
            return Ok(None);
        }
        let (text, span) = (value.to_string(), self.task.cost.span);
        let (block, values) = self.at_end(&[value], span)?;
        let sources = vec![Source::Task(span)];
        let block = block.finish(Kind::Objective, values, sources, text);
        Ok(Some(block))
    }

    /// Constraints.
    pub fn constraints(&self, mpcc: &mut Mpcc<'e>) -> Result<(), DiscretizeError> {
        for (number, row) in self.task.rows.iter().enumerate() {
            let first = mpcc.blocks.len();
            let is_bound = matches!(row.holds, Holds::Strictly) && row.lower < row.upper;
            let variables = is_bound.then(|| self.bound(row, mpcc)).flatten();
            let slack = match row.holds {
                Holds::Softly(penalty) => Some(self.soften(number, penalty, mpcc)?),
                Holds::Strictly | Holds::Against(_) => None,
            };
            if variables.is_none() && slack.is_none() {
                mpcc.blocks.extend(self.rows(row)?);
            }
            mpcc.stated.push(Stated {
                blocks: first..mpcc.blocks.len(),
                variables: variables.unwrap_or_default(),
                slack,
            });
        }
        Ok(())
    }

    /// A constraint at its instants; at x(0) that is free, too.
    fn rows(&self, row: &TaskRow<'e>) -> Result<Vec<Block<'e>>, DiscretizeError> {
        Ok(match row.at {
            At::Start => vec![self.at_start("initial", row)?],
            At::End => {
                let (block, values) = self.at_end(&members(row), row.span)?;
                vec![stated(block, &values, row)]
            }
            At::Nodes | At::Elements | At::Intervals => {
                let mut blocks = vec![self.along(row)?];
                let initial = self.task.initial.iter();
                let freed = initial.map(|free| self.formals.states[free.place]);
                if row.is_at_start(freed) {
                    blocks.push(self.at_start("path_start", row)?);
                }
                blocks
            }
        })
    }

    /// A constraint on one variable as bounds of these; nothing where it is more than that.
    fn bound(&self, row: &TaskRow<'e>, mpcc: &mut Mpcc<'e>) -> Option<Vec<usize>> {
        let (task, layout) = (self.task, self.formals.layout);
        let states = &self.formals.states;
        let state = states.iter().position(|state| *state == row.value);
        let control = task
            .controls
            .iter()
            .position(|control| control.var == row.value);
        let constant = task.shape == Shape::Constant;
        let (steps, elements) = (1..=layout.steps, 1..=layout.elements);
        let mut indices: Vec<usize> = Vec::new();
        match (state, control) {
            (Some(i), _) => {
                let last = layout.elements;
                let at = |[k, j, m]: [usize; 3]| match m {
                    0 => layout.before(k, j) + i,
                    _ => layout.x(k, j, m) + i,
                };
                let is_free = task.initial.iter().any(|free| free.place == i);
                // What is given has no bounds.
                if row.at == At::Start && !is_free {
                    return None;
                }
                if is_free && row.at != At::End {
                    indices.push(at([1, 1, 0]));
                }
                match row.at {
                    At::Start => {}
                    At::End => indices.push(at([layout.steps, last, layout.end])),
                    At::Intervals => indices.extend(steps.map(|k| at([k, last, layout.end]))),
                    At::Elements => indices.extend(
                        steps.flat_map(|k| elements.clone().map(move |j| at([k, j, layout.end]))),
                    ),
                    At::Nodes => indices.extend(steps.flat_map(|k| {
                        let nodes = move |j| (1..=layout.nodes).map(move |m| at([k, j, m]));
                        elements.clone().flat_map(nodes)
                    })),
                }
            }
            (None, Some(i)) if constant => match row.at {
                At::Start => indices.push(layout.u(1) + i),
                At::End => indices.push(layout.u(layout.steps) + i),
                _ => indices.extend(steps.map(|k| layout.u(k) + i)),
            },
            _ => return None,
        }
        let bound = |bounds: &Bounds| bounds.within(row.lower, row.upper);
        let mut fits = |index: &usize| {
            let bounds = bound(mpcc.bound_mut(*index));
            bounds.lower <= bounds.upper
        };
        // What is fixed, or left without a value, stays a row that says so.
        if !indices.iter().all(&mut fits) {
            return None;
        }
        for &index in &indices {
            let bounds = mpcc.bound_mut(index);
            *bounds = bound(bounds);
        }
        Some(indices)
    }

    /// A row at the ends of intervals or elements, or at all nodes.
    fn along(&self, row: &TaskRow<'e>) -> Result<Block<'e>, DiscretizeError> {
        let (formals, layout) = (self.formals, self.formals.layout);
        let (end, last) = (layout.end, layout.elements);
        let [k, j] = [layout.each_step(), layout.each_element()];
        let h = formals.dcs.exprs.variable("h");
        let values = formals.timed(&members(row), h);
        Ok(match row.at {
            At::Nodes => {
                let block = Builder::new("path", [k, j, layout.each_node()]);
                stated(formals.at(block, h, |node| node), &values, row)
            }
            At::Elements => {
                let block = formals.at(Builder::new("path", [k, j]), h, |[k, j]| [k, j, end]);
                formals.check(&block, &values, row.span)?;
                stated(block, &values, row)
            }
            _ => {
                let block = formals.at(Builder::new("path", [k]), h, |[k]| [k, last, end]);
                formals.check(&block, &values, row.span)?;
                stated(block, &values, row)
            }
        })
    }

    /// A value at t = T.
    pub(super) fn at_end(
        &self,
        values: &[Expr<'e>],
        span: Span,
    ) -> Result<(Builder<0>, Vec<Expr<'e>>), DiscretizeError> {
        let (formals, layout) = (self.formals, self.formals.layout);
        let place = [layout.steps, layout.elements, layout.end];
        let h = formals.dcs.exprs.variable("h");
        let block = formals.at(Builder::new("final", []), h, |[]| place);
        formals.check(&block, values, span)?;
        let values = values.iter().map(|&value| formals.at_end(value));
        Ok((block, values.collect()))
    }

    /// A row at t = 0, before impulses.
    fn at_start(
        &self,
        name: &'static str,
        row: &TaskRow<'e>,
    ) -> Result<Block<'e>, DiscretizeError> {
        let formals = self.formals;
        let h = formals.dcs.exprs.variable("h");
        let block = Builder::new(name, []);
        let block = block.vector(&formals.states, |[]| formals.layout.before(1, 1));
        let block = formals.at(block, h, |[]| [1, 1, 0]);
        let values = members(row);
        formals.check(&block, &values, row.span)?;
        let values: Vec<Expr> = (values.into_iter())
            .map(|value| formals.at_start(value))
            .collect();
        Ok(stated(block, &values, row))
    }
}

/// What is compared with bounds, or both members of a pair.
fn members<'e>(row: &TaskRow<'e>) -> Vec<Expr<'e>> {
    match row.holds {
        Holds::Against(other) => vec![row.value, other],
        Holds::Strictly | Holds::Softly(_) => vec![row.value],
    }
}

/// A row with what it is to be.
pub(super) fn stated<'e, const N: usize>(
    block: Builder<N>,
    values: &[Expr<'e>],
    row: &TaskRow<'e>,
) -> Block<'e> {
    let sources = vec![Source::Task(row.span)];
    if let Holds::Against(other) = row.holds {
        let text = format!("0 <= {} perp {other} >= 0", row.value);
        return block.finish(Kind::Pair, values.to_vec(), sources, text);
    }
    let value = values[0];
    let (text, finite) = (row.value, (row.lower.is_finite(), row.upper.is_finite()));
    match row.lower == row.upper {
        true => {
            let zero = value - row.lower;
            let text = format!("0 = {}", text - row.lower);
            block.finish(Kind::Equation, vec![zero], sources, text)
        }
        false => {
            let text = match finite {
                (true, true) => format!("{} <= {text} <= {}", row.lower, row.upper),
                (true, false) => format!("{text} >= {}", row.lower),
                _ => format!("{text} <= {}", row.upper),
            };
            let block = block.bounds(vec![(row.lower, row.upper)]);
            block.finish(Kind::Inequality, vec![value], sources, text)
        }
    }
}
