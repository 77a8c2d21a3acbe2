//! Settings of a `simulate` experiment, evaluated.

use crate::source::Span;
use crate::syntax::Expect;

/// What a `simulate` experiment asks for.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Name of the experiment.
    pub name: String,
    /// Name of the model.
    pub model: String,
    /// End time; the run starts at 0.
    pub horizon: f64,
    /// Aim for the global error of every reported state, relative to its largest magnitude.
    pub tolerance: f64,
    /// The method with its options.
    pub method: Method,
    /// Lowerings asked for by name; empty for the default.
    pub lowerings: Vec<Lowering>,
    /// Names to keep, as written (`q`, `x[2]`); `None` for all states and outputs.
    pub outputs: Option<Vec<(String, Span)>>,
    /// When outputs are recorded.
    pub sampling: Sampling,
    /// Assertions, in order, with the span of each statement.
    pub expects: Vec<(Expect, Span)>,
    /// The experiment.
    pub span: Span,
}

/// A simulation method.
#[derive(Clone, Debug, PartialEq)]
pub enum Method {
    /// The compiler chooses.
    Auto,
    /// Switch-detecting active-set integration.
    Event(EventOptions),
}

/// Options of `method event`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EventOptions {
    /// Order of the Taylor method; chosen from the tolerance otherwise.
    pub order: Option<usize>,
    /// Sides to take where the solution is not unique, in order of declaration of the switches;
    /// one entry holds for all.
    pub branch: Vec<Branch>,
    /// Largest number of events.
    pub max_events: Option<usize>,
}

/// A branch at a point where the solution is not unique.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Branch {
    /// Leave to ψ < 0.
    Minus,
    /// Stay on ψ = 0.
    Slide,
    /// Leave to ψ > 0.
    Plus,
}

/// A lowering of switches that an experiment may ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lowering {
    /// Stewart's reformulation.
    Stewart,
    /// The step (Heaviside) reformulation.
    Step,
}

/// When outputs are recorded.
#[derive(Clone, Debug, PartialEq)]
pub enum Sampling {
    /// At the method's own points.
    Method,
    /// At multiples of the period, and at the end.
    Every(f64),
    /// At these instants.
    At(Vec<f64>),
}
