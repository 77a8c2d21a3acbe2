//! Shapes, units and values of what a model declares, at the parameters of an experiment.

use std::rc::Rc;

use super::super::world::Analysis;
use super::cache::{Cache, Made};
use crate::compile;
use crate::diagnostics::Diagnostics;
use crate::model::{self, Model};
use crate::project::clock::Clock;
use crate::source::Span;
use crate::syntax::{self, Experiment, Expr, ExprKind, File, Ident, Index, Item, Link, Stmt};
use crate::system::About;

/// More entries are not shown.
const MOST_ENTRIES: usize = 12;

/// More parts are not looked at.
const MOST_PARTS: usize = 1000;

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
pub struct Facts<'e> {
    /// The experiment.
    experiment: Option<String>,
    /// The part of its model that is meant, as `leg[1].`; empty of the model itself.
    part: String,
    made: Rc<Made<'e>>,
}

impl<'e> Facts<'e> {
    /// The model that is declared at a place, as each sound experiment of the file takes it, by itself or as a part: first the
    /// one that is named, then those that have it as the part that is named, and those of the model itself.
    pub fn taken<'a>(
        cache: &'a Cache<'e>,
        analysis: &'a Rc<Analysis>,
        declared: Span,
        (first, part): (&str, Option<&str>),
    ) -> impl Iterator<Item = Self> + 'a {
        let file = &analysis.project.file;
        let experiments = analysis.project.experiments();
        let sound = experiments.filter(|known| !analysis.is_broken(known.span));
        let of = |known: &'a Experiment| {
            let found = model::find(file, &known.model, &mut Diagnostics::new());
            let mut parts = parts_of(found?, declared);
            let named = part.and_then(|part| parts.iter().find_map(|found| named(part, found)));
            let is_named = named.is_some();
            let part = named.or_else(|| parts.drain(..).next())?;
            let order = (first != known.name.name, !is_named, !part.is_empty());
            Some((order, known, part))
        };
        let mut all: Vec<_> = sound.filter_map(of).collect();
        all.sort_by_key(|(order, ..)| *order);
        all.into_iter().filter_map(move |(_, known, part)| {
            let made = cache.get(analysis, known.span, |exprs| {
                let (mut clock, mut silent) = (Clock::default(), Diagnostics::new());
                let compiled = compile(exprs, file, known, &[], &mut clock, &mut silent)?;
                let lowered = compiled.lowered();
                Some(Made::Taken(Box::new(compiled), Box::new(lowered)))
            });
            Some(Facts {
                experiment: Some(known.name.name.clone()),
                part,
                made: made?,
            })
        })
    }

    /// The model that is declared at a place, by itself.
    pub fn alone(cache: &Cache<'e>, analysis: &Rc<Analysis>, declared: Span) -> Option<Self> {
        let (home, item) = model_at(&analysis.project.file, declared)?;
        let made = cache.get(analysis, declared, |exprs| {
            let name = &item.name.name;
            let model = model::resolve(exprs, home, name, &[], &mut Diagnostics::new());
            Some(Made::Alone(Box::new(model?)))
        });
        Some(Facts {
            experiment: None,
            part: String::new(),
            made: made?,
        })
    }

    /// The experiment.
    pub fn experiment(&self) -> Option<&str> {
        self.experiment.as_deref()
    }

    /// What a name of the model is called in all of it.
    pub fn called(&self, name: &str) -> String {
        format!("{}{name}", self.part)
    }

    fn model(&self) -> &Model<'e> {
        match &*self.made {
            Made::Alone(model) => model,
            Made::Taken(compiled, _) => &compiled.model,
        }
    }

    /// The lowered equations of a name, and the switches that they meet, as `nsdc emit` prints them; of many the first.
    pub fn equations(&self, name: &str) -> Option<String> {
        let Made::Taken(_, system) = &*self.made else {
            return None;
        };
        let text = About(system, &self.called(name)).to_string();
        let mut lines: Vec<String> = text.lines().take(MOST_LINES).map(shortened).collect();
        if text.lines().nth(MOST_LINES).is_some() {
            lines.push("..".to_owned());
        }
        (!lines.is_empty()).then(|| lines.join("\n"))
    }

    /// What a name of the model is.
    pub fn shown(&self, name: &str) -> Option<Shown> {
        let name = &self.called(name);
        let tensor = self
            .model()
            .scope
            .expr(&path(name)?, None, &mut Diagnostics::new())?;
        let number = |var| {
            let known = match &*self.made {
                Made::Alone(_) => None,
                Made::Taken(compiled, _) => compiled.settings.values.numbers.get(&var).copied(),
            };
            known.unwrap_or(f64::NAN)
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

/// The parts of a model that are of the model which is declared at a place, the model itself among them, by how deep they are
/// and then in order; of an array of parts the first.
fn parts_of<'f>(whole: (&'f File, &'f syntax::Model), declared: Span) -> Vec<String> {
    let (mut open, mut found) = (vec![(whole, String::new())], Vec::new());
    let mut at = 0;
    while let Some(((file, item), prefix)) = open.get(at).cloned() {
        at += 1;
        if item.name.span == declared {
            found.push(prefix);
            continue;
        }
        let parts = item.body.iter().filter_map(|stmt| match stmt {
            Stmt::Part(part) => Some(part),
            _ => None,
        });
        for part in parts.take(MOST_PARTS.saturating_sub(open.len())) {
            let entry = match part.binder.as_ref().map(|binder| &binder.first.kind) {
                None => String::new(),
                Some(ExprKind::Number(first)) => format!("[{first}]"),
                Some(_) => continue,
            };
            if let Some(inner) = model::find(file, &part.model, &mut Diagnostics::new()) {
                open.push((inner, format!("{prefix}{}{entry}.", part.name.name)));
            }
        }
    }
    found
}

/// What a path from somewhere leads to, where that is a part, or another one of its array.
fn named(path: &str, part: &str) -> Option<String> {
    let part = part.strip_suffix('.')?;
    let n_pieces = path.split('.').count();
    let pieces: Vec<&str> = part.split('.').collect();
    let (outer, own) = pieces.split_at(pieces.len().checked_sub(n_pieces)?);
    let mut found = outer.to_vec();
    for (asked, own) in path.split('.').zip(own) {
        let [(name, entry), (known, _)] = [asked, own].map(|piece| match piece.split_once('[') {
            Some((name, entry)) => (name, entry.trim_end_matches(']')),
            None => (piece, ""),
        });
        if name != known {
            return None;
        }
        found.push(if entry.parse::<u32>().is_ok() {
            asked
        } else {
            own
        });
    }
    Some(format!("{}.", found.join(".")))
}

/// `leg[1].x` as an expression.
fn path(name: &str) -> Option<Expr> {
    let span = Span::default();
    let mut path: Option<Expr> = None;
    for piece in name.split('.') {
        let (name, entry) = match piece.strip_suffix(']') {
            Some(piece) => {
                let (name, entry) = piece.split_once('[')?;
                (name, Some(entry.parse().ok()?))
            }
            None => (piece, None),
        };
        let name = name.to_owned();
        let mut kind = match path {
            None => ExprKind::Name(name),
            Some(base) => ExprKind::Field(Box::new(base), Ident { name, span }),
        };
        if let Some(entry) = entry.map(ExprKind::Number) {
            let entry = Index::One(Expr { kind: entry, span });
            kind = ExprKind::Index(Box::new(Expr { kind, span }), vec![entry]);
        }
        path = Some(Expr { kind, span });
    }
    path
}

/// The model whose name stands at a place, with its file.
pub fn model_at(file: &File, place: Span) -> Option<(&File, &syntax::Model)> {
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
