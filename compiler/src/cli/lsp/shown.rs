//! Shapes, units and values of what a model declares, at the parameters of an experiment.

use lsp_types::{InlayHint, InlayHintKind, InlayHintLabel, InlayHintParams};

use super::world::{Analysis, World};
use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::model::index::{Definition, Kind};
use crate::model::{self, Model};
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

/// A model, as an experiment takes it or by itself.
pub enum Facts<'e> {
    /// Without an experiment: what a run needs is not known.
    Alone(Box<Model<'e>>),
    /// What is compiled of an experiment, with its name.
    Taken(String, Box<Compiled<'e>>),
}

impl<'e> Facts<'e> {
    /// The model that is declared at a place, as each sound experiment of the file takes it: first the one that is named,
    /// then the others in their order.
    pub fn taken(
        exprs: &'e Exprs,
        analysis: &'e Analysis,
        declared: Span,
        first: Option<&str>,
    ) -> impl Iterator<Item = Self> + 'e {
        let file = &analysis.project.file;
        let is_of = |known: &&Experiment| {
            let found = model::find(file, &known.model, &mut Diagnostics::new());
            found.is_some_and(|(_, model)| model.name.span == declared)
        };
        let mut all: Vec<&Experiment> = analysis.project.experiments().filter(is_of).collect();
        all.sort_by_key(|known| first != Some(known.name.name.as_str()));
        all.into_iter().filter_map(move |known| {
            let (mut clock, mut silent) = (Clock::default(), Diagnostics::new());
            let compiled = compile(exprs, file, known, &[], &mut clock, &mut silent)?;
            Some(Facts::Taken(known.name.name.clone(), Box::new(compiled)))
        })
    }

    /// The model that is declared at a place, by itself.
    pub fn alone(exprs: &'e Exprs, analysis: &Analysis, declared: Span) -> Option<Self> {
        let (home, item) = model_at(&analysis.project.file, declared)?;
        let model = model::resolve(exprs, home, &item.name.name, &[], &mut Diagnostics::new())?;
        Some(Facts::Alone(Box::new(model)))
    }

    /// The experiment.
    pub fn experiment(&self) -> Option<&str> {
        match self {
            Facts::Alone(_) => None,
            Facts::Taken(name, _) => Some(name),
        }
    }

    fn compiled(&self) -> Option<&Compiled<'e>> {
        match self {
            Facts::Alone(_) => None,
            Facts::Taken(_, compiled) => Some(compiled),
        }
    }

    fn model(&self) -> &Model<'e> {
        match self {
            Facts::Alone(model) => model,
            Facts::Taken(_, compiled) => &compiled.model,
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
            let numbers = self
                .compiled()
                .map(|compiled| &compiled.settings.values.numbers);
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
        if !is_seen {
            continue;
        }
        let place = item.name.span;
        let taken = Facts::taken(&exprs, &analysis, place, None).next();
        let Some(facts) = taken.or_else(|| Facts::alone(&exprs, &analysis, place)) else {
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
