//! The symbols of a model as formal arguments, and what they are in an element.
//!
//! x = x_kjm,   z = z_kjm,   t = t_kj + c_m h_kj, or the clock,   r(t) as in `data`
//!
//! Controls are u_k in step k, or the line from u_(k-1) to u_k:
//!
//! u = u_(k-1) + (u_k - u_(k-1)) (t N/T - (k - 1))

pub(crate) mod block;
mod data;

use data::Data;
pub use data::{beginning, ends, inside};

use super::layout::Layout;
use super::{DiscretizeError, Grid};
use crate::expr::{Expr, Substitution, variables_of};
use crate::lowering::dcs::{Dcs, Origin};
use crate::lowering::mpcc::Source;
use crate::source::Span;
use crate::system::task::Shape;
use block::{Builder, variable};

/// Formal arguments, and the variables and numbers that they stand for.
pub(crate) struct Formals<'p, 'e> {
    pub dcs: &'p Dcs<'e>,
    pub layout: &'p Layout,
    pub grid: Grid,
    /// x.
    pub states: Vec<Expr<'e>>,
    /// T: a number, a parameter, or a formal argument where it is free.
    pub horizon: Expr<'e>,
    /// c, a formal argument.
    node: Expr<'e>,
    /// k - 1, a formal argument.
    pub before: Expr<'e>,
    /// s, a formal argument, where steps are not equal.
    share: Option<Expr<'e>>,
    /// Functions of time as polynomials.
    data: Data<'p, 'e>,
    /// Linear controls at the end of a step, formal arguments; at its start they are those of the system.
    next: Vec<Expr<'e>>,
}

/// Rows of the system as sources of rows of the program.
pub(crate) fn sources(origins: impl IntoIterator<Item = Origin>) -> Vec<Source> {
    origins.into_iter().map(Source::Dcs).collect()
}

impl<'p, 'e> Formals<'p, 'e> {
    pub fn new(dcs: &'p Dcs<'e>, layout: &'p Layout, grid: Grid) -> Self {
        let exprs = dcs.exprs;
        let lines = dcs.task.iter().filter(|task| task.shape == Shape::Linear);
        let controls = lines.flat_map(|task| &task.controls);
        Formals {
            dcs,
            layout,
            grid,
            states: dcs.states.iter().map(|state| state.var).collect(),
            node: exprs.variable("c"),
            horizon: match dcs.task.as_ref().map(|task| (task.horizon, task.length)) {
                Some((Some(_), _)) => exprs.variable("T"),
                Some((None, Some(length))) => length,
                _ => exprs.constant(grid.horizon),
            },
            before: exprs.variable("before"),
            share: (layout.decided.share(1)).map(|_| exprs.variable("s")),
            data: Data::of(dcs, grid),
            next: controls.map(|u| exprs.variable(&u.name)).collect(),
        }
    }

    /// T/N, times s where steps are not equal.
    pub fn step(&self) -> Expr<'e> {
        let mean = self.horizon / self.grid.steps as f64;
        self.share.map_or(mean, |share| share * mean)
    }

    /// Binds what the length of a step is made of: T and s.
    pub fn with_length<const N: usize>(
        &self,
        block: Builder<N>,
        step: impl Fn([usize; N]) -> usize,
    ) -> Builder<N> {
        let block = self.with_horizon(block);
        match self.share {
            Some(share) => block.variable(share, |place| {
                let share = self.layout.decided.share(step(place));
                share.expect("all steps have one")
            }),
            None => block,
        }
    }

    /// The state that is physical time.
    pub fn clock(&self) -> Option<usize> {
        self.dcs.task.as_ref().and_then(|task| task.clock)
    }

    /// Rows at c of an element of length h, in its own t and in controls and data where its step begins and ends.
    pub fn timed(&self, rows: &[Expr<'e>], h: Expr<'e>) -> Vec<Expr<'e>> {
        let time = match self.clock() {
            Some(clock) => self.states[clock],
            None => self.dcs.time + self.node * h,
        };
        let mut values = Substitution::new();
        values.insert(variable(self.dcs.time), time);
        let controls = self.dcs.task.iter().flat_map(|task| &task.controls);
        let share = time * self.grid.steps as f64 / self.horizon - self.before;
        for (control, &next) in controls.zip(&self.next) {
            let line = control.var + (next - control.var) * share;
            values.insert(variable(control.var), line);
        }
        for (data, function) in self.data.at(time) {
            values.insert(data, function);
        }
        values.apply(rows)
    }

    /// A number for c.
    pub fn at_point(&self, point: f64) -> Substitution<'e> {
        Substitution::one(variable(self.node), self.dcs.exprs.constant(point))
    }

    /// The rows of the system with these numbers, at c of an element of length h, and where they come from.
    pub fn equations(&self, numbers: &[usize], h: Expr<'e>) -> (Vec<Expr<'e>>, Vec<Source>) {
        let dcs = self.dcs;
        let rows: Vec<Expr> = numbers.iter().map(|&row| dcs.rows.equations[row]).collect();
        let origins = numbers.iter().map(|&row| dcs.rows.origins.equations[row]);
        (self.timed(&rows, h), sources(origins))
    }

    /// A value at t = 0, with the controls there.
    pub fn at_start(&self, value: Expr<'e>) -> Expr<'e> {
        let zero = self.dcs.exprs.constant(0.0);
        let mut values = Substitution::one(variable(self.dcs.time), zero);
        for (data, value) in self.data.at_end_of(1, zero) {
            values.insert(data, value);
        }
        value.substitute(&values)
    }

    /// A value at t = T, with the controls there.
    pub fn at_end(&self, value: Expr<'e>) -> Expr<'e> {
        let mut values = Substitution::one(variable(self.dcs.time), self.horizon);
        for (data, value) in self.data.at_end_of(self.grid.steps, self.horizon) {
            values.insert(data, value);
        }
        let controls = self.dcs.task.iter().flat_map(|task| &task.controls);
        for (control, &next) in controls.zip(&self.next) {
            values.insert(variable(control.var), next);
        }
        value.substitute(&values)
    }

    /// Binds T.
    pub fn with_horizon<const N: usize>(&self, block: Builder<N>) -> Builder<N> {
        match self.layout.horizon() {
            Some(index) => block.variable(self.horizon, |_| index),
            None => block,
        }
    }

    /// Binds k - 1.
    pub fn with_step<const N: usize>(
        &self,
        block: Builder<N>,
        step: impl Fn([usize; N]) -> usize,
    ) -> Builder<N> {
        block.number(self.before, |place| (step(place) - 1) as f64)
    }

    /// Binds what is the same in all of an element: h, its t, and T, parameters, controls and data of its step.
    pub fn in_element<const N: usize>(
        &self,
        block: Builder<N>,
        h: Expr<'e>,
        element: impl Fn([usize; N]) -> [usize; 2],
    ) -> Builder<N> {
        let (dcs, layout) = (self.dcs, self.layout);
        let step = |place| element(place)[0];
        let mut block = block.variable(h, |place| {
            let [k, j] = element(place);
            layout.h(k, j)
        });
        if layout.t(1, 1).is_some() {
            block = block.variable(dcs.time, |place| {
                let [k, j] = element(place);
                layout.t(k, j).expect("all elements have a start")
            });
        }
        let Some(task) = &dcs.task else {
            return block;
        };
        block = self.data.bind(self.with_horizon(block), step);
        block = self.with_step(block, step);
        for (i, free) in task.params.iter().enumerate() {
            block = block.variable(dcs.params[free.place].var, |_| layout.p(i));
        }
        for (i, control) in task.controls.iter().enumerate() {
            let first = |place| match task.shape {
                Shape::Constant => layout.u(step(place)),
                Shape::Linear => layout.u(step(place) - 1),
            };
            block = block.variable(control.var, |place| first(place) + i);
        }
        for (i, &next) in self.next.iter().enumerate() {
            block = block.variable(next, |place| layout.u(step(place)) + i);
        }
        block
    }

    /// Binds all symbols at node m of element j of step k, but for z that are not there.
    pub fn at<const N: usize>(
        &self,
        block: Builder<N>,
        h: Expr<'e>,
        node: impl Fn([usize; N]) -> [usize; 3],
    ) -> Builder<N> {
        let layout = self.layout;
        let block = self.in_element(block, h, |place| {
            let [k, j, _] = node(place);
            [k, j]
        });
        let block = block.vector(&self.states, |place| {
            let [k, j, m] = node(place);
            layout.x(k, j, m)
        });
        let block = block.number(self.node, |place| layout.points[node(place)[2]]);
        self.with_z(block, node)
    }

    /// Binds the z that are there.
    pub fn with_z<const N: usize>(
        &self,
        block: Builder<N>,
        node: impl Fn([usize; N]) -> [usize; 3],
    ) -> Builder<N> {
        let index = |place, i| {
            let [k, j, m] = node(place);
            self.layout.z(k, j, m, i)
        };
        let z = self.dcs.algebraics.iter().enumerate();
        z.fold(block, |block, (i, z)| {
            let is_there = block.places().all(|place| index(place, i).is_some());
            match is_there {
                true => block.variable(z.var, |place| index(place, i).expect("it is there")),
                false => block,
            }
        })
    }

    /// Refuses what contains z that are not there at these places.
    pub fn check<const N: usize>(
        &self,
        block: &Builder<N>,
        values: &[Expr<'e>],
        span: Span,
    ) -> Result<(), DiscretizeError> {
        let occurring = variables_of(values);
        let z = self.dcs.algebraics.iter().map(|z| z.var);
        let mut missing = z.filter(|&z| occurring.contains(&variable(z)) && !block.is_bound(z));
        match missing.next() {
            Some(z) => Err(DiscretizeError::NoValue {
                name: z.to_string(),
                span,
            }),
            None => Ok(()),
        }
    }

    /// `(t, x, u, z)` at a node.
    pub fn at_node(&self) -> String {
        self.arguments("t[k,j] + c[m]*h[k,j]", "x[k,j,m]", "z[k,j,m]")
    }

    /// `(t, x, u, z)`, without what does not occur; `u[k]` where the states are `x[k,j,m]`, `u` where they are `x`.
    pub fn arguments(&self, t: &str, x: &str, z: &str) -> String {
        let task = self.dcs.task.as_ref();
        let task = task.filter(|task| !task.controls.is_empty());
        let u = task.map(|task| match task.shape {
            _ if !x.contains('[') => "u".to_owned(),
            Shape::Linear => format!("u{}", &x[1..]),
            Shape::Constant => "u[k]".to_owned(),
        });
        let all: Vec<&str> = (self.layout.t(1, 1).map(|_| t).into_iter())
            .chain([x])
            .chain(u.as_deref())
            .chain((!self.dcs.algebraics.is_empty()).then_some(z))
            .collect();
        format!("({})", all.join(", "))
    }
}
