//! Rows of the grid: lengths of elements add up to steps, and to times.
//!
//! 0 = Σ_j h_kj - T/N,   0 = (k - 1) T/N - t_k1,   0 = t_k(j-1) + h_k(j-1) - t_kj
//!
//! A state that is physical time is k T/N where step k ends, and lengths are free.
//!
//! Where steps are not equal, step k has the length s_k T/N with
//!
//! 0 = Σ_k s_k - N,   0 = Σ_j h_kj - s_k T/N,   0 = t_(k-1)1 + s_(k-1) T/N - t_k1,
//!
//! and a state that is physical time is s_k T/N later where step k ends than where step k - 1 does.

use super::formals::Formals;
use super::formals::block::Builder;
use crate::lowering::mpcc::{Kind, Mpcc, Source, Span};

/// All rows.
pub(crate) fn state<'e>(formals: &Formals<'_, 'e>, mpcc: &mut Mpcc<'e>) {
    shares(formals, mpcc);
    if let Some(clock) = formals.clock() {
        return clock_at_ends(formals, clock, mpcc);
    }
    let layout = formals.layout;
    let has_lengths = layout.horizon().is_some() || layout.decided.share(1).is_some();
    // Equal lengths that are given add up.
    if !has_lengths && mpcc.bound_mut(layout.h(1, 1)).is_fixed() {
        return;
    }
    let (exprs, step) = (mpcc.exprs, formals.step());
    let h = exprs.variables("h", layout.elements);
    let mut block = Builder::new("steps", [layout.each_step()]);
    for (j, &h) in h.iter().enumerate() {
        block = block.variable(h, |[k]| layout.h(k, j + 1));
    }
    let block = formals.with_length(block, |[k]| k);
    let row = exprs.sum(h.iter().copied()) - step;
    let text = format!("0 = sum(h[k,j], j in 1..{}) - {step}", layout.elements);
    block.state(mpcc, Kind::Equation, vec![row], vec![Source::Grid], text);

    if layout.t(1, 1).is_none() {
        return;
    }
    let start = |k, j| layout.t(k, j).expect("all elements have a start");
    let [before, after] = ["before", "after"].map(|name| exprs.variable(name));
    if layout.decided.share(1).is_some() && layout.steps > 1 {
        let block = Builder::new("starts", [Span::new("k", 2, layout.steps)])
            .variable(before, |[k]| start(k - 1, 1))
            .variable(after, |[k]| start(k, 1));
        let block = formals.with_length(block, |[k]| k - 1);
        let row = before + step - after;
        let text = format!("0 = t[k-1,1] + {step} - t[k,1]");
        block.state(mpcc, Kind::Equation, vec![row], vec![Source::Grid], text);
    } else if layout.horizon().is_some() && layout.steps > 1 {
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

/// 0 = Σ_k s_k - N, where steps are not equal.
fn shares<'e>(formals: &Formals<'_, 'e>, mpcc: &mut Mpcc<'e>) {
    let Some(first) = formals.layout.decided.share(1) else {
        return;
    };
    let (exprs, n) = (mpcc.exprs, formals.layout.steps);
    let s = exprs.variables("s", n);
    let block = Builder::new("lengths", []).vector(&s, |[]| first);
    let row = exprs.sum(s.iter().copied()) - n as f64;
    let text = format!("0 = sum(s[k], k in 1..{n}) - {n}");
    block.state(mpcc, Kind::Equation, vec![row], vec![Source::Grid], text);
}

/// The clock at the ends of steps whose lengths are their own.
fn clock_of_shares<'e>(formals: &Formals<'_, 'e>, clock: usize, mpcc: &mut Mpcc<'e>) {
    let (layout, step) = (formals.layout, formals.step());
    let time = formals.states[clock];
    let before = mpcc.exprs.variable("before");
    let at = |k: usize| layout.x(k, layout.elements, layout.end) + clock;
    for (first, last) in [(1, 1), (2, layout.steps)] {
        if last < first {
            continue;
        }
        let block = Builder::new("clock", [Span::new("k", first, last)]);
        let block = block.variable(time, |[k]| at(k));
        let block = formals.with_length(block, |[k]| k);
        let (block, row) = match first {
            1 => (block, step - time),
            _ => (
                block.variable(before, |[k]| at(k - 1)),
                before + step - time,
            ),
        };
        let text = format!("0 = {row}");
        block.state(mpcc, Kind::Equation, vec![row], vec![Source::Grid], text);
    }
}

/// The clock at the ends of steps.
fn clock_at_ends<'e>(formals: &Formals<'_, 'e>, clock: usize, mpcc: &mut Mpcc<'e>) {
    if formals.layout.decided.share(1).is_some() {
        return clock_of_shares(formals, clock, mpcc);
    }
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
