//! Text -> text the grammar can rely on, reporting what is wrong below the
//! level of statements.
//!
//! One pass over the tokens refuses files the parser must not see (not text,
//! too large, nested too deeply) and reports stray characters, numbers, strings,
//! foreign operators and brackets. Each is replaced, byte for byte, by something
//! harmless, so that the rest of the file is still checked and no position
//! moves; only closing braces that are missing at the end are added behind it.
//!
//! Afterwards brackets are balanced and nesting is bounded by [`MAX_DEPTH`].

use std::borrow::Cow;
use std::ops::Range;

use nsd_grammar::{NsdParser, Rule};
use pest::Parser;

use super::brackets::Brackets;
use super::lexer::{Lexer, Token, TokenKind, is_word_part};
use super::{MAX_BYTES, MAX_DEPTH, MAX_ERRORS, SyntaxError};
use crate::diagnostics::{Applicability, Help};
use crate::source::{SourceFile, Span};

/// The scanned text, with what was wrong in it.
pub struct Scan<'t> {
    /// Repaired text.
    pub text: Cow<'t, str>,
    /// Errors in the order in which they were found.
    pub errors: Vec<SyntaxError>,
    /// Places of the errors, by position.
    pub wrong: Vec<Range<usize>>,
}

/// Checks a file; nothing where there is no use in parsing it.
pub fn scan(file: &SourceFile) -> Result<Scan<'_>, SyntaxError> {
    let text = file.text.as_str();
    let at = |range: Range<usize>| Span::new(file.start + range.start..file.start + range.end);
    if let Some(offset) = file.invalid {
        return Err(SyntaxError::NotUtf8 {
            offset,
            span: at(offset..offset + char::REPLACEMENT_CHARACTER.len_utf8()),
        });
    }
    if text.len() > MAX_BYTES {
        let boundary = (0..=MAX_BYTES).rev().find(|&at| text.is_char_boundary(at));
        let limit = boundary.unwrap_or_default();
        return Err(SyntaxError::TooLarge {
            limit: MAX_BYTES,
            span: at(limit..limit),
        });
    }

    let mut repair = Repair::new(text, file.start);
    let mut brackets = Brackets::default();
    let mut tokens = Lexer::new(text).peekable();
    while let Some(token) = tokens.next() {
        repair.token(&token, tokens.peek());
        if !brackets.token(&token, &mut repair) {
            return Err(SyntaxError::TooDeep {
                limit: MAX_DEPTH,
                span: at(token.start..token.end()),
            });
        }
    }
    brackets.finish(&mut repair);
    Ok(repair.finish())
}

/// The text under repair.
pub struct Repair<'t> {
    text: &'t str,
    base: usize,
    bytes: Option<Vec<u8>>,
    errors: Vec<SyntaxError>,
    wrong: Vec<Range<usize>>,
    last_word: &'t str,
    /// The last token that is neither blank nor out of place.
    last: &'t str,
    /// Whether it is inside of the braces of `data "..." {`, where an arrow leads to a column.
    in_data: bool,
    /// Whether the last `with` is that of `data "..." with {`.
    with_of_data: bool,
}

impl<'t> Repair<'t> {
    fn new(text: &'t str, base: usize) -> Self {
        Repair {
            text,
            base,
            bytes: None,
            errors: Vec::new(),
            wrong: Vec::new(),
            last_word: "x",
            last: "",
            in_data: false,
            with_of_data: false,
        }
    }

    /// The span of a range of the text.
    pub fn span(&self, range: Range<usize>) -> Span {
        Span::new(self.base + range.start..self.base + range.end)
    }

    /// True at the start of a line, without indentation.
    pub fn starts_line(&self, at: usize) -> bool {
        self.text[..at].ends_with('\n')
    }

    /// Reports an error at `range` and puts `instead` there, filled up with blanks.
    pub fn replace(&mut self, range: Range<usize>, instead: &str, error: SyntaxError) {
        self.patch(range.clone(), instead);
        self.report(range, error);
    }

    fn report(&mut self, range: Range<usize>, error: SyntaxError) {
        self.wrong.push(range);
        // One more than is shown tells that there are more.
        if self.errors.len() <= MAX_ERRORS {
            self.errors.push(error);
        }
    }

    /// Blanks out what follows from an error that has been reported.
    pub fn silence(&mut self, range: Range<usize>) {
        self.patch(range.clone(), "");
        self.wrong.push(range);
    }

    /// Puts `instead` over whole characters, filled up with blanks.
    pub fn patch(&mut self, range: Range<usize>, instead: &str) {
        debug_assert!(
            instead.len() <= range.len(),
            "a repair must not move what follows"
        );
        let bytes = self
            .bytes
            .get_or_insert_with(|| self.text.as_bytes().to_vec());
        let (head, tail) = bytes[range].split_at_mut(instead.len());
        head.copy_from_slice(instead.as_bytes());
        tail.fill(b' ');
    }

    /// Adds text behind the file.
    pub fn append(&mut self, more: &str) {
        let bytes = self
            .bytes
            .get_or_insert_with(|| self.text.as_bytes().to_vec());
        bytes.extend_from_slice(more.as_bytes());
    }

    fn finish(mut self) -> Scan<'t> {
        self.wrong.sort_by_key(|range| range.start);
        let text = match self.bytes {
            None => Cow::Borrowed(self.text),
            Some(bytes) => match String::from_utf8(bytes) {
                Ok(text) => Cow::Owned(text),
                Err(error) => unreachable!("repairs replace whole characters: {error}"),
            },
        };
        Scan {
            text,
            errors: self.errors,
            wrong: self.wrong,
        }
    }

    /// Checks one token by itself.
    fn token(&mut self, token: &Token<'t>, next: Option<&Token>) {
        let range = token.start..token.end();
        let span = self.span(range.clone());
        match token.kind {
            TokenKind::Blank => self.blank(token),
            TokenKind::BlockComment => {
                // Where it has no end, it may be meant to have ended anywhere.
                let is_closed = token.text.len() >= 4 && token.text.ends_with("*/");
                let behind = &self.text[token.end()..];
                let lines = is_closed.then(|| line_comments(token.text, behind));
                self.replace(range, "", SyntaxError::BlockComment { lines, span });
            }
            TokenKind::OpenString => {
                let empty = if range.len() > 1 { "\"\"" } else { "0" };
                self.replace(range, empty, SyntaxError::UnterminatedString { span });
            }
            TokenKind::BadNumber => {
                let error = malformed(token.text, span);
                self.replace(range, "0", error);
            }
            TokenKind::Number if token.text.parse().is_ok_and(f64::is_infinite) => {
                let error = SyntaxError::MalformedNumber {
                    text: token.text.to_owned(),
                    help: Help::edit("write `inf` for infinity", "inf", Applicability::Suggestion),
                    span,
                    problem: "larger than any floating point number".to_owned(),
                };
                self.replace(range, "0", error);
            }
            TokenKind::Word => {
                if token.text == "with" {
                    self.with_of_data = self.follows_file();
                }
                self.last_word = token.text;
            }
            TokenKind::Stray => self.stray(token, span),
            TokenKind::Symbol => {
                match token.text {
                    "{" => {
                        let follows_with = self.with_of_data && self.last == "}";
                        self.in_data = follows_with || self.follows_file();
                    }
                    "}" => self.in_data = false,
                    _ => {}
                }
                self.symbol(token, next, span);
            }
            _ => {}
        }
        if !token.is_blank() && token.kind != TokenKind::Stray {
            self.last = token.text;
        }
    }

    /// Makes unusual blanks usual; line breaks stay, they end comments.
    fn blank(&mut self, token: &Token) {
        for (offset, character) in token.text.char_indices() {
            if !matches!(character, ' ' | '\t' | '\r' | '\n') {
                let start = token.start + offset;
                self.patch(start..start + character.len_utf8(), "");
            }
        }
    }

    fn symbol(&mut self, token: &Token, next: Option<&Token>, span: Span) {
        let range = token.start..token.end();
        let (word, instead) = match token.text {
            "''" => {
                let name = self.last_word.to_owned();
                return self.replace(range, "'", SyntaxError::SecondDerivative { name, span });
            }
            "==" | "!=" | "~=" | "<>" => {
                let help = match token.text {
                    "==" => Help::edit(
                        "write `=` in a declaration or a constraint, `<` or `>` in a guard",
                        "=",
                        Applicability::Suggestion,
                    ),
                    _ => "write `<` or `>`; `not` reverses a comparison".into(),
                };
                let error = SyntaxError::NoEquality {
                    operator: token.text.to_owned(),
                    help,
                    span,
                };
                return self.replace(range, "<=", error);
            }
            "&&" | "&" => ("and", "+"),
            "||" | "|" => ("or", "+"),
            "!" if next.is_some_and(|next| next.text == "=") => ("not", " "),
            "!" => ("not", "-"),
            "**" => ("^", "^"),
            "=<" => ("<=", "<="),
            "=>" => (">=", ">="),
            "->" if self.in_data => return,
            "->" => ("=", "="),
            _ => return,
        };
        let error = self.foreign(token, word);
        self.replace(range, instead, error);
    }

    /// Whether what comes stands behind `data "file"`.
    fn follows_file(&self) -> bool {
        self.last_word == "data" && self.last.starts_with('"')
    }

    fn foreign(&self, token: &Token<'t>, word: &str) -> SyntaxError {
        let range = token.start..token.end();
        SyntaxError::ForeignSymbol {
            symbol: token.text.to_owned(),
            word: word.to_owned(),
            replacement: self.apart(&range, word),
            span: self.span(range),
        }
    }

    /// The characters around a range.
    fn beside(&self, range: &Range<usize>) -> [Option<char>; 2] {
        let before = self.text[..range.start].chars().next_back();
        [before, self.text[range.end..].chars().next()]
    }

    /// A word or symbol in the place of a range, with blanks where it would run into what stands beside it.
    fn apart(&self, range: &Range<usize>, word: &str) -> String {
        let runs_into = |own: Option<char>, other: Option<char>| {
            let (Some(own), Some(other)) = (own, other) else {
                return false;
            };
            let is_mark = |c: char| !is_word_part(c) && !c.is_whitespace();
            match is_word_part(own) {
                true => is_word_part(other),
                // Quotes and primes belong to what they touch.
                false => is_mark(other) && !"\"'".contains(own) && !"()[]{},;".contains(other),
            }
        };
        let [before, after] = self.beside(range);
        let left = runs_into(word.chars().next(), before);
        let right = runs_into(word.chars().next_back(), after);
        let blank = |needed: bool| if needed { " " } else { "" };
        format!("{}{word}{}", blank(left), blank(right))
    }

    /// A comment of another language, up to the end of the line where nothing else can be meant.
    fn comment(&self, start: usize, span: Span) -> (Option<Help>, Span) {
        let help = "a comment starts with `//`";
        if !matches!(self.last, "" | ";" | "{" | "}") {
            return (Some(help.into()), span);
        }
        let line = self.text[start..].lines().next().unwrap_or_default();
        let comment = format!("//{}", line.trim_start_matches(['#', '%']));
        let help = Help::edit(help, comment, Applicability::Safe);
        (Some(help), self.span(start..start + line.len()))
    }

    /// What to do about a character that has no place here.
    fn stray_help(&self, character: char, range: &Range<usize>) -> Option<Help> {
        let word = |text: &str, word: &str| {
            Some(Help::edit(
                text,
                self.apart(range, word),
                Applicability::Safe,
            ))
        };
        let [before, after] = self.beside(range);
        let ends_operand = before.is_some_and(|c| is_word_part(c) || matches!(c, ')' | ']'));
        // `x²³` is a power of two digits, and `sin²(x)` one of a function.
        let goes_on = |c: char| is_word_part(c) || ".(^²³⁰¹⁴⁵⁶⁷⁸⁹".contains(c);
        let is_power = ends_operand && !after.is_some_and(goes_on);
        let power = |text: &str, power: &str| match is_power {
            true => Some(Help::edit(text, power, Applicability::Safe)),
            false => Some(text.into()),
        };
        match character {
            '?' => Some("write `if x > 0 then a else b`".into()),
            '²' => power("write a power as `^2`", "^2"),
            '³' => power("write a power as `^3`", "^3"),
            '√' if after == Some('(') => word("write `sqrt(...)`", "sqrt"),
            '√' => Some("write `sqrt(...)`".into()),
            '∞' => word("write `inf`", "inf"),
            '∈' => word("write `in`", "in"),
            '\\' => Some("write the operator or the function by its name".into()),
            '\0' => Some("the file does not seem to be text".into()),
            _ => None,
        }
    }

    fn stray(&mut self, token: &Token, span: Span) {
        let range = token.start..token.end();
        let known = FOREIGN
            .iter()
            .find(|(symbols, _)| symbols.contains(token.text));
        if let Some((_, word)) = known {
            let error = self.foreign(token, word);
            let instead = match *word {
                "or" | "and" => "+",
                "not" => "-",
                "perp" => "<=",
                // A lone quote would open a string, and two slashes a comment.
                "\"" => "",
                "/" if self.text[..token.start].ends_with('/') => "",
                word => word,
            };
            return self.replace(range, instead, error);
        }
        // Of a run of stray characters, only the first is worth a message.
        let goes_on = self
            .wrong
            .last()
            .is_some_and(|last| last.end == token.start)
            && matches!(self.errors.last(), Some(SyntaxError::StrayCharacter { .. }));
        if goes_on {
            self.patch(range.clone(), "");
            if let Some(last) = self.wrong.last_mut() {
                last.end = range.end;
            }
            return;
        }
        let character = token
            .text
            .chars()
            .next()
            .unwrap_or(char::REPLACEMENT_CHARACTER);
        let (help, place) = match character {
            '#' | '%' => self.comment(token.start, span),
            _ => (self.stray_help(character, &range), span),
        };
        let error = SyntaxError::StrayCharacter {
            character: match character.is_control() {
                true => format!("U+{:04X}", u32::from(character)),
                false => format!("`{character}`"),
            },
            help,
            place,
            span,
        };
        self.replace(range, "", error);
    }
}

/// Symbols of papers and keyboards, with what is written instead.
const FOREIGN: [(&str, &str); 13] = [
    ("−–—", "-"),
    ("×·\u{387}⋅∗", "*"),
    ("÷∕", "/"),
    ("≤⩽", "<="),
    ("≥⩾", ">="),
    ("′’‘", "'"),
    ("“”„", "\""),
    ("∧", "and"),
    ("∨", "or"),
    ("¬", "not"),
    ("⟂⊥", "perp"),
    ("≈", "~"),
    ("≔", ":="),
];

/// A block comment as comments of its lines; what follows on its last line begins a line of its own.
fn line_comments(block: &str, behind: &str) -> String {
    let inner = block.strip_prefix("/*").unwrap_or(block);
    let inner = inner.strip_suffix("*/").unwrap_or(inner);
    let mut lines: Vec<String> = inner
        .lines()
        .map(|line| format!("// {}", line.trim()).trim_end().to_owned())
        .collect();
    if lines.is_empty() {
        lines.push("//".to_owned());
    }
    let rest = behind.lines().next().unwrap_or_default();
    let breaks = if rest.trim().is_empty() { "" } else { "\n" };
    lines.join("\n") + breaks
}

/// Whether a word is a unit that may stand behind a number.
fn is_unit(word: &str) -> bool {
    let parsed = NsdParser::parse(Rule::known_unit, word);
    parsed.is_ok_and(|mut pairs| pairs.as_str() == word && pairs.next().is_some())
}

/// Says what is wrong with a number and how to write it.
fn malformed(text: &str, span: Span) -> SyntaxError {
    let (problem, help) = if text.matches('.').count() > 1 {
        (
            "more than one point",
            "write the number with one point".into(),
        )
    } else if text.ends_with(['e', 'E']) {
        ("the exponent has no digits", "write it as in `1e-3`".into())
    } else {
        let end = text
            .find(|c: char| !c.is_ascii_digit() && c != '.')
            .unwrap_or(0);
        match text[..end].strip_suffix('.') {
            Some(whole) => {
                let help = format!(
                    "write `{whole}.0{}` or `{whole}*{}`",
                    &text[end..],
                    &text[end..]
                );
                ("a digit is missing after the point", help.into())
            }
            None if is_unit(&text[end..]) => {
                let (number, unit) = text.split_at(end);
                let help = format!(
                    "write `{number} {unit}` for a number with its unit, `{number}*{unit}` for a product"
                );
                ("a number runs into a unit", help.into())
            }
            None => {
                let product = format!("{}*{}", &text[..end], &text[end..]);
                let help = format!("write `{product}` for a product");
                let help = Help::edit(help, product, Applicability::Suggestion);
                ("a number runs into a name", help)
            }
        }
    };
    SyntaxError::MalformedNumber {
        text: text.to_owned(),
        help,
        span,
        problem: problem.to_owned(),
    }
}
