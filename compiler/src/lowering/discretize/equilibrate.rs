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

use super::Detection;
use super::cross::Pairs;
use super::formals::Formals;
use super::formals::block::Builder;
use crate::expr::Expr;
use crate::lowering::mpcc::{Kind, Mpcc, Source, Span};
use crate::system::experiment::Equilibration;

/// Rows or terms of the objective that say so.
pub(crate) fn state<'e>(pairs: &Pairs<'_, 'e>, detection: Option<Detection>, mpcc: &mut Mpcc<'e>) {
    if pairs.formals.layout.elements == 1 {
        return;
    }
    let Some(detection) = detection else {
        return equal(pairs.formals, mpcc);
    };
    // Simulations have no other objective.
    let kind = match pairs.formals.dcs.task {
        Some(_) => Kind::Steering,
        None => Kind::Objective,
    };
    match detection.equilibration {
        Equilibration::None => {}
        Equilibration::Mean { weight } => mean(pairs.formals, kind, weight, mpcc),
        Equilibration::Tanh { weight, scale } => {
            let weighted = factor(weight);
            let text = format!("{weighted}tanh(eta[k,j]/{scale})*(h[k,j+1] - h[k,j])^2");
            let term =
                |eta: Expr<'e>, change: Expr<'e>| weight * (eta / scale).tanh() * change.powi(2);
            between(pairs, kind, text, term, mpcc);
        }
        Equilibration::Exact => {
            let text = "0 = eta[k,j]*(h[k,j+1] - h[k,j])".to_owned();
            between(
                pairs,
                Kind::Equation,
                text,
                |eta, change| eta * change,
                mpcc,
            );
        }
    }
}

/// Lengths are equal whatever is between elements, where they are not given.
fn equal<'e>(formals: &Formals<'_, 'e>, mpcc: &mut Mpcc<'e>) {
    let layout = formals.layout;
    if mpcc.bound_mut(layout.h(1, 1)).is_fixed() {
        return;
    }
    let h = mpcc.exprs.variables("h", 2);
    let ranges = [layout.each_step(), Span::new("j", 1, layout.elements - 1)];
    // Elements of a step stand one after the other.
    let block = Builder::new("equal", ranges).vector(&h, |[k, j]| layout.h(k, j));
    let (row, text) = (vec![h[1] - h[0]], "0 = h[k,j+1] - h[k,j]");
    block.state(mpcc, Kind::Equation, row, vec![Source::Grid], text);
}

/// A term in h and its mean for each element.
fn mean<'e>(formals: &Formals<'_, 'e>, kind: Kind, weight: f64, mpcc: &mut Mpcc<'e>) {
    let layout = formals.layout;
    let mean = match layout.decided.share(1) {
        Some(_) => formals.step() / layout.elements as f64,
        None => formals.horizon / (layout.steps * layout.elements) as f64,
    };
    let h = mpcc.exprs.variable("h");
    let ranges = [layout.each_step(), layout.each_element()];
    let block = Builder::new("equilibration", ranges).variable(h, |[k, j]| layout.h(k, j));
    let block = formals.with_length(block, |[k, _]| k);
    let text = format!("{}(h[k,j] - {mean})^2", factor(weight));
    let term = weight * (h - mean).powi(2);
    block.state(mpcc, kind, vec![term], vec![Source::Grid], text);
}

/// A row or term in η and Δh for each two elements of a step.
fn between<'e>(
    pairs: &Pairs<'_, 'e>,
    kind: Kind,
    text: String,
    row: impl Fn(Expr<'e>, Expr<'e>) -> Expr<'e>,
    mpcc: &mut Mpcc<'e>,
) {
    let (formals, exprs) = (pairs.formals, mpcc.exprs);
    let Formals { dcs, layout, .. } = *formals;
    let ranges = [layout.each_step(), Span::new("j", 1, layout.elements - 1)];
    let h = exprs.variables("h", 2);
    let mut block = Builder::new("equilibration", ranges)
        .variable(h[0], |[k, j]| layout.h(k, j))
        .variable(h[1], |[k, j]| layout.h(k, j + 1));
    let mut factors = Vec::new();
    for group in pairs.crossed() {
        let mut sides = Vec::new();
        for side in [&group.jumps, &group.continuous] {
            let (before, behind);
            (block, before) = side.sum(formals, block, |element| element);
            (block, behind) = side.sum(formals, block, |[k, j]| [k, j + 1]);
            sides.push((before, behind));
        }
        for (i, b) in group.continuous.members.iter().enumerate() {
            let mut products = sides.iter().map(|(before, behind)| before[i] * behind[i]);
            let is_gap = dcs.impacts.iter().any(|impact| impact.gap == b.z);
            let is_slip = dcs.switches.discs.iter().any(|disc| disc.slip == b.z);
            factors.push(match is_gap || is_slip {
                false => exprs.sum(products),
                // Open on both sides of an impact, where the gap is zero.
                true => {
                    let there = exprs.variable("there");
                    block = block.variable(there, |[k, j]| {
                        let index = layout.z(k, j + 1, 0, b.z);
                        index.expect("what is continuous is there at left ends")
                    });
                    let forces = products.next();
                    there + forces.expect("what jumps comes first")
                }
            });
        }
    }
    let row = row(exprs.product(factors), h[1] - h[0]);
    block.state(mpcc, kind, vec![row], vec![Source::Grid], text);
}

/// η as it is printed.
pub(crate) fn eta_text(pairs: &Pairs) -> Vec<String> {
    let lines = pairs.crossed().map(|group| {
        let [a, b] = [&group.jumps, &group.continuous]
            .map(|side| format!("{}*{}", side.summed_in("j"), side.summed_in("j+1")));
        format!("product over pairs of {b} + {a}")
    });
    let lines: Vec<String> = lines.collect();
    if lines.is_empty() {
        return vec!["1".to_owned()];
    }
    lines
}

/// A weight in front of a term.
fn factor(weight: f64) -> String {
    match weight {
        1.0 => String::new(),
        _ => format!("{weight}*"),
    }
}
