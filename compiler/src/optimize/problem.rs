//! A task with the program that it becomes.

use std::sync::Arc;

use nsd_solver::linalg::analyses::Analyses;
use nsd_solver::optimization::problem::Nlp;
use nsd_solver::optimization::scaling::Sizes;

use super::checks::runs::Runs;
use super::moved::Moved;
use super::start::products::products;
use super::steps;
use crate::lowering::dcs::Dcs;
use crate::lowering::discretize::{DiscretizeError, Grid, Layout, discretize};
use crate::lowering::mpcc::{Mpcc, Program};
use crate::lowering::{dcs, discretize};
use crate::system::System;
use crate::system::experiment::{Optimize, Settings};
use crate::system::freezing::{Frozen, freeze};

/// What initial values are in a program: which member of a pair is a variable may depend on them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Given<'p> {
    /// Numbers.
    Numbers,
    /// Variables, which are given their values by [`Problem::restart`], as the parameters at these places are.
    Inputs(&'p [usize]),
}

/// Everything about one task before it is solved.
pub(crate) struct Problem<'e> {
    pub(crate) system: System<'e>,
    /// The same in numerical time.
    pub(crate) frozen: Option<Frozen<'e>>,
    pub(crate) settings: Settings<'e>,
    pub(crate) task: Optimize<'e>,
    pub(crate) dcs: Dcs<'e>,
    pub(crate) mpcc: Mpcc<'e>,
    pub(crate) layout: Layout,
    pub(crate) program: Program,
    /// How large its variables, its rows and its objective are.
    pub(crate) sizes: Arc<Sizes>,
    pub(crate) runs: Runs<'e>,
    pub(crate) analyses: Analyses,
    /// The places of parameters that are inputs.
    pub(crate) open: Vec<usize>,
}

impl<'e> Problem<'e> {
    /// Discretizes and compiles.
    pub(crate) fn new(
        system: &System<'e>,
        settings: &Settings<'e>,
        task: &Optimize<'e>,
        given: Given<'_>,
    ) -> Result<Self, DiscretizeError> {
        let system = &steps::held(system, settings, task, given);
        let frozen = settings.freezes().then(|| {
            let frozen = freeze(system, settings.pace());
            frozen.expect("compilation has checked that the system can be frozen")
        });
        let lowered = frozen.as_ref().map_or(system, |frozen| &frozen.system);
        let dcs = dcs::lower(lowered, &settings.numerics.lowerings)
            .expect("the lowering has been checked");
        let grid = Grid::new(settings.horizon, task.discretization.intervals);
        let (mpcc, layout) = discretize(&dcs, grid, &discretize::Options::optimize(task))?;
        let (program, open) = match given {
            Given::Numbers => (mpcc.program(), &[][..]),
            Given::Inputs(params) => {
                let mut open = mpcc.clone();
                layout.given(&dcs).for_each(|(index, _)| open.free(index));
                (open.program(), params)
            }
        };
        let mut program = program.expect("kernels are smooth");
        let moved = Moved::new(&layout, &mpcc.conditions, products(&dcs));
        program.set_others(Arc::new(moved));
        let start = program.start().to_vec();
        let sizes = Sizes::new(&mut program, &mpcc.quantities(), &start);
        let length = sizes.variables[layout.h(1, 1)];
        program.set_steering(sizes.objective / (length * length));
        Ok(Problem {
            system: system.clone(),
            frozen,
            settings: settings.clone(),
            task: task.clone(),
            dcs,
            mpcc,
            layout,
            program,
            sizes: Arc::new(sizes),
            runs: Runs::default(),
            analyses: Analyses::default(),
            open: open.to_vec(),
        })
    }

    /// The system that is discretized.
    pub(crate) fn lowered(&self) -> &System<'e> {
        match &self.frozen {
            Some(frozen) => &frozen.system,
            None => &self.system,
        }
    }
}

/// What errors of an objective are measured by: itself, or where that is nearly zero, what its derivatives make of the sizes
/// of quantities, at most 1.
pub(crate) fn size_of_objective(problem: &Problem<'_>, objective: f64) -> f64 {
    objective.abs().max(problem.sizes.objective.min(1.0))
}

/// What errors of a state are measured by where it is nearly zero, at most 1.
pub(crate) fn size_of_state(problem: &Problem<'_>, state: usize) -> f64 {
    let layout = &problem.layout;
    let first = layout.x(layout.steps, layout.elements, layout.end);
    problem.sizes.variables[first + state].min(1.0)
}
