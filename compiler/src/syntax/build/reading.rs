//! Pairs of the grammar: where they stand, what is wrong in them, and their children.

use std::iter::Peekable;
use std::ops::Range;

use nsd_grammar::{Rule, spelling};
use pest::iterators::{Pair, Pairs};
use unicode_normalization::UnicodeNormalization;

use super::words;
use crate::source::Span;
use crate::syntax::ast::Ident;
use crate::syntax::scan::Scan;
use crate::syntax::{MAX_ERRORS, SyntaxError};

/// The text that is read: where its pieces stand, and what is wrong with them.
pub(crate) struct Reading<'b> {
    pub scan: &'b Scan<'b>,
    /// Position of the file.
    pub start: usize,
    /// Position of its end.
    pub end: usize,
    /// Offset in the file of the text that is being built.
    pub base: usize,
    pub errors: Vec<SyntaxError>,
}

impl Reading<'_> {
    pub fn idents(&mut self, pair: Pair<Rule>) -> Vec<Ident> {
        parts(pair).map(|name| self.ident(name)).collect()
    }

    pub fn ident(&mut self, pair: Pair<Rule>) -> Ident {
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
    pub fn range(&self, pair: &Pair<Rule>) -> Range<usize> {
        self.base + pair.as_span().start()..self.base + end_of(pair)
    }

    pub fn span(&self, pair: &Pair<Rule>) -> Span {
        self.position(self.range(pair))
    }

    /// The span of offsets in the file; what the scan added lies at its end.
    pub fn position(&self, range: Range<usize>) -> Span {
        let clamp = |offset: usize| (self.start + offset).min(self.end);
        Span::new(clamp(range.start)..clamp(range.end))
    }

    /// True where the scan has repaired something in a statement, outside of the blocks in it.
    pub fn is_wrong(&self, pair: &Pair<Rule>) -> bool {
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

    pub fn wrong_within(&self, range: Range<usize>) -> bool {
        let first = self
            .scan
            .wrong
            .partition_point(|wrong| wrong.start < range.start);
        self.scan
            .wrong
            .get(first)
            .is_some_and(|wrong| wrong.start < range.end)
    }

    pub fn report(&mut self, error: SyntaxError) {
        if self.errors.len() <= MAX_ERRORS {
            self.errors.push(error);
        }
    }
}

/// Where the last token of a pair ends; pest counts blanks before an optional part that is not there.
pub(crate) fn end_of(pair: &Pair<Rule>) -> usize {
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
pub(crate) fn is_bad(rule: Rule) -> bool {
    use Rule::{
        bad_bind, bad_drawing, bad_free, bad_guess, bad_item, bad_measured, bad_option, bad_plot,
        bad_reset, bad_row, bad_setting, bad_statement,
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
            | bad_measured
            | bad_plot
            | bad_drawing
    )
}

/// The children of a pair that carry content.
pub(crate) fn parts(pair: Pair<'_, Rule>) -> Parts<'_> {
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
pub(crate) struct Parts<'i>(pub Peekable<WithContent<'i>>);

pub(crate) type WithContent<'i> = std::iter::Filter<Pairs<'i, Rule>, fn(&Pair<Rule>) -> bool>;

impl<'i> Parts<'i> {
    /// The next child, which the grammar makes a `rule`.
    pub fn one(&mut self, rule: Rule) -> Pair<'i, Rule> {
        self.maybe(rule)
            .unwrap_or_else(|| panic!("grammar: expected a {rule:?}, found {:?}", self.0.peek()))
    }

    /// The next child, where it is a `rule`.
    pub fn maybe(&mut self, rule: Rule) -> Option<Pair<'i, Rule>> {
        self.0.next_if(|pair| pair.as_rule() == rule)
    }
}

impl<'i> Iterator for Parts<'i> {
    type Item = Pair<'i, Rule>;

    fn next(&mut self) -> Option<Self::Item> {
        self.0.next()
    }
}
