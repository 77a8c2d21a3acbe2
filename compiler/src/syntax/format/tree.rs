//! Tokens, comments and blocks of a file, as the formatter sees them.

use std::iter::Peekable;
use std::vec::IntoIter;

use nsd_grammar::{NsdParser, Rule};
use pest::Parser;
use pest::iterators::Pair;
use rustc_hash::{FxHashMap, FxHashSet};

use crate::syntax::build;
use crate::syntax::lexer::{Lexer, Token, TokenKind};

/// The inside of a file or of braces.
#[derive(Debug, Default)]
pub struct Block<'t> {
    /// Members and comments in order.
    pub entries: Vec<Entry<'t>>,
    /// A comment behind the opening brace.
    pub opening: Option<&'t str>,
    /// Whether it stood on one line, without comments.
    pub one_line: bool,
}

/// A line or more of a block.
#[derive(Debug)]
pub struct Entry<'t> {
    /// Whether a blank line stood before it.
    pub blank_before: bool,
    /// What it is.
    pub kind: EntryKind<'t>,
}

/// A comment of its own, or a member of the block.
#[derive(Debug)]
pub enum EntryKind<'t> {
    /// A comment on its own line.
    Comment(&'t str),
    /// A statement, an item, a row, ...
    Member {
        /// What it consists of.
        parts: Vec<Part<'t>>,
        /// A comment behind it, on the same line.
        trailing: Option<&'t str>,
    },
}

/// A piece of a member.
#[derive(Debug)]
pub enum Part<'t> {
    /// A word, a number, a symbol, ...
    Piece(Piece<'t>),
    /// A comment between two of them.
    Comment {
        /// The comment.
        text: &'t str,
        /// Whether a line break stood before it.
        own_line: bool,
    },
    /// A block in braces.
    Block(Block<'t>),
}

/// A token with what the layout needs to know about its place.
#[derive(Clone, Copy, Debug)]
pub struct Piece<'t> {
    /// As written.
    pub text: &'t str,
    /// Whether a line break stood before it.
    pub new_line: bool,
    /// A bracket that belongs to what stands before it: `f(x)`, `x[1]`.
    pub attached: bool,
    /// `+` or `-` between two operands.
    pub binary: bool,
    /// Inside a bound of a range, where `+` and `-` take no blanks.
    pub tight: bool,
}

/// Reads a text that the grammar accepts without wrong statements.
pub fn read(text: &str) -> Block<'_> {
    let Ok(pairs) = NsdParser::parse(Rule::file, text) else {
        return Block::default();
    };
    let mut marks = Marks::default();
    for pair in pairs.flatten() {
        marks.add(&pair);
    }
    let mut reader = Reader {
        tokens: lines(text, &marks).into_iter().peekable(),
        marks,
    };
    reader.block(false)
}

/// What the grammar knows about positions.
#[derive(Default)]
struct Marks {
    /// Ends of the members of blocks, by their starts.
    members: FxHashMap<usize, usize>,
    /// Braces that list things and enclose no block.
    listing: FxHashSet<usize>,
    /// Braces of blocks.
    braces: FxHashSet<usize>,
    attached: FxHashSet<usize>,
    binary: FxHashSet<usize>,
    tight: FxHashSet<usize>,
    tight_until: usize,
    /// Ends of what stays as it is, by its starts.
    verbatim: FxHashMap<usize, usize>,
}

impl Marks {
    fn add(&mut self, pair: &Pair<Rule>) {
        let start = pair.as_span().start();
        let mut children = pair.clone().into_inner();
        match pair.as_rule() {
            Rule::open_brace | Rule::close_brace if !self.listing.contains(&start) => {
                self.braces.insert(start);
            }
            Rule::finite_set | Rule::use_names => {
                let ends = children.next().into_iter().chain(children.next_back());
                self.listing
                    .extend(ends.map(|brace| brace.as_span().start()));
            }
            Rule::call | Rule::index | Rule::sizes | Rule::part_index | Rule::fn_params => {
                self.attached
                    .extend(children.next().map(|bracket| bracket.as_span().start()));
            }
            Rule::binder | Rule::span => {
                let is_range = children.any(|child| child.as_rule() == Rule::dots);
                let end = if is_range { pair.as_span().end() } else { 0 };
                self.tight_until = self.tight_until.max(end);
            }
            Rule::infix => {
                self.binary.insert(start);
                if start < self.tight_until {
                    self.tight.insert(start);
                }
            }
            Rule::relative_path => {
                self.verbatim.insert(start, pair.as_span().end());
            }
            rule if is_member(rule) => {
                self.members.insert(start, build::reading::end_of(pair));
            }
            _ => {}
        }
    }
}

fn is_member(rule: Rule) -> bool {
    use Rule::*;
    matches!(
        rule,
        use_item
            | const_item
            | fn_item
            | model
            | experiment
            | expect_diagnostic
            | decl
            | named
            | switch
            | part
            | region
            | hidden
            | project
            | jump
            | sampled
            | mechanics
            | contact
            | for_loop
            | program
            | equation
            | complementarity
            | dynamics
            | row_for
            | relation
            | bind
            | reset
            | option
            | expect
            | with
            | guess
            | guess_from
            | method
            | horizon
            | record
            | lower
            | subject_to
            | final_rows
            | initial
            | initial_free
            | free
            | free_path
            | perturb
            | starts
            | on_chattering
            | stop
            | free_intervals
            | sensitivity
            | sensed
            | data
            | measured
            | controller
            | plot
            | plot_panel
            | plot_phase
            | plot_title
            | plot_width
            | animate
            | drawing_for
            | drawing
            | value
    )
}

/// A token that is not blank, with the line breaks before it.
struct Line<'t> {
    token: Token<'t>,
    breaks: usize,
}

/// Tokens and comments; what stays verbatim is one token.
fn lines<'t>(text: &'t str, marks: &Marks) -> Vec<Line<'t>> {
    let mut lines = Vec::new();
    let mut breaks = 0;
    let mut until = 0;
    for mut token in Lexer::new(text) {
        if token.start < until {
            continue;
        }
        if token.kind == TokenKind::Blank {
            breaks += token.text.matches('\n').count();
            continue;
        }
        if let Some(end) = marks.verbatim.get(&token.start) {
            until = *end;
            token.text = &text[token.start..until];
        }
        lines.push(Line { token, breaks });
        breaks = 0;
    }
    lines
}

struct Reader<'t> {
    tokens: Peekable<IntoIter<Line<'t>>>,
    marks: Marks,
}

impl<'t> Reader<'t> {
    /// The members up to the end of the file, or to the closing brace `in_braces`.
    fn block(&mut self, in_braces: bool) -> Block<'t> {
        let mut block = Block {
            one_line: true,
            ..Block::default()
        };
        while let Some(&Line { token, breaks }) = self.tokens.peek() {
            let comment = token.kind == TokenKind::Comment;
            block.one_line &= breaks == 0 && !comment;
            if token.text == "}" && self.marks.braces.contains(&token.start) {
                break;
            }
            let first = in_braces && block.entries.is_empty() && block.opening.is_none();
            if comment && breaks == 0 && first {
                block.opening = self.comment();
                continue;
            }
            let blank_before = breaks > 1;
            let kind = if comment {
                EntryKind::Comment(self.comment().unwrap_or_default())
            } else if let Some(&end) = self.marks.members.get(&token.start) {
                let (parts, one_line) = self.member(end);
                block.one_line &= one_line;
                let trailing = self.comment_behind();
                block.one_line &= trailing.is_none();
                EntryKind::Member { parts, trailing }
            } else {
                // A semicolon behind a block.
                self.tokens.next();
                continue;
            };
            block.entries.push(Entry { blank_before, kind });
        }
        block
    }

    fn comment(&mut self) -> Option<&'t str> {
        self.tokens.next().map(|line| line.token.text.trim_end())
    }

    /// A comment on the line where the last token ended.
    fn comment_behind(&mut self) -> Option<&'t str> {
        let next = self.tokens.peek()?;
        let behind = next.token.kind == TokenKind::Comment && next.breaks == 0;
        if behind { self.comment() } else { None }
    }

    /// The parts of a member that ends at `end`, and whether they stood on one line.
    fn member(&mut self, end: usize) -> (Vec<Part<'t>>, bool) {
        let mut parts = Vec::new();
        let mut one_line = true;
        while let Some(line) = self.tokens.next_if(|line| line.token.start < end) {
            let Line { token, breaks } = line;
            let own_line = breaks > 0 && !parts.is_empty();
            one_line &= !own_line;
            if token.kind == TokenKind::Comment {
                let text = token.text.trim_end();
                one_line = false;
                parts.push(Part::Comment { text, own_line });
            } else if token.text == "{" && self.marks.braces.contains(&token.start) {
                let block = self.block(true);
                one_line &= block.one_line;
                self.tokens.next();
                parts.push(Part::Block(block));
            } else if token.text == ";" && matches!(parts.last(), Some(Part::Block(_))) {
                // The block has ended the statement already.
            } else {
                // What follows a block stays on the line of its brace.
                let new_line = own_line && !matches!(parts.last(), Some(Part::Block(_)));
                parts.push(Part::Piece(Piece {
                    text: token.text,
                    new_line,
                    attached: self.marks.attached.contains(&token.start),
                    binary: self.marks.binary.contains(&token.start),
                    tight: self.marks.tight.contains(&token.start),
                }));
            }
        }
        (parts, one_line)
    }
}
