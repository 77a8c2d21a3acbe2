//! Why a run ended before its horizon -> diagnostic at the lines of the model that did it.

use miette::{Diagnostic, LabeledSpan};
use thiserror::Error;

use super::Status;
use crate::diagnostics::Fixable;
use crate::limit::Over;
use crate::source::Span;

/// A run that ended before its horizon.
#[derive(Clone, Debug, Diagnostic, Error)]
#[allow(
    missing_docs,
    reason = "fields are the words of the message; labels say the rest"
)]
pub enum Failure {
    /// Several solutions go on from a point, and none was chosen.
    #[error("at t = {time}, {count} solutions go on: {branches}")]
    #[diagnostic(
        code(E0701),
        help("choose one, for example with `method event {{ branch = {example}; }}`")
    )]
    NonUnique {
        time: f64,
        count: String,
        branches: String,
        example: &'static str,
        #[label(collection)]
        surfaces: Vec<LabeledSpan>,
    },

    /// No mode is consistent with its own rates.
    #[error("at t = {time}, no solution goes on")]
    #[diagnostic(
        code(E0702),
        help("{}", if *contacts {
            "no forces or impulses of these contacts fit together: take less friction, or leave out contacts that others make up; `method timestepping` may go on"
        } else {
            "the fields on the two sides contradict each other here; check their signs"
        })
    )]
    NoSolution {
        time: f64,
        /// Whether contacts are among the surfaces.
        contacts: bool,
        #[label(collection)]
        surfaces: Vec<LabeledSpan>,
    },

    /// The rates of the switching functions do not determine what keeps them at zero.
    #[error("at t = {time}, no solution goes on for sure: sliding is not determined here")]
    #[diagnostic(
        code(E0703),
        help("{}", if *contacts {
            "how much these contacts push depends on how they share friction while they stick, which motion does not tell, and when they set off depends on it; take less friction, give one of them a spring, or end the horizon before"
        } else {
            "the rates of these switching functions do not depend on their own switches independently; look for two surfaces that coincide, or for both sides being tangent"
        })
    )]
    Undetermined {
        time: f64,
        /// Whether all of them are contacts with their friction.
        contacts: bool,
        #[label(collection)]
        surfaces: Vec<LabeledSpan>,
    },

    /// The equations for sliding lost their unique solution.
    #[error("at t = {time}, the sliding mode became singular")]
    #[diagnostic(
        code(E0704),
        help("{}", if *contacts {
            "motion does not determine the force of a contact here: friction comes to zero while a body sticks, or directions of contacts become parallel; keep friction above zero, as `max(mu, 1e-6)` does, or end the horizon before"
        } else {
            "rates do not determine the switch on its surface here: both sides are tangent to it, or sliding modes of a nonlinear switch meet without a fold"
        })
    )]
    SingularSliding {
        time: f64,
        /// Whether contacts are among the surfaces.
        contacts: bool,
        #[label(collection)]
        surfaces: Vec<LabeledSpan>,
    },

    /// A switch was found on the wrong side of its surface.
    #[error("at t = {time}, a switch was missed")]
    #[diagnostic(code(E0705), help("try a smaller `tolerance`, and report the model"))]
    MissedSwitch {
        time: f64,
        #[label(collection)]
        surfaces: Vec<LabeledSpan>,
    },

    /// The right-hand side is not finite.
    #[error("at t = {time}, the right-hand side or one of its derivatives is not finite")]
    #[diagnostic(
        code(E0706),
        help(
            "look for a division by zero, a root or logarithm at its end, or a solution that blows up"
        )
    )]
    NotFinite {
        time: f64,
        /// The line of the term to blame, or the run.
        #[label(collection)]
        terms: Vec<LabeledSpan>,
    },

    /// A clock that does not go on.
    #[error("at t = {time}, {what}, and time-freezing does not get beyond")]
    #[diagnostic(
        code(E0726),
        help(
            "every impact takes numerical time, one after the other; `method event` without `lower` goes on"
        )
    )]
    Standstill {
        time: f64,
        what: String,
        #[label("this run")]
        span: Span,
    },

    /// Events without time between them.
    #[error("at t = {time}, events follow each other without time passing")]
    #[diagnostic(
        code(E0707),
        help("infinitely many events accumulate here (Zeno); end the horizon before")
    )]
    Accumulation {
        time: f64,
        #[label("this run")]
        span: Span,
    },

    /// Chattering that fades and never ends.
    #[error(
        "at t = {time}, switching goes on without end, ever faster: every {spacing:.1e} now, with {events} events until the end"
    )]
    #[diagnostic(
        code(E0733),
        help(
            "a lag between a switch and its surface, or a point where surfaces meet, does this; let the switch act on the surface without the lag, so that the state slides, give it a hysteresis, let a run of `method event` slide with `on chattering slide;`, shorten the horizon, or raise `max_events`"
        )
    )]
    Chattering {
        time: f64,
        spacing: f64,
        events: String,
        #[label(collection)]
        surfaces: Vec<LabeledSpan>,
    },

    /// Relays that make each other switch.
    #[error("at t = {time}, relays make each other switch without end")]
    #[diagnostic(
        code(E0710),
        help(
            "what switches one relay must not depend on the value of the other at once: let it act on a rate"
        )
    )]
    Restless {
        time: f64,
        #[label(collection)]
        surfaces: Vec<LabeledSpan>,
    },

    /// A jump to where its own guard holds.
    #[error("at t = {time}, a jump leads to where its own guard holds")]
    #[diagnostic(
        code(E0721),
        help(
            "a jump must leave its guard, or its guard must ask for a direction too: `c <= 0 and v < 0`"
        )
    )]
    StaysInGuard {
        time: f64,
        #[label(collection)]
        laws: Vec<LabeledSpan>,
    },

    /// A condition that ends a run holds before it has begun.
    #[error("at t = {time}, the run stops before it has begun")]
    #[diagnostic(
        code(E0736),
        help(
            "start where the condition does not hold, or ask for more: `stop when q <= 0 and v < 0;`"
        )
    )]
    StopsAtStart {
        time: f64,
        #[label(collection)]
        laws: Vec<LabeledSpan>,
    },

    /// Jumps without end at one instant.
    #[error("at t = {time}, jumps follow each other without end")]
    #[diagnostic(
        code(E0722),
        help("what one of them does makes the next one jump; let their guards exclude each other")
    )]
    EndlessJumps {
        time: f64,
        #[label(collection)]
        laws: Vec<LabeledSpan>,
    },

    /// Two jumps that disagree.
    #[error("at t = {time}, two jumps set `{state}` to different values")]
    #[diagnostic(
        code(E0723),
        help("jumps at one instant apply together; let one of them do what both mean")
    )]
    ConflictingJumps {
        time: f64,
        state: String,
        #[label(collection)]
        laws: Vec<LabeledSpan>,
    },

    /// Painlevé's paradox.
    #[error("at t = {time}, friction pulls the body into the contact `{name}`")]
    #[diagnostic(
        code(E0725),
        help(
            "while it slips, no force of the contact keeps its gap from closing (Painlevé's paradox), and the run ends even where it might stick: take less friction, mu |Jn M^-1 Jt| < Jn M^-1 Jn, or a model of the contact that gives way"
        )
    )]
    Painleve {
        time: f64,
        name: String,
        #[label(collection)]
        surfaces: Vec<LabeledSpan>,
    },

    /// A state beyond a surface that it cannot pass.
    #[error("at t = {time}, the state is below the surface of `{name}`, which it cannot pass")]
    #[diagnostic(
        code(E0724),
        help("start where the gap is not negative; other jumps must not lead there either")
    )]
    Penetrates {
        time: f64,
        name: String,
        #[label(collection)]
        surfaces: Vec<LabeledSpan>,
    },

    /// Impulses that were not found.
    #[error("at t = {time}, the impulses of `{name}` and the contacts around it were not found")]
    #[diagnostic(
        code(E0727),
        help("take more `steps`, less friction, or a `restitution` that all contacts share")
    )]
    Impulses {
        time: f64,
        name: String,
        #[label(collection)]
        surfaces: Vec<LabeledSpan>,
    },

    /// A coefficient that no contact has.
    #[error("at t = {time}, the {what} of `{name}` {how}")]
    #[diagnostic(
        code(E0731),
        help("bound it with `max` and `min`, or what it is computed from")
    )]
    Coefficient {
        time: f64,
        what: &'static str,
        name: String,
        how: String,
        #[label(collection)]
        surfaces: Vec<LabeledSpan>,
    },

    /// Equations without a solution.
    #[error("from t = {time} on, no values of the algebraic states satisfy these equations")]
    #[diagnostic(
        code(E0728),
        help(
            "check whether there is a solution here: rows of a program may contradict each other; where there is one, give a guess close to it: `algebraic z = ..;`, or `with {{ z = ..; }}`"
        )
    )]
    Inconsistent {
        time: f64,
        #[label(collection)]
        rows: Vec<LabeledSpan>,
    },

    /// Equations that leave algebraic states open.
    #[error(
        "at t = {time}, these equations do not determine the algebraic states: the index is above one"
    )]
    #[diagnostic(
        code(E0729),
        help(
            "the Jacobian by the algebraic states is singular here: two equations may say the same, or a solution may turn back"
        )
    )]
    HighIndex {
        time: f64,
        #[label(collection)]
        rows: Vec<LabeledSpan>,
    },

    /// Complementarities with several solutions.
    #[error("at t = {time}, these complementarities have {count} solutions: {branches}")]
    #[diagnostic(
        code(E0730),
        help(
            "what is complementary must be determined: where forces are redundant, take one away, or let each of them give way a little"
        )
    )]
    SeveralSolutions {
        time: f64,
        count: usize,
        branches: String,
        #[label(collection)]
        rows: Vec<LabeledSpan>,
    },

    /// A finite element without a solution.
    #[error("at t = {time}, the equations of a finite element were not solved")]
    #[diagnostic(
        code(E0711),
        help("take more `steps`, or `method event`, which needs no elements")
    )]
    Unsolved {
        time: f64,
        #[label("this run")]
        span: Span,
    },

    /// A Runge-Kutta method that does not hold a state on a surface.
    #[error("at t = {time}, a sliding mode begins, which this scheme cannot hold")]
    #[diagnostic(
        code(E0712),
        help("take a scheme whose matrix is invertible, such as `scheme = radau_iia(4);`")
    )]
    CannotSlide {
        time: f64,
        #[label(collection)]
        surfaces: Vec<LabeledSpan>,
    },

    /// Stewart's form where it leaves the vector field open.
    #[error("at t = {time}, Stewart's form does not determine the sliding field")]
    #[diagnostic(
        code(E0714),
        help("write `lower step;`, which takes the field that is affine in each switch")
    )]
    Unweighted {
        time: f64,
        #[label(collection)]
        surfaces: Vec<LabeledSpan>,
    },

    /// A grid that is too coarse for the model.
    #[error("the steps are too long: {}", if *modes {
        "a run with steps half as long goes through other modes".to_owned()
    } else {
        format!("steps half as long change the result by {error} of its size")
    })]
    #[diagnostic(
        code(E0713),
        help(
            "take more `steps`, or give a `tolerance` instead and leave their lengths to the method"
        )
    )]
    Coarse {
        error: String,
        modes: bool,
        #[label("this run")]
        span: Span,
    },

    /// Out of steps or events.
    #[error("at t = {time}, the limit of {what} was reached")]
    #[diagnostic(
        code(E0708),
        help("shorten the horizon, loosen the tolerance, or raise `max_events`")
    )]
    Limit {
        time: f64,
        what: &'static str,
        /// The line of a term that turns over within a step, or the run.
        #[label(collection)]
        terms: Vec<LabeledSpan>,
    },

    /// Constraints that contradict each other, or a grid that holds no trajectory.
    #[error(
        "no controls were found that satisfy the model and all constraints on this grid: where they are missed least from here, by {violation}"
    )]
    #[diagnostic(
        code(E0715),
        help(
            "loosen one of these lines, the horizon, or bounds of controls and states, or start from another `guess`; an interval with m `elements` holds m - 1 instants of switches, and steps of time are best where `intervals` begin"
        )
    )]
    Infeasible {
        violation: String,
        #[label(collection)]
        lines: Vec<LabeledSpan>,
    },

    /// A cost without a lower bound.
    #[error("the cost falls below all bounds")]
    #[diagnostic(
        code(E0716),
        help("bound the controls, or add what makes large values expensive")
    )]
    Unbounded {
        #[label("has no minimum")]
        span: Span,
    },

    /// An optimization that ended without an optimum.
    #[error("no optimum was found: {what}")]
    #[diagnostic(
        code(E0717),
        help("{}", match end {
            Status::IterationLimit => "raise `max_iterations`, or leave it out and give the run `--time-limit`",
            _ => "try another `guess`, several `starts`, or more `elements`",
        })
    )]
    NotOptimal {
        what: String,
        /// How the run ended: where constraints are satisfied, or at a limit, or neither.
        end: Status,
        /// Lines that are to blame, or the experiment.
        #[label(collection)]
        lines: Vec<LabeledSpan>,
    },

    /// A fit that ended without a minimum.
    #[error("no least sum of squares was found: {what}")]
    #[diagnostic(
        code(E0741),
        help(
            "try other values to start from in `with`, several `starts`, closer bounds, or a smaller `tolerance`"
        )
    )]
    NotFitted {
        what: String,
        is_limit: bool,
        #[label("this fit")]
        span: Span,
    },

    /// A run of a fit, besides the one that is told, that ended before its last measurement.
    #[error("in the run with {with}, {failure}")]
    #[diagnostic(forward(failure))]
    OfRun {
        /// What is given to it.
        with: String,
        failure: Box<Failure>,
    },

    /// A state from which a controller's model does not begin.
    #[error("at t = {time}, there is no plan: {why}")]
    #[diagnostic(
        code(E0745),
        help("keep the plant where the controller's model begins, with other controls or bounds")
    )]
    NoPlan {
        time: f64,
        why: String,
        #[label("this controller")]
        span: Span,
    },

    /// A feasible point whose multipliers leave open that the objective falls.
    #[error(
        "no optimum was shown: a feasible point was reached that is {class}-stationary, {missing}"
    )]
    #[diagnostic(
        code(E0735),
        help(
            "try another `guess` or several `starts`, which may end where the choice of mode does not matter"
        )
    )]
    Weak {
        class: &'static str,
        missing: String,
        /// What is complementary at the point, and undecided.
        #[label(collection)]
        lines: Vec<LabeledSpan>,
    },

    /// An optimum in other sliding modes than the model.
    #[error(
        "at t = {time}, the program has `{name}` at {found}, and a simulation with its controls at {simulated}"
    )]
    #[diagnostic(
        code(E0732),
        help(
            "several sliding modes are consistent here, and the model takes the one that is reached from the side of entry: try another `guess`, more `elements`, or constraints that this one can meet"
        )
    )]
    OtherMode {
        time: f64,
        name: String,
        found: String,
        simulated: String,
        #[label("read nonlinearly")]
        span: Span,
    },

    /// Out of time.
    #[error("at t = {time}, the time limit was reached")]
    #[diagnostic(code(E0709), help("raise `--time-limit`, or loosen the tolerance"))]
    TimeLimit {
        time: f64,
        #[label("this run")]
        span: Span,
    },

    /// Canceled from outside.
    #[error("at t = {time}, the run was canceled")]
    #[diagnostic(code(E0734), help("run it again for the rest"))]
    Canceled {
        time: f64,
        #[label("this run")]
        span: Span,
    },
}

impl Fixable for Failure {}

impl Failure {
    /// That the limit of a run was over.
    pub fn over(over: Over, time: f64, span: Span) -> Self {
        match over {
            Over::TimeLimit => Failure::TimeLimit { time, span },
            Over::Canceled => Failure::Canceled { time, span },
        }
    }

    /// Whether that is why.
    pub fn is_over(&self) -> bool {
        self.status().is_over()
    }

    /// The language's word for how the run ended.
    pub fn status(&self) -> Status {
        match self {
            Failure::Limit { .. }
            | Failure::Chattering { .. }
            | Failure::NotFitted { is_limit: true, .. } => Status::IterationLimit,
            Failure::TimeLimit { .. } => Status::TimeLimit,
            Failure::Canceled { .. } => Status::Canceled,
            Failure::Infeasible { .. } => Status::LocallyInfeasible,
            Failure::Unbounded { .. } => Status::Unbounded,
            Failure::OfRun { failure, .. } => failure.status(),
            Failure::NotOptimal { end, .. } => *end,
            Failure::Weak { .. } | Failure::NotFitted { .. } => Status::Feasible,
            _ => Status::NumericalFailure,
        }
    }
}
