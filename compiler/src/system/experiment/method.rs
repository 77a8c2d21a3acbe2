//! Methods, their options, and lowerings.

use super::fesd::{self, FesdOptions, SteppingOptions};
use super::law::{self, Law};
use super::{ExperimentError, Reader, unknown_choice};
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

impl Method<'_> {
    /// The word of the language.
    pub fn word(&self) -> &'static str {
        match self {
            Method::Auto => "auto",
            Method::Event(_) => "event",
            Method::Fesd(_) => "fesd",
            Method::Timestepping(_) => "timestepping",
            Method::Smoothing(_) => "smoothing",
            Method::Adaptive => "adaptive",
        }
    }

    /// Whether it works on a complementarity system.
    pub fn needs_dcs(&self) -> bool {
        matches!(self, Method::Fesd(_) | Method::Timestepping(_))
    }

    /// Whether it is told how many steps to take.
    pub fn has_steps(&self) -> bool {
        match self {
            Method::Fesd(options) => options.steps.is_some(),
            Method::Timestepping(_) => true,
            _ => false,
        }
    }

    /// Whether the method knows of states that jump.
    pub fn takes_jumps(&self) -> bool {
        matches!(self, Method::Auto | Method::Event(_))
    }

    /// What takes jumps in its place.
    pub fn way_with_jumps(&self) -> &'static str {
        match self {
            Method::Fesd(_) => {
                "use `method event`, which is the default; `lower timefreezing;` makes motion of a jump that is a contact"
            }
            _ => "use `method event`, which is the default",
        }
    }

    /// What takes contacts, where it does not take them itself.
    pub fn way_with_contacts(&self) -> &'static str {
        match self {
            Method::Fesd(_) => {
                "add `lower impact;` for impulses where elements meet, or `lower timefreezing;`; or use `method event`, which is the default"
            }
            _ => "use `method event`, which is the default, or `method timestepping`",
        }
    }

    /// Whether it runs a system in numerical time.
    pub fn takes_frozen_time(&self) -> bool {
        matches!(self, Method::Auto | Method::Event(_) | Method::Fesd(_))
    }

    /// Whether the method finds by itself how the system goes on from any state: also where a nonlinear switch leaves
    /// several ways, and where something else than the system has moved the state.
    pub fn takes_any_state(&self) -> bool {
        matches!(self, Method::Auto | Method::Event(_) | Method::Smoothing(_))
    }

    /// Whether the method looks at the present state alone, so that relays have no place in it.
    pub fn is_without_memory(&self) -> bool {
        matches!(self, Method::Smoothing(_) | Method::Adaptive)
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

pub(super) const METHODS: [&str; 6] = [
    "auto",
    "event",
    "fesd",
    "timestepping",
    "smoothing",
    "adaptive",
];
const EVENT_OPTIONS: [&str; 3] = ["order", "branch", "max_events"];
const SMOOTHING_OPTIONS: [&str; 2] = ["epsilon", "law"];
const BRANCHES: [&str; 3] = ["plus", "minus", "slide"];
const LOWERINGS: [&str; 4] = ["stewart", "step", "timefreezing", "impact"];

/// Highest order of the Taylor method that a user may ask for.
const HIGHEST_ORDER: f64 = 60.0;
const MOST_EVENTS: f64 = 1e9;

/// `method NAME { options }`
pub(super) fn method<'e>(
    reader: &mut Reader<'_, 'e>,
    name: &Ident,
    options: &[Setting],
) -> Option<Method<'e>> {
    match name.name.as_str() {
        "auto" => {
            let help = "name the method whose option it is";
            no_options(reader, "auto", options, Some(help));
            Some(Method::Auto)
        }
        "adaptive" => {
            no_options(reader, "adaptive", options, None);
            Some(Method::Adaptive)
        }
        "smoothing" => Some(Method::Smoothing(smoothing_options(reader, options))),
        "event" => Some(Method::Event(event_options(reader, options))),
        "fesd" => Some(Method::Fesd(fesd::options(reader, options))),
        "timestepping" => Some(Method::Timestepping(fesd::stepping_options(
            reader, options,
        ))),
        _ => {
            reader.error(unknown_choice("method", name, &METHODS));
            None
        }
    }
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
    once(reader, options);
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
    once(reader, options);
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

/// Reports options that are given twice.
pub(super) fn once(reader: &mut Reader<'_, '_>, options: &[Setting]) {
    for (k, option) in options.iter().enumerate() {
        let mut earlier = options[..k].iter();
        if let Some(first) = earlier.find(|first| first.name.name == option.name.name) {
            let what = format!("option `{}`", option.name.name);
            reader.error(ExperimentError::Twice {
                what,
                first: first.span,
                second: option.span,
            });
        }
    }
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

/// A name after `lower`.
pub(super) fn lowering(reader: &mut Reader<'_, '_>, name: &Ident) -> Option<Lowering> {
    match name.name.as_str() {
        "stewart" => Some(Lowering::Stewart),
        "step" => Some(Lowering::Step),
        "timefreezing" => Some(Lowering::TimeFreezing),
        "impact" => Some(Lowering::Impact),
        _ => {
            reader.error(unknown_choice("lowering", name, &LOWERINGS));
            None
        }
    }
}
