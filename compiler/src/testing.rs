//! What unit tests share.

use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::project::clock::Clock;
use crate::source::SourceMap;
use crate::syntax::{Item, parse};
use crate::{Compiled, compile};

/// Calls `see` with the experiment at the end of a text.
pub(crate) fn with_last<R>(text: &str, see: impl FnOnce(&Compiled<'_>) -> R) -> R {
    let mut diags = Diagnostics::new();
    let file = parse(&SourceMap::new().add("test.nsd", text), &mut diags);
    let Some(Item::Experiment(experiment)) = file.items.last() else {
        panic!("the text ends in an experiment")
    };
    let exprs = Exprs::new();
    let mut clock = Clock::default();
    let compiled = compile(&exprs, &file, experiment, &[], &mut clock, &mut diags);
    see(&compiled.expect("the model is right"))
}
