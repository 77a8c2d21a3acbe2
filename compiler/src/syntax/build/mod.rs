//! Pairs of the grammar -> abstract syntax.
//!
//! The grammar fixes which children a pair has and in which order; taking a
//! child that is not there is a bug here or in the grammar, and panics.

mod experiment;
mod expression;
mod recover;
mod statement;
mod words;

use std::iter::Peekable;
use std::ops::Range;

use nsd_grammar::{NsdParser, Rule, spelling};
use pest::Parser;
use pest::iterators::{Pair, Pairs};
use unicode_normalization::UnicodeNormalization;

use super::ast::*;
use super::scan::Scan;
use super::{MAX_ERRORS, SyntaxError};
use crate::source::{SourceFile, Span, table};
use recover::Place;

/// Builds the abstract syntax of a scanned file and reports what is wrong in it.
pub fn build(file: &SourceFile, scan: &Scan) -> (File, Vec<SyntaxError>) {
    let mut builder = Builder {
        scan,
        start: file.start,
        end: file.start + file.text.len(),
        base: 0,
        errors: Vec::new(),
    };
    let items = match NsdParser::parse(Rule::file, &scan.text) {
        Ok(mut pairs) => builder.file(pairs.next().expect("grammar: a file is one pair")),
        Err(error) => unreachable!("grammar: any balanced text is a file, with bad items: {error}"),
    };
    let span = file.span();
    let data = table::Sources::new();
    (File { items, data, span }, builder.errors)
}

struct Builder<'b> {
    scan: &'b Scan<'b>,
    /// Position of the file.
    start: usize,
    /// Position of its end.
    end: usize,
    /// Offset in the file of the text that is being built.
    base: usize,
    errors: Vec<SyntaxError>,
}

impl Builder<'_> {
    fn file(&mut self, pair: Pair<Rule>) -> Vec<Item> {
        let mut items = Vec::new();
        for pair in pair.into_inner() {
            match pair.as_rule() {
                Rule::EOI => {}
                Rule::bad_item => {
                    let range = self.range(&pair);
                    let span = self.span(&pair);
                    let complete = self.recover(Place::File, range, &mut |builder, pair| {
                        let item = builder.item(pair);
                        items.push(item);
                    });
                    items.extend((!complete).then_some(Item::Bad(span)));
                }
                _ => items.push(self.item(pair)),
            }
        }
        items
    }

    fn item(&mut self, pair: Pair<Rule>) -> Item {
        let span = self.span(&pair);
        let wrong = self.is_wrong(&pair);
        let rule = pair.as_rule();
        let mut parts = parts(pair);
        let item = match rule {
            Rule::use_item => Item::Use(self.use_item(parts, span)),
            Rule::const_item => Item::Const(self.constant(parts, span)),
            Rule::fn_item => Item::Fn(Function {
                name: self.ident(parts.one(Rule::name)),
                params: self.idents(parts.one(Rule::fn_params)),
                body: self.expr(parts.one(Rule::expr)),
                span,
            }),
            Rule::model => Item::Model(Model {
                name: self.ident(parts.one(Rule::name)),
                body: self.body(parts.one(Rule::body)),
                span,
            }),
            Rule::experiment => Item::Experiment(self.experiment(parts, span)),
            Rule::expect_diagnostic => Item::ExpectDiagnostic(ExpectDiagnostic {
                severity: self.ident(parts.one(Rule::severity)),
                code: self.ident(parts.one(Rule::name)),
                span,
            }),
            rule => unreachable!("grammar: {rule:?} is no item"),
        };
        if wrong { Item::Bad(span) } else { item }
    }

    fn use_item(&mut self, mut parts: Parts, span: Span) -> Use {
        let source = match parts.maybe(Rule::relative_path) {
            Some(path) => UseSource::Relative(Ident {
                name: path.as_str().to_owned(),
                span: self.span(&path),
            }),
            None => UseSource::Dotted(self.idents(parts.one(Rule::dotted_path))),
        };
        let mut names = Vec::new();
        for pair in parts
            .maybe(Rule::use_names)
            .into_iter()
            .flat_map(self::parts)
        {
            let mut parts = self::parts(pair);
            let name = self.ident(parts.one(Rule::name));
            names.push((name, self.alias(&mut parts)));
        }
        Use {
            source,
            names,
            alias: self.alias(&mut parts),
            link: Link::Open,
            span,
        }
    }

    fn alias(&mut self, parts: &mut Parts) -> Option<Ident> {
        let alias = parts.maybe(Rule::use_alias)?;
        Some(self.ident(self::parts(alias).one(Rule::name)))
    }

    fn constant(&mut self, mut parts: Parts, span: Span) -> Const {
        Const {
            name: self.ident(parts.one(Rule::name)),
            value: self.expr(parts.one(Rule::expr)),
            span,
        }
    }

    fn path(&mut self, pair: Pair<Rule>) -> Path {
        let span = self.span(&pair);
        let mut parts = parts(pair);
        let head = self.ident(parts.one(Rule::name));
        let segment = |pair: Pair<Rule>| match pair.as_rule() {
            Rule::field => Segment::Field(self.ident(self::parts(pair).one(Rule::name))),
            _ => Segment::Index(self.indices(pair)),
        };
        let rest = parts.map(segment).collect();
        Path { head, rest, span }
    }

    fn idents(&mut self, pair: Pair<Rule>) -> Vec<Ident> {
        parts(pair).map(|name| self.ident(name)).collect()
    }

    fn ident(&mut self, pair: Pair<Rule>) -> Ident {
        let span = self.span(&pair);
        let text = pair.as_str();
        if text.is_ascii() {
            let name = text.to_owned();
            return Ident { name, span };
        }
        let name: String = text.nfkc().collect();
        if words::RESERVED.contains(&name.as_str()) {
            let word = name.clone();
            self.report(SyntaxError::ReservedName { word, span });
        }
        Ident { name, span }
    }

    /// Offsets of a pair in the file.
    fn range(&self, pair: &Pair<Rule>) -> Range<usize> {
        self.base + pair.as_span().start()..self.base + end_of(pair)
    }

    fn span(&self, pair: &Pair<Rule>) -> Span {
        self.position(self.range(pair))
    }

    /// The span of offsets in the file; what the scan added lies at its end.
    fn position(&self, range: Range<usize>) -> Span {
        let clamp = |offset: usize| (self.start + offset).min(self.end);
        Span::new(clamp(range.start)..clamp(range.end))
    }

    /// True where the scan has repaired something in a statement, outside of the blocks in it.
    fn is_wrong(&self, pair: &Pair<Rule>) -> bool {
        let range = self.range(pair);
        let mut children = pair.clone().into_inner();
        let block = children.find(|child| {
            matches!(
                child.as_rule(),
                Rule::body
                    | Rule::rows
                    | Rule::binds
                    | Rule::resets
                    | Rule::options
                    | Rule::open_brace
            )
        });
        let end = block.map_or(range.end, |block| self.range(&block).start);
        self.wrong_within(range.start..end)
    }

    fn wrong_within(&self, range: Range<usize>) -> bool {
        let first = self
            .scan
            .wrong
            .partition_point(|wrong| wrong.start < range.start);
        self.scan
            .wrong
            .get(first)
            .is_some_and(|wrong| wrong.start < range.end)
    }

    fn report(&mut self, error: SyntaxError) {
        if self.errors.len() <= MAX_ERRORS {
            self.errors.push(error);
        }
    }
}

/// Where the last token of a pair ends; pest counts blanks before an optional part that is not there.
pub(super) fn end_of(pair: &Pair<Rule>) -> usize {
    let mut last = pair.clone();
    while let Some(child) = last.clone().into_inner().next_back() {
        last = child;
    }
    let end = last.as_span().end();
    match is_bad(pair.as_rule()) {
        true => pair.as_span().start() + pair.as_str().trim_end().len(),
        false => end,
    }
}

/// True for what a list of statements could not read.
fn is_bad(rule: Rule) -> bool {
    use Rule::{
        bad_bind, bad_free, bad_guess, bad_item, bad_option, bad_reset, bad_row, bad_setting,
        bad_statement,
    };
    matches!(
        rule,
        bad_item
            | bad_statement
            | bad_row
            | bad_bind
            | bad_reset
            | bad_option
            | bad_setting
            | bad_guess
            | bad_free
    )
}

/// The children of a pair that carry content.
fn parts(pair: Pair<'_, Rule>) -> Parts<'_> {
    Parts(
        pair.into_inner()
            .filter(has_content as fn(&Pair<Rule>) -> bool)
            .peekable(),
    )
}

fn has_content(pair: &Pair<Rule>) -> bool {
    spelling(pair.as_rule()).is_none()
}

/// See [`parts`].
struct Parts<'i>(Peekable<WithContent<'i>>);

type WithContent<'i> = std::iter::Filter<Pairs<'i, Rule>, fn(&Pair<Rule>) -> bool>;

impl<'i> Parts<'i> {
    /// The next child, which the grammar makes a `rule`.
    fn one(&mut self, rule: Rule) -> Pair<'i, Rule> {
        self.maybe(rule)
            .unwrap_or_else(|| panic!("grammar: expected a {rule:?}, found {:?}", self.0.peek()))
    }

    /// The next child, where it is a `rule`.
    fn maybe(&mut self, rule: Rule) -> Option<Pair<'i, Rule>> {
        self.0.next_if(|pair| pair.as_rule() == rule)
    }
}

impl<'i> Iterator for Parts<'i> {
    type Item = Pair<'i, Rule>;

    fn next(&mut self) -> Option<Self::Item> {
        self.0.next()
    }
}
