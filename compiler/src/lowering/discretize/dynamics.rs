//! Rows of the dynamics, of the equations, and of the grid.

use nsd_solver::integrate::tableau::{differentiation, lagrange};

use super::Problem;
use super::block::{Builder, variable};
use super::layout::End;
use crate::expr::{Expr, Substitution};
use crate::lowering::dcs::Origin;
use crate::lowering::mpcc::{Kind, Mpcc, Source, Span};
use crate::system::experiment::Form;

impl<'e> Problem<'_, 'e> {
    pub(crate) fn steps(&self) -> Span {
        Span::new("k", 1, self.layout.steps)
    }

    pub(crate) fn elements(&self) -> Span {
        Span::new("j", 1, self.layout.elements)
    }

    pub(crate) fn nodes(&self) -> Span {
        Span::new("m", 1, self.layout.nodes)
    }

    /// All rows but pairs and those that equilibrate.
    pub(crate) fn dynamics(&self, mpcc: &mut Mpcc<'e>) {
        match self.form {
            Form::Integral => self.integral(mpcc),
            Form::Differential => self.differential(mpcc),
        }
        self.equations(mpcc);
        self.grid_rows(mpcc);
    }

    /// Derivatives and the end of the polynomial through left end and nodes.
    fn integral(&self, mpcc: &mut Mpcc<'e>) {
        let (exprs, layout) = (mpcc.exprs, &self.layout);
        let n = layout.nodes;
        let points: Vec<f64> = [0.0]
            .into_iter()
            .chain(self.tableau.nodes.iter().copied())
            .collect();
        let derivatives = differentiation(&points);
        let (d, x) = (exprs.variables("d", n + 1), self.copies("x", n + 1));
        let sums = self.sums(&d, &x);
        let h = exprs.variable("h");
        let rates = self.timed(&self.dcs.rates, h);
        let rows = sums.iter().zip(&rates).map(|(&sum, &rate)| sum - h * rate);
        let mut block = Builder::new("collocation", [self.steps(), self.elements(), self.nodes()]);
        for (l, (&d, x)) in d.iter().zip(&x).enumerate() {
            block = block
                .number(d, |[_, _, m]| derivatives[m * (n + 1) + l])
                .vector(x, |[k, j, _]| layout.x(k, j, l));
        }
        let block = self.at_nodes(block, h);
        let f = self.arguments("t[k,j] + c[m]*h[k,j]", "x[k,j,m]", "z[k,j,m]");
        let text = format!("0 = sum(d[m,l]*x[k,j,l], l in 0..{n}) - h[k,j]*f{f}");
        let sources = sources(&self.dcs.origins.rates);
        mpcc.blocks
            .push(block.finish(Kind::Equation, rows.collect(), sources.clone(), text));

        if layout.end == n {
            return;
        }
        let ends = lagrange(&points, &[1.0]);
        let end = self.copies("end", 1).remove(0);
        let rows = sums.iter().zip(&end).map(|(&sum, &end)| sum - end);
        let mut block = Builder::new("end", [self.steps(), self.elements()]);
        for (l, (&d, x)) in d.iter().zip(&x).enumerate() {
            block = block
                .number(d, |_| ends[l])
                .vector(x, |[k, j]| layout.x(k, j, l));
        }
        let block = block.vector(&end, |[k, j]| layout.x(k, j, layout.end));
        let text = format!(
            "0 = sum(e[l]*x[k,j,l], l in 0..{n}) - x[k,j,{}]",
            layout.end
        );
        mpcc.blocks
            .push(block.finish(Kind::Equation, rows.collect(), sources, text));
    }

    /// Nodes and the end from slopes, and the slopes.
    fn differential(&self, mpcc: &mut Mpcc<'e>) {
        let (exprs, layout) = (mpcc.exprs, &self.layout);
        let n = layout.nodes;
        let (a, v) = (exprs.variables("a", n), self.copies("v", n));
        let sums = self.sums(&a, &v);
        let h = exprs.variable("h");
        let [start, end] = ["start", "end"].map(|name| self.copies(name, 1).remove(0));
        let rows = start.iter().zip(&sums).zip(&end);
        let rows: Vec<Expr> = rows
            .map(|((&start, &sum), &end)| start + h * sum - end)
            .collect();
        let sources = sources(&self.dcs.origins.rates);
        let slope = |k, j, l| layout.v(k, j, l).expect("the differential form has slopes");

        let mut block = Builder::new("nodes", [self.steps(), self.elements(), self.nodes()])
            .variable(h, |[k, j, _]| layout.h(k, j))
            .vector(&start, |[k, j, _]| layout.x(k, j, 0))
            .vector(&end, |[k, j, m]| layout.x(k, j, m));
        for (l, (&a, v)) in a.iter().zip(&v).enumerate() {
            block = block
                .number(a, |[_, _, m]| self.tableau.a[(m - 1) * n + l])
                .vector(v, |[k, j, _]| slope(k, j, l + 1));
        }
        let text = format!("0 = x[k,j,0] + h[k,j]*sum(a[m,l]*v[k,j,l], l in 1..{n}) - x[k,j,m]");
        mpcc.blocks
            .push(block.finish(Kind::Equation, rows.clone(), sources.clone(), text));

        if layout.end > n {
            let mut block = Builder::new("end", [self.steps(), self.elements()])
                .variable(h, |[k, j]| layout.h(k, j))
                .vector(&start, |[k, j]| layout.x(k, j, 0))
                .vector(&end, |[k, j]| layout.x(k, j, layout.end));
            for (l, (&a, v)) in a.iter().zip(&v).enumerate() {
                block = block
                    .number(a, |_| self.tableau.weights[l])
                    .vector(v, |[k, j]| slope(k, j, l + 1));
            }
            let end = layout.end;
            let text =
                format!("0 = x[k,j,0] + h[k,j]*sum(b[l]*v[k,j,l], l in 1..{n}) - x[k,j,{end}]");
            mpcc.blocks
                .push(block.finish(Kind::Equation, rows, sources.clone(), text));
        }

        let rates = self.timed(&self.dcs.rates, h);
        let rows = rates.iter().zip(&v[0]).map(|(&rate, &v)| rate - v);
        let block = Builder::new("slopes", [self.steps(), self.elements(), self.nodes()])
            .vector(&v[0], |[k, j, m]| slope(k, j, m));
        let block = self.at_nodes(block, h);
        let f = self.arguments("t[k,j] + c[m]*h[k,j]", "x[k,j,m]", "z[k,j,m]");
        let text = format!("0 = f{f} - v[k,j,m]");
        mpcc.blocks
            .push(block.finish(Kind::Equation, rows.collect(), sources, text));
    }

    /// g at the nodes, and what of it holds at a right end that is no node.
    fn equations(&self, mpcc: &mut Mpcc<'e>) {
        let (dcs, layout) = (self.dcs, &self.layout);
        if dcs.equations.is_empty() {
            return;
        }
        let h = mpcc.exprs.variable("h");
        let block = Builder::new("algebraic", [self.steps(), self.elements(), self.nodes()]);
        let block = self.at_nodes(block, h);
        let g = self.arguments("t[k,j] + c[m]*h[k,j]", "x[k,j,m]", "z[k,j,m]");
        let rows = self.timed(&dcs.equations, h);
        let origins = sources(&dcs.origins.equations);
        mpcc.blocks
            .push(block.finish(Kind::Equation, rows, origins, format!("0 = g{g}")));

        if layout.at_end.is_empty() {
            return;
        }
        let rows = End::new(dcs).equations;
        let pick = |row: &usize| dcs.equations[*row];
        let equations = self.timed(&rows.iter().map(pick).collect::<Vec<_>>(), h);
        let origins: Vec<Origin> = rows.iter().map(|&row| dcs.origins.equations[row]).collect();
        let end = layout.end;
        let block = Builder::new("algebraic_end", [self.steps(), self.elements()])
            .vector(&self.states(), |[k, j]| layout.x(k, j, end))
            .variable(h, |[k, j]| layout.h(k, j))
            .number(self.node, |_| 1.0);
        let block = layout.at_end.iter().fold(block, |block, &i| {
            let index = |[k, j]: [usize; 2]| {
                layout
                    .z(k, j, end, i)
                    .expect("what is declared at the end is there")
            };
            block.variable(dcs.algebraics[i].var, index)
        });
        let block = match layout.t(1, 1) {
            Some(_) => block.variable(dcs.time, |[k, j]| layout.t(k, j).unwrap_or(0)),
            None => block,
        };
        let block = self.decided(block, |[k, _]| k);
        let t = "t[k,j] + h[k,j]";
        let g = self.arguments(t, &format!("x[k,j,{end}]"), &format!("z[k,j,{end}]"));
        let which = match rows.len() == dcs.equations.len() {
            true => String::new(),
            false => {
                let rows: Vec<String> = rows.iter().map(|row| (row + 1).to_string()).collect();
                format!("[{}]", rows.join(","))
            }
        };
        let text = format!("0 = g{which}{g}");
        mpcc.blocks
            .push(block.finish(Kind::Equation, equations, sources(&origins), text));
    }

    /// Lengths add up to steps, and to times.
    fn grid_rows(&self, mpcc: &mut Mpcc<'e>) {
        let (exprs, layout) = (mpcc.exprs, &self.layout);
        let step = self.horizon / self.grid.steps as f64;
        if let Some(clock) = self.clock() {
            return self.clock_rows(clock, step, mpcc);
        }
        if layout.elements == 1 && layout.horizon().is_none() {
            return;
        }
        let h = exprs.variables("h", layout.elements);
        let mut block = Builder::new("steps", [self.steps()]);
        for (j, &h) in h.iter().enumerate() {
            block = block.variable(h, |[k]| layout.h(k, j + 1));
        }
        let block = self.with_horizon(block);
        let row = exprs.sum(h.iter().copied()) - step;
        let text = format!("0 = sum(h[k,j], j in 1..{}) - {step}", layout.elements);
        mpcc.blocks
            .push(block.finish(Kind::Equation, vec![row], vec![Source::Grid], text));

        if layout.t(1, 1).is_none() {
            return;
        }
        let start = |k, j| layout.t(k, j).unwrap_or(0);
        let [before, after] = ["before", "after"].map(|name| exprs.variable(name));
        if layout.horizon().is_some() && layout.steps > 1 {
            let block = Builder::new("starts", [Span::new("k", 2, layout.steps)])
                .variable(after, |[k]| start(k, 1))
                .number(self.before, |[k]| (k - 1) as f64);
            let block = self.with_horizon(block);
            let row = self.before * step - after;
            let text = format!("0 = (k - 1)*{step} - t[k,1]");
            mpcc.blocks
                .push(block.finish(Kind::Equation, vec![row], vec![Source::Grid], text));
        }
        if layout.elements == 1 {
            return;
        }
        let ranges = [self.steps(), Span::new("j", 2, layout.elements)];
        let block = Builder::new("times", ranges)
            .variable(before, |[k, j]| start(k, j - 1))
            .variable(h[0], |[k, j]| layout.h(k, j - 1))
            .variable(after, |[k, j]| start(k, j));
        let text = "0 = t[k,j-1] + h[k,j-1] - t[k,j]".to_owned();
        let row = before + h[0] - after;
        mpcc.blocks
            .push(block.finish(Kind::Equation, vec![row], vec![Source::Grid], text));
    }

    /// The clock at the ends of steps, which have free lengths.
    fn clock_rows(&self, clock: usize, step: Expr<'e>, mpcc: &mut Mpcc<'e>) {
        let layout = &self.layout;
        let (last, end) = (layout.elements, layout.end);
        let time = self.dcs.states[clock].var;
        let block = Builder::new("clock", [self.steps()])
            .variable(time, |[k]| layout.x(k, last, end) + clock)
            .number(self.before, |[k]| (k - 1) as f64);
        let block = self.with_horizon(block);
        let row = (self.before + 1.0) * step - time;
        let text = format!("0 = k*{step} - {time}[k,{last},{end}]");
        mpcc.blocks
            .push(block.finish(Kind::Equation, vec![row], vec![Source::Grid], text));
    }

    /// The state that is physical time.
    fn clock(&self) -> Option<usize> {
        self.dcs.task.as_ref().and_then(|task| task.clock)
    }

    /// Physical time at c of an element.
    fn instant(&self, h: Expr<'e>) -> Expr<'e> {
        match self.clock() {
            Some(clock) => self.dcs.states[clock].var,
            None => self.dcs.time + self.node * h,
        }
    }

    /// Binds x, z, h and the time at the nodes.
    pub(crate) fn at_nodes(&self, block: Builder<3>, h: Expr<'e>) -> Builder<3> {
        let (dcs, layout) = (self.dcs, &self.layout);
        let algebraics: Vec<Expr> = dcs.algebraics.iter().map(|z| z.var).collect();
        let first = |[k, j, m]: [usize; 3]| layout.z(k, j, m, 0).unwrap_or(0);
        let block = block
            .vector(&self.states(), |[k, j, m]| layout.x(k, j, m))
            .vector(&algebraics, first)
            .variable(h, |[k, j, _]| layout.h(k, j));
        let block = self.decided(block, |[k, _, _]| k);
        match layout.t(1, 1) {
            Some(_) => block
                .variable(dcs.time, |[k, j, _]| layout.t(k, j).unwrap_or(0))
                .number(self.node, |[_, _, m]| self.tableau.nodes[m - 1]),
            None => block,
        }
    }

    /// With t + c h or the clock for the time, t the start of the element, and with what linear controls are there.
    pub(crate) fn timed(&self, rows: &[Expr<'e>], h: Expr<'e>) -> Vec<Expr<'e>> {
        let mut values = Substitution::new();
        let time = self.instant(h);
        values.insert(variable(self.dcs.time), time);
        for (u, line) in self.lines(time).into_iter().chain(self.functions(time)) {
            values.insert(u, line);
        }
        values.apply(rows)
    }

    pub(crate) fn states(&self) -> Vec<Expr<'e>> {
        self.dcs.states.iter().map(|state| state.var).collect()
    }

    /// Formal vectors of as many entries as there are states.
    fn copies(&self, name: &str, n: usize) -> Vec<Vec<Expr<'e>>> {
        let copy = |_| self.dcs.exprs.variables(name, self.dcs.states.len());
        (0..n).map(copy).collect()
    }

    /// Σ_l c_l v_l, entry by entry.
    fn sums(&self, coefficients: &[Expr<'e>], vectors: &[Vec<Expr<'e>>]) -> Vec<Expr<'e>> {
        let sum = |i| {
            let terms = coefficients.iter().zip(vectors);
            self.dcs.exprs.sum(terms.map(|(&c, vector)| c * vector[i]))
        };
        (0..self.dcs.states.len()).map(sum).collect()
    }
}

pub(crate) fn sources(origins: &[Origin]) -> Vec<Source> {
    origins.iter().map(|&origin| Source::Dcs(origin)).collect()
}
