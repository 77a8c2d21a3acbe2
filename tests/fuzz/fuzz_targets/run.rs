//! Whatever compiles runs to an end or to a reason, in bounded time, and leaves a trajectory that is one.
#![no_main]

use std::time::Duration;

use libfuzzer_sys::fuzz_target;
use nsdc::limit::Limit;
use nsdc::project::clock::Clock;
use nsdc::diagnostics::Diagnostics;
use nsdc::expr::Exprs;
use nsdc::source::imports;
use nsdc::source::imports::NoFiles;
use nsdc::report::Status;
use nsdc::simulate::{self, Request};
use nsdc::source::SourceMap;
use nsdc::syntax::{self, Item};

fuzz_target!(|bytes: &[u8]| {
    let mut sources = SourceMap::new();
    let mut diags = Diagnostics::new();
    let source = sources.add_bytes("fuzz.nsd", bytes.to_vec());
    let mut file = syntax::parse(&source, &mut diags);
    imports::link(&mut file, "fuzz", &mut NoFiles, &mut sources, &mut diags);
    if diags.has_errors() {
        return;
    }
    let experiments = file.items.iter().filter_map(|item| match item {
        Item::Experiment(experiment) => Some(experiment),
        _ => None,
    });
    // One of each file, so that inputs stay quick.
    let Some(experiment) = experiments.last() else {
        return;
    };
    let exprs = Exprs::new();
    let mut clock = Clock::default();
    let compiled = nsdc::compile(&exprs, &file, experiment, &[], &mut clock, &mut diags);
    let Some(compiled) = compiled.filter(|_| !diags.has_errors()) else {
        return;
    };
    if compiled.settings.optimize.is_some() {
        return;
    }
    let request = Request {
        limit: Limit::within(Duration::from_millis(200)),
        ..Request::default()
    };
    let trajectory = simulate::run(&compiled.system, &compiled.settings, &request);
    assert_eq!(trajectory.verify(), Ok(()));
    let is_solved = trajectory.status == Status::Solved;
    if is_solved {
        assert!(trajectory.failure.is_none(), "what is solved has not failed");
        let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
        assert!(finite(&trajectory.time), "instants are finite");
        for state in &trajectory.states {
            assert!(finite(&state.values), "`{}` is finite", state.name);
        }
    }
});
