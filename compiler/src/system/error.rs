//! What can be wrong with switches (E04), and with partitions of regions (E032).

use miette::{Diagnostic, LabeledSpan};
use thiserror::Error;

use crate::diagnostics::{Applicability, Fix, Fixable};
use crate::source::Span;
use crate::syntax::Sliding;

/// A mistake that shows when the switches of a model are made explicit.
#[derive(Clone, Debug, Diagnostic, Error)]
#[allow(
    missing_docs,
    reason = "fields are the words of the message; labels say the rest"
)]
pub enum SystemError {
    /// Two regions of one partition that hold at the same point.
    #[error("regions `{first}` and `{second}` overlap at {witness}")]
    #[diagnostic(
        code(E0321),
        help("make the guards exclude each other, or write one as `else`")
    )]
    Overlap {
        first: String,
        second: String,
        witness: String,
        #[label("`{first}` holds there")]
        first_span: Span,
        #[label(primary, "`{second}` holds there too")]
        second_span: Span,
    },

    /// A point that no region of a partition covers.
    #[error("no region sets `{states}` at {witness}")]
    #[diagnostic(code(E0322), help("add a region for it, or make the last one `else`"))]
    Gap {
        states: String,
        witness: String,
        #[label("the last region of this partition")]
        span: Span,
        entries: Vec<String>,
    },

    /// A guard whose comparisons exclude each other, or hold together on a surface only.
    #[error("region `{region}` is a thin set at most")]
    #[diagnostic(
        code(E0309),
        help("widen the region, or drop it; `<` and `<=` are the same")
    )]
    ThinGuard {
        region: String,
        #[label("{why}")]
        span: Span,
        why: &'static str,
    },

    /// A switch that enters the dynamics nonlinearly, without a reading on its surface.
    #[error("`{name}` enters nonlinearly and has no reading on its surface")]
    #[diagnostic(code(E0401), help("choose a reading: {linear}, or {nonlinear}"))]
    NonlinearSwitch {
        name: String,
        linear: String,
        nonlinear: String,
        #[label(primary, "this switching term")]
        switch: Span,
        #[label("enters nonlinearly here")]
        entry: Option<Span>,
        /// Its `switch` statement, where it has one, or else where one may be and how it begins.
        named: Result<Span, (Span, String)>,
    },

    /// Hidden terms of a switch that says neither to keep nor to drop them.
    #[error("`{name}` has hidden terms and no reading on its surface")]
    #[diagnostic(
        code(E0401),
        help(
            "choose a reading: `{statement} sliding nonlinear;` keeps `{term}` while `{name}` is between its sides, `{statement} sliding linear;` (or `with {{ {name}.sliding = linear; }}` in an experiment) is Filippov's reading, which drops it"
        )
    )]
    HiddenReading {
        name: String,
        statement: String,
        term: String,
        #[label(primary, "acts on the surface of `{name}` only")]
        term_span: Span,
        #[label("without `sliding linear` or `sliding nonlinear`")]
        switch: Span,
    },

    /// A nonlinear condition: no named switch can carry the reading.
    #[error("the condition on `{name}` enters nonlinearly")]
    #[diagnostic(
        code(E0402),
        help(
            "choose between whole terms: `if c then exp(a) else exp(b)` instead of `exp(if c then a else b)`"
        )
    )]
    NonlinearCondition {
        name: String,
        #[label(primary, "this condition")]
        condition: Span,
        #[label("enters nonlinearly here")]
        entry: Option<Span>,
    },

    /// A jump after which its own guard holds as before.
    #[error("after the jump `{name}` its guard still holds")]
    #[diagnostic(
        code(E0409),
        help(
            "a jump must leave its guard: a ball bounces with `v := -e*v`, and what counts waits for another jump to arm it: \
             `jump count when x <= 0 and armed > 0 {{ n := n + 1; armed := 0; }}`"
        )
    )]
    StaysInGuard {
        name: String,
        #[label("holds before and after")]
        guard: Span,
        #[label(primary, "this changes no comparison of the guard")]
        span: Span,
    },

    /// A contact whose gap or slip velocity is none.
    #[error("`{name}` is no contact: {what}")]
    #[diagnostic(
        code(E0410),
        help(
            "a gap is a function of positions, smooth or the smallest of smooth ones, and no other contact has it; a slip velocity is linear in velocities; 0 <= restitution <= 1, friction >= 0"
        )
    )]
    NoContact {
        name: String,
        what: String,
        #[label("here")]
        span: Span,
    },

    /// A gap that switches something else, too.
    #[error(
        "`{name}` is no contact: its gap is compared elsewhere too, or is that of another contact"
    )]
    #[diagnostic(
        code(E0410),
        help(
            "a surface belongs to one contact: leave out the other place, or let it ask for something else, as for a speed, or for a gap that is larger by a little"
        )
    )]
    SharedGap {
        name: String,
        #[label(primary, "here")]
        span: Span,
        #[label("and here")]
        other: Option<Span>,
    },

    /// A slip velocity that steps or bends where a switch changes its side.
    #[error("the slip velocity of `{name}` steps or bends where {switches} changes its sign")]
    #[diagnostic(
        code(E0410),
        help(
            "a belt may step with time, data and relays, and turns with nothing: let a speed that depends on states be one that jumps, `state w = 1; w' = 0; jump faster when q[1] > 1 and w < 2 {{ w := 2; }}`, or that follows, `w' = (speed - w)/0.01;`"
        )
    )]
    SlipSwitches {
        name: String,
        switches: String,
        #[label("linear in velocities, but not smooth")]
        span: Span,
    },

    /// A gap with a corner that points into the free space, or a step.
    #[error("the gap of `{name}` has a corner or steps where `{switch}` changes its sign")]
    #[diagnostic(
        code(E0410),
        help(
            "a gap is the smallest of smooth functions, or smooth in itself: of a body that rounds a corner `p` at a distance, write `norm(max(q - p, 0)) - r` with a radius `r`, and a sharp corner with a small one"
        )
    )]
    CornerInGap {
        name: String,
        switch: String,
        #[label("neither `min` nor smooth")]
        span: Span,
    },

    /// A gap whose switch changes its side inside of the body, as far as was seen.
    #[error(
        "no point outside of the body was found where `{switch}`, in the gap of `{name}`, changes its sign"
    )]
    #[diagnostic(
        code(E0410),
        help(
            "whether the gap has a corner there is not known: leave out what changes nothing outside, and write `q[1] - 1` in place of `max(q[1], 0) - 1`"
        )
    )]
    BendInside {
        name: String,
        switch: String,
        #[label("bends inside of the body, as far as was seen")]
        span: Span,
    },

    /// A gap that is the smallest of too many.
    #[error("the gap of `{name}` is the smallest of more than {limit} functions")]
    #[diagnostic(
        code(E0410),
        help(
            "a sum of n absolute values has 2^n features: write the distance from a smooth body, as `r - norm(q)`, or contacts for the features that may be struck"
        )
    )]
    ManyFeatures {
        name: String,
        limit: usize,
        #[label("the limit is reached here")]
        span: Span,
    },

    /// One slip velocity for several surfaces.
    #[error("`{name}` has one slip velocity, and its gap is the smallest of {features}")]
    #[diagnostic(
        code(E0410),
        help(
            "each surface has a slip velocity of its own: write a contact for each; of a point in the plane, `slip` may be left out"
        )
    )]
    SlipOfFeatures {
        name: String,
        features: usize,
        #[label("along which of them?")]
        span: Span,
    },

    /// Bodies that overlap where a run starts.
    #[error("`{name}` starts with a gap of {gap}")]
    #[diagnostic(
        code(E0418),
        help("start where no gap is negative, and check the sign of this one")
    )]
    StartsBelow {
        name: String,
        gap: f64,
        #[label("bodies overlap here at the start")]
        span: Span,
    },

    /// Closed contacts whose forces are not determined.
    #[error("the normal of `{name}` depends on those of {others} at the start")]
    #[diagnostic(
        code(W0401),
        severity(Warning),
        help("motion is determined, forces are not; leave out a contact that others make up")
    )]
    DependentNormals {
        name: String,
        others: String,
        #[label("this one adds no direction")]
        span: Span,
    },

    /// A contact that friction may pull closed.
    #[error("friction may pull the body into the contact `{name}` (Painlevé's paradox)")]
    #[diagnostic(
        code(W0402),
        severity(Warning),
        help("where it is closed and slips like this, the run ends (E0725); take less friction")
    )]
    Pulls {
        name: String,
        #[label("its force does not push it open in the position of the start")]
        span: Span,
    },

    /// Friction of a point along directions that are none of its surface.
    #[error("{what}")]
    #[diagnostic(code(W0403), severity(Warning), help("{help}"))]
    Directions {
        what: String,
        help: &'static str,
        #[label("a point: its mass is a number")]
        span: Span,
    },

    /// A switching function that is zero everywhere.
    #[error("the switching function `{name}` is zero everywhere")]
    #[diagnostic(
        code(W0404),
        severity(Warning),
        help("its terms cancel: compare what differs, or leave the comparison out")
    )]
    ZeroSwitch {
        name: String,
        #[label("always 0, so it is on neither side and never switches")]
        span: Span,
    },

    /// A constraint that a projection cannot keep.
    #[error("`{name}` is no constraint of a projection: {what}")]
    #[diagnostic(
        code(E0412),
        help(
            "a row is a smooth function of time and state that the projected state moves, and no other row or comparison has the same one; `metric` is positive semidefinite"
        )
    )]
    NoConstraint {
        name: String,
        what: String,
        #[label("here")]
        span: Span,
    },

    /// Equations that hold too few algebraic states.
    #[error("the index is above one: {held}, and {free} is left over")]
    #[diagnostic(
        code(E0413),
        help(
            "algebraic states must follow from the equations at each instant: differentiate an equation that holds none, or keep a state on a set with `project` or `contact`"
        )
    )]
    HighIndex {
        held: String,
        free: String,
        #[label(collection)]
        rows: Vec<LabeledSpan>,
    },

    /// A pair one member of which determines nothing.
    #[error("the index is above one where this member of a complementarity is zero")]
    #[diagnostic(
        code(E0414),
        help(
            "each member must determine an algebraic state; a force that keeps a state on one side of a surface is `project x onto {{ .. }}` or a `contact`"
        )
    )]
    HighIndexPair {
        #[label(primary, "no algebraic state follows from it alone")]
        span: Span,
        #[label("the other member")]
        other: Span,
    },

    /// A program that is not convex.
    #[error("this program is not convex: {what} curves the wrong way")]
    #[diagnostic(
        code(E0415),
        help(
            "minimize a function that is nowhere concave, over rows `H >= 0` with H nowhere convex and equations that are affine: only then the optimality conditions give a minimum"
        )
    )]
    NotConvex {
        what: &'static str,
        #[label("not convex")]
        span: Span,
    },

    /// A program without a feasible point.
    #[error("no point satisfies all rows of this program where a run starts")]
    #[diagnostic(
        code(E0416),
        help("these rows contradict each other there; loosen one of them")
    )]
    Infeasible {
        #[label(collection)]
        rows: Vec<LabeledSpan>,
    },

    /// A row that another one says already.
    #[error("two rows of this program say the same")]
    #[diagnostic(
        code(E0417),
        help("leave one of them out: only one multiplier can be determined")
    )]
    RepeatedRow {
        #[label("said here")]
        first: Span,
        #[label(primary, "and here again")]
        second: Span,
    },

    /// Friction without a direction.
    #[error("the direction in which `{name}` slips is not known")]
    #[diagnostic(
        code(E0411),
        help(
            "write `slip = w;`, the velocity along the surface; it follows from the gap only where all bodies are points in the plane, with `mass = m*eye(2);`"
        )
    )]
    NoTangent {
        name: String,
        #[label("friction without `slip`")]
        span: Span,
    },

    /// A switching function without a state or time.
    #[error("the switching function `{name}` is constant")]
    #[diagnostic(code(E0403), help("it must depend on a state or on time"))]
    ConstantSwitch {
        name: String,
        #[label("always {value}")]
        span: Span,
        value: f64,
    },

    /// A switching function that free parameters alone decide, where something jumps.
    #[error("free parameters alone decide on which side of zero `{name}` is")]
    #[diagnostic(
        code(E0527),
        help(
            "give the free parameters ranges on one side, or optimize each side with an experiment of its own"
        )
    )]
    FreeSwitch {
        name: String,
        #[label("does not change along a run, so that the optimum may lie where it jumps")]
        span: Span,
    },

    /// A switching function that touches zero without crossing it, or crosses it with zero slope.
    #[error("`{name}` = 0 is no switching surface")]
    #[diagnostic(code(E0404))]
    NoSurface {
        name: String,
        #[label("{why}")]
        span: Span,
        why: String,
        #[help]
        help: Option<String>,
    },

    /// A switching function that itself jumps.
    #[error("the switching function `{outer}` jumps with `{inner}`")]
    #[diagnostic(
        code(E0405),
        help("a switching function must be continuous; write the cases as regions")
    )]
    DiscontinuousSurface {
        outer: String,
        inner: String,
        #[label(primary, "jumps")]
        outer_span: Span,
        #[label("when this switches")]
        inner_span: Span,
    },

    /// A relay without two thresholds.
    #[error("relay `{name}` switches on at {on} and off at {off}")]
    #[diagnostic(
        code(E0406),
        help("`on` and `off` are two different numbers; without memory, write `step(..)`")
    )]
    Thresholds {
        name: String,
        on: f64,
        off: f64,
        #[label("no memory between them")]
        span: Span,
    },

    /// A relay that starts with another value than its two.
    #[error("relay `{name}` cannot start at {start}")]
    #[diagnostic(code(E0406), help("`start` is 0 or 1"))]
    RelayStart {
        name: String,
        start: f64,
        #[label("0 or 1")]
        span: Span,
    },

    /// A relay whose value at the start is not known.
    #[error("relay `{name}` starts between its thresholds")]
    #[diagnostic(
        code(E0407),
        help("add `start = 1` or `start = 0`: there, its value depends on what was before")
    )]
    NoStart {
        name: String,
        y: f64,
        #[label("what it watches is {y} at the start")]
        span: Span,
    },

    /// A comparison of a relay with one of its own values.
    #[error("`{name}` is zero at a value of what it compares")]
    #[diagnostic(
        code(E0408),
        help("compare with a number between the values, as in `h > 0.5`")
    )]
    ZeroAtCorner {
        name: String,
        #[label("neither above nor below")]
        span: Span,
    },

    /// Data that does not reach as far as the run.
    #[error("the data of `{name}` is on [{first}, {last}], the run on [0, {horizon}]")]
    #[diagnostic(
        code(E0511),
        help("shorten the horizon, or add rows; `fit = hold` goes on after its last row")
    )]
    ShortData {
        name: String,
        first: f64,
        last: f64,
        horizon: f64,
        #[label("no data for the whole run")]
        span: Span,
        #[label("this run")]
        run: Span,
    },

    /// The floor of what is not a function of time alone.
    #[error("`{text}` depends on `{on}`, which is not known before the run")]
    #[diagnostic(code(E0423), help("{help}"))]
    Rounded {
        text: String,
        on: String,
        help: String,
        #[label("neither known before the run nor within declared ranges")]
        span: Span,
    },

    /// More jumps of a floor than a run looks at.
    #[error("`{text}` jumps more than {limit} times on [0, {horizon}]")]
    #[diagnostic(
        code(E0423),
        help("shorten the horizon, or count with a state and a `jump`")
    )]
    TooManyInstants {
        text: String,
        horizon: f64,
        limit: usize,
        #[label("too many instants")]
        span: Span,
    },

    /// Jumps of a floor that cannot be told apart from touches.
    #[error("where `{text}` passes an integer is not known")]
    #[diagnostic(
        code(E0423),
        help(
            "its argument is flat at an integer, jumps or has a pole: write the steps one by one, `step(time - 1)`"
        )
    )]
    UnknownInstants {
        text: String,
        #[label("of this function of time")]
        span: Span,
    },

    /// A floor of time where nothing says how long the run may be.
    #[error("until when `{text}` jumps is not known")]
    #[diagnostic(
        code(E0423),
        help("fix the horizon, or give it a largest length: `horizon free in [0.1, 10];`")
    )]
    OpenHorizon {
        text: String,
        #[label("depends on time, and the horizon is free")]
        span: Span,
    },

    /// Instants that follow each other by nothing, or by what is no number before the run.
    #[error("the {what} of these instants is {found}: it has to be {expected}")]
    #[diagnostic(
        code(E0424),
        help(
            "write `every T offset t` with numbers and parameters: a `jump .. when` is for what states decide"
        )
    )]
    Instants {
        what: &'static str,
        found: String,
        expected: &'static str,
        #[label("of these instants")]
        span: Span,
    },

    /// A remainder by nothing.
    #[error("the period is {period}")]
    #[diagnostic(code(E0423), help("a period is a number above zero"))]
    Period {
        period: f64,
        #[label("called here")]
        span: Span,
    },

    /// A pulse that is shorter than nothing or longer than its period.
    #[error("the duty of `pulse` is {duty}")]
    #[diagnostic(code(E0423), help("it is a share of the period, from 0 to 1"))]
    Duty {
        duty: f64,
        #[label("called here")]
        span: Span,
    },

    /// More switches than can be looked at one by one in what they act on.
    #[error("{count} switches act together")]
    #[diagnostic(
        code(E0422),
        help("use fewer switches, or let each act on fewer states and shorter terms")
    )]
    TooManySwitches {
        count: usize,
        #[label("one of the {count} switches")]
        span: Span,
    },

    /// A nonlinear function of so many switches has a value of its own on each of their sides.
    #[error("{count} switches stand inside nonlinear functions of each other")]
    #[diagnostic(
        code(E0422),
        help("nest fewer, or give an inner value a state of its own that follows it quickly")
    )]
    EntangledSwitches {
        count: usize,
        #[label("2^{count} cases")]
        span: Span,
    },

    /// More regions than can be compared with each other.
    #[error("{count} regions in one partition")]
    #[diagnostic(
        code(E0422),
        help("a partition has at most {limit} regions; write repeated terms as a sum")
    )]
    TooManyRegions {
        count: usize,
        limit: usize,
        #[label("the limit is reached here")]
        span: Span,
    },

    /// What time-freezing would change.
    #[error("`lower timefreezing` does not take {what}")]
    #[diagnostic(code(E0925), help("{help}"))]
    Unfrozen {
        what: String,
        help: &'static str,
        #[label("not lowered yet")]
        span: Span,
    },

    /// A region whose guard holds a nonlinear switch and does not decide it.
    #[error(
        "`{name}` is read nonlinearly, and is in an alternative of the guard of this region and in its rates"
    )]
    #[diagnostic(code(E0920), help("write one region for each side of `{name}`"))]
    NonlinearGuard {
        name: String,
        #[label("is not written for one side of `{name}`")]
        span: Span,
    },
}

impl Fixable for SystemError {
    fn choices(&self) -> Vec<Fix> {
        let readings = |statement: &Span| {
            let words = Sliding::ALL.map(|reading| format!("sliding {}", reading.word()));
            words.map(|words| Fix::at_end(*statement, &words)).to_vec()
        };
        match self {
            SystemError::Gap { span, entries, .. } => {
                vec![Fix::rest(*span, entries.iter().map(String::as_str))]
            }
            SystemError::NonlinearSwitch { named, .. } => match named {
                Ok(statement) => readings(statement),
                Err((place, statement)) => Sliding::ALL
                    .map(Sliding::word)
                    .map(|reading| {
                        let line = format!("  {statement} sliding {reading};\n");
                        Fix::one(*place, line, Applicability::Suggestion)
                    })
                    .to_vec(),
            },
            SystemError::HiddenReading { switch, .. } => readings(switch),
            _ => Vec::new(),
        }
    }
}
