//! Optimal control: controls, free parameters, free initial values and a free horizon.
//!
//! Steps are control intervals of length T/N. In step k, controls are u_k, or the straight line from u_(k-1) to u_k.
//! In numerical time intervals have free lengths, and a clock that is k T/N at their ends: s_k = Σ_j h_kj N/T is the
//! speed of time of Nurkanović, Sartor, Albrecht & Diehl 2021, who scale rates by it instead.
//! A control with a finite set of values is one of them by complementarity: 0 <= u - a ⟂ b - u >= 0 for {a, b}, and
//! u = Σ a_i y_i, Σ y_i = 1, 0 <= y_i ⟂ 1 - y_i >= 0 for more.
//!
//! Where the start is not known, or ψ contains what jumps where a step begins, continuous z at the start of the first
//! element, or of the first element of every step, are variables with the equations that contain them, and so are the
//! algebraic states in these that follow what is decided.
//!
//! Two rows wait for the sides of pairs. Elements between which nothing switches have equal lengths, and where a
//! sliding mode is left inside a step, what jumps has reached its bound: λ alone accepts every boundary within about
//! half a node's distance, because it leaves zero tangentially.

pub(crate) mod points;
pub(crate) mod quadrature;
use super::block::{Builder, variable};
use super::dynamics::sources;
use super::layout::End;
use super::{DiscretizeError, Grid, Problem};
use crate::expr::{Expr, Var, variables_of};
use crate::lowering::dcs::Dcs;
use crate::lowering::discretize::task::quadrature::Integral;
use crate::lowering::mpcc;
use crate::lowering::mpcc::{Block, Bounds, Conditions, Kind, Mpcc, Source, Span};
use crate::system::Allowed;
use crate::system::task::{Control, Shape};
use nsd_solver::integrate::tableau::lagrange;

/// First indices of what is decided besides states.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Decided {
    pub horizon: Option<usize>,
    pub params: usize,
    pub controls: usize,
}

/// What is known where elements begin.
#[derive(Clone, Debug)]
pub(crate) struct Start {
    /// Whether the continuous z of the first element are variables.
    pub is_free: bool,
    /// Whether those of every step are.
    pub restarts: bool,
    /// Their equations; where these hold algebraic states that follow what is decided, the equations of all of those,
    /// too.
    rows: Vec<usize>,
    /// The states that have values of their own where an element begins with free z.
    pub states: Vec<usize>,
}

impl Start {
    pub fn of(dcs: &Dcs) -> Self {
        let mut start = Start {
            is_free: false,
            restarts: false,
            rows: Start::rows(dcs),
            states: Vec::new(),
        };
        let Some(task) = &dcs.task else {
            return start;
        };
        let rows = start.rows.iter().map(|&row| dcs.equations[row]);
        let occurring = variables_of(&rows.collect::<Vec<Expr>>());
        let occurs = |e: Expr| occurring.contains(&variable(e));
        let controls = task.controls.iter().any(|control| occurs(control.var));
        let params = task
            .params
            .iter()
            .any(|free| occurs(dcs.params[free.place].var));
        let states = task
            .initial
            .iter()
            .any(|free| occurs(dcs.states[free.place].var));
        let jumps = super::data::jumps(dcs, &occurring);
        start.is_free = controls || params || states || jumps;
        start.restarts = controls && task.shape == Shape::Constant || jumps;
        if start.is_free {
            let follows = |i: &usize| {
                let x = dcs.states[*i].var;
                dcs.following.contains(&x) && occurs(x)
            };
            start.states = (0..dcs.states.len()).filter(follows).collect();
        }
        start
    }

    fn rows(dcs: &Dcs) -> Vec<usize> {
        let mut rows = End::new(dcs).equations;
        let followed: Vec<Var> = dcs.following.iter().map(|&x| variable(x)).collect();
        let follows = |row: &usize| {
            let vars = variables_of(&[dcs.equations[*row]]);
            vars.iter().any(|var| followed.contains(var))
        };
        if rows.iter().any(follows) {
            rows.extend((0..dcs.equations.len()).filter(follows));
            rows.sort_unstable();
            rows.dedup();
        }
        rows
    }
}

/// Whether instants occur in more than the rates and equations, in which `occurring` do.
pub(crate) fn is_timed(dcs: &Dcs, occurring: &[Var]) -> bool {
    let Some(task) = dcs.task.as_ref().filter(|task| task.clock.is_none()) else {
        return false;
    };
    let rows: Vec<Expr> = task.rows.iter().map(|row| row.value).collect();
    let in_rows = variables_of(&rows);
    let occurs = |e: Expr| {
        let var = variable(e);
        occurring.contains(&var) || in_rows.contains(&var)
    };
    let lines = task.shape == Shape::Linear;
    occurs(dcs.time)
        || dcs.data.iter().any(|&data| occurs(data))
        || lines && task.controls.iter().any(|control| occurs(control.var))
}

/// Parameters that stay numbers.
pub(crate) fn fixed_params<'e>(dcs: &Dcs<'e>) -> Vec<crate::system::Param<'e>> {
    let free = |place: usize| {
        let mut free = dcs.task.iter().flat_map(|task| &task.params);
        free.any(|free| free.place == place)
    };
    let params = dcs.params.iter().enumerate();
    params
        .filter(|(place, _)| !free(*place))
        .map(|(_, param)| param.clone())
        .collect()
}

/// Formal arguments for linear controls at the end of a step.
pub(crate) fn next<'e>(dcs: &Dcs<'e>) -> Vec<Expr<'e>> {
    let lines = dcs.task.iter().filter(|task| task.shape == Shape::Linear);
    let controls = lines.flat_map(|task| &task.controls);
    controls
        .map(|control| dcs.exprs.variable(&control.name))
        .collect()
}

/// Declares what is decided.
pub(crate) fn declare(mpcc: &mut Mpcc, dcs: &Dcs, grid: Grid) -> Decided {
    let Some(task) = &dcs.task else {
        return Decided::default();
    };
    let horizon = task.horizon.map(|(lower, upper)| {
        let bounds = Bounds::between(lower, upper, grid.horizon);
        mpcc.declare("T", vec!["T".to_owned()], &[], vec![bounds])
    });
    let params = task.params.iter().map(|free| {
        let param = &dcs.params[free.place];
        let bounds = Bounds::between(free.lower, free.upper, param.value);
        (param.name.clone(), bounds)
    });
    let (names, bounds) = params.unzip();
    let params = mpcc.declare("p", names, &[], bounds);
    let (names, bounds): (Vec<String>, Vec<Bounds>) = (task.controls.iter())
        .map(|control| (control.name.clone(), bounds_of(control)))
        .unzip();
    let first = match task.shape {
        Shape::Constant => 1,
        Shape::Linear => 0,
    };
    let step = Span::new("k", first, grid.steps);
    let bounds = bounds.repeat(step.len());
    let controls = mpcc.declare("u", names, &[step], bounds);
    Decided {
        horizon,
        params,
        controls,
    }
}

pub(crate) fn bounds_of(control: &Control) -> Bounds {
    match &control.allowed {
        None => Bounds::free(control.guess()),
        Some(Allowed::Between(lower, upper)) => Bounds::between(*lower, *upper, control.guess()),
        Some(Allowed::OneOf(values)) => {
            let [lower, upper] = ends(values);
            Bounds::between(lower, upper, control.guess())
        }
    }
}

fn ends(values: &[f64]) -> [f64; 2] {
    let lower = values.iter().copied().fold(f64::INFINITY, f64::min);
    let upper = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    [lower, upper]
}

impl<'e> Problem<'_, 'e> {
    /// u_(k-1) + (u_k - u_(k-1)) (t N/T - (k - 1)) of linear controls.
    pub(crate) fn lines(&self, time: Expr<'e>) -> Vec<(Var, Expr<'e>)> {
        let controls = self.dcs.task.iter().flat_map(|task| &task.controls);
        let share = time * self.grid.steps as f64 / self.horizon - self.before;
        let lines = controls.zip(&self.next).map(|(control, &next)| {
            let line = control.var + (next - control.var) * share;
            (variable(control.var), line)
        });
        lines.collect()
    }

    /// Binds T.
    pub(crate) fn with_horizon<const N: usize>(&self, block: Builder<N>) -> Builder<N> {
        match self.layout.horizon() {
            Some(index) => block.variable(self.horizon, |_| index),
            None => block,
        }
    }

    /// Binds controls, free parameters and T at places of step `step`.
    pub(crate) fn decided<const N: usize>(
        &self,
        block: Builder<N>,
        step: impl Fn([usize; N]) -> usize,
    ) -> Builder<N> {
        let Some(task) = &self.dcs.task else {
            return block;
        };
        let layout = &self.layout;
        let mut block = self.with_data(self.with_horizon(block), &step);
        block = block.number(self.before, |place| (step(place) - 1) as f64);
        for (i, free) in task.params.iter().enumerate() {
            block = block.variable(self.dcs.params[free.place].var, |_| layout.p(i));
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

    /// Everything that simulations do not have.
    pub(crate) fn task(
        &self,
        mpcc: &mut Mpcc<'e>,
        integrals: &[Integral<'e>],
    ) -> Result<(), DiscretizeError> {
        if self.dcs.task.is_none() {
            return Ok(());
        }
        self.starts(mpcc);
        self.choices(mpcc);
        self.integrals(integrals, mpcc);
        self.cost(mpcc)?;
        self.terms(integrals, mpcc)?;
        self.points(mpcc)?;
        self.conditional(mpcc);
        Ok(())
    }

    /// Equations of what is continuous where it starts anew.
    fn starts(&self, mpcc: &mut Mpcc<'e>) {
        let (dcs, layout) = (self.dcs, &self.layout);
        let start = Start::of(dcs);
        if !start.is_free || self.detection.is_none() {
            return;
        }
        let steps = if start.restarts { layout.steps } else { 1 };
        // What jumps with states has its equations where every element begins.
        let (_, jumping) = super::impulses::jumping(dcs);
        let mut rows = start.rows;
        rows.retain(|row| layout.boundaries.is_none() || !jumping.contains(row));
        let is_led = |row: &usize| layout.led.as_ref().is_some_and(|led| led.states(*row));
        rows.retain(|row| !is_led(row));
        if rows.is_empty() {
            return;
        }
        let pick = |row: &usize| dcs.equations[*row];
        let h = mpcc.exprs.variable("h");
        let equations = self.timed(&rows.iter().map(pick).collect::<Vec<_>>(), h);
        let origins: Vec<_> = rows.iter().map(|&row| dcs.origins.equations[row]).collect();
        let mut block = Builder::new("start", [Span::new("k", 1, steps)])
            .variable(h, |[k]| layout.h(k, 1))
            .number(self.node, |_| 0.0);
        for (i, state) in self.states().into_iter().enumerate() {
            block = block.variable(state, |[k]| layout.x_start(k, i));
        }
        block = self.decided(block, |[k]| k);
        // What jumps, as the sides of switches inside of others, is that of the first node.
        let occurring = variables_of(&equations);
        let mut jumps = "";
        for (i, z) in dcs.algebraics.iter().enumerate() {
            let is_kept = layout.kept.contains(&i);
            if !is_kept && !occurring.contains(&variable(z.var)) {
                continue;
            }
            if !is_kept {
                jumps = ", jumps[k,1,1]";
            }
            block = block.variable(z.var, |[k]| {
                let index = layout.z(k, 1, usize::from(!is_kept), i);
                index.expect("what is continuous is there where a step starts, all else at nodes")
            });
        }
        if layout.t(1, 1).is_some() {
            block = block.variable(dcs.time, |[k]| layout.t(k, 1).unwrap_or(0));
        }
        let g = self.arguments("t[k,1]", "x[k,1,0]", &format!("z[k,1,0]{jumps}"));
        let own = start.states.iter().map(|&i| dcs.states[i].var.to_string());
        let own: Vec<String> = own.collect();
        let own = match own.is_empty() {
            true => String::new(),
            false => format!(", with x_start[k,1,0] for {}", own.join(", ")),
        };
        let text = format!("0 = g{g}{own}");
        mpcc.blocks
            .push(block.finish(Kind::Equation, equations, sources(&origins), text));
    }

    /// Controls with finite sets of values.
    fn choices(&self, mpcc: &mut Mpcc<'e>) {
        let (exprs, layout) = (mpcc.exprs, &self.layout);
        let steps = self.steps();
        let controls = self
            .dcs
            .task
            .iter()
            .flat_map(|task| task.controls.iter().enumerate());
        for (i, control) in controls {
            let Some(Allowed::OneOf(values)) = &control.allowed else {
                continue;
            };
            let source = vec![Source::Task(control.span)];
            let u = |block: Builder<1>| block.variable(control.var, |[k]| layout.u(k) + i);
            let name = &control.name;
            match values[..] {
                [] | [_] => {}
                [_, _] => {
                    let [a, b] = ends(values);
                    let outputs = vec![control.var - a, b - control.var];
                    let text = format!("0 <= {name}[k] - {a} perp {b} - {name}[k] >= 0");
                    let block = u(Builder::new("choice", [steps]));
                    mpcc.blocks
                        .push(block.finish(Kind::Pair, outputs, source, text));
                }
                _ => {
                    let guess = 1.0 / values.len() as f64;
                    let bounds = vec![Bounds::between(0.0, 1.0, guess); values.len()];
                    let names = values.iter().map(|value| format!("{name}={value}"));
                    let bounds = bounds.repeat(layout.steps);
                    let first = mpcc.declare("y", names.collect(), &[steps], bounds);
                    let y = exprs.variables("y", values.len());
                    let index = |[k]: [usize; 1]| first + (k - 1) * values.len();
                    let sum = exprs.sum(y.iter().zip(values).map(|(&y, &value)| value * y));
                    let outputs = vec![control.var - sum, 1.0 - exprs.sum(y.iter().copied())];
                    let text = format!("0 = {name}[k] - sum(values*y[k]), 0 = 1 - sum(y[k])");
                    let block = u(Builder::new("choice", [steps])).vector(&y, index);
                    let both = vec![source[0]; 2];
                    mpcc.blocks
                        .push(block.finish(Kind::Equation, outputs, both, text));
                    let others = y.iter().map(|&y| 1.0 - y);
                    let outputs = y.iter().copied().chain(others).collect();
                    let text = "0 <= y[k] perp 1 - y[k] >= 0".to_owned();
                    let block = Builder::new("choice", [steps]).vector(&y, index);
                    let each = vec![source[0]; values.len()];
                    mpcc.blocks
                        .push(block.finish(Kind::Pair, outputs, each, text));
                }
            }
        }
    }

    /// Rows that wait for the sides of pairs.
    fn conditional(&self, mpcc: &mut Mpcc<'e>) {
        let layout = &self.layout;
        if layout.elements < 2 || self.detection.is_none() {
            return;
        }
        let inner = [self.steps(), Span::new("j", 1, layout.elements - 1)];
        let mut conditions = Conditions {
            steps: layout.steps,
            elements: layout.elements,
            branches: self.branch_conditions(mpcc),
            has_more: self.groups().iter().any(|group| !group.is_crossed)
                || layout.boundaries.is_some()
                || layout.led.is_some()
                || mpcc.blocks.iter().any(|block| block.name == "sliding"),
            impulses: self.impact_pairs(mpcc),
            rests: self.rests(mpcc),
            ..Conditions::default()
        };
        let groups = self.groups();
        for group in groups.iter().filter(|group| group.is_crossed) {
            let is_own = |block: &&Block| block.kind == Kind::Pair && block.name == group.block;
            let stated = mpcc.blocks.iter().find(is_own);
            let stated = stated.expect("pairs are stated before what follows from them");
            let places = stated.n_places();
            let first_pair = mpcc.first_pair(group.block);
            conditions.groups.push(mpcc::Group {
                first_pair,
                per_element: places / (layout.steps * layout.elements),
                members: group.members.len(),
                continuous: group
                    .continuous()
                    .iter()
                    .map(|&b| self.algebraic(b))
                    .collect(),
                jumps: group.jumps().iter().map(|&a| self.jump(a)).collect(),
                leave: mpcc.blocks.len(),
            });
            // What jumps, at the end of an element: the polynomial through its values at the nodes.
            let a = group.jumps();
            let ends = lagrange(&self.tableau.nodes, &[1.0]);
            let is_there = |m: usize| group.last > layout.nodes || ends[m - 1] != 0.0;
            let copies = self.copied(&a, Span::new("m", 1, group.last));
            let mut block = Builder::new("leave", inner);
            let mut values = vec![Vec::new(); a.len()];
            for (m, copy) in copies.iter().filter(|(m, _)| is_there(*m)) {
                block = self.bind(block, &a, copy, |[k, j]| (k, j, *m));
                let weight = match group.last > layout.nodes {
                    true => f64::from(u8::from(*m == group.last)),
                    false => ends[m - 1],
                };
                for (value, &member) in values.iter_mut().zip(copy) {
                    value.push(weight * member);
                }
            }
            let values = values.into_iter().map(|terms| mpcc.exprs.sum(terms));
            let (block, stabilities) = self.stabilities_at_end(block, |[k, j]| (k, j));
            let values = values.zip(&a).map(|(value, &a)| match self.branch_of(a) {
                Some(branch) => value * stabilities[branch],
                None => value,
            });
            let times = if stabilities.is_empty() { "" } else { "*S" };
            let text = format!(
                "0 = {}{times}(z[k,j]) at the end, where it reaches zero there",
                group.names.0
            );
            let block: Block = group.conditional(block, values.collect(), text);
            mpcc.blocks.push(block);
        }
        let h = mpcc.exprs.variables("h", 2);
        let block = Builder::new("equal", inner)
            .variable(h[0], |[k, j]| layout.h(k, j))
            .variable(h[1], |[k, j]| layout.h(k, j + 1));
        let text = "0 = h[k,j+1] - h[k,j], where nothing switches".to_owned();
        let row = vec![h[1] - h[0]];
        conditions.equal = Some(mpcc.blocks.len());
        mpcc.conditions = conditions;
        mpcc.blocks
            .push(block.finish(Kind::Conditional, row, vec![Source::Grid], text));
    }
}
