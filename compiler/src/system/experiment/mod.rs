//! Settings of an experiment, evaluated.
//!
//! The values of `with` are given to the model first; every other setting is a number in terms of
//! its parameters. What is asserted (`expect`) stays as it was written.

mod branches;
mod capabilities;
mod error;
mod fesd;
mod law;
mod method;
mod optimize;
mod perturb;
mod statements;
mod with;

use rustc_hash::{FxHashMap, FxHashSet};

use super::values::{self, Values};
use crate::diagnostics::{Diagnostics, Help};
use crate::expr::{Expr, Var};
use crate::model::{Model, TargetKind};
use crate::source::Span;
use crate::syntax::{self, Bind, Expect, OutputWhen, SettingKind, Sliding};

pub use branches::beside_branches;
pub(crate) use capabilities::POISSON;
pub use capabilities::{Feature, table};
pub use error::ExperimentError;
pub use fesd::{Cross, Equilibration, FesdOptions, Form, SteppingOptions};
pub use law::Law;
pub use method::{Branch, EventOptions, Lowering, Method, MethodKind, SmoothingOptions};
pub use optimize::{
    At, Cost, Freed, Integral, MpccOptions, Optimize, Row, Shape, Starts, Term, Tied,
    relaxation_word, steering_word,
};
pub use perturb::Perturbation;
use statements::Statements;

/// What an experiment asks for.
#[derive(Clone, Debug)]
pub struct Settings<'e> {
    /// Name of the experiment.
    pub name: String,
    /// Name of the model.
    pub model: String,
    /// End time, or a guess of it; the run starts at 0.
    pub horizon: f64,
    /// Aim for the global error of every reported state, relative to its largest magnitude.
    pub tolerance: f64,
    /// The method with its options.
    pub method: Method<'e>,
    /// Lowerings asked for by name; empty for the default.
    pub lowerings: Vec<Lowering>,
    /// What to keep; `None` for all states and outputs.
    pub outputs: Option<Vec<Kept<'e>>>,
    /// When outputs are recorded.
    pub sampling: Sampling,
    /// What is optimized; `None` for a simulation.
    pub optimize: Option<Optimize<'e>>,
    /// Whether chattering that fades and never ends goes on as sliding.
    pub averages: bool,
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
    pub(super) sliding: FxHashMap<usize, Sliding>,
}

impl Settings<'_> {
    /// Whether time stands still where states jump.
    pub fn freezes(&self) -> bool {
        self.lowerings.contains(&Lowering::TimeFreezing)
    }

    /// Whether contacts give impulses where finite elements meet.
    pub fn takes_impulses(&self) -> bool {
        self.lowerings.contains(&Lowering::Impact)
    }

    /// What the motion of a frozen system is measured in: the time of a run, or of a control interval.
    pub fn pace(&self) -> f64 {
        match &self.optimize {
            None => self.horizon,
            Some(task) => self.horizon / task.discretization.intervals as f64,
        }
    }

    /// Whether contacts are a matter of the method, which takes them in steps of time.
    pub fn steps_through_contacts(&self) -> bool {
        self.optimize.is_none() && matches!(self.method, Method::Timestepping(_))
    }
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
#[derive(Clone, Debug, PartialEq)]
pub enum Sampling {
    /// At the method's own points.
    Method,
    /// At multiples of the period, and at the end.
    Every(f64),
    /// At these instants, ascending.
    At(Vec<f64>),
}

const DEFAULT_TOLERANCE: f64 = 1e-8;
/// An optimum has the accuracy of a grid that the user chose.
const DEFAULT_OPTIMIZE_TOLERANCE: f64 = 1e-6;
/// More instants than this are a mistake.
const MOST_INSTANTS: f64 = 1e8;

/// Runs of one experiment.
const MOST_RUNS: f64 = 1e4;

/// What `with` gives to the model.
#[derive(Debug, Default)]
pub(super) struct Given<'e> {
    /// Values by variable, with the line that gives each.
    pub values: FxHashMap<Var, (Expr<'e>, Span)>,
    /// Readings of named switches.
    pub sliding: FxHashMap<usize, Sliding>,
    /// Whether controls that are not given are decided by the experiment.
    pub decides: bool,
    /// Parameters that are optimized or stay open, with where each is freed.
    pub free: FxHashMap<Var, Span>,
    /// Those that stay open.
    pub open: FxHashSet<Var>,
    /// The experiment.
    pub span: Span,
}

/// The settings of an experiment of `model`; `None` after an error.
///
/// `overrides` come from outside the file and replace what `with` says.
pub fn evaluate<'e>(
    model: &Model<'e>,
    experiment: &syntax::Experiment,
    overrides: &[Bind],
    diags: &mut Diagnostics,
) -> Option<Settings<'e>> {
    // `None` where something was reported.
    let given = with::given(model, experiment, overrides, diags);
    let values = values::evaluate(model, given.as_ref()?, diags)?;
    let mut reader = Reader {
        model,
        values: &values,
        diags,
        seen: FxHashMap::default(),
        failed: false,
    };

    let mut statements = Statements::new(model, experiment.kind);
    // The horizon bounds what others may be, wherever it stands.
    let is_horizon =
        |setting: &&syntax::ExperimentSetting| matches!(setting.kind, SettingKind::Horizon { .. });
    let all = || experiment.settings.iter();
    let others = all().filter(|setting| !is_horizon(setting));
    for setting in all().filter(is_horizon).chain(others) {
        statements.setting(&mut reader, &setting.kind, setting.span);
    }
    statements.check(&mut reader, experiment);
    let is_optimize = statements.draft.is_some();
    let draft = statements.draft.take();
    let optimize = draft.and_then(|draft| draft.finish(&mut reader, experiment));
    let failed = reader.failed || optimize.is_some() != is_optimize;
    let (horizon, _) = statements.horizon?;
    let settings = Settings {
        name: experiment.name.name.clone(),
        model: model.name.clone(),
        horizon: horizon?,
        tolerance: statements.tolerance,
        method: statements.method,
        lowerings: statements.lowerings,
        outputs: statements.outputs,
        sampling: statements.sampling,
        optimize,
        kicks: statements.kicks,
        averages: statements.averages.is_some(),
        runs: statements.runs.map(|(n, _)| n),
        expects: statements.expects,
        span: experiment.span,
        values,
        sliding: given?.sliding,
    };
    (!failed).then_some(settings)
}

/// How a setting of optimal control begins.
fn word_of(setting: &SettingKind) -> String {
    match setting {
        SettingKind::Value { name, .. } => &name.name,
        SettingKind::Guess { .. } => "guess",
        SettingKind::SubjectTo { .. } => "subject to",
        SettingKind::Final(_) => "final",
        SettingKind::Initial { .. } => "initial",
        SettingKind::Free(_) => "free",
        _ => "starts",
    }
    .to_owned()
}

/// Reads settings as numbers and choices.
struct Reader<'r, 'e> {
    model: &'r Model<'e>,
    values: &'r Values<'e>,
    diags: &'r mut Diagnostics,
    /// Where settings that may stand once were seen.
    seen: FxHashMap<&'static str, Span>,
    failed: bool,
}

impl<'e> Reader<'_, 'e> {
    fn error(&mut self, error: ExperimentError) {
        self.failed = true;
        self.diags.push(error);
    }

    fn not_for_simulate(&mut self, setting: &str, span: Span) {
        self.error(ExperimentError::NotForSimulate {
            setting: setting.to_owned(),
            span,
        });
    }

    fn once(&mut self, what: &'static str, second: Span) {
        if let Some(first) = self.seen.insert(what, second) {
            self.error(ExperimentError::Twice {
                what: what.to_owned(),
                first,
                second,
            });
        }
    }

    /// The entries as numbers, parameters at their values.
    fn numbers(&mut self, what: &str, value: &syntax::Expr) -> Option<Vec<f64>> {
        let (entries, numbers) = self.entries(what, value)?;
        match self.values.free.first_in(&entries) {
            None => Some(numbers),
            Some(free) => {
                let what = what.to_owned();
                self.error((self.values).depends_on_free(self.model, what, free, value.span));
                None
            }
        }
    }

    /// The entries, and as numbers, with free parameters at their guesses.
    fn entries(&mut self, what: &str, value: &syntax::Expr) -> Option<(Vec<Expr<'e>>, Vec<f64>)> {
        let Some(tensor) = self.model.scope.expr(value, None, self.diags) else {
            self.failed = true;
            return None;
        };
        let numbers = self.guesses(what, &tensor.data, value.span)?;
        Some((tensor.data, numbers))
    }

    /// Expressions in parameters as numbers, with free parameters at their guesses.
    fn guesses(&mut self, what: &str, entries: &[Expr<'e>], span: Span) -> Option<Vec<f64>> {
        match self.values.numbers_of(self.model, entries) {
            Ok(numbers) => Some(numbers),
            Err(cause) => {
                let what = what.to_owned();
                self.error(ExperimentError::NotANumber { what, cause, span });
                None
            }
        }
    }

    fn within(
        &mut self,
        what: &str,
        value: &syntax::Expr,
        expected: &str,
        fits: impl Fn(f64) -> bool,
    ) -> Option<f64> {
        let numbers = self.numbers(what, value)?;
        self.one_of(what, value, &numbers, expected, fits)
    }

    /// A number with what it is computed from: free parameters may be among it.
    fn follows(
        &mut self,
        what: &str,
        value: &syntax::Expr,
        expected: &str,
        fits: impl Fn(f64) -> bool,
    ) -> Option<(f64, Expr<'e>)> {
        let (entries, numbers) = self.entries(what, value)?;
        let number = self.one_of(what, value, &numbers, expected, fits)?;
        Some((number, entries[0]))
    }

    /// The one number of a value, where it fits.
    fn one_of(
        &mut self,
        what: &str,
        value: &syntax::Expr,
        numbers: &[f64],
        expected: &str,
        fits: impl Fn(f64) -> bool,
    ) -> Option<f64> {
        match *numbers {
            [number] if fits(number) => Some(number),
            _ => {
                let found = numbers
                    .iter()
                    .map(f64::to_string)
                    .collect::<Vec<_>>()
                    .join(", ");
                let found = if numbers.len() == 1 {
                    found
                } else {
                    format!("[{found}]")
                };
                let (what, expected) = (what.to_owned(), expected.to_owned());
                self.error(ExperimentError::OutOfRange {
                    what,
                    expected,
                    found,
                    span: value.span,
                });
                None
            }
        }
    }

    fn positive(&mut self, what: &str, value: &syntax::Expr) -> Option<f64> {
        self.within(what, value, "a positive number", |x| {
            x > 0.0 && x.is_finite()
        })
    }

    fn count(&mut self, what: &str, value: &syntax::Expr, most: f64) -> Option<usize> {
        let expected = format!("a whole number from 1 to {most}");
        let number = self.within(what, value, &expected, |x| {
            (1.0..=most).contains(&x) && x.fract() == 0.0
        })?;
        Some(number as usize)
    }
}

impl Sampling {
    /// What an `output` statement says, within a horizon that may be unknown.
    fn read(reader: &mut Reader<'_, '_>, when: &OutputWhen, horizon: Option<f64>) -> Option<Self> {
        match when {
            OutputWhen::Method => Some(Sampling::Method),
            OutputWhen::Every(period) => {
                let fits = |x: f64| x > 0.0 && horizon.is_none_or(|end| end / x <= MOST_INSTANTS);
                let period = reader.within("the period", period, "positive, and not tiny", fits)?;
                Some(Sampling::Every(period))
            }
            OutputWhen::At(instants) => {
                let mut times = reader.numbers("the instants", instants)?;
                if let Some(bad) = times
                    .iter()
                    .find(|time| !(**time >= 0.0 && horizon.is_none_or(|end| **time <= end)))
                {
                    let (what, found) = ("every instant".to_owned(), bad.to_string());
                    let expected = "between 0 and the horizon".to_owned();
                    reader.error(ExperimentError::OutOfRange {
                        what,
                        expected,
                        found,
                        span: instants.span,
                    });
                    return None;
                }
                times.sort_by(f64::total_cmp);
                Some(Sampling::At(times))
            }
        }
    }
}

impl<'e> Kept<'e> {
    /// What a path of an `output` statement names.
    fn read(reader: &mut Reader<'_, 'e>, path: &syntax::Path) -> Option<Self> {
        let Some(target) = reader.model.scope.target(path, reader.diags) else {
            reader.failed = true;
            return None;
        };
        let model = reader.model;
        let all: Option<&[Expr<'e>]> = match target.kind {
            TargetKind::State(k) => Some(&model.states[k].vars),
            TargetKind::Algebraic(k) => Some(&model.algebraics[k].vars),
            TargetKind::Control(k) => Some(&model.controls[k].vars),
            TargetKind::Input(k) => Some(&model.inputs[k].vars),
            TargetKind::Signal(k) => Some(&model.signals[k].value.data),
            TargetKind::Let(k) => Some(&model.lets[k].value.data),
            TargetKind::Output(k) => Some(&model.outputs[k].value.data),
            TargetKind::Switch(k) => Some(&model.switches[k].vars),
            TargetKind::Const | TargetKind::Param(_) | TargetKind::Sliding(_) => None,
        };
        let name = with::path_text(model, path, &target);
        let Some(all) = all else {
            let kind = target.kind.word();
            reader.error(ExperimentError::NoTrajectory {
                name,
                kind,
                span: path.span,
            });
            return None;
        };
        Some(Kept {
            name,
            kind: target.kind,
            entries: target.entries.iter().map(|&entry| all[entry]).collect(),
            shape: target.shape.sizes(),
            span: path.span,
        })
    }
}

/// `one of `a`, `b`, or did-you-mean help for a word that is none of the choices.
fn unknown_choice(what: &str, word: &syntax::Ident, choices: &[&str]) -> ExperimentError {
    let best = choices.iter().max_by(|a, b| {
        strsim::jaro_winkler(&word.name, a).total_cmp(&strsim::jaro_winkler(&word.name, b))
    });
    let close = best.filter(|best| strsim::jaro_winkler(&word.name, best) > 0.75);
    ExperimentError::UnknownChoice {
        what: what.to_owned(),
        found: word.name.clone(),
        span: word.span,
        choices: choices
            .iter()
            .map(|choice| match choice.contains(' ') {
                true => (*choice).to_owned(),
                false => format!("`{choice}`"),
            })
            .collect::<Vec<_>>()
            .join(", "),
        help: close.map(|close| Help::did_you_mean(close)),
    }
}
