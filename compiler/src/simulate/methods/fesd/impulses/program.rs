//! A system with contacts as the solver sees it: its functions at a point, and the programs of its steps.
//!
//! Whether a member of a pair is a variable or a row depends on bounds. What a step starts from therefore has none
//! until it is given its value.

use nsd_solver::fesd::jumps;
use nsd_solver::fesd::jumps::{Contacts, Points, StepProgram};
use nsd_solver::integrate::tableau::Tableau;
use rustc_hash::FxHashMap;

use super::super::complementarity::complementarity_open;
use crate::expr::{self, Expr, Var};
use crate::lowering::dcs::{Dcs, Impact, Kept};
use crate::lowering::discretize::{self, Detection, Elements, End, Grid, WINDOW, discretize};
use crate::lowering::hybrid;
use crate::lowering::mpcc::Program;
use crate::simulate::record::elements::shape;
use crate::simulate::reference::{impacts, without_outputs};
use crate::source::Span;
use crate::system::experiment::{Equilibration, FesdOptions};
use crate::system::task::{Cost, Lengths, Shape as ControlShape, Task};
use crate::system::{Param, System};

impl jumps::Program for Program {
    fn bound(&mut self, variable: usize, lower: f64, upper: f64) {
        self.set_bounds(variable, lower, upper);
    }

    fn n_parameters(&self) -> usize {
        Program::n_parameters(self)
    }

    fn set_parameters(&mut self, values: &[f64]) {
        Program::set_parameters(self, values);
    }
}

/// A system for runs to a horizon, with some parameters open, by their numbers, and no programs yet.
pub(crate) fn plain(
    system: &System,
    dcs: &Dcs,
    (horizon, options): (f64, &FesdOptions),
    open: &[usize],
) -> jumps::System<Program> {
    let (family, nodes) = options.scheme;
    let tableau = Tableau::new(family, nodes).expect("the number of nodes has been checked");
    jumps::System {
        points: points(system, dcs),
        shape: shape(system, &tableau.points(), nodes),
        events: hybrid::lower_open(&without_outputs(system), horizon, open),
        open: open.to_vec(),
        parameters: system.exogenous.numbers().map(|(_, p)| p).collect(),
        programs: FxHashMap::default(),
    }
}

/// The program of steps with so many elements, of a length that is their last parameter; nothing where it cannot be made.
///
/// Pairs are sums over an element, and lengths are equal where nothing happens between them, whatever the options say of
/// the printed form: its solutions are the same.
pub(crate) fn program(
    system: &System,
    dcs: &Dcs,
    options: &FesdOptions,
    elements: usize,
) -> Option<StepProgram<Program>> {
    let (mut dcs, kept) = dcs.without_drift(system);
    let length = dcs.exprs.variable("step");
    dcs.params.push(Param {
        name: "step".into(),
        var: length,
        value: 1.0,
    });
    dcs.task = Some(nothing(length, Span::default()));
    let options = discretize::Options::fesd(options);
    let options = discretize::Options {
        elements: Elements::Detected(Detection {
            elements,
            cross: discretize::Cross::SumBoth,
            equilibration: Equilibration::Mean { weight: 1.0 },
            spread: elements as f64 - 1.0,
        }),
        ..options
    };
    let grid = Grid::new(1.0, 1);
    let (mut mpcc, layout) = discretize(&dcs, grid, &options).ok()?;
    let continuous: Vec<(usize, usize)> = layout.algebraics.fixed_at_start().collect();
    for &(index, _) in &continuous {
        mpcc.free(index);
    }
    let (elements, bounds) = (layout.step(1), mpcc.bounds());
    let share = |element: &jumps::Element| {
        let length = bounds[element.length];
        [length.lower, length.upper]
    };
    Some(StepProgram {
        program: mpcc.program().expect("kernels are smooth"),
        shares: elements.iter().map(share).collect(),
        elements,
        nodes: layout.nodes,
        points: layout.points.clone(),
        n_states: layout.n_states(),
        window: WINDOW / layout.elements as f64,
        numbers: dcs.params.iter().map(|param| param.value).collect(),
        continuous,
        closed: kept.iter().map(|&Kept { closed, .. }| closed).collect(),
    })
}

/// A task with nothing to decide, of a length that is a parameter.
fn nothing(length: Expr<'_>, span: Span) -> Task<'_> {
    Task {
        controls: Vec::new(),
        shape: ControlShape::Constant,
        lengths: Lengths::Equal,
        horizon: None,
        length: Some(length),
        params: Vec::new(),
        initial: Vec::new(),
        bounds: Vec::new(),
        integrals: 0,
        clock: None,
        cost: Cost {
            value: length.exprs().constant(0.0),
            terms: Vec::new(),
            span,
        },
        rows: Vec::new(),
    }
}

/// The functions of a system and its lowering at a point, with parameters as inputs.
fn points<'e>(system: &System<'e>, dcs: &Dcs<'e>) -> Points {
    let open: Vec<usize> = (0..system.exogenous.params.len()).collect();
    let lowered = complementarity_open(system, dcs, &open);
    Points::new(contacts(system, dcs), lowered, End::new(dcs).equations)
}

/// Contacts and their laws. What these contain besides t, x and parameters has no value where elements meet.
fn contacts<'e>(system: &System<'e>, dcs: &Dcs<'e>) -> Contacts {
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
        impacts: impacts(system, &dcs.impacts),
        laws: expr::compile(&inputs, &laws).expect("the laws of impacts are smooth"),
        parameters: values.chain(none).collect(),
    }
}
