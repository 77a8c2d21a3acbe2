//! Methods, their options, and lowerings.

use nsd_solver::tableau::Family;

use super::{ExperimentError, Reader, unknown_choice};
use crate::syntax::{self, Arg, ExprKind, Ident, Setting};

/// A simulation method.
#[derive(Clone, Debug, PartialEq)]
pub enum Method {
    /// The compiler chooses.
    Auto,
    /// Switch-detecting active-set integration.
    Event(EventOptions),
    /// Finite elements with switch detection.
    Fesd(FesdOptions),
}

/// Options of `method fesd`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FesdOptions {
    /// Family of Runge-Kutta methods, and number of nodes.
    pub scheme: (Family, usize),
    /// Steps of equal length; as many as the tolerance asks for otherwise.
    pub steps: Option<usize>,
    /// Finite elements per step.
    pub elements: usize,
}

impl Default for FesdOptions {
    fn default() -> Self {
        FesdOptions {
            scheme: (Family::RadauIia, 4),
            steps: None,
            elements: 2,
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

/// A lowering of switches that an experiment may ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lowering {
    /// Stewart's reformulation.
    Stewart,
    /// The step (Heaviside) reformulation.
    Step,
}

const METHODS: [&str; 6] = [
    "auto",
    "event",
    "fesd",
    "timestepping",
    "smoothing",
    "adaptive",
];
const EVENT_OPTIONS: [&str; 3] = ["order", "branch", "max_events"];
const FESD_OPTIONS: [&str; 3] = ["scheme", "elements", "steps"];
const BRANCHES: [&str; 3] = ["plus", "minus", "slide"];
const LOWERINGS: [&str; 4] = ["stewart", "step", "timefreezing", "impact"];

/// Highest order of the Taylor method that a user may ask for.
const HIGHEST_ORDER: f64 = 60.0;
const MOST_EVENTS: f64 = 1e9;
const MOST_STEPS: f64 = 1e8;
const MOST_ELEMENTS: f64 = 1e4;

/// `method NAME { options }`
pub(super) fn method(
    reader: &mut Reader<'_, '_>,
    name: &Ident,
    options: &[Setting],
) -> Option<Method> {
    match name.name.as_str() {
        "auto" => {
            for option in options {
                reader.error(ExperimentError::UnknownChoice {
                    what: "option".into(),
                    found: option.name.name.clone(),
                    span: option.name.span,
                    choices: "no option of `auto`".into(),
                    help: Some("name the method whose option it is".into()),
                });
            }
            Some(Method::Auto)
        }
        "event" => Some(Method::Event(event_options(reader, options))),
        "fesd" => Some(Method::Fesd(fesd_options(reader, options))),
        known if METHODS.contains(&known) => {
            reader.error(ExperimentError::Method {
                name: known.to_owned(),
                span: name.span,
            });
            None
        }
        _ => {
            reader.error(unknown_choice("method", name, &METHODS));
            None
        }
    }
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

fn fesd_options(reader: &mut Reader<'_, '_>, options: &[Setting]) -> FesdOptions {
    let mut fesd = FesdOptions::default();
    once(reader, options);
    for option in options {
        match option.name.name.as_str() {
            "scheme" => fesd.scheme = scheme(reader, &option.value).unwrap_or(fesd.scheme),
            "steps" => fesd.steps = reader.count("`steps`", &option.value, MOST_STEPS),
            "elements" => {
                let elements = reader.count("`elements`", &option.value, MOST_ELEMENTS);
                fesd.elements = elements.unwrap_or(fesd.elements);
            }
            _ => reader.error(unknown_choice("option", &option.name, &FESD_OPTIONS)),
        }
    }
    fesd
}

/// `radau_iia(4)`
fn scheme(reader: &mut Reader<'_, '_>, value: &syntax::Expr) -> Option<(Family, usize)> {
    let named = match &value.kind {
        ExprKind::Call(function, arguments) => match (&function.kind, &arguments[..]) {
            (ExprKind::Name(name), [Arg::Positional(nodes, binders)]) if binders.is_empty() => {
                Some((name, function.span, nodes))
            }
            _ => None,
        },
        _ => None,
    };
    let Some((name, span, nodes)) = named else {
        let found = match &value.kind {
            ExprKind::Name(name) => name.as_str(),
            _ => "..",
        };
        reader.error(ExperimentError::UnknownChoice {
            what: "scheme".into(),
            found: found.into(),
            span: value.span,
            choices: "a family with its number of nodes".into(),
            help: Some("write for example `scheme = radau_iia(4);`".into()),
        });
        return None;
    };
    let Some(family) = Family::ALL.into_iter().find(|family| family.word() == name) else {
        let name = Ident {
            name: name.clone(),
            span,
        };
        reader.error(unknown_choice(
            "scheme",
            &name,
            &Family::ALL.map(Family::word),
        ));
        return None;
    };
    let range = family.nodes();
    let expected = format!("a whole number from {} to {}", range.start(), range.end());
    let fits = |x: f64| x.fract() == 0.0 && range.contains(&(x as usize));
    let nodes = reader.within("the number of nodes", nodes, &expected, fits)?;
    Some((family, nodes as usize))
}

/// Reports options that are given twice.
fn once(reader: &mut Reader<'_, '_>, options: &[Setting]) {
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
        known if LOWERINGS.contains(&known) => {
            reader.error(ExperimentError::Lowering {
                name: known.to_owned(),
                span: name.span,
            });
            None
        }
        _ => {
            reader.error(unknown_choice("lowering", name, &LOWERINGS));
            None
        }
    }
}
