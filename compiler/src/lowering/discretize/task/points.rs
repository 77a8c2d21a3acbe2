//! Costs and constraints at instants: the start, the end, ends of intervals and elements, all nodes.
//!
//! A constraint on one variable alone becomes a bound of that variable, unless it fixes it: then it stays a row, so
//! that what cannot be met has a name.

use super::quadrature::Integral;
use crate::expr::{Expr, Substitution, variables_of};
use crate::lowering::discretize::block::{Builder, variable};
use crate::lowering::discretize::{DiscretizeError, Problem};
use crate::lowering::mpcc::{Block, Bounds, Kind, Mpcc, Source, Stated};
use crate::source::Span;
use crate::system::task::{At, Shape, TaskRow};

/// Step, element and node.
type Place = (usize, usize, usize);

impl<'e> Problem<'_, 'e> {
    /// φ at the end.
    pub(crate) fn cost(&self, mpcc: &mut Mpcc<'e>) -> Result<(), DiscretizeError> {
        let Some(task) = &self.dcs.task else {
            return Ok(());
        };
        mpcc.blocks.extend(self.at_horizon(task.cost.value)?);
        Ok(())
    }

    /// The terms of φ each by itself, which are no part of the program.
    pub(crate) fn terms(
        &self,
        integrals: &[Integral<'e>],
        mpcc: &mut Mpcc<'e>,
    ) -> Result<(), DiscretizeError> {
        let terms = self.dcs.task.iter().flat_map(|task| &task.cost.terms);
        for (number, term) in terms.enumerate() {
            let mut blocks: Vec<_> = self.at_horizon(term.value)?.into_iter().collect();
            for integral in integrals {
                let share = integral.shares[number];
                blocks.extend((share != 0.0).then(|| self.integral_of(integral, share)));
            }
            mpcc.terms.push(blocks);
        }
        Ok(())
    }

    /// A term of the objective from values at the end.
    fn at_horizon(&self, value: Expr<'e>) -> Result<Option<Block<'e>>, DiscretizeError> {
        let Some(task) = self.dcs.task.as_ref().filter(|_| !value.is_zero()) else {
            return Ok(None);
        };
        let (text, span) = (value.to_string(), task.cost.span);
        let (block, value) = self.at_end("final", (value, span))?;
        let sources = vec![Source::Task(span)];
        Ok(Some(block.finish(
            Kind::Objective,
            vec![value],
            sources,
            text,
        )))
    }

    /// Constraints.
    pub(crate) fn points(&self, mpcc: &mut Mpcc<'e>) -> Result<(), DiscretizeError> {
        let rows = self.dcs.task.iter().flat_map(|task| &task.rows);
        for row in rows {
            let first = mpcc.blocks.len();
            let variables = match row.lower < row.upper {
                true => self.bound(row, mpcc),
                false => None,
            };
            if let Some(variables) = variables {
                mpcc.stated.push(Stated {
                    blocks: first..first,
                    variables,
                });
                continue;
            }
            match row.at {
                At::Start => {
                    let (block, value) = self.at_start("initial", row)?;
                    self.push(mpcc, block, value, row);
                }
                At::End => {
                    let (block, value) = self.at_end("final", (row.value, row.span))?;
                    self.push(mpcc, block, value, row);
                }
                At::Nodes | At::Elements | At::Intervals => {
                    self.along(row, mpcc)?;
                    let is_free = |e: &Expr<'e>| variables_of(&[row.value]).contains(&variable(*e));
                    let initial = self.dcs.task.iter().flat_map(|task| &task.initial);
                    let mut freed = initial.map(|free| self.dcs.states[free.place].var);
                    if freed.any(|state| is_free(&state)) {
                        let (block, value) = self.at_start("path_start", row)?;
                        self.push(mpcc, block, value, row);
                    }
                }
            }
            mpcc.stated.push(Stated {
                blocks: first..mpcc.blocks.len(),
                variables: Vec::new(),
            });
        }
        Ok(())
    }

    fn push<const N: usize>(
        &self,
        mpcc: &mut Mpcc<'e>,
        block: Builder<N>,
        value: Expr<'e>,
        row: &TaskRow<'e>,
    ) {
        let sources = vec![Source::Task(row.span)];
        let (text, finite) = (row.value, (row.lower.is_finite(), row.upper.is_finite()));
        let block = match row.lower == row.upper {
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
        };
        mpcc.blocks.push(block);
    }

    /// A constraint on one variable as bounds of these; nothing where it is more than that.
    fn bound(&self, row: &TaskRow<'e>, mpcc: &mut Mpcc<'e>) -> Option<Vec<usize>> {
        let layout = &self.layout;
        let task = self.dcs.task.as_ref()?;
        let states = &self.dcs.states;
        let state = states.iter().position(|state| state.var == row.value);
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
                let at = |(k, j, m): Place| match m {
                    0 => layout.before(k, j) + i,
                    _ => layout.x(k, j, m) + i,
                };
                let is_free = task.initial.iter().any(|free| free.place == i);
                // What is given has no bounds.
                if row.at == At::Start && !is_free {
                    return None;
                }
                if is_free && row.at != At::End {
                    indices.push(at((1, 1, 0)));
                }
                match row.at {
                    At::Start => {}
                    At::End => indices.push(at((layout.steps, last, layout.end))),
                    At::Intervals => indices.extend(steps.map(|k| at((k, last, layout.end)))),
                    At::Elements => indices.extend(
                        steps.flat_map(|k| elements.clone().map(move |j| at((k, j, layout.end)))),
                    ),
                    At::Nodes => indices.extend(steps.flat_map(|k| {
                        let nodes = move |j| (1..=layout.nodes).map(move |m| at((k, j, m)));
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
        let fits = |index: &usize| {
            let bounds = bound(mpcc.bound(*index));
            bounds.lower <= bounds.upper
        };
        // What is fixed, or left without a value, stays a row that says so.
        if !indices.iter().all(fits) {
            return None;
        }
        for &index in &indices {
            let bounds = mpcc.bound_mut(index);
            *bounds = bound(bounds);
        }
        Some(indices)
    }

    /// A row at the ends of intervals or elements, or at all nodes.
    fn along(&self, row: &TaskRow<'e>, mpcc: &mut Mpcc<'e>) -> Result<(), DiscretizeError> {
        let layout = &self.layout;
        let (end, last) = (layout.end, layout.elements);
        let steps = self.steps();
        let h = mpcc.exprs.variable("h");
        let value = self.timed(&[row.value], h)[0];
        match row.at {
            At::Nodes => {
                let ranges = [steps, self.elements(), self.nodes()];
                let block = self.at_nodes(Builder::new("path", ranges), h);
                self.push(mpcc, block, value, row);
            }
            At::Elements => {
                let block = Builder::new("path", [steps, self.elements()]);
                let block = self.at_place(block, h, (row.value, row.span), |[k, j]| (k, j, end))?;
                self.push(mpcc, block.number(self.node, |_| 1.0), value, row);
            }
            _ => {
                let block = Builder::new("path", [steps]);
                let block = self.at_place(block, h, (row.value, row.span), |[k]| (k, last, end))?;
                self.push(mpcc, block.number(self.node, |_| 1.0), value, row);
            }
        }
        Ok(())
    }

    /// A value at t = T.
    fn at_end(
        &self,
        name: &'static str,
        (value, span): (Expr<'e>, Span),
    ) -> Result<(Builder<0>, Expr<'e>), DiscretizeError> {
        let layout = &self.layout;
        let place = (layout.steps, layout.elements, layout.end);
        let h = self.dcs.exprs.variable("h");
        let block = self.at_place(Builder::new(name, []), h, (value, span), |[]| place)?;
        let mut values = Substitution::new();
        values.insert(variable(self.dcs.time), self.horizon);
        for (data, value) in self.functions_at(self.grid.horizon) {
            values.insert(data, value);
        }
        let controls = self.dcs.task.iter().flat_map(|task| &task.controls);
        for (control, &next) in controls.zip(&self.next) {
            values.insert(variable(control.var), next);
        }
        Ok((block, value.substitute(&values)))
    }

    /// A value at t = 0.
    fn at_start(
        &self,
        name: &'static str,
        row: &TaskRow<'e>,
    ) -> Result<(Builder<0>, Expr<'e>), DiscretizeError> {
        let (value, h) = (row.value, self.dcs.exprs.variable("h"));
        let block = Builder::new(name, []);
        let block = self.at_place(block, h, (value, row.span), |[]| (1, 1, 0))?;
        let zero = self.dcs.exprs.constant(0.0);
        let mut at_zero = Substitution::one(variable(self.dcs.time), zero);
        for (data, value) in self.functions_at(0.0) {
            at_zero.insert(data, value);
        }
        Ok((block, value.substitute(&at_zero)))
    }

    /// Binds everything that `value` may contain at a place.
    fn at_place<const N: usize>(
        &self,
        block: Builder<N>,
        h: Expr<'e>,
        (value, span): (Expr<'e>, Span),
        place: impl Fn([usize; N]) -> Place,
    ) -> Result<Builder<N>, DiscretizeError> {
        let (dcs, layout) = (self.dcs, &self.layout);
        let mut block = block.vector(&self.states(), |at| {
            // The start is that before impulses.
            match place(at) {
                (k, j, 0) => layout.before(k, j),
                (k, j, m) => layout.x(k, j, m),
            }
        });
        block = block.variable(h, |at| {
            let (k, j, _) = place(at);
            layout.h(k, j)
        });
        block = self.decided(block, |at| place(at).0);
        if layout.t(1, 1).is_some() {
            block = block.variable(dcs.time, |at| {
                let (k, j, _) = place(at);
                layout.t(k, j).unwrap_or(0)
            });
        }
        let occurring = variables_of(&[value]);
        let algebraics = dcs.algebraics.iter().enumerate();
        for (i, z) in algebraics.filter(|(_, z)| occurring.contains(&variable(z.var))) {
            let index = |at| {
                let (k, j, m) = place(at);
                layout.z(k, j, m, i)
            };
            if block.places().any(|at| index(at).is_none()) {
                return Err(DiscretizeError::NoValue {
                    name: z.var.to_string(),
                    span,
                });
            }
            block = block.variable(z.var, |at| index(at).unwrap_or(0));
        }
        Ok(block)
    }
}

impl<'e> Mpcc<'e> {
    fn bound(&self, index: usize) -> &Bounds {
        let block = self.variables.partition_point(|block| block.start <= index) - 1;
        let block = &self.variables[block];
        &block.bounds[index - block.start]
    }
}
