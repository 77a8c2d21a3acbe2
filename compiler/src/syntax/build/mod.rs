//! Pairs of the grammar -> abstract syntax.
//!
//! The grammar fixes which children a pair has and in which order; taking a
//! child that is not there is a bug here or in the grammar, and panics.

mod experiment;
mod expression;
pub(crate) mod reading;
mod recover;
mod statement;
pub(super) mod words;

use nsd_grammar::{NsdParser, Rule};
use pest::Parser;
use pest::iterators::Pair;

use self::experiment::experiment;
use self::expression::expr;
use self::reading::{Parts, Reading, parts};
use self::recover::recover;
use self::statement::{body, constant};
use self::words::Place;
use super::SyntaxError;
use super::ast::*;
use super::scan::Scan;
use crate::source::{SourceFile, Span, table};

/// Builds the abstract syntax of a scanned file and reports what is wrong in it.
pub fn build(file: &SourceFile, scan: &Scan) -> (File, Vec<SyntaxError>) {
    let mut reading = Reading {
        scan,
        start: file.start,
        end: file.start + file.text.len(),
        base: 0,
        errors: Vec::new(),
    };
    let items = match NsdParser::parse(Rule::file, &scan.text) {
        Ok(mut pairs) => items(
            &mut reading,
            pairs.next().expect("grammar: a file is one pair"),
        ),
        Err(error) => unreachable!("grammar: any balanced text is a file, with bad items: {error}"),
    };
    let span = file.span();
    let data = table::Sources::new();
    (File { items, data, span }, reading.errors)
}

fn items(reading: &mut Reading, pair: Pair<Rule>) -> Vec<Item> {
    let mut items = Vec::new();
    for pair in pair.into_inner() {
        match pair.as_rule() {
            Rule::EOI => {}
            Rule::bad_item => {
                let range = reading.range(&pair);
                let span = reading.span(&pair);
                let complete = recover(reading, Place::File, range, &mut |reading, pair| {
                    let item = item(reading, pair);
                    items.push(item);
                });
                items.extend((!complete).then_some(Item::Bad(span)));
            }
            _ => items.push(item(reading, pair)),
        }
    }
    items
}

fn item(reading: &mut Reading, pair: Pair<Rule>) -> Item {
    let span = reading.span(&pair);
    let wrong = reading.is_wrong(&pair);
    let rule = pair.as_rule();
    let mut parts = parts(pair);
    let item = match rule {
        Rule::use_item => Item::Use(use_item(reading, parts, span)),
        Rule::const_item => Item::Const(constant(reading, parts, span)),
        Rule::fn_item => Item::Fn(Function {
            name: reading.ident(parts.one(Rule::name)),
            params: reading.idents(parts.one(Rule::fn_params)),
            body: expr(reading, parts.one(Rule::expr)),
            span,
        }),
        Rule::model => Item::Model(Model {
            name: reading.ident(parts.one(Rule::name)),
            body: body(reading, parts.one(Rule::body)),
            span,
        }),
        Rule::experiment => Item::Experiment(experiment(reading, parts, span)),
        Rule::expect_diagnostic => Item::ExpectDiagnostic(ExpectDiagnostic {
            severity: reading.ident(parts.one(Rule::severity)),
            code: reading.ident(parts.one(Rule::name)),
            span,
        }),
        rule => unreachable!("grammar: {rule:?} is no item"),
    };
    if wrong { Item::Bad(span) } else { item }
}

fn use_item(reading: &mut Reading, mut parts: Parts, span: Span) -> Use {
    let source = match parts.maybe(Rule::relative_path) {
        Some(path) => UseSource::Relative(Ident {
            name: path.as_str().to_owned(),
            span: reading.span(&path),
        }),
        None => UseSource::Dotted(reading.idents(parts.one(Rule::dotted_path))),
    };
    let mut names = Vec::new();
    for pair in parts
        .maybe(Rule::use_names)
        .into_iter()
        .flat_map(self::parts)
    {
        let mut parts = self::parts(pair);
        let name = reading.ident(parts.one(Rule::name));
        names.push((name, alias(reading, &mut parts)));
    }
    Use {
        source,
        names,
        alias: alias(reading, &mut parts),
        link: Link::Open,
        span,
    }
}

fn alias(reading: &mut Reading, parts: &mut Parts) -> Option<Ident> {
    let alias = parts.maybe(Rule::use_alias)?;
    Some(reading.ident(self::parts(alias).one(Rule::name)))
}
