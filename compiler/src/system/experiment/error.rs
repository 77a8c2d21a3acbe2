//! What can be wrong with the settings of an experiment (E05), and what is not supported yet.

use miette::Diagnostic;
use thiserror::Error;

use crate::diagnostics::{Fix, Fixable, Help};
use crate::source::Span;

/// A mistake in an experiment.
#[derive(Clone, Debug, Diagnostic, Error)]
#[allow(
    missing_docs,
    reason = "fields are the words of the message; labels say the rest"
)]
pub enum ExperimentError {
    /// A state without an initial value, an input or parameter without a value.
    #[error("{kind} `{name}` has no value")]
    #[diagnostic(
        code(E0501),
        help("give one in its declaration or in `with {{ {name} = ..; }}`")
    )]
    NoValue {
        kind: &'static str,
        name: String,
        #[label("declared without a value")]
        span: Span,
        #[label("not given here")]
        experiment: Span,
    },

    /// A value that must be known before the run, but is not.
    #[error("{what} must be a number")]
    #[diagnostic(code(E0502), help("it may depend on parameters and constants only"))]
    NotANumber {
        what: String,
        cause: String,
        #[label("depends on `{cause}`")]
        span: Span,
    },

    /// Values that are given by each other.
    #[error("`{name}` is given by itself")]
    #[diagnostic(
        code(E0503),
        help("give it without itself; what it replaces cannot be read")
    )]
    SignalCycle {
        name: String,
        #[label("needed to compute itself")]
        span: Span,
    },

    /// A number out of its range.
    #[error("{what} must be {expected}, not {found}")]
    #[diagnostic(code(E0504))]
    OutOfRange {
        what: String,
        expected: String,
        found: String,
        #[label("must be {expected}")]
        span: Span,
    },

    /// An experiment without an end.
    #[error("experiment `{name}` has no horizon")]
    #[diagnostic(code(E0505), help("add `horizon 1;` with the end time"))]
    NoHorizon {
        name: String,
        #[label("runs for how long?")]
        span: Span,
    },

    /// One setting or value twice.
    #[error("{what} is given twice")]
    #[diagnostic(code(E0506), help("remove one of them"))]
    Twice {
        what: String,
        #[label("given here")]
        first: Span,
        #[label(primary, "and again here")]
        second: Span,
    },

    /// A `with` of something that the model computes.
    #[error("`{name}` is a {kind} and cannot be given")]
    #[diagnostic(
        code(E0507),
        help("`with` gives parameters, initial values, inputs, controls and `s.sliding`")
    )]
    NotGiven {
        name: String,
        kind: &'static str,
        #[label("computed by the model")]
        span: Span,
    },

    /// A word that is none of the choices.
    #[error("unknown {what} `{found}`")]
    #[diagnostic(code(E0508))]
    UnknownChoice {
        what: String,
        found: String,
        #[label("expected {choices}")]
        span: Span,
        choices: String,
        #[help]
        help: Option<Help>,
    },

    /// A setting of the other kind of experiment.
    #[error("`{setting}` is no setting of a simulation")]
    #[diagnostic(code(E0509), help("it belongs to {home}"))]
    NotForSimulate {
        setting: String,
        home: &'static str,
        #[label("needs an experiment of another kind")]
        span: Span,
    },

    /// An `output` of something that has no trajectory.
    #[error("`{name}` is a {kind} and has no trajectory")]
    #[diagnostic(code(E0510), help("record states, outputs or controls"))]
    NoTrajectory {
        name: String,
        kind: &'static str,
        #[label("does not change in time")]
        span: Span,
    },

    /// A method that does not determine a polynomial, written with its derivatives.
    #[error("`{family}` has no integral form")]
    #[diagnostic(
        code(E0512),
        help("write `form = differential`, or choose `radau_iia` or `gauss`")
    )]
    NoIntegralForm {
        family: &'static str,
        #[label("needs collocation without a node at the start of the step")]
        span: Span,
    },

    /// An optimal control problem without a cost.
    #[error("experiment `{name}` minimizes nothing")]
    #[diagnostic(
        code(E0520),
        help(
            "add `minimize integral(..);`, `minimize final(..);`, or `minimize 0;` for any feasible solution"
        )
    )]
    NoCost {
        name: String,
        #[label("what is to be small?")]
        span: Span,
    },

    /// A quantity that changes in time where one number is asked for.
    #[error("the cost contains `{name}` at no instant")]
    #[diagnostic(
        code(E0514),
        help(
            "write `integral(..)` for what adds up over the horizon, or `final(..)` for its value at the end"
        )
    )]
    NoInstant {
        name: String,
        #[label("`{name}` changes in time")]
        span: Span,
    },

    /// A quantity that changes in time in a constraint of values of the whole run.
    #[error("the constraint compares `{name}` at an instant with values of the whole run")]
    #[diagnostic(
        code(E0514),
        help("write `final({name})` for its value at the end, where the constraint holds then")
    )]
    TwoInstants {
        name: String,
        #[label("`{name}` changes in time, `final(..)` and `integral(..)` do not")]
        span: Span,
    },

    /// `integral` or `final` of several things, or of none.
    #[error("`{word}` takes one argument")]
    #[diagnostic(code(E0515), help("write `{word}(x^2)`"))]
    OneArgument {
        word: String,
        #[label("takes one expression")]
        span: Span,
    },

    /// A setting of the other kind of experiment.
    #[error("`{setting}` is no setting of an optimal control problem")]
    #[diagnostic(code(E0516), help("it belongs to `simulate`"))]
    NotForOptimize {
        setting: String,
        #[label("needs a `simulate` experiment")]
        span: Span,
    },

    /// Something that cannot be chosen.
    #[error("`{name}` is a {kind}, and no {expected}")]
    #[diagnostic(
        code(E0517),
        help("`initial` frees states, `free` frees parameters, and controls are free anyway")
    )]
    NotFree {
        name: String,
        kind: &'static str,
        expected: &'static str,
        #[label("must be a {expected}")]
        span: Span,
    },

    /// A constraint that nothing satisfies.
    #[error("this constraint never holds")]
    #[diagnostic(code(E0518), help("correct its numbers, or remove it"))]
    NeverHolds {
        why: String,
        #[label("{why}")]
        span: Span,
    },

    /// `perp` elsewhere than in `0 <= a perp b >= 0`.
    #[error("this row is no complementarity: {why}")]
    #[diagnostic(
        code(E0535),
        help("write `0 <= a perp b >= 0;`: both are never negative, and one of them is zero")
    )]
    NotAPair {
        why: &'static str,
        #[label("one `perp` between two expressions")]
        span: Span,
    },

    /// A guess that cannot be read.
    #[error("cannot start from `{name}`: {reason}")]
    #[diagnostic(
        code(E0519),
        help("give an experiment of this file, or a file that `nsdc run --json` wrote")
    )]
    BadGuess {
        name: String,
        reason: String,
        #[label("the guess")]
        span: Span,
    },

    /// A function in the place of the sign that does not go from -1 to 1.
    #[error("`{name}` is no law of smoothing")]
    #[diagnostic(
        code(E0513),
        help(
            "a law is a smooth function of psi/epsilon that goes from -1 to 1; where f goes from 0 to 1, take 2*f - 1"
        )
    )]
    NoLaw {
        name: String,
        what: String,
        #[label("{what}")]
        span: Span,
    },

    /// A relay in a method that looks at the present state alone.
    #[error("`method {method}` does not take relays")]
    #[diagnostic(code(E0910), help("use `method event`, which is the default"))]
    Relay {
        method: &'static str,
        name: String,
        #[label("`{name}` depends on what was before")]
        span: Span,
    },

    /// A nonlinear switch where it cannot be taken.
    #[error("{what} cannot take nonlinear sliding yet")]
    #[diagnostic(
        code(E0920),
        help(
            "{others}`with {{ {name}.sliding = linear; }}` chooses Filippov's reading, without hidden terms"
        )
    )]
    Nonlinear {
        what: String,
        /// What takes it instead.
        others: &'static str,
        name: String,
        #[label(primary, "`{name}` is read nonlinearly")]
        span: Span,
        #[label("beside it")]
        beside: Option<Span>,
    },

    /// A jump in a method that integrates rates alone.
    #[error("`method {method}` does not take state jumps yet")]
    #[diagnostic(code(E0904), help("{help}"))]
    Jump {
        method: &'static str,
        help: &'static str,
        name: String,
        #[label("`{name}` sets states")]
        span: Span,
    },

    /// A contact in a method that integrates rates alone.
    #[error("`method {method}` does not take the contact `{name}` as it is")]
    #[diagnostic(code(E0904), help("{help}"))]
    Contact {
        method: &'static str,
        help: &'static str,
        name: String,
        #[label("velocities jump where it is struck")]
        span: Span,
    },

    /// A projection in a method that knows forces up to a bound only.
    #[error("`method {method}` does not take projections")]
    #[diagnostic(
        code(E0905),
        help("use `method event`, which is the default, or `fesd` or `timestepping`")
    )]
    Projection {
        method: &'static str,
        #[label("kept by a force without a bound")]
        span: Span,
    },

    /// Algebraic states in a method for rates alone.
    #[error("`method {method}` does not take algebraic states")]
    #[diagnostic(
        code(E0906),
        help("use `method event`, which is the default, or `fesd` or `timestepping`")
    )]
    Algebraic {
        method: &'static str,
        #[label("not solved for one state")]
        span: Span,
    },

    /// Algebraic states that jump with what is decided, where a jump would switch.
    #[error("`optimize` does not take this of algebraic states that follow {what} yet")]
    #[diagnostic(
        code(E0906),
        help(
            "let {what} act on the rates of states; an equation that gives a state explicitly may hold anything"
        )
    )]
    OpenAlgebraic {
        what: &'static str,
        #[label("a kink in the equation of one, or a row at the start that holds one")]
        span: Span,
    },

    /// The same in a scheme whose left ends count.
    #[error("`optimize` takes algebraic states that follow {what} with Radau IIA alone yet")]
    #[diagnostic(
        code(E0906),
        help("write `scheme radau_iia(3);`, without `lower timefreezing` and `lower impact`")
    )]
    OpenAlgebraicScheme {
        what: &'static str,
        #[label("not solved for one state")]
        span: Span,
    },

    /// A Runge-Kutta method where contacts have a scheme of their own.
    #[error("steps of time with contacts take no `scheme`")]
    #[diagnostic(
        code(E0526),
        help("leave `scheme` out: contacts are stepped through by Moreau and Jean's method")
    )]
    SchemeOfContacts {
        #[label("has contacts")]
        span: Span,
    },

    /// A switch that jumps, in steps of time with contacts.
    #[error("`method timestepping` with contacts does not take switches that jump yet")]
    #[diagnostic(
        code(E0961),
        help("use `method event`, which is the default, or a term without a jump")
    )]
    SwitchBesideContacts {
        name: String,
        #[label("the rates jump where `{name}` is zero")]
        span: Span,
    },

    /// A comparison of methods of simulation.
    #[error("`{name}` is no simulation")]
    #[diagnostic(
        code(E0521),
        help("{what} is about simulations; name a `simulate` experiment")
    )]
    NotSimulated {
        name: String,
        what: &'static str,
        #[label("looks for numbers itself")]
        span: Span,
    },

    /// Data with another piece inside a control interval.
    #[error(
        "the data of `{name}` go on with another piece at t = {time}, inside a control interval"
    )]
    #[diagnostic(
        code(E0522),
        help(
            "choose `intervals` whose ends are at the times of the data, and a horizon that is fixed"
        )
    )]
    Bends {
        name: String,
        time: f64,
        #[label("needs `{name}`")]
        span: Span,
    },

    /// Straight lines between values of a finite set.
    #[error(
        "`{name}` has a finite set of values, and `controls linear` has all values between them"
    )]
    #[diagnostic(
        code(E0523),
        help("write `controls constant;`, or give `{name}` an interval `[lo, hi]`")
    )]
    LinesOfChoices {
        name: String,
        #[label("one of these values")]
        control: Span,
        #[label("straight lines here")]
        span: Span,
    },

    /// Straight lines over intervals whose lengths are not equal.
    #[error("`controls linear` needs intervals of equal lengths")]
    #[diagnostic(
        code(E0523),
        help("write `controls constant;`, or `intervals` with a number alone")
    )]
    LinesOfLengths {
        #[label("straight lines here")]
        span: Span,
    },

    /// Data where a discretized form is printed.
    #[error("discretized forms do not hold signals from tables and `floor` yet")]
    #[diagnostic(
        code(E0522),
        help(
            "`--ir dcs` shows the system before it is discretized; `nsdc run` takes tables with every method"
        )
    )]
    DataInProgram {
        name: String,
        #[label("needs `{name}`, which is data")]
        span: Span,
    },

    /// Runs that are all the same.
    #[error("nothing is random here, so that all runs are the same")]
    #[diagnostic(
        code(E0524),
        help("add `perturb every 0.1 by gauss(1e-3) seed 1;`, or leave out `runs`")
    )]
    SameRuns {
        #[label("repeats with other seeds")]
        span: Span,
    },

    /// A figure without width, or one that is wider than any sheet.
    #[error("the width of a figure must be from 1 px to 100000 px, with 96 px to an inch")]
    #[diagnostic(
        code(E0529),
        help("write `width 8 cm;`, or leave it out: panels have a width of their own")
    )]
    PlotWidth {
        #[label("must be from 1 px to 100000 px")]
        span: Span,
    },

    /// A shape of an animation with too many numbers or too few.
    #[error("`{shape}` takes {takes}")]
    #[diagnostic(
        code(E0530),
        help(
            "write numbers side by side, as in `disc q[1], q[2], r;`, or vectors and matrices of them, as in `disc q, r;`"
        )
    )]
    ShapeNumbers {
        shape: String,
        takes: &'static str,
        found: usize,
        #[label("has {found}")]
        span: Span,
    },

    /// A loop over more shapes than a picture shows.
    #[error("loops of an animation have {count} turns")]
    #[diagnostic(
        code(E0530),
        help("draw some of them: loops in each other have 2000 turns at most")
    )]
    ManyShapes {
        count: usize,
        #[label("too many")]
        span: Span,
    },

    /// A way through chattering, of a method that does not meet it.
    #[error("`on chattering` is of `method event`")]
    #[diagnostic(
        code(E0528),
        help(
            "leave it out, or choose `method event`: other methods do not go from event to event"
        )
    )]
    NoChattering {
        #[label("not for this method")]
        span: Span,
    },

    /// A condition that ends runs, by a method that does not go from event to event.
    #[error("`{by}` does not end a run where a condition becomes true")]
    #[diagnostic(
        code(E0533),
        help(
            "leave out `stop when`, and choose the horizon; or use `method event`, which is the default"
        )
    )]
    NoStop {
        by: String,
        #[label("of `method event`")]
        span: Span,
    },

    /// Something that must be known before the run and depends on what is optimized.
    #[error("{what} cannot depend on the free parameter `{name}`")]
    #[diagnostic(
        code(E0527),
        help(
            "give it by numbers and by parameters that are not free, or take `{name}` out of `free` or `sensitivity to`"
        )
    )]
    DependsOnFree {
        what: String,
        name: String,
        #[label(primary, "must be known before the run")]
        span: Span,
        #[label("free here")]
        free: Span,
    },

    /// Perturbations.
    #[error("{setting} is not supported yet")]
    #[diagnostic(code(E0923))]
    Repetition {
        setting: String,
        #[label("not supported yet")]
        span: Span,
    },

    /// What is neither a parameter nor an initial value.
    #[error("a run has no sensitivity to {kind} `{name}`")]
    #[diagnostic(
        code(E0531),
        help("name a parameter, or the initial value of a state as `x at 0`")
    )]
    NotSensed {
        name: String,
        kind: &'static str,
        #[label("neither a parameter nor an initial value")]
        span: Span,
    },

    /// A sensitivity that is asked for twice.
    #[error("the sensitivity to `{name}` is asked for twice")]
    #[diagnostic(code(E0531), help("name it once"))]
    SensedTwice {
        name: String,
        #[label("a second time")]
        span: Span,
    },

    /// A sensitivity to what decides the form of a system, or by a method that is not differentiated.
    #[error("the sensitivity to `{name}` is not known: {why}")]
    #[diagnostic(
        code(E0532),
        help(
            "leave it out of `sensitivity to` or `free`, or compare runs with other values; what is zero where runs begin takes another value by `with`"
        )
    )]
    NoSensitivity {
        name: String,
        why: String,
        #[label("asked for here")]
        span: Span,
    },

    /// Weights of which no sum is differentiated.
    #[error("no gradient of a weighted sum: {why}")]
    #[diagnostic(
        code(E0534),
        help(
            "give states, outputs and controls by name, each once, as many finite weights as they have values in the rows of a simulation with `sensitivity to`"
        )
    )]
    NoGradient {
        why: String,
        #[label("weighted here")]
        span: Span,
    },

    /// A setting of another kind of experiment.
    #[error("{setting} is no setting of a fit")]
    #[diagnostic(
        code(E0540),
        help(
            "a fit has `data`, `free`, `initial`, `loss` and `starts`, and of a simulation `with`, `horizon`, `tolerance`, `method`, `output`, `plot`, `animate` and `expect`"
        )
    )]
    NotForFit {
        setting: String,
        #[label("belongs to another kind of experiment")]
        span: Span,
    },

    /// A fit without data, or without something that is free.
    #[error("{of} has no {what}")]
    #[diagnostic(
        code(E0541),
        help("{}", match *what {
            "`data`" => "add `data \"measured.csv\" { q -> column; }`, with what was measured of which quantity",
            "`free`" => "add `free { mu in [0, 1]; }` with the parameters that are looked for",
            _ => "what `with` of data gives is not free in their run: leave something out of it",
        })
    )]
    NothingToFit {
        of: String,
        what: &'static str,
        #[label("nothing to fit")]
        span: Span,
    },

    /// What a fit has once, and what data give to their runs makes two of.
    #[error("{what} is one in all runs of a fit, not {first} and {other}")]
    #[diagnostic(
        code(E0544),
        help(
            "write it without what `with` of data gives: with numbers, or with parameters that are the same in all runs"
        )
    )]
    NotCommon {
        what: String,
        first: String,
        other: String,
        with: String,
        #[label(primary, "holds for all runs")]
        span: Span,
        #[label("{other} with {with}")]
        data: Span,
    },

    /// A column whose values are all missing or outside of the run.
    #[error("column `{column}` of `{file}` has no value between 0 and the horizon")]
    #[diagnostic(
        code(E0542),
        help(
            "a run begins at time 0, and the first column of the file is time: give a horizon that reaches the data"
        )
    )]
    NoMeasurements {
        column: String,
        file: String,
        #[label("nothing to compare with")]
        span: Span,
    },

    /// What no column of numbers is compared with.
    #[error("`{name}` is not compared with a column of data: {why}")]
    #[diagnostic(
        code(E0543),
        help(
            "name a state, an output or an entry of one: `x[2] -> column`; an `output` may be any function of states"
        )
    )]
    NotMeasured {
        name: String,
        why: String,
        #[label("no measured quantity")]
        span: Span,
    },

    /// A setting of another kind of experiment.
    #[error("{setting} is no setting of a closed loop")]
    #[diagnostic(
        code(E0550),
        help(
            "an `mpc` has `controller`, `sample` and `deadline`, and of a simulation `with`, `horizon`, `tolerance`, `method event`, `perturb`, `stop when`, `output`, `plot`, `animate` and `expect`"
        )
    )]
    NotForMpc {
        setting: String,
        #[label("belongs to another kind of experiment")]
        span: Span,
    },

    /// A closed loop without a controller, or without the time between two samples.
    #[error("the loop `{name}` has no `{what}`")]
    #[diagnostic(
        code(E0551),
        help("{}", match *what {
            "controller" => "add `controller NAME;` with an `optimize` experiment of this file",
            _ => "add `sample 0.1;`, the time from one plan to the next",
        })
    )]
    OpenLoop {
        name: String,
        what: &'static str,
        #[label("no closed loop")]
        span: Span,
    },

    /// An experiment that is solved from no other state.
    #[error("`{name}` is no controller: {why}")]
    #[diagnostic(code(E0552), help("{help}"))]
    BadController {
        name: String,
        why: String,
        help: &'static str,
        #[label("named here")]
        span: Span,
    },

    /// A state or a control that one side of a loop has and the other lacks.
    #[error("the loop is open at `{name}`: {why}")]
    #[diagnostic(code(E0553), help("{help}"))]
    LoopMismatch {
        name: String,
        why: String,
        help: &'static str,
        #[label("the loop")]
        span: Span,
    },

    /// Impulses where elements meet, in a method without elements.
    #[error("`lower impact` needs `method fesd`")]
    #[diagnostic(
        code(E0924),
        help(
            "add `method fesd {{ steps = 100; }}`, or leave out `lower impact`, which `method event` does not need"
        )
    )]
    NoElements {
        method: &'static str,
        #[label("runs by `method {method}`")]
        span: Span,
    },

    /// A lowering that there is not, or not here.
    #[error("lowering `{name}` is not supported {with}yet")]
    #[diagnostic(code(E0924), help("{help}"))]
    Lowering {
        name: String,
        with: &'static str,
        help: &'static str,
        #[label("not supported yet")]
        span: Span,
    },
}

impl Fixable for ExperimentError {
    fn fix(&self) -> Option<Fix> {
        match self {
            ExperimentError::UnknownChoice { help, span, .. } => help.as_ref()?.fix(*span),
            _ => None,
        }
    }

    fn choices(&self) -> Vec<Fix> {
        match self {
            ExperimentError::NoValue { span, .. } => vec![Fix::at_end(*span, "= 0")],
            _ => Vec::new(),
        }
    }
}
