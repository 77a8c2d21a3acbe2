//! Equations of what is continuous where it starts anew.
//!
//! Where the start is not known, or ψ contains what jumps where a step begins, continuous z at the start of the first
//! element, or of the first element of every step, are variables with the equations that contain them, and so are the
//! algebraic states in these that follow what is decided.

use crate::expr::variables_of;
use crate::lowering::discretize::formals::Formals;
use crate::lowering::discretize::formals::block::{Builder, variable};
use crate::lowering::discretize::layout::ends::{Start, jumping_with_states};
use crate::lowering::mpcc::{Kind, Mpcc, Span};

/// All rows.
pub(crate) fn state<'e>(formals: &Formals<'_, 'e>, mpcc: &mut Mpcc<'e>) {
    let Formals { dcs, layout, .. } = *formals;
    let start = Start::of(dcs);
    if !start.is_free {
        return;
    }
    // What jumps with states or switches of time has its equations where every element begins.
    let (_, jumping) = jumping_with_states(dcs);
    let led = layout.algebraics.led.iter().flat_map(|led| &led.equations);
    let led: Vec<usize> = led.copied().collect();
    let mut rows = start.rows;
    rows.retain(|row| layout.boundaries.is_none() || !jumping.contains(row));
    rows.retain(|row| !led.contains(row));
    if rows.is_empty() {
        return;
    }
    let h = mpcc.exprs.variable("h");
    let (equations, origins) = formals.equations(&rows, h);
    let steps = if start.restarts { layout.steps } else { 1 };
    let mut block = Builder::new("start", [Span::new("k", 1, steps)]);
    for &i in &start.states {
        block = block.variable(formals.states[i], |[k]| {
            let index = layout.started(k, i);
            index.expect("what follows what is decided has values where a step starts")
        });
    }
    // Other states are those before impulses.
    block = block.vector(&formals.states, |[k]| layout.before(k, 1));
    let kept = &layout.algebraics.kept;
    for &i in kept {
        block = block.variable(dcs.algebraics[i].var, |[k]| {
            let index = layout.z(k, 1, 0, i);
            index.expect("what is continuous is there where a step starts")
        });
    }
    // What jumps, as the sides of switches inside of others, is that of the first node.
    let block = formals.with_z(block, |[k]| [k, 1, 1]);
    let block = formals.at(block, h, |[k]| [k, 1, 0]);
    let occurring = variables_of(&equations);
    let mut z = dcs.algebraics.iter().enumerate();
    let jumps = match z.any(|(i, z)| !kept.contains(&i) && occurring.contains(&variable(z.var))) {
        true => ", jumps[k,1,1]",
        false => "",
    };
    let g = formals.arguments("t[k,1]", "x[k,1,0]", &format!("z[k,1,0]{jumps}"));
    let own = start.states.iter().map(|&i| formals.states[i].to_string());
    let own: Vec<String> = own.collect();
    let own = match own.is_empty() {
        true => String::new(),
        false => format!(", with x_start[k,1,0] for {}", own.join(", ")),
    };
    let text = format!("0 = g{g}{own}");
    block.state(mpcc, Kind::Equation, equations, origins, text);
}
