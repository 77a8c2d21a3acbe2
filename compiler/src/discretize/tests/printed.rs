//! Printed forms of small systems.

use insta::assert_snapshot;

use super::*;
use crate::dcs::fixtures::{self, Fixture};
use crate::expr::Exprs;

const GRID: Grid = Grid {
    horizon: 1.0,
    steps: 10,
};

fn printed(make: fn(&Exprs) -> Fixture<'_>, formulation: Formulation, options: &Options) -> String {
    let exprs = Exprs::new();
    discretized(&make(&exprs).system, formulation, GRID, options)
        .0
        .to_string()
}

#[test]
fn relay() {
    let options = options((Family::RadauIia, 4), Detection::default());
    assert_snapshot!(printed(fixtures::relay, Formulation::Stewart, &options), @"");
    assert_snapshot!(printed(fixtures::relay, Formulation::Step, &options), @"");
}

#[test]
fn gauss() {
    let detection = Detection {
        elements: 3,
        cross: Cross::SumBoth,
        equilibration: Equilibration::Switch {
            weight: 0.1,
            scale: 0.01,
        },
        spread: 0.5,
    };
    let options = options((Family::GaussLegendre, 2), detection);
    assert_snapshot!(printed(fixtures::open_sign, Formulation::Stewart, &options), @"");
    assert_snapshot!(printed(fixtures::open_sign, Formulation::Step, &options), @"");
}

/// α of a kink below another switch is there at the right end too, and so are its products.
#[test]
fn nested() {
    let detection = Detection {
        cross: Cross::SumJumps,
        equilibration: Equilibration::Mean { weight: 1.0 },
        ..Detection::default()
    };
    let options = Options {
        form: Some(Form::Differential),
        ..options((Family::GaussLegendre, 2), detection)
    };
    assert_snapshot!(printed(fixtures::many, Formulation::Step, &options), @"");
}

#[test]
fn time_stepping() {
    let options = Options {
        scheme: (Family::Explicit, 2),
        form: None,
        detection: None,
    };
    assert_snapshot!(printed(fixtures::two_relays, Formulation::Stewart, &options), @"");
    assert_snapshot!(printed(fixtures::two_relays, Formulation::Step, &options), @"");
}

#[test]
fn rows_one_by_one() {
    let exprs = Exprs::new();
    let system = fixtures::relay(&exprs).system;
    let options = options((Family::RadauIia, 1), Detection::default());
    let grid = Grid {
        horizon: 1.0,
        steps: 1,
    };
    let (mpcc, _) = discretized(&system, Formulation::Step, grid, &options);
    assert_snapshot!(mpcc.flat(), @"");
}
