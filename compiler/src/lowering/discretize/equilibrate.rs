//! Equal lengths of elements between which there is no switch.
//!
//! η = Π_i (Σ_l b_il Σ_l b⁺_il + Σ_m a_im Σ_m a⁺_im),   sums over the element before (b, a) and behind (b⁺, a⁺)
//!
//! η is positive exactly when every pair has the same positive member on both sides, and then the lengths have to be
//! equal: η Δh = 0. For the step formulation these are both pairs of a switch: with λ alone η would vanish while
//! sliding, and leave the lengths free there (Nurkanović et al. 2024).
//! Of a contact the gap where the elements meet takes the place of Σ_l b_il Σ_l b⁺_il: it is open before and behind an
//! impact, at which lengths are free. So does γ = |w| where the elements meet of a slip velocity with two entries: it
//! slips before and behind an instant at which it turns round, and where it is at rest.

use super::Problem;
use super::block::Builder;
use crate::expr::Expr;
use crate::lowering::mpcc::{Kind, Mpcc, Source, Span};
use crate::system::experiment::Equilibration;

impl<'e> Problem<'_, 'e> {
    /// Rows or terms of the objective that say so.
    pub(crate) fn equilibrate(&self, mpcc: &mut Mpcc<'e>) {
        let Some(detection) = self.detection.filter(|detection| detection.elements > 1) else {
            return;
        };
        match detection.equilibration {
            Equilibration::None => {}
            Equilibration::Mean { weight } => self.mean(weight, mpcc),
            Equilibration::Tanh { weight, scale } => {
                let weighted = factor(weight);
                let text = format!("{weighted}tanh(eta[k,j]/{scale})*(h[k,j+1] - h[k,j])^2");
                let term = |eta: Expr<'e>, change: Expr<'e>| {
                    weight * (eta / scale).tanh() * change.powi(2)
                };
                self.between(self.steering(), text, term, mpcc);
            }
            Equilibration::Exact => {
                let text = "0 = eta[k,j]*(h[k,j+1] - h[k,j])".to_owned();
                self.between(Kind::Equation, text, |eta, change| eta * change, mpcc);
            }
        }
    }

    /// Simulations have no other objective.
    fn steering(&self) -> Kind {
        match self.dcs.task {
            Some(_) => Kind::Steering,
            None => Kind::Objective,
        }
    }

    fn mean(&self, weight: f64, mpcc: &mut Mpcc<'e>) {
        let mean = self.horizon / (self.layout.steps * self.layout.elements) as f64;
        let h = mpcc.exprs.variable("h");
        let block = Builder::new("equilibration", [self.steps(), self.elements()])
            .variable(h, |[k, j]| self.layout.h(k, j));
        let block = self.with_horizon(block);
        let text = format!("{}(h[k,j] - {mean})^2", factor(weight));
        let term = weight * (h - mean).powi(2);
        mpcc.blocks
            .push(block.finish(self.steering(), vec![term], vec![Source::Grid], text));
    }

    /// A row or term in η and Δh for each two elements of a step.
    fn between(
        &self,
        kind: Kind,
        text: String,
        row: impl Fn(Expr<'e>, Expr<'e>) -> Expr<'e>,
        mpcc: &mut Mpcc<'e>,
    ) {
        let (exprs, layout) = (mpcc.exprs, &self.layout);
        let ranges = [self.steps(), Span::new("j", 1, layout.elements - 1)];
        let h = exprs.variables("h", 2);
        let mut block = Builder::new("equilibration", ranges)
            .variable(h[0], |[k, j]| layout.h(k, j))
            .variable(h[1], |[k, j]| layout.h(k, j + 1));
        let mut factors = Vec::new();
        for group in self.groups().iter().filter(|group| group.is_crossed) {
            let [m, l] = self.spans(group);
            let mut sides = Vec::new();
            for (members, nodes) in [(group.jumps(), m), (group.continuous(), l)] {
                let [before, behind] = [0, 1].map(|_| self.copied(&members, nodes));
                for (next, copies) in [(0, &before), (1, &behind)] {
                    for (node, copy) in copies {
                        block = self.bind(block, &members, copy, |[k, j]| (k, j + next, *node));
                    }
                }
                sides.push((self.sum(&before), self.sum(&behind)));
            }
            for (i, pair) in group.members.iter().enumerate() {
                let mut products = sides.iter().map(|(before, behind)| before[i] * behind[i]);
                let meets = self.impact_of(pair.continuous).is_some();
                factors.push(match meets || self.is_slip(pair.continuous) {
                    false => exprs.sum(products),
                    // Open on both sides of an impact, where the gap is zero.
                    true => {
                        let there = exprs.variable("there");
                        let i = self.algebraic(pair.continuous);
                        let index = |[k, j]: [usize; 2]| layout.z(k, j + 1, 0, i);
                        block = block.variable(there, |place| {
                            index(place).expect("what is continuous is there at left ends")
                        });
                        let forces = products.next();
                        there + forces.expect("what jumps comes first")
                    }
                });
            }
        }
        let row = row(exprs.product(factors), h[1] - h[0]);
        mpcc.blocks
            .push(block.finish(kind, vec![row], vec![Source::Grid], text));
    }

    /// η as it is printed.
    pub(crate) fn eta_text(&self) -> Vec<String> {
        let groups = self.groups();
        let crossed = groups.iter().filter(|group| group.is_crossed);
        let lines = crossed.map(|group| {
            let [m, l] = self.spans(group);
            let (a, b) = group.names;
            let product = |name: &str, nodes: Span| {
                let side = |element: &str| {
                    let (index, first, last) = (nodes.name, nodes.first, nodes.last);
                    format!("sum({name}(z[k,{element},{index}]), {index} in {first}..{last})")
                };
                format!("{}*{}", side("j"), side("j+1"))
            };
            format!(
                "product over pairs of {} + {}",
                product(b, l),
                product(a, m)
            )
        });
        let lines: Vec<String> = lines.collect();
        if lines.is_empty() {
            return vec!["1".to_owned()];
        }
        lines
    }
}

/// A weight in front of a term.
fn factor(weight: f64) -> String {
    match weight {
        1.0 => String::new(),
        _ => format!("{weight}*"),
    }
}
