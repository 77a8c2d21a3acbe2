//! What is around a position in a text, whether it can be read or not.

use crate::syntax::{self, Token, TokenKind};

/// What is around a position in a text: statements that are open, outermost first, each from its first word on.
pub struct Around<'t> {
    /// Statements in whose braces it is.
    pub heads: Vec<Vec<Token<'t>>>,
    /// The tokens of its own statement in front of the word that is written there.
    pub before: Vec<Token<'t>>,
}

impl<'t> Around<'t> {
    /// Nothing inside of comments, strings and numbers, where no name is meant.
    pub fn of(text: &'t str, byte: usize) -> Option<Self> {
        let mut around = Around {
            heads: vec![],
            before: vec![],
        };
        // The statement whose block ended last, which may go on.
        let mut ended = None;
        // Of braces that list values or names.
        let mut lists = 0;
        for token in syntax::tokens(text).take_while(|token| token.start < byte) {
            let reaches = token.end() >= byte;
            match token.kind {
                TokenKind::Comment if reaches => return None,
                TokenKind::BlockComment
                | TokenKind::String
                | TokenKind::OpenString
                | TokenKind::Number
                | TokenKind::BadNumber
                    if reaches && (token.end() > byte || token.kind != TokenKind::String) =>
                {
                    return None;
                }
                TokenKind::Word if reaches => break,
                _ if token.is_blank() => continue,
                _ => {}
            }
            let ended_here = ended.take();
            match token.text {
                "}" => {
                    ended = around.heads.pop();
                    around.before.clear();
                }
                "metric" | "solves" | "at" if ended_here.is_some() => {
                    around.before = ended_here.unwrap_or_default();
                    around.before.push(token);
                }
                "{" => {
                    lists = 0;
                    around.heads.push(std::mem::take(&mut around.before));
                }
                ";" if lists == 0 => around.before.clear(),
                "[" | "(" => {
                    lists += 1;
                    around.before.push(token);
                }
                "]" | ")" => {
                    lists = usize::saturating_sub(lists, 1);
                    around.before.push(token);
                }
                _ => around.before.push(token),
            }
        }
        Some(around)
    }

    pub fn word(&self, at: usize) -> &'t str {
        self.before.get(at).map_or("", |token| token.text)
    }

    /// The first word of the statement in whose braces it is.
    pub fn block(&self) -> &'t str {
        self.heads
            .last()
            .and_then(|head| head.first())
            .map_or("", |token| token.text)
    }

    pub fn is_in_experiment(&self) -> bool {
        let head = self.heads.first().and_then(|head| head.first());
        head.is_some_and(|token| matches!(token.text, "simulate" | "optimize" | "fit" | "mpc"))
    }

    pub fn last(&self) -> &'t str {
        self.before.last().map_or("", |token| token.text)
    }

    /// Whether a bracket is open in its own statement.
    pub fn is_open(&self) -> bool {
        let count = |texts: [&str; 2]| {
            let tokens = self.before.iter();
            tokens.filter(|token| texts.contains(&token.text)).count()
        };
        count(["(", "["]) > count([")", "]"])
    }

    /// Whether its own statement ends with these tokens.
    pub fn ends_with(&self, texts: &[&str]) -> bool {
        let last = self.before.iter().rev().map(|token| token.text);
        self.before.len() >= texts.len() && last.zip(texts.iter().rev()).all(|(a, b)| a == *b)
    }
}
