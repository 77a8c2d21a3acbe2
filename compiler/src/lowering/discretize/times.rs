//! Rows of the grid: lengths of elements add up to steps, and to times.
//!
//! 0 = Σ_j h_kj - T/N,   0 = (k - 1) T/N - t_k1,   0 = t_k(j-1) + h_k(j-1) - t_kj
//!
//! A state that is physical time is k T/N where step k ends, and lengths are free.

use super::formals::Formals;
use super::formals::block::Builder;
use crate::lowering::mpcc::{Kind, Mpcc, Source, Span};

/// All rows.
pub(crate) fn state<'e>(formals: &Formals<'_, 'e>, mpcc: &mut Mpcc<'e>) {
    if let Some(clock) = formals.clock() {
        return clock_at_ends(formals, clock, mpcc);
    }
    let layout = formals.layout;
    if layout.elements == 1 && layout.horizon().is_none() {
        return;
    }
    let (exprs, step) = (mpcc.exprs, formals.step());
    let h = exprs.variables("h", layout.elements);
    let mut block = Builder::new("steps", [layout.each_step()]);
    for (j, &h) in h.iter().enumerate() {
        block = block.variable(h, |[k]| layout.h(k, j + 1));
    }
    let block = formals.with_horizon(block);
    let row = exprs.sum(h.iter().copied()) - step;
    let text = format!("0 = sum(h[k,j], j in 1..{}) - {step}", layout.elements);
    block.state(mpcc, Kind::Equation, vec![row], vec![Source::Grid], text);

    if layout.t(1, 1).is_none() {
        return;
    }
    let start = |k, j| layout.t(k, j).expect("all elements have a start");
    let [before, after] = ["before", "after"].map(|name| exprs.variable(name));
    if layout.horizon().is_some() && layout.steps > 1 {
        let block = Builder::new("starts", [Span::new("k", 2, layout.steps)]);
        let block = block.variable(after, |[k]| start(k, 1));
        let block = formals.with_horizon(formals.with_step(block, |[k]| k));
        let row = formals.before * step - after;
        let text = format!("0 = (k - 1)*{step} - t[k,1]");
        block.state(mpcc, Kind::Equation, vec![row], vec![Source::Grid], text);
    }
    if layout.elements == 1 {
        return;
    }
    let ranges = [layout.each_step(), Span::new("j", 2, layout.elements)];
    let block = Builder::new("times", ranges)
        .variable(before, |[k, j]| start(k, j - 1))
        .variable(h[0], |[k, j]| layout.h(k, j - 1))
        .variable(after, |[k, j]| start(k, j));
    let text = "0 = t[k,j-1] + h[k,j-1] - t[k,j]";
    let row = before + h[0] - after;
    block.state(mpcc, Kind::Equation, vec![row], vec![Source::Grid], text);
}

/// The clock at the ends of steps.
fn clock_at_ends<'e>(formals: &Formals<'_, 'e>, clock: usize, mpcc: &mut Mpcc<'e>) {
    let (layout, step) = (formals.layout, formals.step());
    let (last, end) = (layout.elements, layout.end);
    let time = formals.states[clock];
    let block = Builder::new("clock", [layout.each_step()])
        .variable(time, |[k]| layout.x(k, last, end) + clock);
    let block = formals.with_horizon(formals.with_step(block, |[k]| k));
    let row = (formals.before + 1.0) * step - time;
    let text = format!("0 = k*{step} - {time}[k,{last},{end}]");
    block.state(mpcc, Kind::Equation, vec![row], vec![Source::Grid], text);
}
