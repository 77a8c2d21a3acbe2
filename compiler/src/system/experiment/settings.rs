//! What an experiment asks for, as data.

use rustc_hash::FxHashMap;

use super::method::{EventOptions, Lowering, Method};
use super::optimize::{ClosedLoop, Fit, Optimize};
use super::perturb::Perturbation;
use super::plot::Figures;
use super::sensed::Sensed;
use crate::expr::{Expr, Interval, Var};
use crate::model::{Model, TargetKind};
use crate::source::Span;
use crate::syntax::{Expect, Sliding};
use crate::system::values::Values;

/// What an experiment asks for.
#[derive(Clone, Debug)]
pub struct Settings<'e> {
    /// Name of the experiment.
    pub name: String,
    /// Name of the model.
    pub model: String,
    /// End time, or a guess of it; the run starts at 0.
    pub horizon: f64,
    /// How it is run.
    pub numerics: Numerics<'e>,
    /// What is told of it.
    pub recording: Recording<'e>,
    /// What is optimized; `None` for a simulation.
    pub optimize: Option<Optimize<'e>>,
    /// Random vectors that are added to the state; none where nothing disturbs it.
    pub kicks: Option<Perturbation>,
    /// How often the experiment is run, with other random vectors each time; none for once.
    pub runs: Option<usize>,
    /// Assertions, in order, with the span of each statement.
    pub expects: Vec<(Expect, Span)>,
    /// The experiment.
    pub span: Span,
    /// Parameters, initial values, controls and inputs.
    pub(crate) values: Values<'e>,
    /// Readings of named switches, by index into the model's list.
    pub(crate) sliding: FxHashMap<usize, Sliding>,
}

/// How an experiment is run.
#[derive(Clone, Debug)]
pub struct Numerics<'e> {
    /// Aim for the global error of every reported state, relative to its largest magnitude.
    pub tolerance: f64,
    /// The method with its options.
    pub method: Method<'e>,
    /// Lowerings asked for by name; empty for the default.
    pub lowerings: Vec<Lowering>,
    /// Whether chattering that fades and never ends goes on as sliding.
    pub averages: bool,
    /// Conditions that end the run; the horizon is its limit.
    pub stops: Vec<Stop<'e>>,
    /// What decides on controls at samples; `None` where they are given, or optimized.
    pub closed_loop: Option<ClosedLoop>,
}

/// What is told of a run.
#[derive(Clone, Debug, Default)]
pub struct Recording<'e> {
    /// What to keep; `None` for all states and outputs.
    pub outputs: Option<Vec<Kept<'e>>>,
    /// When outputs are recorded.
    pub sampling: Sampling,
    /// What figures show.
    pub figures: Figures<'e>,
    /// By what the run is differentiated.
    pub sensed: Vec<Sensed<'e>>,
    /// Weights of what is reported, by name and row, where their sum alone is differentiated.
    pub weights: Option<Vec<(String, Vec<f64>)>>,
    /// What runs are fitted to; `None` for other experiments.
    pub fit: Option<Fit<'e>>,
}

impl<'e> Recording<'e> {
    /// Lets runs tell what a fit needs of them.
    pub(super) fn follow(&mut self, fit: Fit<'e>) {
        self.sensed = fit.sensed.clone();
        let fit = self.fit.insert(fit);
        let Some(outputs) = &mut self.outputs else {
            return;
        };
        for column in &fit.columns {
            let is_known =
                |kept: &Kept<'_>| column.kept.entries.iter().all(|e| kept.entries.contains(e));
            if !outputs.iter().any(is_known) {
                outputs.push(column.kept.clone());
            }
        }
    }
}

impl<'e> Settings<'e> {
    /// Where parameters that stay open may be: where a fit looks for them, or where they were declared to be, and on their
    /// side of zero.
    pub(crate) fn open_ranges(&self, model: &Model<'e>) -> FxHashMap<Var, Interval> {
        let mut ranges = self.values.open_ranges(model);
        for freed in self.recording.fit.iter().flat_map(|fit| &fit.free) {
            let range = ranges.get_mut(&freed.var);
            range
                .into_iter()
                .for_each(|range| *range = Interval::new(freed.lower, freed.upper));
        }
        ranges
    }
}

impl Settings<'_> {
    /// Whether controls that are not given are decided.
    pub(crate) fn decides(&self) -> bool {
        self.optimize.is_some() || self.numerics.closed_loop.is_some()
    }

    /// Whether time stands still where states jump.
    pub fn freezes(&self) -> bool {
        self.numerics.lowerings.contains(&Lowering::TimeFreezing)
    }

    /// Whether contacts give impulses where finite elements meet.
    pub fn takes_impulses(&self) -> bool {
        self.numerics.lowerings.contains(&Lowering::Impact)
    }

    /// What the motion of a frozen system is measured in: the time of a run, or of a control interval of mean length.
    pub fn pace(&self) -> f64 {
        match &self.optimize {
            None => self.horizon,
            Some(task) => self.horizon / task.discretization.intervals as f64,
        }
    }

    /// Lets rows follow the curves where the experiment does not say when there are any.
    pub fn follow_curves(&mut self) {
        if self.recording.sampling == Sampling::Method {
            self.recording.sampling = Sampling::Curve;
        }
    }

    /// Makes it a simulation by events of all states and outputs.
    pub(crate) fn simulate_by_events(&mut self) {
        self.numerics.method = Method::Event(EventOptions::default());
        self.numerics.lowerings.clear();
        (self.recording.outputs, self.optimize) = (None, None);
    }

    /// Whether contacts are a matter of the method, which takes them in steps of time.
    pub fn steps_through_contacts(&self) -> bool {
        self.optimize.is_none() && matches!(self.numerics.method, Method::Timestepping(_))
    }
}

/// A condition that ends a run where it becomes true.
#[derive(Clone, Debug)]
pub struct Stop<'e> {
    /// Its text.
    pub name: String,
    /// 1 where it holds, 0 elsewhere.
    pub guard: Expr<'e>,
    /// The condition.
    pub span: Span,
}

/// A quantity that `output` names.
#[derive(Clone, Debug)]
pub struct Kept<'e> {
    /// `q`, `x[2]`
    pub name: String,
    /// What it is.
    pub kind: TargetKind,
    /// Its entries, in the variables of the model.
    pub entries: Vec<Expr<'e>>,
    /// Their shape; empty for a scalar.
    pub shape: Vec<usize>,
    /// The path.
    pub span: Span,
}

/// When outputs are recorded.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Sampling {
    /// At the method's own points.
    #[default]
    Method,
    /// At these, and between them where straight lines from row to row would not follow the curves.
    Curve,
    /// At multiples of the period, and at the end.
    Every(f64),
    /// At these instants, ascending.
    At(Vec<f64>),
}

impl Sampling {
    /// Whether the points of the method are recorded.
    pub fn is_own(&self) -> bool {
        matches!(self, Sampling::Method | Sampling::Curve)
    }
}
