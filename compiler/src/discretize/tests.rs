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
    Cross::SumJumps,
    Cross::SumContinuous,
    Cross::SumBoth,
];

fn discretized<'e>(
    system: &System<'e>,
    formulation: Formulation,
    grid: Grid,
    options: &Options,
) -> (Mpcc<'e>, Layout) {
    let dcs = lower_as(system, formulation).expect("the system is small");
    let (mpcc, layout) =
        discretize(&dcs, grid, options, Span::default()).expect("the problem is small");
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
fn wrong_schemes_and_sizes_are_refused() {
    let exprs = crate::expr::Exprs::new();
    let fixture = crate::dcs::fixtures::relay(&exprs);
    let dcs = lower_as(&fixture.system, Formulation::Step).unwrap();
    let refused = |scheme, form, steps| {
        let options = Options {
            scheme,
            form,
            detection: Some(Detection::default()),
        };
        let grid = Grid {
            horizon: 1.0,
            steps,
        };
        discretize(&dcs, grid, &options, Span::default()).unwrap_err()
    };
    let error = refused((Family::RadauIia, 99), None, 1);
    assert!(matches!(error, DiscretizeError::Scheme { .. }), "{error}");
    let error = refused((Family::LobattoIiia, 2), Some(Form::Integral), 1);
    assert!(
        matches!(error, DiscretizeError::NoIntegralForm { .. }),
        "{error}"
    );
    let error = refused((Family::RadauIia, 4), None, 100_000_000);
    assert!(matches!(error, DiscretizeError::TooLarge { .. }), "{error}");
}
