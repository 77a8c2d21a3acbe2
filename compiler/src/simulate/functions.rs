//! What is compiled of a form: tapes, and where their inputs are among its variables.

use std::cell::RefCell;
use std::collections::hash_map::Entry;
use std::sync::Arc;

use nsd_solver::simulate::{Affine, Input, Partials, Side};
use nsd_solver::tape::Tape;
use rustc_hash::FxHashMap;

use crate::expr::{self, Expr, Var};

/// Functions by form and the sides of the α in it, in order.
pub(super) type Known<T> = RefCell<ByForm<T>>;
pub(super) type ByForm<T> = FxHashMap<(usize, Box<[Side]>), T>;

/// What is known of a form on certain sides, compiled when it is asked for first.
pub(super) fn kept<T>(
    known: &mut ByForm<T>,
    key: (usize, Box<[Side]>),
    compile: impl FnOnce(&[Side]) -> T,
) -> &T {
    match known.entry(key) {
        Entry::Occupied(known) => known.into_mut(),
        Entry::Vacant(new) => {
            let compiled = compile(&new.key().1);
            new.insert(compiled)
        }
    }
}

/// An input of a form.
#[derive(Clone, std::marker::Copy)]
pub(super) enum Place {
    Var(usize),
    Hole(usize),
}

/// Rates of a form on certain sides.
pub(super) struct CompiledRates {
    pub inputs: Vec<Place>,
    pub field: Arc<Tape>,
    pub by_alpha: Arc<Partials>,
}

/// ψ of a form on certain sides.
pub(super) enum CompiledSurface {
    /// (factors, coefficient) of every term.
    Affine(Vec<(Vec<Place>, f64)>),
    Smooth {
        inputs: Vec<Place>,
        psi: Arc<Tape>,
        gradient: Arc<Partials>,
        mixed: Arc<Partials>,
    },
}

/// Collects the terms of an affine ψ.
pub(super) fn affine(terms: impl IntoIterator<Item = (Vec<Input>, f64)>) -> Affine {
    let mut affine = Affine::default();
    for (factors, mut c) in terms {
        let mut moving = None;
        for factor in factors {
            match factor {
                Input::Number(number) => c *= number,
                other => moving = Some(other),
            }
        }
        match moving {
            Some(Input::State(state)) => affine.terms.push((state, c)),
            Some(_) => affine.time += c,
            None => affine.constant += c,
        }
    }
    affine.terms.sort_unstable_by_key(|&(state, _)| state);
    affine
}

pub(super) fn tape(inputs: &[Var], outputs: &[Expr]) -> Tape {
    expr::compile(inputs, outputs)
        .expect("a verified system holds smooth functions of time, states and α only")
}

/// The derivatives of functions of `inputs` by some of these.
pub(super) fn partials(inputs: &[Var], functions: &[Expr], by: &[Var]) -> Partials {
    let entries = expr::jacobian(functions, by).entries;
    let values: Vec<_> = entries.iter().map(|&(.., value)| value).collect();
    let place = |var: &Var| {
        let place = inputs.binary_search(var);
        place.expect("functions are differentiated by their inputs")
    };
    Partials {
        tape: tape(inputs, &values),
        entries: (entries.iter())
            .map(|&(function, column, _)| (function, place(&by[column])))
            .collect(),
    }
}
