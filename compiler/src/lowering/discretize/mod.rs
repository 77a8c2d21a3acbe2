//! Finite elements with switch detection (FESD): Dcs -> Mpcc.
//!
//! N steps of equal length T/N consist of elements j of free lengths h_kj, which are a Runge-Kutta step each. With
//! polynomials x through x_kj0, .., x_kjn (integral form, collocation methods) or slopes v (differential form):
//!
//! 0 = Σ_l d_ml x_kjl - h_kj f(t_kjm, x_kjm, z_kjm)   or   0 = x_kj0 + h_kj Σ_l a_ml v_kjl - x_kjm,  0 = f(..) - v_kjm
//! 0 = g(t_kjm, x_kjm, z_kjm),   0 = Σ_j h_kj - T/N,   t_kjm = t_kj + c_m h_kj
//!
//! Node 0 is the left end of an element and the right end of the one before. Where the last node is not the right end,
//! that is node n + 1: x there, and of z what is continuous with the equations that contain it.
//!
//! In a pair one member b is continuous along solutions (λ) and one a jumps (θ, α, 1 - α). Switches are at ends of
//! elements only, because within an element no a at any node and no b at any node or end are both positive, see
//! `cross`. Elements without a switch between them get equal lengths, see `equilibrate`.
//! Time stepping is the same with lengths that are given and pairs at each node alone.
//!
//! The state and the continuous z at the start of the first element are fixed variables: there, as everywhere off the
//! surfaces, λ is what the switching functions say.
//!
//! Where switching functions jump with a switch of time, what depends on them starts anew in every element, see `led`.
//!
//! Where contacts give impulses, every element has a left end of its own, and states jump to it, see `impulses`; slip
//! velocities with two entries do not turn round within one, see `directions`.
//!
//! Where something is optimized, repelling sliding modes of nonlinear switches are left out, see `branch`; steps are
//! control intervals; `task` adds controls, free parameters, a free T and constraints, `quadrature` the integrals of
//! the cost.
//!
//! Nurkanović, Sperl, Albrecht & Diehl 2024; Baumrucker & Biegler 2009 for free lengths.

mod block;
mod branch;
mod cross;
mod data;
mod definitions;
mod directions;
mod dynamics;
mod equilibrate;
mod error;
mod given;
mod impulses;
mod layout;
mod led;
mod task;
#[cfg(test)]
mod tests;

use nsd_solver::integrate::tableau::{Family, Tableau};

pub use data::inside;
pub use error::{DiscretizeError, check_given, check_start};
pub use impulses::WINDOW;
pub use layout::Layout;
pub(crate) use task::fixed_params;

use crate::expr::Expr;
use crate::lowering::dcs::Dcs;
use crate::lowering::mpcc::{Conditions, Mpcc};
pub use crate::system::experiment::{Cross, Equilibration, Form};
use crate::system::experiment::{FesdOptions, Optimize, SteppingOptions};

/// The steps of a horizon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// When it starts.
    pub start: f64,
    /// T.
    pub horizon: f64,
    /// N.
    pub steps: usize,
}

/// How a step becomes rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Family of Runge-Kutta methods, and number of nodes.
    pub scheme: (Family, usize),
    /// How the method is written; `None` for the integral form where there is one.
    pub form: Option<Form>,
    /// How switches are detected; `None` for time stepping, which does not.
    pub detection: Option<Detection>,
}

/// How switches get to the ends of elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detection {
    /// Elements per step; r switches inside a step need r + 1.
    pub elements: usize,
    /// How pairs across the nodes are added up.
    pub cross: Cross,
    /// What makes lengths equal where there is no switch.
    pub equilibration: Equilibration,
    /// γ: lengths are between (1 - γ) and (1 + γ) times their mean, and not negative.
    pub spread: f64,
}

impl Default for Detection {
    fn default() -> Self {
        let FesdOptions {
            elements,
            cross,
            equilibration,
            ..
        } = FesdOptions::default();
        Detection {
            elements,
            cross,
            equilibration,
            spread: 1.0,
        }
    }
}

impl Options {
    /// Those of `method fesd`.
    pub fn fesd(options: &FesdOptions) -> Self {
        Options {
            scheme: options.scheme,
            form: options.form,
            detection: Some(Detection {
                elements: options.elements,
                cross: options.cross,
                equilibration: options.equilibration,
                ..Detection::default()
            }),
        }
    }

    /// Those of an `optimize`.
    pub fn optimize(task: &Optimize) -> Self {
        Options {
            scheme: task.discretization.scheme,
            form: None,
            detection: Some(Detection {
                elements: task.discretization.elements,
                cross: task.options.cross,
                equilibration: task.options.equilibration,
                // An element may be as long as its interval: which of them a switch is between is the solver's choice.
                spread: task.discretization.elements as f64 - 1.0,
            }),
        }
    }

    /// Those of `method timestepping`.
    pub fn stepping(options: &SteppingOptions) -> Self {
        Options {
            scheme: options.scheme(),
            form: None,
            detection: None,
        }
    }
}

/// What the passes of this folder share.
struct Problem<'p, 'e> {
    dcs: &'p Dcs<'e>,
    grid: Grid,
    tableau: Tableau,
    form: Form,
    detection: Option<Detection>,
    layout: Layout,
    /// c, a formal argument.
    node: Expr<'e>,
    /// T: a number, or a formal argument where it is free.
    horizon: Expr<'e>,
    /// k - 1, a formal argument.
    before: Expr<'e>,
    /// Functions of time as polynomials.
    data: Vec<data::Polynomial<'e>>,
    /// Linear controls at the end of a step, formal arguments; at its start they are those of the system.
    next: Vec<Expr<'e>>,
}

/// Discretizes; the scheme has its number of nodes, and the form.
pub fn discretize<'e>(
    dcs: &Dcs<'e>,
    grid: Grid,
    options: &Options,
) -> Result<(Mpcc<'e>, Layout), DiscretizeError> {
    error::check_size(dcs, grid, options)?;
    if options.detection.is_some() {
        check_given(dcs, grid.start)?;
    }
    let (reduced, integrals) = task::quadrature::split(dcs);
    let dcs = &reduced;
    let (family, n_nodes) = options.scheme;
    let tableau = Tableau::new(family, n_nodes).expect("the number of nodes has been checked");
    let usual = match Form::Integral.is_of(family) {
        true => Form::Integral,
        false => Form::Differential,
    };
    let form = options.form.unwrap_or(usual);
    assert!(
        form.is_of(family),
        "the form of the scheme has been checked"
    );

    let mut mpcc = Mpcc {
        exprs: dcs.exprs,
        name: dcs.name.clone(),
        remarks: definitions::remarks(dcs, grid, form, options),
        params: fixed_params(dcs),
        definitions: Vec::new(),
        variables: Vec::new(),
        blocks: Vec::new(),
        terms: Vec::new(),
        stated: Vec::new(),
        conditions: Conditions::default(),
    };
    let layout = layout::declare(
        &mut mpcc,
        dcs,
        grid,
        &tableau,
        form,
        options.detection,
        &integrals,
    );
    let problem = Problem {
        dcs,
        grid,
        tableau,
        form,
        detection: options.detection,
        layout,
        node: dcs.exprs.variable("c"),
        horizon: match dcs.task.as_ref().and_then(|task| task.horizon) {
            Some(_) => dcs.exprs.variable("T"),
            None => dcs.exprs.constant(grid.horizon),
        },
        before: dcs.exprs.variable("before"),
        data: data::polynomials(dcs),
        next: task::next(dcs),
    };
    problem.define(&mut mpcc);
    problem.dynamics(&mut mpcc);
    problem.complementarity(&mut mpcc);
    problem.branches(&mut mpcc);
    problem.impulses(&mut mpcc);
    problem.leads(&mut mpcc);
    problem.directions(&mut mpcc);
    problem.equilibrate(&mut mpcc);
    problem.task(&mut mpcc, &integrals)?;
    debug_assert_eq!(mpcc.verify(), Ok(()), "discretization keeps the invariants");
    Ok((mpcc, problem.layout))
}
