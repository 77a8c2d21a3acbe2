//! Known solutions satisfy the rows, derivatives agree with differences, printed forms.

mod derivatives;
mod known;
mod printed;

use nsd_solver::integrate::tableau::Family;

use super::*;
use crate::lowering::dcs::{Cause, Formulation, lower_as};
use crate::lowering::mpcc::{Evaluator, Source};
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
        elements: Elements::Detected(detection),
    }
}

#[test]
fn what_does_not_fit_into_memory_is_refused() {
    let exprs = crate::expr::Exprs::new();
    let fixture = crate::lowering::dcs::fixtures::relay(&exprs);
    let dcs = lower_as(&fixture.system, Formulation::Step).unwrap();
    let grid = Grid::new(1.0, 100_000_000);
    let options = options((Family::RadauIia, 4), Detection::default());
    let error = discretize(&dcs, grid, &options).unwrap_err();
    assert!(matches!(error, DiscretizeError::TooLarge { size } if size > 1e9));
}

/// 1/x at x = 0: λ has no value there, and the first element nothing to begin with.
#[test]
fn a_start_without_values_is_refused() {
    let exprs = crate::expr::Exprs::new();
    let mut b = crate::lowering::dcs::fixtures::Builder::new(&exprs, &["x"]);
    let alpha = b.switch("1/x", 1.0 / b.states[0]);
    let mut system = b.finish(&[1.0 + alpha], &[(&[0], None)]).system;
    system.states[0].initial = 0.0;
    let grid = Grid::new(1.0, 1);
    let options = options((Family::RadauIia, 2), Detection::default());
    for formulation in FORMULATIONS {
        let dcs = lower_as(&system, formulation).unwrap();
        let error = discretize(&dcs, grid, &options).unwrap_err();
        assert!(matches!(error, DiscretizeError::Start { .. }), "{error}");
    }
}

/// A row of collocation knows its state, step, element and node.
#[test]
fn rows_know_where_they_come_from() {
    let exprs = crate::expr::Exprs::new();
    let system = crate::lowering::dcs::fixtures::two_relays(&exprs).system;
    let grid = Grid::new(1.0, 3);
    let options = options((Family::RadauIia, 2), Detection::default());
    let (mpcc, layout) = discretized(&system, Formulation::Step, grid, &options);
    let names = mpcc.names();
    let (block, rows) = mpcc.rows().next().expect("collocation comes first");
    let pattern = Evaluator::new(&mpcc).unwrap().pattern().clone();
    for row in rows {
        let origin = block.origin(row);
        let Source::Dcs(source) = origin.source else {
            panic!("collocation states rates");
        };
        let Cause::State(i) = source.cause else {
            panic!("collocation states rates");
        };
        let [k, j, m] = origin.place[..] else {
            panic!("collocation is stated in a step, an element, at a node");
        };
        assert_eq!(
            names[layout.x(k, j, m) + i],
            format!("x[{}][{k},{j},{m}]", i + 1)
        );
        let columns = pattern.row(row);
        for index in [layout.h(k, j), layout.x(k, j, 0) + i, layout.x(k, j, m) + i] {
            assert!(columns.contains(&(index as u32)), "{}", names[index]);
        }
    }
}

/// What `verify` says after a change.
fn broken<'e>(mpcc: &Mpcc<'e>, change: impl FnOnce(&mut Mpcc<'e>)) -> String {
    let mut mpcc = mpcc.clone();
    change(&mut mpcc);
    mpcc.verify().expect_err("an invariant is broken")
}

#[test]
fn broken_invariants_are_found() {
    let exprs = crate::expr::Exprs::new();
    let system = crate::lowering::dcs::fixtures::relay(&exprs).system;
    let grid = Grid::new(1.0, 2);
    let options = options((Family::RadauIia, 2), Detection::default());
    let (mpcc, _) = discretized(&system, Formulation::Stewart, grid, &options);
    let gap = broken(&mpcc, |mpcc| drop(mpcc.variables.remove(1)));
    assert!(gap.contains("starts at"), "{gap}");
    assert!(broken(&mpcc, |mpcc| mpcc.variables[0].bounds[0].guess = 2.0).contains("bounds"));
    assert!(broken(&mpcc, |mpcc| mpcc.blocks[0].arguments[0] = 1000).contains("no variable 1000"));
    assert!(broken(&mpcc, |mpcc| mpcc.blocks[0].numbers[0] = f64::NAN).contains("a number is NaN"));
    assert!(broken(&mpcc, |mpcc| mpcc.blocks[0].ranges[0].last = 3).contains("places"));
    assert!(broken(&mpcc, |mpcc| mpcc.blocks[0].sources.clear()).contains("sources"));
    let twice = broken(&mpcc, |mpcc| {
        mpcc.blocks[0].kernel.variables[1] = mpcc.blocks[0].kernel.variables[0]
    });
    assert!(twice.contains("named twice"), "{twice}");
    let stranger = exprs.variable("stranger");
    let strange = broken(&mpcc, |mpcc| mpcc.blocks[0].kernel.outputs[0] = stranger);
    assert!(strange.contains("`stranger` is no argument"), "{strange}");
    let kinked = broken(&mpcc, |mpcc| {
        let output = mpcc.blocks[0].kernel.outputs[0];
        mpcc.blocks[0].kernel.outputs[0] = output.abs();
    });
    assert!(kinked.contains("not smooth"), "{kinked}");
}
