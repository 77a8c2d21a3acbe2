//! Experiments: `simulate`, `optimize`, their settings and expectations.

use std::collections::HashSet;

use super::{Bind, Binder, Domain, Expr, Ident, Path, Row, Setting};
use crate::source::Span;

/// `simulate NAME of MODEL { ... }`, `optimize ...`, `fit ...` or `mpc ...`
#[derive(Clone, Debug, PartialEq)]
pub struct Experiment {
    /// Which of them it is.
    pub kind: ExperimentKind,
    /// Declared name.
    pub name: Ident,
    /// The model.
    pub model: Path,
    /// Settings in order of appearance.
    pub settings: Vec<ExperimentSetting>,
    /// Parameters that stay open, for runs with others of their values; no file says so.
    pub open: Vec<Path>,
    /// Whether runs are differentiated as is asked for; no file says so.
    pub differentiates: bool,
    /// Of a fit, the first of the data that are compared with its run; no file says so.
    pub measures: Option<usize>,
    /// The whole item.
    pub span: Span,
}

impl Experiment {
    /// The files of data that it is fitted to.
    pub fn measured(&self) -> impl Iterator<Item = &Data> {
        self.settings
            .iter()
            .filter_map(|setting| match &setting.kind {
                SettingKind::Data(data) => Some(data),
                _ => None,
            })
    }

    /// What data give to their run, in place of what the experiment gives.
    pub fn own(&self) -> &[Bind] {
        let data = self.measures.and_then(|at| self.measured().nth(at));
        data.map_or(&[], Data::own)
    }

    /// The data that are compared with its run: those that give the same.
    pub fn compared(&self) -> impl Iterator<Item = &Data> {
        let given = sorted(self.own());
        self.measured()
            .filter(move |data| sorted(data.own()) == given)
    }

    /// The experiment as it is for each run that is compared with data, first that to which these give nothing.
    pub fn runs(&self) -> Vec<Self> {
        let mut seen = HashSet::new();
        let all = self.measured().map(|data| sorted(data.own())).enumerate();
        let mut runs: Vec<_> = all
            .filter(|(_, given)| seen.insert(given.clone()))
            .collect();
        runs.sort_by_key(|(_, given)| !given.is_empty());
        let runs = runs.into_iter().map(|(at, _)| Some(at));
        let is_none = seen.is_empty().then_some(None);
        let run = |measures| Experiment {
            measures,
            ..self.clone()
        };
        runs.chain(is_none).map(run).collect()
    }
}

/// Simulation, optimal control, parameter estimation or a closed loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExperimentKind {
    /// `simulate`
    Simulate,
    /// `optimize`
    Optimize,
    /// `fit`
    Fit,
    /// `mpc`
    Mpc,
}

impl ExperimentKind {
    /// The word of the language.
    pub fn word(self) -> &'static str {
        match self {
            ExperimentKind::Simulate => "simulate",
            ExperimentKind::Optimize => "optimize",
            ExperimentKind::Fit => "fit",
            ExperimentKind::Mpc => "mpc",
        }
    }
}

/// A setting of an experiment, with the span of its statement.
#[derive(Clone, Debug, PartialEq)]
pub struct ExperimentSetting {
    /// Which setting.
    pub kind: SettingKind,
    /// The statement.
    pub span: Span,
}

/// `soft l1 weight 1e3`
#[derive(Clone, Debug, PartialEq)]
pub struct Soft {
    /// How violations are measured.
    pub norm: Ident,
    /// What they are multiplied by.
    pub weight: Expr,
}

/// The settings of an experiment.
#[derive(Clone, Debug, PartialEq)]
pub enum SettingKind {
    /// `with { omega = 6; }`
    With(Vec<Bind>),
    /// `guess { from crossing; u = 0; }`
    Guess {
        /// `from` sources.
        from: Vec<GuessSource>,
        /// Values.
        binds: Vec<Bind>,
    },
    /// `method fesd { steps = 10; }`
    Method {
        /// The method.
        name: Ident,
        /// Its options.
        options: Vec<Setting>,
    },
    /// `horizon pi/2;` or `horizon free in [0.1, 10] = 4;`
    Horizon {
        /// True after `free`.
        free: bool,
        /// Range of a free horizon.
        range: Option<(Expr, Expr)>,
        /// Length, or guess of a free one.
        value: Option<Expr>,
    },
    /// `output q, E every 0.01;`
    Output {
        /// What is kept.
        paths: Vec<Path>,
        /// When.
        when: OutputWhen,
    },
    /// `lower step, timefreezing;`
    Lower(Vec<Ident>),
    /// `subject to { rows } at elements soft l1 weight 1e3;`
    SubjectTo {
        /// Constraints.
        rows: Vec<Row>,
        /// `nodes`, `elements` or `intervals`.
        at: Option<Ident>,
        /// Where missing them costs.
        soft: Option<Soft>,
    },
    /// `final { q = [..]; } soft squared weight 10;`
    Final {
        /// Constraints.
        rows: Vec<Row>,
        /// Where missing them costs.
        soft: Option<Soft>,
    },
    /// `initial { x[1] free in [0, 1]; }`
    Initial {
        /// Freed states with their ranges.
        free: Vec<(Path, Option<Domain>)>,
        /// Constraints.
        rows: Vec<Row>,
    },
    /// `free { k; }`
    Free(Vec<(Path, Option<Domain>)>),
    /// `intervals 20 free;`
    FreeIntervals(Expr),
    /// `on chattering slide;`
    OnChattering,
    /// `stop when q <= 0;`
    Stop(Expr),
    /// `sensitivity to mu, x[1] at 0 one_sided;`
    Sensitivity {
        /// Parameters, and initial values, which are marked.
        to: Vec<(Path, bool)>,
        /// Whether derivatives from both sides are asked for where there is none.
        one_sided: bool,
    },
    /// `perturb every 0.16 by sphere(1e-4) seed 1;`
    Perturb {
        /// Period.
        every: Expr,
        /// Distribution.
        by: Option<Expr>,
        /// Seed.
        seed: Option<Expr>,
    },
    /// `starts 40 by gauss(0.5) seed 1;`
    Starts {
        /// How many.
        count: Expr,
        /// Distribution.
        by: Option<Expr>,
        /// Seed.
        seed: Option<Expr>,
    },
    /// `data "measured.csv" { q -> position; }`
    Data(Data),
    /// `controller swing;`
    Controller(Path),
    /// `plot { x, v; phase q, v; title "Fall"; width 8 cm; }`
    Plot(Vec<PlotItem>),
    /// `animate { disc q, r; trace q[1], q[2]; speed 0.5; title "Fall"; width 8 cm; }`
    Animate(Vec<PlotItem>),
    /// `tolerance`, `runs`, `intervals`, `elements`, `scheme`, `grid`, `controls`, `minimize`, `loss`, `sample`, `deadline`
    Value {
        /// Which setting.
        name: Ident,
        /// Its value.
        value: Expr,
    },
    /// `expect ...;`
    Expect(Expect),
    /// A statement the parser could not read.
    Bad,
}

impl SettingKind {
    /// How it begins.
    pub fn word(&self) -> &str {
        match self {
            SettingKind::With(_) => "with",
            SettingKind::Guess { .. } => "guess",
            SettingKind::Method { .. } => "method",
            SettingKind::Horizon { .. } => "horizon",
            SettingKind::Output { .. } => "output",
            SettingKind::Lower(_) => "lower",
            SettingKind::SubjectTo { .. } => "subject to",
            SettingKind::Final { .. } => "final",
            SettingKind::Initial { .. } => "initial",
            SettingKind::Free(_) => "free",
            SettingKind::FreeIntervals(_) => "intervals",
            SettingKind::OnChattering => "on chattering",
            SettingKind::Sensitivity { .. } => "sensitivity to",
            SettingKind::Stop(_) => "stop when",
            SettingKind::Data(_) => "data",
            SettingKind::Controller(_) => "controller",
            SettingKind::Perturb { .. } => "perturb",
            SettingKind::Starts { .. } => "starts",
            SettingKind::Plot(_) => "plot",
            SettingKind::Animate(_) => "animate",
            SettingKind::Value { name, .. } => &name.name,
            SettingKind::Expect(_) => "expect",
            SettingKind::Bad => "",
        }
    }

    /// Whether it takes the place of another one of the same experiment.
    pub(crate) fn replaces(&self, old: &SettingKind) -> bool {
        match (self, old) {
            (SettingKind::Value { name, .. }, SettingKind::Value { name: old, .. }) => {
                name.name == old.name
            }
            (SettingKind::Value { name, .. }, SettingKind::FreeIntervals(_))
            | (SettingKind::FreeIntervals(_), SettingKind::Value { name, .. }) => {
                name.name == "intervals"
            }
            _ => std::mem::discriminant(self) == std::mem::discriminant(old),
        }
    }

    /// Keeps the names of outputs of a setting that is replaced, where it has none itself: it says when they are recorded.
    pub(crate) fn keep_names(&mut self, old: SettingKind) {
        if let (SettingKind::Output { paths, .. }, SettingKind::Output { paths: old, .. }) =
            (self, old)
            && paths.is_empty()
        {
            *paths = old;
        }
    }
}

/// What was measured, in a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Data {
    /// The file, as it is written.
    pub file: String,
    /// Where it stands.
    pub span: Span,
    /// What its run is given, where it has one of its own.
    pub with: Option<Vec<Bind>>,
    /// Its columns with what they are measurements of.
    pub columns: Vec<Measured>,
}

impl Data {
    /// What it gives to its run.
    pub fn own(&self) -> &[Bind] {
        self.with.as_deref().unwrap_or_default()
    }
}

/// What is given, in one order.
fn sorted(binds: &[Bind]) -> Vec<String> {
    let mut given: Vec<String> = binds.iter().map(Bind::written).collect();
    given.sort();
    given
}

/// `q -> position weight 2;`
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// What is measured.
    pub path: Path,
    /// The name of the column.
    pub column: Ident,
    /// What a difference of the two is multiplied by.
    pub weight: Option<Expr>,
    /// The statement.
    pub span: Span,
}

/// Where a `guess` is taken from.
#[derive(Clone, Debug, PartialEq)]
pub enum GuessSource {
    /// An experiment.
    Experiment(Path),
    /// `"file.json"`
    File(String, Span),
}

/// When outputs are recorded.
#[derive(Clone, Debug, PartialEq)]
pub enum OutputWhen {
    /// At the method's own points.
    Method,
    /// `every dt`
    Every(Expr),
    /// `at [..]`
    At(Expr),
}

/// A member of a `plot` or an `animate`, with the span of its statement.
#[derive(Clone, Debug, PartialEq)]
pub struct PlotItem {
    /// Which member.
    pub kind: PlotKind,
    /// The statement.
    pub span: Span,
}

/// The members of a `plot` and of an `animate`.
#[derive(Clone, Debug, PartialEq)]
pub enum PlotKind {
    /// `x, v;`: curves over time in one panel
    Panel(Vec<Expr>),
    /// `phase q, v;`: one over the other, from left to right first
    Phase(Box<[Expr; 2]>),
    /// `disc q, r;`, `speed 0.5;`: a word of an animation with its numbers
    Drawing(Ident, Vec<Expr>),
    /// `for i in 1..n { disc q[i], r; }`
    For(Vec<Binder>, Vec<PlotItem>),
    /// `title "Fall";`
    Title(String),
    /// `width 8 cm;`
    Width(f64, Length),
    /// A statement the parser could not read.
    Bad,
}

impl PlotKind {
    /// What it draws itself.
    pub fn exprs(&self) -> &[Expr] {
        match self {
            PlotKind::Panel(exprs) | PlotKind::Drawing(_, exprs) => exprs,
            PlotKind::Phase(axes) => &axes[..],
            PlotKind::For(..) | PlotKind::Title(_) | PlotKind::Width(..) | PlotKind::Bad => &[],
        }
    }
}

/// A unit of lengths on paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Length {
    /// `cm`
    Centimetres,
    /// `mm`
    Millimetres,
    /// `px`, 96 to an inch
    Pixels,
}

impl Length {
    /// The word of the language.
    pub fn as_str(self) -> &'static str {
        match self {
            Length::Centimetres => "cm",
            Length::Millimetres => "mm",
            Length::Pixels => "px",
        }
    }

    /// How many pixels it is.
    pub fn pixels(self) -> f64 {
        match self {
            Length::Centimetres => 96.0 / 2.54,
            Length::Millimetres => 9.6 / 2.54,
            Length::Pixels => 1.0,
        }
    }
}

/// What an `expect` of an experiment asserts.
#[derive(Clone, Debug, PartialEq)]
pub enum Expect {
    /// `expect lowering golden;`
    LoweringGolden,
    /// `expect numbers golden;`
    NumbersGolden,
    /// `expect mode at 2.0 is inside and sliding(s);`
    Mode {
        /// The instant; `end` is a name.
        at: Expr,
        /// The mode.
        mode: Expr,
    },
    /// `expect status is locally_infeasible;`
    Status(Ident),
    /// `expect warning W0102;`
    Warning(Ident),
    /// `expect x at end ~ [1, 0] within 1e-9;`
    Relation(Box<ExpectRelation>),
}

/// `LEFT when? REL RIGHT (at T)? (within TOL)?`
#[derive(Clone, Debug, PartialEq)]
pub struct ExpectRelation {
    /// Left side.
    pub left: Expr,
    /// When the left side is taken.
    pub when: ExpectWhen,
    /// The relation.
    pub relation: ExpectOp,
    /// Right side.
    pub right: Expr,
    /// When the right side is taken.
    pub right_at: Option<Expr>,
    /// Absolute tolerance.
    pub within: Option<Expr>,
}

/// When the left side of an `expect` is taken.
#[derive(Clone, Debug, PartialEq)]
pub enum ExpectWhen {
    /// No instant: a value of the whole run.
    Run,
    /// `at t`; `end` is a name.
    At(Expr),
    /// `always`
    Always,
}

/// Relation of an `expect`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExpectOp {
    /// `~`
    Close,
    /// `=`
    Equal,
    /// `<`
    Less,
    /// `<=`
    LessEqual,
    /// `>`
    Greater,
    /// `>=`
    GreaterEqual,
}
