//! Shapes, units and values of what a model declares, at the parameters of an experiment.

use lsp_types::{InlayHint, InlayHintKind, InlayHintLabel, InlayHintParams};

use super::world::{Analysis, World};
use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::model::index::{Definition, Kind};
use crate::model::{self, Model};
use crate::project::Project;
use crate::project::clock::Clock;
use crate::source::Span;
use crate::syntax::{Experiment, Expr, ExprKind, File, Item, Link, Stmt};
use crate::system::About;
use crate::{Compiled, compile};

/// More entries are not shown.
const MOST_ENTRIES: usize = 12;

/// More lines of equations are not shown, nor more of a line.
const MOST_LINES: usize = 20;
const MOST_COLUMNS: usize = 240;

/// What is known of a name of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct Shown {
    /// Sizes; none of a scalar.
    pub shape: Vec<usize>,
    /// The unit as it is declared.
    pub unit: Option<String>,
    /// Its values, those at the start of what changes; empty where a run decides them.
    pub value: Vec<f64>,
}

/// A model as an experiment takes it.
pub struct Facts<'e> {
    /// The experiment, where the file has one that is sound.
    pub experiment: Option<String>,
    of: Of<'e>,
    /// Whether it stands for what the file says: for no experiment that is not sound, and without values that are missing.
    pub is_told: bool,
}

/// A model, and what is compiled of it where its experiment is sound.
enum Of<'e> {
    Model(Box<Model<'e>>),
    Compiled(Box<Compiled<'e>>),
}

impl<'e> Facts<'e> {
    /// The model that is declared at a place, at an experiment, or else at the first one that is there, or at one
    /// without settings.
    pub fn of(
        exprs: &'e Exprs,
        analysis: &Analysis,
        declared: Span,
        experiment: Option<&str>,
    ) -> Option<Self> {
        let file = &analysis.project.file;
        let (home, item) = model_at(file, declared)?;
        let is_of = |known: &&Experiment| {
            let mut silent = Diagnostics::new();
            let found = model::find(file, &known.model, &mut silent);
            found.is_some_and(|(_, model)| model.name.span == declared)
                && experiment.is_none_or(|wanted| known.name.name == wanted)
        };
        let compiled = |file: &File, experiment: &Experiment| {
            let (mut clock, mut silent) = (Clock::default(), Diagnostics::new());
            let compiled = compile(exprs, file, experiment, &[], &mut clock, &mut silent);
            compiled.map(|compiled| Of::Compiled(Box::new(compiled)))
        };
        let found = analysis.project.experiments().find(is_of);
        if let Some((experiment, of)) = found.and_then(|one| Some((one, compiled(file, one)?))) {
            return Some(Facts {
                experiment: Some(experiment.name.name.clone()),
                of,
                is_told: true,
            });
        }
        let name = &item.name.name;
        let model = model::resolve(exprs, home, name, &[], &mut Diagnostics::new())?;
        let missing: String = (model.quantities.all())
            .filter(|known| known.value.is_none())
            .map(|known| format!("{} = 0; ", known.name))
            .collect();
        let text = format!("simulate {name} of {name} {{ horizon 1; with {{ {missing}}} }}");
        let plain = Project::from_text("plain", &text);
        let of = plain.experiments().find_map(|one| compiled(home, one));
        Some(Facts {
            experiment: None,
            is_told: found.is_none() && missing.is_empty() && of.is_some(),
            of: of.unwrap_or_else(|| Of::Model(Box::new(model))),
        })
    }

    fn compiled(&self) -> Option<&Compiled<'e>> {
        match &self.of {
            Of::Model(_) => None,
            Of::Compiled(compiled) => Some(compiled),
        }
    }

    fn model(&self) -> &Model<'e> {
        match &self.of {
            Of::Model(model) => model,
            Of::Compiled(compiled) => &compiled.model,
        }
    }

    /// The lowered equations of a name, and the switches that they meet, as `nsdc emit` prints them; of many the first.
    pub fn equations(&self, name: &str) -> Option<String> {
        let system = self.compiled()?.lowered();
        let text = About(&system, name).to_string();
        let mut lines: Vec<String> = text.lines().take(MOST_LINES).map(shortened).collect();
        if text.lines().nth(MOST_LINES).is_some() {
            lines.push("..".to_owned());
        }
        (!lines.is_empty()).then(|| lines.join("\n"))
    }

    /// What a name of the model is.
    pub fn shown(&self, name: &str) -> Option<Shown> {
        let expr = Expr {
            kind: ExprKind::Name(name.to_owned()),
            span: Span::default(),
        };
        let tensor = self
            .model()
            .scope
            .expr(&expr, None, &mut Diagnostics::new())?;
        let number = |var| {
            let compiled = self.compiled().filter(|_| self.is_told);
            let numbers = compiled.map(|compiled| &compiled.settings.values.numbers);
            numbers
                .and_then(|numbers| numbers.get(&var).copied())
                .unwrap_or(f64::NAN)
        };
        let value: Vec<f64> = tensor
            .data
            .iter()
            .map(|entry| entry.eval(&number))
            .collect();
        let quantities = &self.model().quantities;
        let mut units = quantities.all().map(|known| (&known.name, &known.unit));
        let definitions = &self.model().definitions;
        let all = [
            &definitions.signals,
            &definitions.lets,
            &definitions.outputs,
        ];
        let mut named = all
            .into_iter()
            .flatten()
            .map(|known| (&known.name, &known.unit));
        let is_it = |(known, _): &(&String, &Option<String>)| *known == name;
        let unit = units.find(is_it).or_else(|| named.find(is_it));
        Some(Shown {
            shape: tensor.shape.sizes(),
            unit: unit.and_then(|(_, unit)| unit.clone()),
            value: match value.iter().any(|entry| entry.is_nan()) {
                true => vec![],
                false => value,
            },
        })
    }
}

/// The model whose name stands at a place, with its file.
pub fn model_at(file: &File, place: Span) -> Option<(&File, &crate::syntax::Model)> {
    file.items.iter().find_map(|item| match item {
        Item::Model(model) if model.name.span == place => Some((file, model)),
        Item::Use(item) => match &item.link {
            Link::File(file) => model_at(file, place),
            _ => None,
        },
        _ => None,
    })
}

/// A line that is not too long.
fn shortened(line: &str) -> String {
    match line.char_indices().nth(MOST_COLUMNS) {
        Some((end, _)) => format!("{} ..", &line[..end]),
        None => line.to_owned(),
    }
}

/// Numbers as the language has them, a matrix row by row; of very many the first.
pub fn numbers(shape: &[usize], value: &[f64]) -> String {
    let mut texts: Vec<String> = value
        .iter()
        .take(MOST_ENTRIES)
        .map(|&x| number(x))
        .collect();
    if value.len() > MOST_ENTRIES {
        texts.push("..".to_owned());
    }
    match shape {
        [] => texts.concat(),
        [_, columns] if value.len() <= MOST_ENTRIES && *columns > 0 => {
            let rows: Vec<String> = texts.chunks(*columns).map(|row| row.join(", ")).collect();
            format!("[{}]", rows.join("; "))
        }
        _ => format!("[{}]", texts.join(", ")),
    }
}

fn number(x: f64) -> String {
    let rounded: f64 = format!("{x:.6e}").parse().unwrap_or(x);
    match rounded.abs() {
        0.0 => "0".to_owned(),
        size if (1e-3..1e7).contains(&size) => rounded.to_string(),
        _ => format!("{rounded:e}"),
    }
}

/// Shapes of what is not a scalar, and values of what is computed before a run.
pub fn hints(world: &mut World, params: &InlayHintParams) -> Vec<InlayHint> {
    let Some(analysis) = world.analysis(&params.text_document.uri) else {
        return vec![];
    };
    if analysis.project.diags.has_errors() {
        return vec![];
    }
    let mut found = Vec::new();
    for item in analysis.models() {
        let exprs = Exprs::new();
        let range = analysis.range(item.span);
        let is_seen = range.start <= params.range.end && params.range.start <= range.end;
        let Some(facts) = is_seen
            .then(|| Facts::of(&exprs, &analysis, item.name.span, None))
            .flatten()
        else {
            continue;
        };
        for known in analysis.index.members(item.span) {
            if let Some(shown) = facts.shown(&known.name) {
                found.extend(hints_of(&analysis, item, known, &shown));
            }
        }
    }
    found.retain(|hint| params.range.start <= hint.position && hint.position <= params.range.end);
    found
}

fn hints_of(
    analysis: &Analysis,
    model: &crate::syntax::Model,
    known: &Definition,
    shown: &Shown,
) -> Vec<InlayHint> {
    let hint = |span: Span, text: String, padding_left: bool| InlayHint {
        position: analysis.range(span).end,
        label: InlayHintLabel::String(text),
        kind: Some(InlayHintKind::TYPE),
        text_edits: None,
        tooltip: None,
        padding_left: Some(padding_left),
        padding_right: None,
        data: None,
    };
    let mut hints = Vec::new();
    let infers = matches!(
        known.kind,
        Kind::Let | Kind::Output | Kind::Signal | Kind::Constant
    );
    if infers && !shown.shape.is_empty() {
        let sizes: Vec<String> = shown.shape.iter().map(usize::to_string).collect();
        hints.push(hint(known.place, format!("[{}]", sizes.join(", ")), false));
    }
    let is_fixed = matches!(known.kind, Kind::Param | Kind::Constant);
    if let Some(value) = value_of(model, known).filter(|_| is_fixed && !shown.value.is_empty())
        && !is_literal(value)
    {
        hints.push(hint(
            value.span,
            format!("= {}", numbers(&shown.shape, &shown.value)),
            true,
        ));
    }
    hints
}

/// The expression of a declaration.
fn value_of<'m>(model: &'m crate::syntax::Model, known: &Definition) -> Option<&'m Expr> {
    model.body.iter().find_map(|stmt| match stmt {
        Stmt::Const(item) if item.name.span == known.place => Some(&item.value),
        Stmt::Decl(decl) if decl.name.span == known.place => decl.value.as_ref(),
        _ => None,
    })
}

/// Numbers as they are shown.
fn is_literal(value: &Expr) -> bool {
    match &value.kind {
        ExprKind::Number(_) | ExprKind::Quantity(..) => true,
        ExprKind::Negate(inner) => is_literal(inner),
        ExprKind::Matrix(matrix) => matrix.rows.iter().flatten().all(is_literal),
        _ => false,
    }
}
