//! Rows of the dynamics and of the equations.

use nsd_solver::integrate::tableau::{Tableau, differentiation, lagrange};

use super::formals::block::Builder;
use super::formals::{Formals, sources};
use super::layout::ends::End;
use crate::expr::Expr;
use crate::lowering::mpcc::{Kind, Mpcc};
use crate::system::experiment::Form;

/// x' = f and 0 = g by a Runge-Kutta method in one of its forms.
pub(crate) struct Dynamics<'p, 'e> {
    pub formals: &'p Formals<'p, 'e>,
    pub tableau: &'p Tableau,
    pub form: Form,
}

impl<'e> Dynamics<'_, 'e> {
    /// All rows.
    pub fn state(&self, mpcc: &mut Mpcc<'e>) {
        match self.form {
            Form::Integral => self.integral(mpcc),
            Form::Differential => self.differential(mpcc),
        }
        self.equations(mpcc);
        self.equations_at_end(mpcc);
    }

    /// A block at all nodes, and one at all elements.
    fn blocks(&self, at_nodes: &'static str) -> (Builder<3>, Builder<2>) {
        let layout = self.formals.layout;
        let (k, j) = (layout.each_step(), layout.each_element());
        let nodes = Builder::new(at_nodes, [k, j, layout.each_node()]);
        (nodes, Builder::new("end", [k, j]))
    }

    /// Derivatives and the end of the polynomial through left end and nodes.
    fn integral(&self, mpcc: &mut Mpcc<'e>) {
        let (exprs, layout, dcs) = (mpcc.exprs, self.formals.layout, self.formals.dcs);
        let n = layout.nodes;
        let points = &layout.points[..=n];
        let derivatives = differentiation(points);
        let (d, x) = (exprs.variables("d", n + 1), self.copies("x", n + 1));
        let sums = self.sums(&d, &x);
        let h = exprs.variable("h");
        let rates = self.formals.timed(&dcs.rows.rates, h);
        let rows = sums.iter().zip(&rates).map(|(&sum, &rate)| sum - h * rate);
        let (mut block, mut at_end) = self.blocks("collocation");
        let ends = lagrange(points, &[1.0]);
        for (l, (&d, x)) in d.iter().zip(&x).enumerate() {
            block = block
                .number(d, |[_, _, m]| derivatives[m * (n + 1) + l])
                .vector(x, |[k, j, _]| layout.x(k, j, l));
            at_end = at_end
                .number(d, |_| ends[l])
                .vector(x, |[k, j]| layout.x(k, j, l));
        }
        let block = self.formals.at(block, h, |node| node);
        let text = format!(
            "0 = sum(d[m,l]*x[k,j,l], l in 0..{n}) - h[k,j]*f{}",
            self.formals.at_node()
        );
        let origins = sources(dcs.rows.origins.rates.iter().copied());
        block.state(mpcc, Kind::Equation, rows.collect(), origins.clone(), text);

        let last = layout.end;
        if last == n {
            return;
        }
        let end = self.copies("end", 1).remove(0);
        let rows = sums.iter().zip(&end).map(|(&sum, &end)| sum - end);
        let block = at_end.vector(&end, |[k, j]| layout.x(k, j, last));
        let text = format!("0 = sum(e[l]*x[k,j,l], l in 0..{n}) - x[k,j,{last}]");
        block.state(mpcc, Kind::Equation, rows.collect(), origins, text);
    }

    /// Nodes and the end from slopes, and the slopes.
    fn differential(&self, mpcc: &mut Mpcc<'e>) {
        let (exprs, layout, dcs) = (mpcc.exprs, self.formals.layout, self.formals.dcs);
        let n = layout.nodes;
        let (a, v) = (exprs.variables("a", n), self.copies("v", n));
        let sums = self.sums(&a, &v);
        let h = exprs.variable("h");
        let [start, end] = ["start", "end"].map(|name| self.copies(name, 1).remove(0));
        let rows = start.iter().zip(&sums).zip(&end);
        let rows: Vec<Expr> = rows
            .map(|((&start, &sum), &end)| start + h * sum - end)
            .collect();
        let origins = sources(dcs.rows.origins.rates.iter().copied());
        let slope = |k, j, l| layout.v(k, j, l).expect("the differential form has slopes");

        let last = layout.end;
        let (block, at_end) = self.blocks("nodes");
        let mut block = block
            .variable(h, |[k, j, _]| layout.h(k, j))
            .vector(&start, |[k, j, _]| layout.x(k, j, 0))
            .vector(&end, |[k, j, m]| layout.x(k, j, m));
        let mut at_end = at_end
            .variable(h, |[k, j]| layout.h(k, j))
            .vector(&start, |[k, j]| layout.x(k, j, 0))
            .vector(&end, |[k, j]| layout.x(k, j, last));
        for (l, (&a, v)) in a.iter().zip(&v).enumerate() {
            block = block
                .number(a, |[_, _, m]| self.tableau.a[(m - 1) * n + l])
                .vector(v, |[k, j, _]| slope(k, j, l + 1));
            at_end = at_end
                .number(a, |_| self.tableau.weights[l])
                .vector(v, |[k, j]| slope(k, j, l + 1));
        }
        let text = format!("0 = x[k,j,0] + h[k,j]*sum(a[m,l]*v[k,j,l], l in 1..{n}) - x[k,j,m]");
        block.state(mpcc, Kind::Equation, rows.clone(), origins.clone(), text);
        if last > n {
            let text =
                format!("0 = x[k,j,0] + h[k,j]*sum(b[l]*v[k,j,l], l in 1..{n}) - x[k,j,{last}]");
            at_end.state(mpcc, Kind::Equation, rows, origins.clone(), text);
        }

        let rates = self.formals.timed(&dcs.rows.rates, h);
        let rows = rates.iter().zip(&v[0]).map(|(&rate, &v)| rate - v);
        let (block, _) = self.blocks("slopes");
        let block = block.vector(&v[0], |[k, j, m]| slope(k, j, m));
        let block = self.formals.at(block, h, |node| node);
        let text = format!("0 = f{} - v[k,j,m]", self.formals.at_node());
        block.state(mpcc, Kind::Equation, rows.collect(), origins, text);
    }

    /// g at the nodes.
    fn equations(&self, mpcc: &mut Mpcc<'e>) {
        let all: Vec<usize> = (0..self.formals.dcs.rows.equations.len()).collect();
        if all.is_empty() {
            return;
        }
        let h = mpcc.exprs.variable("h");
        let (block, _) = self.blocks("algebraic");
        let block = self.formals.at(block, h, |node| node);
        let (rows, origins) = self.formals.equations(&all, h);
        let text = format!("0 = g{}", self.formals.at_node());
        block.state(mpcc, Kind::Equation, rows, origins, text);
    }

    /// What of g holds at a right end that is no node.
    fn equations_at_end(&self, mpcc: &mut Mpcc<'e>) {
        let (formals, layout) = (self.formals, self.formals.layout);
        if layout.algebraics.at_end.is_empty() {
            return;
        }
        let h = mpcc.exprs.variable("h");
        let numbers = End::new(formals.dcs).equations;
        let (rows, origins) = formals.equations(&numbers, h);
        let end = layout.end;
        let ranges = [layout.each_step(), layout.each_element()];
        let block = Builder::new("algebraic_end", ranges);
        let block = formals.at(block, h, |[k, j]| [k, j, end]);
        let (x, z) = (format!("x[k,j,{end}]"), format!("z[k,j,{end}]"));
        let g = formals.arguments("t[k,j] + h[k,j]", &x, &z);
        let which = match numbers.len() == formals.dcs.rows.equations.len() {
            true => String::new(),
            false => {
                let numbers: Vec<String> = numbers.iter().map(|i| (i + 1).to_string()).collect();
                format!("[{}]", numbers.join(","))
            }
        };
        let text = format!("0 = g{which}{g}");
        block.state(mpcc, Kind::Equation, rows, origins, text);
    }

    /// Formal vectors of as many entries as there are states.
    fn copies(&self, name: &str, n: usize) -> Vec<Vec<Expr<'e>>> {
        let dcs = self.formals.dcs;
        let copy = |_| dcs.exprs.variables(name, dcs.states.len());
        (0..n).map(copy).collect()
    }

    /// Σ_l c_l v_l, entry by entry.
    fn sums(&self, coefficients: &[Expr<'e>], vectors: &[Vec<Expr<'e>>]) -> Vec<Expr<'e>> {
        let dcs = self.formals.dcs;
        let sum = |i| {
            let terms = coefficients.iter().zip(vectors);
            dcs.exprs.sum(terms.map(|(&c, vector)| c * vector[i]))
        };
        (0..dcs.states.len()).map(sum).collect()
    }
}
