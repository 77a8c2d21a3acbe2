//! Methods, their options, and lowerings.

use nsd_solver::integrate::tableau::Family;

use super::capabilities::Feature;
use super::capabilities::Taken::{self, Lowered, No, Yes};
use super::error::ExperimentError;
use super::fesd::{self, FesdOptions, SteppingOptions};
use super::law::{self, Law};
use super::optimize::{self, At};
use super::reader::{Reader, unknown_choice};
use crate::diagnostics::Help;
use crate::syntax::{self, ExprKind, Ident, Setting};

/// A simulation method.
#[derive(Clone, Debug, PartialEq)]
pub enum Method<'e> {
    /// The compiler chooses.
    Auto,
    /// Switch-detecting active-set integration.
    Event(EventOptions),
    /// Finite elements with switch detection.
    Fesd(FesdOptions),
    /// Steps of one length without switch detection.
    Timestepping(SteppingOptions),
    /// Steep functions in the place of switches.
    Smoothing(SmoothingOptions<'e>),
    /// A high-order integrator that does not know of switches.
    Adaptive,
}

/// A method of simulation, without its options.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MethodKind {
    /// The compiler chooses: from event to event.
    Auto,
    /// Switch-detecting active-set integration.
    Event,
    /// Finite elements with switch detection.
    Fesd,
    /// Steps of one length without switch detection.
    Timestepping,
    /// Steep functions in the place of switches.
    Smoothing,
    /// A high-order integrator that does not know of switches.
    Adaptive,
}

/// What a method is and takes.
struct Capabilities {
    word: &'static str,
    /// Whether it looks for the instants at which switches change.
    locates: bool,
    /// Whether it works on a complementarity system.
    needs_dcs: bool,
    /// By [`Feature::ALL`].
    takes: [Taken; Feature::ALL.len()],
}

/// By [`MethodKind::ALL`].
#[rustfmt::skip]
const CAPABILITIES: [Capabilities; MethodKind::ALL.len()] = {
    const FROZEN: Taken = Lowered(&[Lowering::TimeFreezing]);
    const EITHER: Taken = Lowered(&[Lowering::Impact, Lowering::TimeFreezing]);
    //                                                                                 contacts poisson relays  jumps   projections algebraic nonlinear perturb averages stop    timefreezing impact  derivatives
    [
        Capabilities { word: "auto",         locates: true,  needs_dcs: false, takes: [Yes,     Yes,    Yes,    Yes,    Yes,        Yes,      Yes,      Yes,    Yes,     Yes,     Yes,         No,     Yes] },
        Capabilities { word: "event",        locates: true,  needs_dcs: false, takes: [Yes,     Yes,    Yes,    Yes,    Yes,        Yes,      Yes,      Yes,    Yes,     Yes,     Yes,         No,     Yes] },
        Capabilities { word: "fesd",         locates: true,  needs_dcs: true,  takes: [EITHER,  No,     FROZEN, FROZEN, Yes,        Yes,      Yes,      No,     No,      No,      Yes,         Yes,    Yes] },
        Capabilities { word: "timestepping", locates: false, needs_dcs: true,  takes: [Yes,     No,     No,     No,     Yes,        Yes,      No,       No,     No,      No,      No,          No,     No ] },
        Capabilities { word: "smoothing",    locates: true,  needs_dcs: false, takes: [No,      No,     No,     No,     No,         No,       Yes,      Yes,    No,      No,      No,          No,     No ] },
        Capabilities { word: "adaptive",     locates: false, needs_dcs: false, takes: [No,      No,     No,     No,     No,         No,       No,       No,     No,      No,      No,          No,     No ] },
    ]
};

impl MethodKind {
    /// All of them.
    pub const ALL: [MethodKind; 6] = [
        MethodKind::Auto,
        MethodKind::Event,
        MethodKind::Fesd,
        MethodKind::Timestepping,
        MethodKind::Smoothing,
        MethodKind::Adaptive,
    ];

    fn capabilities(self) -> &'static Capabilities {
        &CAPABILITIES[self as usize]
    }

    /// The word of the language.
    pub fn word(self) -> &'static str {
        self.capabilities().word
    }

    /// The words of all methods.
    pub fn words() -> Vec<&'static str> {
        Self::ALL.iter().map(|kind| kind.word()).collect()
    }

    /// The method of a word.
    pub fn named(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.word() == word)
    }

    /// Whether it looks for the instants at which switches change.
    pub fn locates(self) -> bool {
        self.capabilities().locates
    }

    /// Whether it works on a complementarity system.
    pub fn needs_dcs(self) -> bool {
        self.capabilities().needs_dcs
    }

    /// Whether it looks at the present state alone, in rates without switches.
    pub fn is_without_switches(self) -> bool {
        self.taken(Feature::Projections) == No
    }

    /// Whether it goes from event to event of the model as it is.
    pub fn is_by_events(self) -> bool {
        matches!(self, MethodKind::Auto | MethodKind::Event)
    }

    /// Whether it takes a lowering.
    pub fn takes_lowering(self, lowering: Lowering) -> bool {
        match lowering {
            Lowering::Stewart | Lowering::Step => self.needs_dcs(),
            Lowering::TimeFreezing => self.takes(Feature::TimeFreezing),
            Lowering::Impact => self.takes(Feature::Impulses),
        }
    }

    /// The options that may stand in its braces.
    pub fn options(self) -> &'static [&'static str] {
        match self {
            MethodKind::Auto | MethodKind::Adaptive => &[],
            MethodKind::Event => &EVENT_OPTIONS,
            MethodKind::Fesd => &fesd::OPTIONS,
            MethodKind::Timestepping => &fesd::STEPPING_OPTIONS,
            MethodKind::Smoothing => &SMOOTHING_OPTIONS,
        }
    }

    /// How it takes something.
    pub fn taken(self, feature: Feature) -> Taken {
        self.capabilities().takes[feature as usize]
    }

    /// Whether it takes something as it is.
    pub fn takes(self, feature: Feature) -> bool {
        self.taken(feature) == Yes
    }
}

impl Method<'_> {
    /// Without its options.
    pub fn kind(&self) -> MethodKind {
        match self {
            Method::Auto => MethodKind::Auto,
            Method::Event(_) => MethodKind::Event,
            Method::Fesd(_) => MethodKind::Fesd,
            Method::Timestepping(_) => MethodKind::Timestepping,
            Method::Smoothing(_) => MethodKind::Smoothing,
            Method::Adaptive => MethodKind::Adaptive,
        }
    }

    /// Whether it is told how many steps to take.
    pub fn has_steps(&self) -> bool {
        match self {
            Method::Fesd(options) => options.steps.is_some(),
            Method::Timestepping(_) => true,
            _ => false,
        }
    }
}

/// Options of `method smoothing`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmoothingOptions<'e> {
    /// Half of the width in ψ over which a switch changes, in the unit of ψ.
    pub epsilon: f64,
    /// The function in the place of the sign.
    pub law: Law<'e>,
}

impl Default for SmoothingOptions<'_> {
    fn default() -> Self {
        SmoothingOptions {
            epsilon: 1e-3,
            law: Law::Tanh,
        }
    }
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

/// A lowering that an experiment may ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lowering {
    /// Stewart's reformulation.
    Stewart,
    /// The step (Heaviside) reformulation.
    Step,
    /// Jumps and relays take place while a clock stands still.
    TimeFreezing,
    /// Contacts give impulses where finite elements meet (FESD-J).
    Impact,
}

impl Lowering {
    /// All of them.
    pub const ALL: [Lowering; 4] = [
        Lowering::Stewart,
        Lowering::Step,
        Lowering::TimeFreezing,
        Lowering::Impact,
    ];

    /// The word of the language.
    pub fn word(self) -> &'static str {
        match self {
            Lowering::Stewart => "stewart",
            Lowering::Step => "step",
            Lowering::TimeFreezing => "timefreezing",
            Lowering::Impact => "impact",
        }
    }
}

const EVENT_OPTIONS: [&str; 3] = ["order", "branch", "max_events"];
const SMOOTHING_OPTIONS: [&str; 2] = ["epsilon", "law"];
const BRANCHES: [&str; 3] = ["plus", "minus", "slide"];

/// Highest order of the Taylor method that a user may ask for.
const HIGHEST_ORDER: f64 = 60.0;
const MOST_EVENTS: f64 = 1e9;

/// `method NAME { options }`
pub(crate) fn method<'e>(
    reader: &mut Reader<'_, 'e>,
    name: &Ident,
    options: &[Setting],
) -> Option<Method<'e>> {
    let Some(kind) = MethodKind::named(&name.name) else {
        reader.error(unknown_choice("method", name, &MethodKind::words()));
        return None;
    };
    Some(match kind {
        MethodKind::Auto => {
            let help = "name the method whose option it is";
            no_options(reader, kind.word(), options, Some(help));
            Method::Auto
        }
        MethodKind::Adaptive => {
            no_options(reader, kind.word(), options, None);
            Method::Adaptive
        }
        MethodKind::Smoothing => Method::Smoothing(smoothing_options(reader, options)),
        MethodKind::Event => Method::Event(event_options(reader, options)),
        MethodKind::Fesd => Method::Fesd(fesd::options(reader, options)),
        MethodKind::Timestepping => Method::Timestepping(fesd::stepping_options(reader, options)),
    })
}

/// Reports options of a method that has none.
fn no_options(reader: &mut Reader<'_, '_>, method: &str, options: &[Setting], help: Option<&str>) {
    for option in options {
        reader.error(ExperimentError::UnknownChoice {
            what: "option".into(),
            found: option.name.name.clone(),
            span: option.name.span,
            choices: format!("no option of `{method}`"),
            help: help.map(Help::from),
        });
    }
}

fn smoothing_options<'e>(reader: &mut Reader<'_, 'e>, options: &[Setting]) -> SmoothingOptions<'e> {
    let mut smoothing = SmoothingOptions::default();
    reader.once_each(options);
    for option in options {
        match option.name.name.as_str() {
            "epsilon" => {
                let epsilon = reader.positive("`epsilon`", &option.value);
                smoothing.epsilon = epsilon.unwrap_or(smoothing.epsilon);
            }
            "law" => {
                smoothing.law = law::law(reader, &option.value).unwrap_or(smoothing.law);
            }
            _ => reader.error(unknown_choice("option", &option.name, &SMOOTHING_OPTIONS)),
        }
    }
    smoothing
}

fn event_options(reader: &mut Reader<'_, '_>, options: &[Setting]) -> EventOptions {
    let mut event = EventOptions::default();
    reader.once_each(options);
    for option in options {
        match option.name.name.as_str() {
            "order" => event.order = reader.count("the order", &option.value, HIGHEST_ORDER),
            "max_events" => {
                event.max_events = reader.count("`max_events`", &option.value, MOST_EVENTS)
            }
            "branch" => event.branch = branches(reader, &option.value),
            _ => reader.error(unknown_choice("option", &option.name, &EVENT_OPTIONS)),
        }
    }
    event
}

/// `plus` or `[plus, slide]`
fn branches(reader: &mut Reader<'_, '_>, value: &syntax::Expr) -> Vec<Branch> {
    let words: Vec<&syntax::Expr> = match &value.kind {
        ExprKind::Matrix(matrix) => matrix.rows.iter().flatten().collect(),
        _ => vec![value],
    };
    let branch = |word: &syntax::Expr| {
        let name = match &word.kind {
            ExprKind::Name(name) => name.clone(),
            _ => "..".to_owned(),
        };
        match name.as_str() {
            "plus" => Some(Branch::Plus),
            "minus" => Some(Branch::Minus),
            "slide" => Some(Branch::Slide),
            _ => {
                reader.error(unknown_choice(
                    "branch",
                    &Ident {
                        name,
                        span: word.span,
                    },
                    &BRANCHES,
                ));
                None
            }
        }
    };
    words.into_iter().filter_map(branch).collect()
}

/// The options of a method, by its word.
pub fn options_of(method: &str) -> &'static [&'static str] {
    match MethodKind::named(method) {
        Some(kind) => kind.options(),
        None if method == optimize::OPTIMIZER => &optimize::OPTIONS,
        None => &[],
    }
}

/// The words that stand for values of a setting or of an option of a method; none where they are numbers.
pub fn words_of(option: &str) -> Vec<String> {
    fn first<T: Copy>(choices: &[(&'static str, T)]) -> Vec<&'static str> {
        choices.iter().map(|(word, _)| *word).collect()
    }
    let words = match option {
        "scheme" => Family::ALL.map(Family::word).to_vec(),
        "branch" => BRANCHES.to_vec(),
        "equilibration" => fesd::EQUILIBRATIONS.to_vec(),
        "form" => first(&fesd::FORMS),
        "cross" => first(&fesd::CROSS),
        "relaxation" => first(&optimize::RELAXATIONS),
        "steering" => first(&optimize::STEERINGS),
        "path" => first(&optimize::PATHS),
        "controls" => first(&optimize::SHAPES),
        "loss" => optimize::LOSSES.to_vec(),
        "at" => optimize::INSTANTS.map(At::as_str).to_vec(),
        "law" => return Law::BUILT_IN.map(|law| law.word()).to_vec(),
        _ => vec![],
    };
    words.into_iter().map(str::to_owned).collect()
}

/// A name after `lower`.
pub(crate) fn lowering(reader: &mut Reader<'_, '_>, name: &Ident) -> Option<Lowering> {
    let found = Lowering::ALL
        .into_iter()
        .find(|lowering| lowering.word() == name.name);
    if found.is_none() {
        let words = Lowering::ALL.map(Lowering::word);
        reader.error(unknown_choice("lowering", name, &words));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::{CAPABILITIES, MethodKind};

    #[test]
    fn methods_stand_in_their_rows() {
        for (kind, row) in MethodKind::ALL.into_iter().zip(&CAPABILITIES) {
            assert_eq!(MethodKind::named(row.word), Some(kind));
        }
    }
}
