//! Options of `method fesd` and `method timestepping`.

use nsd_solver::integrate::tableau::Family;

use super::error::ExperimentError;
use super::reader::{Reader, unknown_choice};
use crate::diagnostics::{Applicability, Help};
use crate::model::hir::reserved::closest;
use crate::syntax::{self, Arg, ExprKind, Ident, Setting};

/// Options of `method fesd`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FesdOptions {
    /// Family of Runge-Kutta methods, and number of nodes.
    pub scheme: (Family, usize),
    /// Steps of equal length; as many as the tolerance asks for otherwise.
    pub steps: Option<usize>,
    /// Finite elements per step.
    pub elements: usize,
    /// How the discretized system is written; `None` for the integral form where there is one.
    pub form: Option<Form>,
    /// How its pairs across nodes are added up.
    pub cross: Cross,
    /// What makes its lengths equal.
    pub equilibration: Equilibration,
}

/// Options of `method timestepping`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SteppingOptions {
    /// Family of Runge-Kutta methods, and number of nodes, where one is given; contacts have a scheme of their own.
    pub scheme: Option<(Family, usize)>,
    /// Steps of equal length.
    pub steps: usize,
}

impl SteppingOptions {
    /// The Runge-Kutta method.
    pub fn scheme(&self) -> (Family, usize) {
        self.scheme.unwrap_or((Family::RadauIia, 4))
    }
}

impl Default for SteppingOptions {
    fn default() -> Self {
        SteppingOptions {
            scheme: None,
            steps: 100,
        }
    }
}

/// How a Runge-Kutta method is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// The derivative of the polynomial through x satisfies the equation at the nodes.
    Integral,
    /// The slopes at the nodes are variables.
    Differential,
}

/// Which pairs are stated of the values a_m at nodes and b_l at nodes and ends, for each component.
///
/// a jumps where the mode changes, as θ does, and b is continuous, as λ is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cross {
    /// a_m ⟂ b_l for all m and l.
    All,
    /// Σ_m a_m ⟂ b_l for all l.
    SumTheta,
    /// a_m ⟂ Σ_l b_l for all m.
    SumLambda,
    /// Σ_m a_m ⟂ Σ_l b_l.
    SumBoth,
}

/// What makes the lengths of elements equal where there is no switch between them.
///
/// None of these biases what is reported: a simulation by active sets, and the polish of an optimum, make the lengths
/// between two switches exactly equal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Equilibration {
    /// Nothing: lengths are not unique where a step has more elements than it needs.
    None,
    /// ρ Σ (h - h̄)² in the objective; it acts on the lengths at switches too.
    Mean {
        /// ρ
        weight: f64,
    },
    /// ρ Σ tanh(η/σ) Δh² in the objective, with η > 0 where there is no switch.
    Tanh {
        /// ρ
        weight: f64,
        /// σ
        scale: f64,
    },
    /// 0 = η Δh; it violates LICQ where there is a switch.
    Exact,
}

impl Default for FesdOptions {
    fn default() -> Self {
        FesdOptions {
            scheme: (Family::RadauIia, 4),
            steps: None,
            elements: 2,
            form: None,
            cross: Cross::All,
            equilibration: Equilibration::Exact,
        }
    }
}

impl Form {
    /// Whether a family can be written in this form.
    ///
    /// The integral one needs a polynomial that is determined by the left end and the nodes and satisfies the equation
    /// at the nodes: collocation without a node at the left end.
    pub fn is_of(self, family: Family) -> bool {
        match self {
            Form::Differential => true,
            Form::Integral => matches!(family, Family::RadauIia | Family::GaussLegendre),
        }
    }
}

pub(crate) const OPTIONS: [&str; 6] = [
    "scheme",
    "elements",
    "steps",
    "form",
    "cross",
    "equilibration",
];
pub(crate) const STEPPING_OPTIONS: [&str; 2] = ["scheme", "steps"];
pub(crate) const FORMS: [(&str, Form); 2] = [
    ("integral", Form::Integral),
    ("differential", Form::Differential),
];
pub(crate) const CROSS: [(&str, Cross); 4] = [
    ("all", Cross::All),
    ("sum_theta", Cross::SumTheta),
    ("sum_lambda", Cross::SumLambda),
    ("sum_both", Cross::SumBoth),
];
pub(crate) const EQUILIBRATIONS: [&str; 4] = ["none", "mean", "tanh", "exact"];

const MOST_STEPS: f64 = 1e8;
pub(crate) const MOST_ELEMENTS: f64 = 1e4;

/// Reads the options.
pub(crate) fn options(reader: &mut Reader<'_, '_>, options: &[Setting]) -> FesdOptions {
    let mut fesd = FesdOptions::default();
    reader.once_each(options);
    for option in options {
        let value = &option.value;
        match option.name.name.as_str() {
            "scheme" => fesd.scheme = scheme(reader, value).unwrap_or(fesd.scheme),
            "steps" => fesd.steps = reader.count("`steps`", value, MOST_STEPS),
            "elements" => {
                let elements = reader.count("`elements`", value, MOST_ELEMENTS);
                fesd.elements = elements.unwrap_or(fesd.elements);
            }
            "form" => fesd.form = word(reader, "form", value, &FORMS),
            "cross" => fesd.cross = word(reader, "sum", value, &CROSS).unwrap_or(fesd.cross),
            "equilibration" => {
                fesd.equilibration = equilibration(reader, value).unwrap_or(fesd.equilibration);
            }
            _ => reader.error(unknown_choice("option", &option.name, &OPTIONS)),
        }
    }
    let form = options.iter().find(|option| option.name.name == "form");
    if let (Some(option), Some(form)) = (form, fesd.form)
        && !form.is_of(fesd.scheme.0)
    {
        reader.error(ExperimentError::NoIntegralForm {
            family: fesd.scheme.0.word(),
            span: option.value.span,
        });
    }
    fesd
}

/// Reads the options of `timestepping`.
pub(crate) fn stepping_options(
    reader: &mut Reader<'_, '_>,
    options: &[Setting],
) -> SteppingOptions {
    let mut stepping = SteppingOptions::default();
    reader.once_each(options);
    for option in options {
        let value = &option.value;
        match option.name.name.as_str() {
            "scheme" => stepping.scheme = scheme(reader, value).or(stepping.scheme),
            "steps" => {
                let steps = reader.count("`steps`", value, MOST_STEPS);
                stepping.steps = steps.unwrap_or(stepping.steps);
            }
            _ => reader.error(unknown_choice("option", &option.name, &STEPPING_OPTIONS)),
        }
    }
    stepping
}

/// One of some words.
pub(crate) fn word<T: Copy>(
    reader: &mut Reader<'_, '_>,
    what: &str,
    value: &syntax::Expr,
    choices: &[(&str, T)],
) -> Option<T> {
    let name = match &value.kind {
        ExprKind::Name(name) => name.clone(),
        _ => "..".to_owned(),
    };
    let found = choices.iter().find(|(word, _)| *word == name);
    if found.is_none() {
        let words: Vec<&str> = choices.iter().map(|(word, _)| *word).collect();
        let span = value.span;
        reader.error(unknown_choice(what, &Ident { name, span }, &words));
    }
    found.map(|(_, choice)| *choice)
}

/// How a scheme, an equilibration or another word is written, with the arguments that it takes.
pub fn written(word: &str) -> String {
    let family = Family::ALL.into_iter().find(|family| family.word() == word);
    match (family, word) {
        (Some(family), _) => {
            let nodes = family.nodes();
            format!("{word}({})", 4.clamp(*nodes.start(), *nodes.end()))
        }
        (None, "mean") => "mean(0.001)".to_owned(),
        (None, "tanh") => "tanh(1, 0.1)".to_owned(),
        _ => word.to_owned(),
    }
}

/// `none`, `exact`, `mean(1)`, `tanh(1, 0.1)`
pub(crate) fn equilibration(
    reader: &mut Reader<'_, '_>,
    value: &syntax::Expr,
) -> Option<Equilibration> {
    let (function, arguments) = match &value.kind {
        ExprKind::Call(function, arguments) => (&**function, &arguments[..]),
        _ => (value, &[][..]),
    };
    let name = match &function.kind {
        ExprKind::Name(name) => name.clone(),
        _ => "..".to_owned(),
    };
    let arguments = arguments.iter().map(|argument| match argument {
        Arg::Positional(value, binders) if binders.is_empty() => Some(value),
        _ => None,
    });
    let arguments: Option<Vec<&syntax::Expr>> = arguments.collect();
    match (name.as_str(), arguments.as_deref()) {
        ("none", Some([])) => Some(Equilibration::None),
        ("exact", Some([])) => Some(Equilibration::Exact),
        ("mean", Some([weight])) => Some(Equilibration::Mean {
            weight: reader.positive("the weight", weight)?,
        }),
        ("tanh", Some([weight, scale])) => Some(Equilibration::Tanh {
            weight: reader.positive("the weight", weight)?,
            scale: reader.positive("the scale", scale)?,
        }),
        (known, _) if EQUILIBRATIONS.contains(&known) => {
            let form = written(known);
            let text = format!("write for example `{form}`");
            reader.error(ExperimentError::UnknownChoice {
                what: "equilibration".into(),
                span: value.span,
                choices: "`none`, `exact`, `mean(weight)` or `tanh(weight, scale)`".into(),
                help: Some(Help::edit(text, form, Applicability::Suggestion)),
                found: name,
            });
            None
        }
        _ => {
            let span = function.span;
            reader.error(unknown_choice(
                "equilibration",
                &Ident { name, span },
                &EQUILIBRATIONS,
            ));
            None
        }
    }
}

/// `radau_iia(4)`
pub(crate) fn scheme(reader: &mut Reader<'_, '_>, value: &syntax::Expr) -> Option<(Family, usize)> {
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
        let families = Family::ALL.map(Family::word);
        let help = match closest(found, families.into_iter()) {
            Some(family) if family == found => {
                let scheme = written(&family);
                let text = format!("write for example `{scheme}`, with 4 nodes");
                Help::edit(text, scheme, Applicability::Suggestion)
            }
            Some(family) => Help::did_you_mean(&written(&family)),
            None => "write for example `radau_iia(4)`".into(),
        };
        reader.error(ExperimentError::UnknownChoice {
            what: "scheme".into(),
            found: found.into(),
            span: value.span,
            choices: "a family with its number of nodes".into(),
            help: Some(help),
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
