//! Characters to tokens: what the scan for mistakes and the formatter work on.
//!
//! The grammar does not need tokens, but it can neither tell where a string
//! should have ended nor keep a comment. Every byte of the text belongs to
//! exactly one token, so their texts side by side give the file back.

use pest::unicode::XID_START;

/// Kinds of tokens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TokenKind {
    /// Blanks and line breaks.
    Blank,
    /// `// ...` without its line break.
    Comment,
    /// `/* ... */`, which the language does not have.
    BlockComment,
    /// A name or a keyword.
    Word,
    /// A number.
    Number,
    /// What looks like a number but is not one.
    BadNumber,
    /// A string with its quotes.
    String,
    /// A string without its closing quote, up to the end of the line.
    OpenString,
    /// An operator, a bracket or another mark.
    Symbol,
    /// A character that has no place in the language.
    Stray,
}

/// A piece of the text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Token<'t> {
    /// What it is.
    pub kind: TokenKind,
    /// As written.
    pub text: &'t str,
    /// Offset of its first byte.
    pub start: usize,
}

impl Token<'_> {
    /// One past its last byte.
    pub fn end(&self) -> usize {
        self.start + self.text.len()
    }

    /// True for blanks and comments.
    pub fn is_blank(&self) -> bool {
        use TokenKind::{Blank, BlockComment, Comment};
        matches!(self.kind, Blank | Comment | BlockComment)
    }
}

/// The tokens of a text, in order.
#[derive(Clone, Debug)]
pub struct Lexer<'t> {
    text: &'t str,
    at: usize,
}

/// Marks of more than one character, longest first. Those the language does
/// not have are here so that they are refused as a whole.
const SYMBOLS: [&str; 19] = [
    "..", ".*", "./", ".^", "<=", ">=", "+=", ":=", "==", "!=", "=<", "=>", "&&", "||", "**", "''",
    "~=", "<>", "->",
];

impl<'t> Lexer<'t> {
    /// Starts at the beginning of `text`.
    pub fn new(text: &'t str) -> Self {
        Lexer { text, at: 0 }
    }

    /// Starts in the middle, at the start of a token.
    pub fn at(text: &'t str, at: usize) -> Self {
        Lexer { text, at }
    }

    fn token(&mut self, kind: TokenKind, length: usize) -> Token<'t> {
        let start = self.at;
        self.at += length;
        Token {
            kind,
            text: &self.text[start..self.at],
            start,
        }
    }
}

impl<'t> Iterator for Lexer<'t> {
    type Item = Token<'t>;

    fn next(&mut self) -> Option<Token<'t>> {
        #[cfg(test)]
        counter::add(1);
        let rest = &self.text[self.at..];
        let first = rest.chars().next()?;
        let (kind, length) = if is_blank(first) {
            (TokenKind::Blank, prefix(rest, is_blank))
        } else if rest.starts_with("//") {
            (TokenKind::Comment, prefix(rest, |c| c != '\n'))
        } else if rest.starts_with("/*") {
            let end = rest.find("*/").map_or(rest.len(), |end| end + 2);
            (TokenKind::BlockComment, end)
        } else if first.is_ascii_digit() || first == '.' && digits(&rest[1..]) > 0 {
            number(rest)
        } else if is_word_start(first) {
            (TokenKind::Word, prefix(rest, is_word_part))
        } else if first == '"' {
            string(rest)
        } else if rest.starts_with(".//") {
            // A point before a comment, as the grammar reads it where it is no operator.
            (TokenKind::Symbol, 1)
        } else if let Some(symbol) = SYMBOLS.iter().find(|symbol| rest.starts_with(**symbol)) {
            (TokenKind::Symbol, symbol.len())
        } else if "+-*/^()[]{},;:.=<>~'!&|".contains(first) {
            (TokenKind::Symbol, 1)
        } else {
            (TokenKind::Stray, first.len_utf8())
        };
        Some(self.token(kind, length))
    }
}

/// True where a name may start.
pub fn is_word_start(c: char) -> bool {
    c == '_' || XID_START(c)
}

/// True where a name may go on. A raised dot belongs to words by Unicode, but is meant as a product.
pub fn is_word_part(c: char) -> bool {
    pest::unicode::XID_CONTINUE(c) && !matches!(c, '·' | '\u{387}')
}

/// Blanks, and the mark some editors put at the start of a file.
fn is_blank(c: char) -> bool {
    c.is_whitespace() || c == '\u{feff}'
}

/// Length of the longest prefix of characters that satisfy `accept`.
fn prefix(text: &str, accept: impl Fn(char) -> bool) -> usize {
    text.find(|c| !accept(c)).unwrap_or(text.len())
}

fn digits(text: &str) -> usize {
    prefix(text, |c| c.is_ascii_digit())
}

/// Numbers have digits on a side of the point and end where no name goes on.
fn number(text: &str) -> (TokenKind, usize) {
    let whole = digits(text);
    let mut length = whole;
    let mut good = true;
    let mut points = 0;
    // A point belongs to the number unless it starts `..` or a dotted operator.
    while let Some(after) = text[length..].strip_prefix('.') {
        let is_comment = after.starts_with("//");
        if after.starts_with(['.', '*', '/', '^']) && !is_comment {
            break;
        }
        let fraction = digits(after);
        points += 1;
        good &= points == 1;
        length += 1 + fraction;
    }
    if let Some(after) = text[length..].strip_prefix(['e', 'E']) {
        let sign = usize::from(after.starts_with(['+', '-']));
        let exponent = digits(&after[sign..]);
        if exponent > 0 {
            length += 1 + sign + exponent;
        }
    }
    let glued = prefix(&text[length..], is_word_part);
    length += glued;
    good &= glued == 0;
    match good {
        true => (TokenKind::Number, length),
        false => (TokenKind::BadNumber, length),
    }
}

fn string(text: &str) -> (TokenKind, usize) {
    let content = &text[1..];
    match content.find(['"', '\n']) {
        Some(end) if content[end..].starts_with('"') => (TokenKind::String, end + 2),
        Some(end) => (
            TokenKind::OpenString,
            1 + content[..end].trim_end_matches('\r').len(),
        ),
        None => (TokenKind::OpenString, text.len()),
    }
}

/// How much text has been looked at, for tests of the cost of reading.
#[cfg(test)]
pub mod counter {
    use std::cell::Cell;

    thread_local! {
        static WORK: Cell<usize> = const { Cell::new(0) };
    }

    /// Starts to count.
    pub fn reset() {
        WORK.set(0);
    }

    /// Counts some work.
    pub fn add(work: usize) {
        WORK.set(WORK.get() + work);
    }

    /// Work since the last reset.
    pub fn count() -> usize {
        WORK.get()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn tokens(text: &str) -> String {
        let visible = Lexer::new(text).filter(|token| token.kind != TokenKind::Blank);
        let shown: Vec<String> = visible
            .map(|token| match token.kind {
                TokenKind::Symbol | TokenKind::Word | TokenKind::Number => token.text.to_owned(),
                kind => format!("{kind:?}({})", token.text),
            })
            .collect();
        shown.join(" ")
    }

    #[test]
    fn numbers_points_and_ranges() {
        assert_eq!(
            tokens("1..n 1.5..2 2.*x 2.5.^y 1e-3"),
            "1 .. n 1.5 .. 2 2 .* x 2.5 .^ y 1e-3"
        );
        assert_eq!(
            tokens(".5 5. 5.e-3 .5..2. 2.*.5 [1.] 1...5"),
            ".5 5. 5.e-3 .5 .. 2. 2 .* .5 [ 1. ] 1 .. .5"
        );
        assert_eq!(
            tokens("2x 1.2.3 1e 1.e 0x1F 3.x 5.. .5. 5.."),
            "BadNumber(2x) BadNumber(1.2.3) BadNumber(1e) BadNumber(1.e) BadNumber(0x1F) BadNumber(3.x) 5 .. BadNumber(.5.) 5 .."
        );
    }

    #[test]
    fn words_marks_and_comments() {
        assert_eq!(
            tokens("θ' += v.x*q[1]; // end\n\"a b\" \"open"),
            "θ ' += v . x * q [ 1 ] ; Comment(// end) String(\"a b\") OpenString(\"open)"
        );
        assert_eq!(
            tokens("a ./ b.//{\n1.//{"),
            "a ./ b . Comment(//{) 1. Comment(//{)"
        );
        assert_eq!(
            tokens("a @ /* no */ b"),
            "a Stray(@) BlockComment(/* no */) b"
        );
    }

    proptest! {
        #[test]
        fn every_byte_belongs_to_one_token(text in "\\PC*|[-a-z0-9.\"'/* \n=]*") {
            let together: String = Lexer::new(&text).map(|token| token.text).collect();
            prop_assert_eq!(together, text);
        }
    }
}
