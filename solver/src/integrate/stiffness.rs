//! Which method integrates: Taylor series, or Radau IIA where stability would keep them short.
//!
//! On a stiff problem Taylor steps are a few times the shortest time constant, while the solution
//! hardly bends within them. Many such steps in a row are reason to try the implicit method; how long
//! its own steps are says whether it was worth it.

use std::sync::Arc;

use super::radau::{Radau, Shape, Start, Tableau};
use crate::event::state::State;
use crate::expansion::mode::Mode;

/// The implicit method, and what the lengths of steps say.
pub(crate) struct Stiffness {
    /// Error of a step, relative to the magnitude of the states.
    tolerance: f64,
    tableau: Option<Arc<Tableau>>,
    /// The methods used last, the latest at the end.
    methods: Vec<Radau>,
    /// Where its step starts.
    pub start: Start,
    /// Whether the implicit method makes the next step.
    pub implicit: bool,
    /// Length of its first step, until it is taken.
    first: Option<f64>,
    /// Length of its last step that no event cut, in any mode; 0 when there was none.
    cruise: f64,
    /// Length of the last Taylor step that its series allowed.
    pub explicit_length: f64,
    /// Slow Taylor steps in a row, and how many are reason to try the implicit method.
    slow: usize,
    patience: usize,
    /// Implicit steps in a row that were too short, and all.
    short: usize,
    implicit_steps: usize,
}

/// A step below this fraction of the time scale of the solution is slow: where accuracy limits a series
/// of order 20, it is about as long as the time scale.
const SLOW: f64 = 0.03;

/// The same by the root of a tolerance: where steps are at the bound of stability, errors of that size
/// in what is stiff bend the solution too, and c₂ h² is some ten times as large.
const ROUGH: f64 = 10.0;

/// Slow steps before the implicit method is tried: at first, after an event in an implicit step, and
/// at most.
const PATIENCE: usize = 12;
const WARNED: usize = 1;
const MOST: usize = 3000;

/// Tolerance of the Taylor steps between an event in an implicit step and the next one, as a fraction:
/// at the bound of stability they would leave errors of their whole tolerance in what is stiff, which
/// the implicit method takes for a transient.
const CAREFUL: f64 = 1e-3;

/// The largest number of nodes.
pub(crate) const MOST_NODES: usize = 11;

/// Shapes of modes whose method is kept for the next time.
const MOST_KEPT: usize = 3;

/// Fewer Taylor steps than this are not worth another method.
const FEW: f64 = 50.0;

/// Implicit steps in a row that are too short before the series are taken up again.
const SHORT: usize = 3;

/// Implicit steps between two looks at the series.
const UNCHECKED: usize = 20;

/// Implicit steps are worth it when they are longer than Taylor steps by this factor, at equal cost.
const WORTH: f64 = 4.0;

/// Dense matrices of more rows than this take too much memory.
const MOST_UNKNOWNS: usize = 1000;

impl Stiffness {
    pub(crate) fn new(tolerance: f64) -> Self {
        Stiffness {
            tolerance,
            tableau: None,
            methods: Vec::new(),
            start: Start::default(),
            implicit: false,
            first: None,
            cruise: 0.0,
            explicit_length: 0.0,
            slow: 0,
            patience: PATIENCE,
            short: 0,
            implicit_steps: 0,
        }
    }

    /// Starts a run.
    pub(crate) fn reset(&mut self) {
        *self = Stiffness {
            tableau: self.tableau.take(),
            methods: std::mem::take(&mut self.methods),
            start: std::mem::take(&mut self.start),
            ..Stiffness::new(self.tolerance)
        };
    }

    /// Order of the implicit method.
    pub(crate) fn order(&self) -> usize {
        2 * nodes(self.tolerance) - 1
    }

    /// The method for a mode; to be given back after the step.
    pub(crate) fn take(&mut self, shape: Shape) -> Radau {
        let mut methods = self.methods.iter();
        if let Some(fits) = methods.position(|method| method.shape() == shape) {
            return self.methods.remove(fits);
        }
        if self.methods.len() == MOST_KEPT {
            self.methods.remove(0);
        }
        let nodes = nodes(self.tolerance);
        let tableau = self
            .tableau
            .get_or_insert_with(|| Arc::new(Tableau::new(nodes)));
        Radau::new(tableau.clone(), shape, self.tolerance)
    }

    pub(crate) fn give_back(&mut self, method: Radau) {
        self.methods.push(method);
    }

    /// The method that made the last implicit step.
    pub(crate) fn method(&self) -> Option<&Radau> {
        self.methods.last()
    }

    /// What Taylor steps are to be as accurate as.
    pub(crate) fn explicit_tolerance(&self) -> f64 {
        if self.patience == WARNED {
            CAREFUL * self.tolerance
        } else {
            self.tolerance
        }
    }

    /// Takes note of a Taylor step that its series and nothing else limited, the fraction `motion` of
    /// the time scale of the solution; `left` is what is left to the next breakpoint and of the run.
    pub(crate) fn after_explicit(
        &mut self,
        mode: &Mode,
        length: f64,
        motion: f64,
        [next, left]: [f64; 2],
    ) {
        self.explicit_length = length;
        let slow = SLOW.max(ROUGH * self.tolerance.sqrt());
        self.slow = if motion < slow { self.slow + 1 } else { 0 };
        if self.slow < self.patience {
            return;
        }
        let worth = worth(mode, nodes(self.tolerance));
        if left > FEW.max(worth) * length {
            self.implicit = true;
            self.first = Some(next.min(self.length_to_try(length, motion, left)));
            (self.short, self.implicit_steps) = (0, 0);
        }
    }

    /// A tenth of the time scale. Where errors alone may bend the series as much, the time scale can be
    /// anything longer: that of the steps before, or the middle between it and what is left, by orders
    /// of magnitude. A length that is too long costs less than growth from one that is too short.
    fn length_to_try(&self, length: f64, motion: f64, left: f64) -> f64 {
        let known = 0.1 * length / motion;
        if motion > ROUGH * self.tolerance.sqrt() {
            known
        } else if self.cruise > 0.0 {
            known.max(self.cruise)
        } else {
            known.max((known * left).sqrt())
        }
    }

    /// Takes note of an implicit step, worth it when longer than `worth` Taylor steps.
    pub(crate) fn after_implicit(&mut self, length: f64, worth: f64) {
        self.implicit_steps += 1;
        self.cruise = length;
        let short = length < worth * self.explicit_length;
        self.short = if short { self.short + 1 } else { 0 };
        if self.short >= SHORT {
            self.give_up();
        }
    }

    /// True when the length of a Taylor step should be looked at before the next implicit one.
    pub(crate) fn wants_series(&self) -> bool {
        self.implicit_steps > 0 && self.implicit_steps.is_multiple_of(UNCHECKED)
    }

    /// The length to begin with, for the first implicit step in a row.
    pub(crate) fn first_length(&mut self) -> Option<f64> {
        self.first.take()
    }

    /// Goes back to Taylor steps; for longer, where the trial brought nothing.
    pub(crate) fn give_up(&mut self) {
        self.implicit = false;
        self.slow = 0;
        self.patience = if self.implicit_steps > 2 * SHORT {
            PATIENCE
        } else {
            (4 * self.patience).min(MOST)
        };
    }

    /// A new mode starts with Taylor steps, which are good at what moves fast there.
    pub(crate) fn after_event(&mut self) {
        self.slow = 0;
        if self.implicit {
            self.implicit = false;
            self.patience = WARNED;
        }
    }
}

/// Nodes that cost least for a tolerance (chosen by trial).
fn nodes(tolerance: f64) -> usize {
    let pairs = (-0.4 * tolerance.log10() - 0.9).round().max(1.0);
    (2 * pairs as usize + 1).min(MOST_NODES)
}

/// Taylor steps that an implicit step with this many nodes must be longer than, by the operations
/// of both.
pub(crate) fn worth(mode: &Mode, nodes: usize) -> f64 {
    let (order, nodes) = (mode.memory.order as f64, nodes as f64);
    let unknowns = mode.n + mode.sliding.len();
    if unknowns > MOST_UNKNOWNS {
        return f64::INFINITY;
    }
    let evaluation = mode.field.operations() as f64;
    let series = (evaluation * 0.5 * order * order).max(1.0);
    // A real factorization and (s - 1)/2 complex ones, and about four iterations.
    let factors = 2.0 / 3.0 * (unknowns as f64).powi(3) * (2.0 * nodes - 1.0);
    WORTH * ((factors + 4.0 * nodes * evaluation) / series).max(1.0)
}

/// A step in relation to the time scale of the solution, which the curvature of the states, α and
/// monitored ψ shows: for c₂ h² = size it is 1.
pub(super) fn motion(mode: &Mode, state: &State, h: f64) -> f64 {
    let curved = |c: &[f64], size: f64| {
        let bend = c[2].abs() * h * h;
        let size = size.max(c[0].abs()).max(c[1].abs() * h);
        if bend > 0.0 { bend / size } else { 0.0 }
    };
    let states = (0..mode.n).map(|i| curved(mode.x_series(i), state.scales.largest[i]));
    let alphas = mode
        .sliding
        .iter()
        .map(|&i| curved(mode.alpha_series(i), 1.0));
    // A ψ that starts at its surface is no larger than its states make it.
    let size = |i: usize| {
        mode.surfaces
            .weigh(i, |j| state.scales.largest[j])
            .max(state.bands.terms[i])
    };
    let monitored = mode.monitored.switches.iter();
    let psis = monitored.map(|&i| curved(mode.psi_series(i), size(i)));
    states.chain(alphas).chain(psis).fold(0.0, f64::max).sqrt()
}
