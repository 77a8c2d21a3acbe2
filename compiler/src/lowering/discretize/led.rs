//! What jumps with switches of time.
//!
//! Where time passes a step, switching functions that contain it jump, and λ with them. So the λ of these start anew in
//! every element, by their own equations in t and x of its left end, where what jumps is that of its first node:
//!
//! 0 = g(t_kj, x_kj0, λ_kj0, θ_kj1)
//!
//! Where nothing jumps there these are the λ in which the element before ends.

use super::formals::Formals;
use super::formals::block::Builder;
use crate::lowering::mpcc::{Kind, Mpcc};

/// What starts anew.
pub(crate) fn state<'e>(formals: &Formals<'_, 'e>, mpcc: &mut Mpcc<'e>) {
    let layout = formals.layout;
    let Some(led) = &layout.algebraics.led else {
        return;
    };
    let h = mpcc.exprs.variable("h");
    let block = Builder::new("led", [layout.each_step(), layout.each_element()]);
    let block = formals.at(block, h, |[k, j]| [k, j, 0]);
    // What is not continuous is that of the first node.
    let block = formals.with_z(block, |[k, j]| [k, j, 1]);
    let g = formals.arguments("t[k,j]", "x[k,j,0]", "z[k,j,0], jumps[k,j,1]");
    let text = format!("0 = g{g}, which jumps with time");
    let (rows, origins) = formals.equations(&led.equations, h);
    block.state(mpcc, Kind::Equation, rows, origins, text);
}
