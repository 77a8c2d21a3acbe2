//! What jumps with switches of time.
//!
//! Where time passes a step, switching functions that contain it jump, and λ with them. So the λ of these start anew in
//! every element, by their own equations in t and x of its left end, where what jumps is that of its first node:
//!
//! 0 = g(t_kj, x_kj0, λ_kj0, θ_kj1)
//!
//! Where nothing jumps there these are the λ in which the element before ends.

use super::Problem;
use super::block::{Builder, variable};
use super::dynamics::sources;
use super::layout::End;
use crate::expr::{Expr, Var, variables_of};
use crate::lowering::dcs::Dcs;
use crate::lowering::mpcc::{Bounds, Kind, Mpcc, Span, n_places};

/// The continuous z that start anew in every element.
#[derive(Clone, Debug)]
pub(crate) struct Led {
    /// The first index.
    first: usize,
    /// Which z these are.
    algebraics: Vec<usize>,
    /// The equations that say what they are.
    equations: Vec<usize>,
}

impl Led {
    /// The index of z_i at the left end of an element, by its number.
    pub fn index(&self, element: usize, i: usize) -> Option<usize> {
        let place = self.algebraics.binary_search(&i).ok()?;
        Some(self.first + element * self.algebraics.len() + place)
    }

    /// Whether an equation says what starts anew.
    pub fn states(&self, equation: usize) -> bool {
        self.equations.contains(&equation)
    }
}

/// The continuous z that jump with switches of time, and the equations that say what they are.
fn jumping(dcs: &Dcs) -> (Vec<usize>, Vec<usize>) {
    let steps: Vec<Expr> = dcs
        .leading
        .iter()
        .map(|&switch| dcs.alphas[switch])
        .collect();
    let mut known: Vec<Var> = variables_of(&steps);
    let rows = End::new(dcs).equations;
    let continuous = dcs.algebraics.iter().filter(|z| z.continuous);
    let continuous: Vec<Var> = continuous.map(|z| variable(z.var)).collect();
    let mut equations: Vec<usize> = Vec::new();
    loop {
        let jumps = |row: &&usize| {
            let occurring = variables_of(&[dcs.equations[**row]]);
            !equations.contains(*row) && occurring.iter().any(|var| known.contains(var))
        };
        let Some(&row) = rows.iter().find(jumps) else {
            break;
        };
        let occurring = variables_of(&[dcs.equations[row]]).into_iter();
        known.extend(occurring.filter(|var| continuous.contains(var)));
        equations.push(row);
    }
    equations.sort_unstable();
    let is_new = |i: &usize| {
        let z = &dcs.algebraics[*i];
        z.continuous && known.contains(&variable(z.var))
    };
    (
        (0..dcs.algebraics.len()).filter(is_new).collect(),
        equations,
    )
}

/// Declares what starts anew; `bounds` are those of all algebraic variables.
pub(crate) fn declare(
    mpcc: &mut Mpcc,
    dcs: &Dcs,
    [step, element]: [Span; 2],
    bounds: &[Bounds],
) -> Option<Led> {
    if dcs.leading.is_empty() || !dcs.impacts.is_empty() {
        return None;
    }
    let (algebraics, equations) = jumping(dcs);
    if algebraics.is_empty() {
        return None;
    }
    let left = [step, element, Span::new("m", 0, 0)];
    let names = algebraics
        .iter()
        .map(|&i| dcs.algebraics[i].var.to_string());
    let own: Vec<Bounds> = algebraics.iter().map(|&i| bounds[i]).collect();
    let own = own.repeat(n_places(&left));
    Some(Led {
        first: mpcc.declare("z", names.collect(), &left, own),
        algebraics,
        equations,
    })
}

impl<'e> Problem<'_, 'e> {
    /// What starts anew.
    pub(crate) fn leads(&self, mpcc: &mut Mpcc<'e>) {
        let (dcs, layout) = (self.dcs, &self.layout);
        let Some(led) = &layout.led else {
            return;
        };
        let h = mpcc.exprs.variable("h");
        let rows: Vec<Expr> = led
            .equations
            .iter()
            .map(|&row| dcs.equations[row])
            .collect();
        let origins = led.equations.iter().map(|&row| dcs.origins.equations[row]);
        let origins = sources(&origins.collect::<Vec<_>>());
        let mut block = Builder::new("led", [self.steps(), self.elements()])
            .variable(h, |[k, j]| layout.h(k, j))
            .number(self.node, |_| 0.0)
            .vector(&self.states(), |[k, j]| layout.x(k, j, 0));
        block = self.decided(block, |[k, _]| k);
        if layout.t(1, 1).is_some() {
            block = block.variable(dcs.time, |[k, j]| layout.t(k, j).unwrap_or(0));
        }
        let occurring = variables_of(&rows);
        for (i, z) in dcs.algebraics.iter().enumerate() {
            if !occurring.contains(&variable(z.var)) {
                continue;
            }
            let node = usize::from(!z.continuous);
            block = block.variable(z.var, |[k, j]| {
                let index = layout.z(k, j, node, i);
                index.expect("what is continuous is there at left ends, all else at nodes")
            });
        }
        let g = self.arguments("t[k,j]", "x[k,j,0]", "z[k,j,0], jumps[k,j,1]");
        let text = format!("0 = g{g}, which jumps with time");
        let rows = self.timed(&rows, h);
        mpcc.blocks
            .push(block.finish(Kind::Equation, rows, origins, text));
    }
}
