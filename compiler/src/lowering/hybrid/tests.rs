//! Blocks, and what they share.

use std::sync::Arc;

use nsd_solver::event::{Recording, Simulator};
use nsd_solver::hybrid::{HybridSystem, Settings};
use nsd_solver::sensitivity::{Directions, differentiate};

use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::project::clock::Clock;
use crate::source::SourceMap;
use crate::syntax::{self, Item};

fn lowered(text: &str) -> (Arc<HybridSystem>, Vec<f64>) {
    let (mut sources, mut diags) = (SourceMap::new(), Diagnostics::new());
    let source = sources.add("test.nsd", text);
    let file = syntax::parse(&source, &mut diags);
    let experiment = file.items.iter().find_map(|item| match item {
        Item::Experiment(found) => Some(found),
        _ => None,
    });
    let exprs = Exprs::new();
    let experiment = experiment.expect("the text has an experiment");
    let clock = &mut Clock::default();
    let compiled = crate::compile(&exprs, &file, experiment, &[], clock, &mut diags);
    let system = compiled.expect("the text compiles").system;
    let x0 = system.states.iter().map(|state| state.initial).collect();
    (super::lower(&system), x0)
}

/// 30 instances of a part with other numbers in each, whose friction is a nonlinear function.
const PARTS: &str = "
    model mass {
      param k = 1; param c = 1; state q = 1; state v = 0;
      q' = v;
      v' = -k*sin(q) - 0.1*sign(v*(1 + c*q^2) - 0.01);
    }
    model many { part b[i in 1..30] = mass { k = 1 + i/30; c = i; } }
    simulate a of many { horizon 1; }";

#[test]
fn instances_of_one_part_share_their_functions() {
    let (hybrid, x0) = lowered(PARTS);
    assert_eq!(hybrid.blocks.len(), 60);
    let [first, other] = [1, 3].map(|block| &hybrid.rates[block]);
    assert_eq!(first.form, other.form);
    assert_ne!(first.inputs, other.inputs);
    // A run meets q', v' on each side and sliding, and ψ.
    let mut simulator = Simulator::new(hybrid, Settings::default());
    let outcome = simulator.run(0.0, 1.0, &x0, &mut Silent);
    assert!(outcome.stats.functions >= 90);
    let made = simulator.n_functions();
    assert!(made <= 5, "{made}");
    // A second run, with another order, meets nothing new.
    let mut other = simulator.with(Settings {
        order: Some(20),
        ..Settings::default()
    });
    other.run(0.0, 1.0, &x0, &mut Silent);
    assert_eq!(other.n_functions(), made);
}

/// And so do derivatives, from pass to pass: that of q' by v, those of v' on each side and sliding, and those of ψ.
#[test]
fn a_second_pass_meets_no_other_derivatives() {
    let (hybrid, x0) = lowered(PARTS);
    let mut simulator = Simulator::new(hybrid.clone(), Settings::default());
    let mut recording = Recording::default();
    let approaches = (simulator.run(0.0, 1.0, &x0, &mut recording)).approaches;
    let mut start = vec![0.0; x0.len()];
    start[0] = 1.0;
    let directions = Directions {
        initial: vec![start],
        parameters: vec![vec![0.0; hybrid.parameters.len()]],
    };
    let pass = |of: &Simulator| {
        let found = differentiate(of, &recording, &approaches, &directions, &[]);
        assert!(found.lost[0].is_none());
        of.n_functions()
    };
    let made = pass(&simulator);
    assert!(made >= hybrid.blocks.len());
    assert_eq!(pass(&simulator), made);
    assert_eq!(pass(&simulator.with(Settings::default())), made);
}

struct Silent;

impl nsd_solver::event::Observer for Silent {
    fn segment(&mut self, _: &nsd_solver::event::Segment) -> std::ops::ControlFlow<()> {
        std::ops::ControlFlow::Continue(())
    }

    fn event(&mut self, _: &nsd_solver::event::Event) {}
}

#[test]
fn a_switch_concerns_the_rates_that_contain_it() {
    let text = "
        model m {
          state x[6] = ones(6); state y = 0;
          let heavy = sin(x[1]*x[2] + exp(x[3]));
          x[1]' = -sign(x[1]); x[2]' = heavy; x[3]' = heavy*x[1] - x[3];
          x[4]' = -sign(x[4] - x[5]); x[5]' = sign(x[4] - x[5]) - x[6]; x[6]' = -x[6];
          y' = sign(x[1]) + sign(x[6]);
        }
        simulate a of m { horizon 1; }";
    let blocks = lowered(text).0.blocks.clone();
    let blocks: Vec<_> = (blocks.iter())
        .map(|b| (b.states.clone(), b.switches.clone()))
        .collect();
    insta::assert_snapshot!(format!("{blocks:?}"), @"[([0], [0]), ([1, 2], []), ([3], [1]), ([4], [1]), ([5], []), ([6], [0, 2])]");
}
