//! Text -> abstract syntax.
//!
//! - `scan` reports what is wrong with characters and brackets and repairs it;
//! - the grammar cuts the repaired text into statements, wrong ones included;
//! - `build` makes the [`ast::File`] and says what is wrong with the wrong ones.
//!
//! No text makes the parser panic, and its time and memory grow with the length of the text.

pub mod ast;
mod brackets;
mod build;
mod error;
mod format;
mod lexer;
mod print;
mod scan;

pub use ast::*;
#[cfg(feature = "cli")]
pub(crate) use build::words::{EXPECTATIONS, Place, describe, starts};
pub use error::SyntaxError;
pub use format::format;
pub use lexer::{Token, TokenKind};
pub(crate) use print::expression::{Level, Writer};

#[cfg(test)]
mod tests;

use crate::diagnostics::Diagnostics;
use crate::source::{SourceFile, Span, table};

/// Deepest nesting of brackets, blocks and operators that is accepted.
pub const MAX_DEPTH: usize = 128;

/// Largest file that is accepted, in bytes.
pub const MAX_BYTES: usize = 1 << 20;

/// Most declarations of a file: each model sees the names of all others.
pub const MAX_ITEMS: usize = 500;

/// More errors than this are not shown for one file.
pub const MAX_ERRORS: usize = 100;

/// Reads a file. Wrong statements are reported and stand as `Bad` in the result.
pub fn parse(file: &SourceFile, diagnostics: &mut Diagnostics) -> File {
    let scan = match scan::scan(file) {
        Ok(scan) => scan,
        Err(error) => {
            diagnostics.push(error);
            let span = file.span();
            return File {
                items: Vec::new(),
                data: table::Sources::new(),
                span,
            };
        }
    };
    let (mut ast, wrong_statements) = build::build(file, &scan);
    let mut errors = scan.errors;
    errors.extend(wrong_statements);
    let mut names = ast.items.iter().filter_map(name_of);
    if let Some(name) = names.nth(MAX_ITEMS) {
        errors.push(SyntaxError::TooManyItems {
            limit: MAX_ITEMS,
            span: name.span,
        });
        ast.items.clear();
    }
    if ast.items.is_empty() && errors.is_empty() {
        let span = Span::new(file.start..file.start);
        errors.push(SyntaxError::EmptyFile { span });
    }
    if errors.len() > MAX_ERRORS {
        errors.truncate(MAX_ERRORS);
        errors.push(SyntaxError::TooManyErrors {
            span: file.span().after(),
        });
    }
    for error in errors {
        diagnostics.push(error);
    }
    ast
}

/// The tokens of a text, in order; each byte is in one.
pub fn tokens(text: &str) -> impl Iterator<Item = Token<'_>> {
    lexer::Lexer::new(text)
}

/// The name that an item declares.
fn name_of(item: &Item) -> Option<&Ident> {
    match item {
        Item::Const(item) => Some(&item.name),
        Item::Fn(item) => Some(&item.name),
        Item::Model(item) => Some(&item.name),
        Item::Experiment(item) => Some(&item.name),
        Item::Use(_) | Item::ExpectDiagnostic(_) | Item::Bad(_) => None,
    }
}
