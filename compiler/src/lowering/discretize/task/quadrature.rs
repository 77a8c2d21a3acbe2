//! Integrals of the cost: states that nothing reads become sums over the nodes.
//!
//! ∫ L dt = Σ_kj h_kj Σ_m b_m L(t_kjm, x_kjm, u_k, z_kjm)
//!
//! An integral that the cost contains with a constant factor, and no constraint contains, needs no values at nodes:
//! the sum is what the Runge-Kutta method gives for it at the end. Others stay states.

use crate::expr::{Expr, Substitution, variables_of};
use crate::lowering::dcs::Dcs;
use crate::lowering::discretize::formals::Formals;
use crate::lowering::discretize::formals::block::{Builder, variable};
use crate::lowering::mpcc::{Block, Kind, Mpcc, Source};
use crate::source::Span;
use crate::system::task::Term;

/// `factor` ∫ `rate` dt.
pub(crate) struct Integral<'e> {
    factor: f64,
    /// The factor in each term of the cost.
    pub shares: Vec<f64>,
    /// What is integrated.
    pub rate: Expr<'e>,
    span: Span,
}

/// The system without integrals that are sums, whose share of the cost is left out of it.
pub(crate) fn split<'e>(dcs: &Dcs<'e>) -> (Dcs<'e>, Vec<Integral<'e>>) {
    let mut reduced = dcs.clone();
    let Some(task) = &mut reduced.task else {
        return (reduced, Vec::new());
    };
    let first = dcs.states.len() - task.integrals;
    let rows: Vec<Expr> = task.in_rows().collect();
    let in_rows = variables_of(&rows);
    let factor = |place: usize| {
        let var = variable(dcs.states[place].var);
        let factor = task.cost.value.diff(var).as_constant();
        factor.filter(|_| !in_rows.contains(&var))
    };
    let factors: Option<Vec<f64>> = (first..dcs.states.len()).map(factor).collect();
    let Some(factors) = factors else {
        return (reduced, Vec::new());
    };
    let zero = dcs.exprs.constant(0.0);
    let integrals: Substitution = (dcs.states[first..].iter())
        .map(|state| (variable(state.var), zero))
        .collect();
    let share = |place: usize, term: &Term<'e>| {
        let factor = term.value.diff(variable(dcs.states[place].var));
        factor.as_constant()
    };
    let shares = |place: usize| -> Option<Vec<f64>> {
        let terms = task.cost.terms.iter();
        terms.map(|term| share(place, term)).collect()
    };
    let shares: Option<Vec<Vec<f64>>> = (first..dcs.states.len()).map(shares).collect();
    // Terms of which only the sum has a constant factor do not come apart.
    let shares = shares.unwrap_or_else(|| {
        task.cost.terms.clear();
        vec![Vec::new(); factors.len()]
    });
    task.cost = task.cost.map(|e| e.substitute(&integrals));
    task.integrals = 0;
    reduced.states.truncate(first);
    reduced.rows.rates.truncate(first);
    reduced.rows.origins.rates.truncate(first);
    let sums = factors
        .into_iter()
        .zip(shares)
        .zip(&dcs.rows.rates[first..])
        .zip(&dcs.rows.origins.rates[first..]);
    let sums = sums.map(|(((factor, shares), &rate), origin)| Integral {
        factor,
        shares,
        rate,
        span: origin.span,
    });
    (reduced, sums.collect())
}

/// All integrals as sums.
pub(crate) struct Quadrature<'p, 'e> {
    pub formals: &'p Formals<'p, 'e>,
    /// b_m.
    pub weights: &'p [f64],
    pub integrals: &'p [Integral<'e>],
}

impl<'e> Quadrature<'_, 'e> {
    /// Terms of the objective.
    pub fn state(&self, mpcc: &mut Mpcc<'e>) {
        let integrals = self.integrals.iter();
        let blocks = integrals.map(|integral| self.sum(integral, integral.factor));
        mpcc.blocks.extend(blocks);
    }

    /// What a term of the cost has of all integrals, by its number.
    pub fn shares(&self, term: usize) -> impl Iterator<Item = Block<'e>> {
        let integrals = self.integrals.iter();
        let shares = integrals.map(move |integral| (integral, integral.shares[term]));
        let shares = shares.filter(|(_, share)| *share != 0.0);
        shares.map(|(integral, share)| self.sum(integral, share))
    }

    /// An integral with a factor.
    fn sum(&self, integral: &Integral<'e>, factor: f64) -> Block<'e> {
        let (formals, layout) = (self.formals, self.formals.layout);
        let exprs = formals.dcs.exprs;
        let (h, b) = (exprs.variable("h"), exprs.variable("b"));
        let rate = formals.timed(&[integral.rate], h)[0];
        let ranges = [
            layout.each_step(),
            layout.each_element(),
            layout.each_node(),
        ];
        let block = Builder::new("integral", ranges).number(b, |[_, _, m]| self.weights[m - 1]);
        let block = formals.at(block, h, |node| node);
        let weight = match factor {
            1.0 => String::new(),
            factor => format!("{factor}*"),
        };
        let text = format!("{weight}b[m]*h[k,j]*({})", integral.rate);
        let term = factor * b * h * rate;
        let sources = vec![Source::Task(integral.span)];
        block.finish(Kind::Objective, vec![term], sources, text)
    }
}
