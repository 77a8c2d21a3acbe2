//! Known solutions satisfy the rows, derivatives agree with differences, printed forms.

mod derivatives;
mod known;
mod printed;

use nsd_solver::tableau::Family;

use super::*;
use crate::dcs::{Formulation, lower_as};
use crate::system::System;

const FORMULATIONS: [Formulation; 2] = [Formulation::Stewart, Formulation::Step];
const CROSS: [Cross; 4] = [
    Cross::All,
    Cross::SumTheta,
    Cross::SumLambda,
    Cross::SumBoth,
];

fn discretized<'e>(
    system: &System<'e>,
    formulation: Formulation,
    grid: Grid,
    options: &Options,
) -> (Mpcc<'e>, Layout) {
    let dcs = lower_as(system, formulation).expect("the system is small");
    let (mpcc, layout) = discretize(&dcs, grid, options).expect("the problem is small");
    mpcc.verify().expect("discretization keeps the invariants");
    (mpcc, layout)
}

fn options(scheme: (Family, usize), detection: Detection) -> Options {
    Options {
        scheme,
        form: None,
        detection: Some(detection),
    }
}

#[test]
fn what_does_not_fit_into_memory_is_refused() {
    let exprs = crate::expr::Exprs::new();
    let fixture = crate::dcs::fixtures::relay(&exprs);
    let dcs = lower_as(&fixture.system, Formulation::Step).unwrap();
    let grid = Grid {
        horizon: 1.0,
        steps: 100_000_000,
    };
    let options = options((Family::RadauIia, 4), Detection::default());
    let DiscretizeError::TooLarge { size } = discretize(&dcs, grid, &options).unwrap_err();
    assert!(size > 1e9);
}
