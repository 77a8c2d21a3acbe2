//! The steps of contacts as the solver sees them: the program of so many elements, and the laws of impacts.
//!
//! Whether a member of a pair is a variable or a row depends on bounds. What a step starts from therefore has none
//! until it is given its value.

use nsd_solver::fesd::jumps;
use nsd_solver::fesd::jumps::{Contacts, Element, Points};

use super::super::complementarity::complementarity_open;
use crate::expr::{self, Expr, Var};
use crate::lowering::dcs::{Dcs, Impact, Kept};
use crate::lowering::discretize::{End, Grid, Layout, Options, WINDOW, discretize};
use crate::lowering::mpcc::Program;
use crate::system::System;

/// A program with the way back from its variables.
pub(crate) struct StepProgram {
    pub step: jumps::StepProgram<Program>,
    pub layout: Layout,
}

impl jumps::Program for Program {
    fn fix(&mut self, variable: usize, value: f64) {
        self.set_value(variable, value);
    }
}

impl StepProgram {
    /// For steps of the grid with these options; nothing where it cannot be made.
    pub fn new(system: &System, dcs: &Dcs, grid: Grid, options: &Options) -> Option<Self> {
        let (dcs, kept) = dcs.without_drift(system);
        let (mut mpcc, layout) = discretize(&dcs, grid, options).ok()?;
        let continuous: Vec<(usize, usize)> = layout.algebraics.fixed_at_start().collect();
        for &(index, _) in &continuous {
            mpcc.free(index);
        }
        let element = |(k, j)| Element {
            length: layout.h(k, j),
            start: layout.t(k, j),
            before: layout.before(k, j),
            states: (0..=layout.end).map(|m| layout.x(k, j, m)).collect(),
            algebraics: (0..=layout.end)
                .map(|m| {
                    let all = 0..layout.n_algebraics();
                    all.map(|i| layout.z(k, j, m, i)).collect()
                })
                .collect(),
            impulses: layout.impulses(k, j).expect("contacts give impulses"),
        };
        let step = jumps::StepProgram {
            program: mpcc.program().expect("kernels are smooth"),
            elements: layout.all_elements().map(element).collect(),
            nodes: layout.nodes,
            points: layout.points.clone(),
            n_states: layout.n_states(),
            length: grid.horizon,
            window: WINDOW * grid.horizon / layout.elements as f64,
            continuous,
            closed: kept.iter().map(|&Kept { closed, .. }| closed).collect(),
        };
        Some(StepProgram { step, layout })
    }
}

/// The functions of a system and its lowering at a point, with parameters as inputs.
pub(crate) fn points<'e>(system: &System<'e>, dcs: &Dcs<'e>) -> Points {
    let open: Vec<usize> = (0..system.params.len()).collect();
    let lowered = complementarity_open(system, dcs, &open);
    Points::new(contacts(dcs), lowered, End::new(dcs).equations)
}

/// Contacts and their laws. What these contain besides t, x and parameters has no value where elements meet.
fn contacts<'e>(dcs: &Dcs<'e>) -> Contacts {
    let law = |impact: &Impact<'e>| {
        let friction = impact.friction.as_ref();
        let none = dcs.exprs.constant(0.0);
        let friction = friction.map_or(none, |friction| friction.coefficient);
        [impact.speed, impact.restitution, friction]
    };
    let var = |e: Expr| e.as_variable().expect("what a DCS declares is a variable");
    let states = dcs.states.iter().map(|state| var(state.var));
    let params = dcs.params.iter().map(|param| var(param.var));
    let others = dcs.algebraics.iter().map(|z| var(z.var));
    let inputs: Vec<Var> = ([var(dcs.time)].into_iter())
        .chain(states)
        .chain(params)
        .chain(others)
        .collect();
    let laws: Vec<Expr> = dcs.impacts.iter().flat_map(law).collect();
    let values = dcs.params.iter().map(|param| param.value);
    let none = dcs.algebraics.iter().map(|_| f64::NAN);
    Contacts {
        gaps: dcs.impacts.iter().map(|impact| impact.gap).collect(),
        forces: dcs.impacts.iter().map(|impact| impact.force).collect(),
        laws: expr::compile(&inputs, &laws).expect("the laws of impacts are smooth"),
        parameters: values.chain(none).collect(),
    }
}
