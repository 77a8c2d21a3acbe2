//! Bracket balance and depth, over the tokens of a file.
//!
//! Depth is that of the tree the parser will build, so what nests without
//! brackets counts too: `not`, unary minus, powers, `if` in an `else`, and
//! calls and fields behind a name.

use std::ops::Range;

use super::lexer::{Token, TokenKind};
use super::scan::Repair;
use super::{MAX_DEPTH, SyntaxError};
use crate::diagnostics::{Applicability, Help};
use crate::source::Span;

/// Open brackets, innermost last.
#[derive(Default)]
pub struct Brackets<'t> {
    outer: Vec<(Open<'t>, Nesting)>,
    here: Nesting,
    /// Nesting around the innermost bracket.
    base: usize,
    /// The last two tokens that are not blank.
    last: [Option<Token<'t>>; 2],
    /// Blanks before the last token, and those since.
    blanks: [Vec<Range<usize>>; 2],
    after_comment: bool,
}

/// An open bracket.
#[derive(Clone, Copy)]
struct Open<'t> {
    token: Token<'t>,
    /// Whether it calls or indexes what stands before it.
    postfix: bool,
    /// The first semicolon inside.
    semicolon: Option<Token<'t>>,
    /// Whether a string that is not closed may have swallowed its end.
    swallowed: bool,
}

/// Depth of what is read inside one bracket.
#[derive(Clone, Copy, Default)]
struct Nesting {
    /// Each `if` of the expression takes all that follows below it.
    ifs: usize,
    /// Prefix operators and powers above the operand that is read.
    above: usize,
    /// Depth of that operand.
    operand: usize,
    /// Whether an operand has been read.
    complete: bool,
    /// Deepest so far.
    deepest: usize,
}

impl Nesting {
    fn depth(&self) -> usize {
        self.ifs + self.above + self.operand
    }

    /// An operator of lower precedence, or a word: the next operand stands beside the last.
    fn next_operand(&mut self) {
        self.deepest = self.deepest.max(self.depth());
        self.above = 0;
        self.operand = 0;
        self.complete = false;
    }

    /// The next operand stands below what has been read: `^`, `not`, `-`.
    fn descend(&mut self) {
        self.deepest = self.deepest.max(self.depth());
        self.above += 1;
        self.operand = 0;
        self.complete = false;
    }

    fn next_expression(&mut self) {
        self.next_operand();
        self.ifs = 0;
    }
}

impl<'t> Brackets<'t> {
    /// Takes the next token; false where the nesting is too deep.
    pub fn token(&mut self, token: &Token<'t>, repair: &mut Repair<'t>) -> bool {
        match token.kind {
            // The line break that ends a comment has to stay.
            TokenKind::Blank => {
                self.blanks[1].push(token.start + usize::from(self.after_comment)..token.end())
            }
            TokenKind::Comment | TokenKind::BlockComment | TokenKind::Stray => {}
            _ => {
                self.significant(token, repair);
                self.last = [self.last[1], Some(*token)];
                self.blanks.swap(0, 1);
                self.blanks[1].clear();
            }
        }
        self.after_comment = token.kind == TokenKind::Comment;
        self.base + self.here.depth() <= MAX_DEPTH && self.outer.len() <= MAX_DEPTH
    }

    fn significant(&mut self, token: &Token<'t>, repair: &mut Repair<'t>) {
        match token.kind {
            TokenKind::Word => self.word(token, repair),
            TokenKind::Symbol => self.symbol(token, repair),
            TokenKind::OpenString => {
                let brackets = self.outer.iter_mut().rev().map(|(open, _)| open);
                let brackets = brackets.take_while(|open| open.token.text != "{");
                brackets.for_each(|open| open.swallowed = true);
            }
            _ => self.operand(),
        }
    }

    fn word(&mut self, token: &Token<'t>, repair: &mut Repair<'t>) {
        match token.text {
            "if" => {
                self.here.next_operand();
                self.here.ifs += 1;
            }
            "not" => self.here.descend(),
            "and" | "or" | "then" | "else" | "in" | "where" | "perp" => self.here.next_operand(),
            "for" => self.here.next_expression(),
            _ if self.last[1].is_some_and(|last| last.text == ".") => self.here.operand += 1,
            _ => {
                self.next_item(repair);
                self.operand();
            }
        }
    }

    fn operand(&mut self) {
        if self.here.complete {
            self.here.next_operand();
        }
        self.here.operand = self.here.operand.max(1);
        self.here.complete = true;
    }

    fn symbol(&mut self, token: &Token<'t>, repair: &mut Repair<'t>) {
        match token.text {
            "(" | "[" => self.open(token),
            "{" => {
                // A block never stands in parentheses or brackets.
                self.abandon(|open| open.token.text != "{", token, repair);
                self.here.next_expression();
                self.open(token);
            }
            ")" | "]" | "}" => self.close(token, repair),
            ";" => {
                self.abandon(|open| open.token.text == "(", token, repair);
                if let Some((open, _)) = self.outer.last_mut() {
                    open.semicolon.get_or_insert(*token);
                }
                self.here.next_expression();
            }
            "=" | "+=" | ":=" | "'" => {
                // None of them stands in a matrix: the bracket was left open a statement ago.
                let forgotten = self.outer.last().and_then(|(open, _)| open.semicolon);
                if let Some(semicolon) = forgotten {
                    self.abandon(|open| open.token.text == "[", &semicolon, repair);
                }
                if token.text != "'" {
                    self.here.next_expression();
                }
            }
            "," => self.here.next_expression(),
            "-" if !self.here.complete => self.here.descend(),
            "!" => self.here.descend(),
            "^" | ".^" | "**" => self.here.descend(),
            "." => {}
            _ => self.here.next_operand(),
        }
    }

    fn open(&mut self, token: &Token<'t>) {
        let open = Open {
            token: *token,
            postfix: self.here.complete && token.text != "{",
            semicolon: None,
            swallowed: false,
        };
        self.base += self.here.ifs + self.here.above + 1;
        self.outer.push((open, self.here));
        self.here = Nesting::default();
    }

    /// Leaves the innermost bracket.
    fn leave(&mut self) {
        let Some((open, outer)) = self.outer.pop() else {
            return;
        };
        self.here.next_expression();
        let inside = self.here.deepest + 1;
        self.here = outer;
        self.base -= outer.ifs + outer.above + 1;
        self.here.operand = inside.max(outer.operand + usize::from(open.postfix));
        self.here.complete = true;
        if open.token.text == "{" {
            self.here.next_expression();
        }
    }

    fn close(&mut self, token: &Token<'t>, repair: &mut Repair<'t>) {
        let opening = match token.text {
            ")" => "(",
            "]" => "[",
            _ => "{",
        };
        // What could be closed without leaving the block.
        let reachable = self.outer.iter().rev().map(|(open, _)| open.token.text);
        let matching = reachable
            .scan(false, |left_block, text| {
                let stop = *left_block;
                *left_block |= text == "{";
                (!stop).then_some(text)
            })
            .any(|text| text == opening);
        let innermost = self.outer.last().map(|(open, _)| *open);
        if matching {
            self.abandon(|open| open.token.text != opening, token, repair);
            self.leave();
            return;
        }
        let range = token.start..token.end();
        let span = repair.span(range.clone());
        let bracket = token.text.chars().next().unwrap_or_default();
        let error = |help: Help, open| SyntaxError::UnmatchedBracket {
            bracket,
            help,
            span,
            open,
        };
        match innermost.filter(|open| open.token.text != "{" && opening != "{") {
            Some(open) => {
                let closing = closing(open.token.text);
                let help = format!("close `{}` with `{closing}`", open.token.text);
                let help = Help::edit(help, closing, Applicability::Suggestion);
                let open = Some(repair.span(open.token.start..open.token.end()));
                repair.replace(range, &closing.to_string(), error(help, open));
                self.leave();
            }
            None => repair.replace(
                range,
                "",
                error(
                    format!("remove it, or open it with `{opening}`").into(),
                    None,
                ),
            ),
        }
    }

    /// Takes back the innermost brackets that satisfy `which`: they should have
    /// been closed before `token`.
    fn abandon(&mut self, which: impl Fn(&Open) -> bool, token: &Token, repair: &mut Repair<'t>) {
        while let Some((open, _)) = self.outer.last().copied().filter(|(open, _)| which(open)) {
            let before = repair.span(token.start..token.end());
            self.report_unclosed(&open, Some(before), repair);
            self.leave();
        }
    }

    fn report_unclosed(&self, open: &Open, before: Option<Span>, repair: &mut Repair<'t>) {
        let range = open.token.start..open.token.end();
        if open.swallowed {
            return repair.silence(range);
        }
        let error = SyntaxError::UnclosedBracket {
            bracket: open.token.text.chars().next().unwrap_or_default(),
            closing: closing(open.token.text),
            span: repair.span(range.clone()),
            before,
        };
        let instead = if open.token.text == "{" { "{" } else { "" };
        repair.replace(range, instead, error);
    }

    /// `model` and a name at the start of a line start an item: what is still open
    /// should have been closed before. Closing braces find room in the blanks
    /// before the keyword.
    fn next_item(&mut self, repair: &mut Repair<'t>) {
        let [Some(before), Some(keyword)] = self.last else {
            return;
        };
        let starts_item = matches!(keyword.text, "model" | "simulate" | "optimize")
            && matches!(before.text, ";" | "}")
            && repair.starts_line(keyword.start);
        let braces = self.outer.iter().filter(|(open, _)| open.token.text == "{");
        let room: Vec<usize> = self.blanks[0]
            .iter()
            .cloned()
            .flatten()
            .take(MAX_DEPTH)
            .collect();
        if !starts_item || braces.count() > room.len() {
            return;
        }
        let mut room = room.into_iter();
        while let Some((open, _)) = self.outer.last().copied() {
            let before = repair.span(keyword.start..keyword.end());
            self.report_unclosed(&open, Some(before), repair);
            if open.token.text == "{"
                && let Some(at) = room.next()
            {
                repair.patch(at..at + 1, "}");
            }
            self.leave();
        }
    }

    /// The end of the file: closes what is still open.
    pub fn finish(mut self, repair: &mut Repair<'t>) {
        let mut missing = String::from("\n");
        while let Some((open, _)) = self.outer.last().copied() {
            self.report_unclosed(&open, None, repair);
            if open.token.text == "{" {
                missing.push('}');
            }
            self.leave();
        }
        if missing.len() > 1 {
            repair.append(&missing);
        }
    }
}

fn closing(open: &str) -> char {
    match open {
        "(" => ')',
        "[" => ']',
        _ => '}',
    }
}
