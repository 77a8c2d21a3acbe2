//! Finite elements with switch detection (FESD): Dcs -> Mpcc.
//!
//! N steps of equal length T/N, or of lengths s_k T/N (`times`), consist of elements j of free lengths h_kj, which are a
//! Runge-Kutta step each. With polynomials x through x_kj0, .., x_kjn (integral form, collocation methods) or slopes v
//! (differential form):
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
//! `layout` says which variable is what, `formals` binds the symbols of the model to variables; every other file states
//! rows in these.
//!
//! Nurkanović, Sperl, Albrecht & Diehl 2024; Baumrucker & Biegler 2009 for free lengths.

mod branch;
mod cross;
mod definitions;
mod directions;
mod dynamics;
mod equilibrate;
mod error;
mod formals;
mod impulses;
mod layout;
mod led;
mod options;
mod task;
#[cfg(test)]
mod tests;
mod times;

use nsd_solver::integrate::tableau::Tableau;

use cross::Pairs;
use dynamics::Dynamics;
pub use error::{DiscretizeError, check_given};
use formals::Formals;
pub use formals::{beginning, ends, inside};
pub use impulses::WINDOW;
pub use layout::Layout;
pub(crate) use layout::ends::End;
pub(crate) use layout::fixed_params;
pub use options::{Detection, Elements, Grid, Options};
pub(crate) use task::chosen;

use crate::expr::Expr;
use crate::lowering::dcs::Dcs;
use crate::lowering::mpcc::{Conditions, Mpcc};
pub use crate::system::experiment::{Cross, Equilibration, Form};

/// Discretizes; the scheme has its number of nodes, and the form.
pub fn discretize<'e>(
    dcs: &Dcs<'e>,
    grid: Grid,
    options: &Options,
) -> Result<(Mpcc<'e>, Layout), DiscretizeError> {
    error::check_size(dcs, grid, options)?;
    error::check_plain(dcs, options)?;
    if options.elements.detection().is_some() {
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
    let rates: Vec<Expr> = integrals.iter().map(|integral| integral.rate).collect();
    let detection = options.elements.detection();
    let layout = layout::declare(
        &mut mpcc,
        dcs,
        grid,
        &tableau,
        form,
        options.elements,
        &rates,
    );
    let formals = Formals::new(dcs, &layout, grid);
    let pairs = Pairs::new(&formals, detection.map(|detection| detection.cross));
    let dynamics = Dynamics {
        formals: &formals,
        tableau: &tableau,
        form,
    };
    definitions::state(&pairs, detection, &mut mpcc);
    dynamics.state(&mut mpcc);
    times::state(&formals, &mut mpcc);
    pairs.state(&mut mpcc);
    branch::state(&formals, &mut mpcc);
    impulses::state(&formals, &mut mpcc);
    led::state(&formals, &mut mpcc);
    directions::state(&formals, &mut mpcc);
    equilibrate::state(&pairs, detection, &mut mpcc);
    task::state(&pairs, &tableau, &integrals, &mut mpcc)?;
    debug_assert_eq!(mpcc.verify(), Ok(()), "discretization keeps the invariants");
    Ok((mpcc, layout))
}
