//! Text -> text in the one layout: what `nsdc fmt` does.
//!
//! Tokens and comments stay as they are and in their order; only what stands
//! between them changes, and a `;` behind a block goes. The grammar says where
//! statements and blocks begin and end:
//!
//! - one statement per line, blocks indented by two; a block that stood on one
//!   line stays there as long as the line has at most [`WIDTH`] columns;
//! - line breaks inside statements stay, and so do blank lines, one at a time;
//! - blanks around `+`, `-` and relations, none around `*`, `/` and powers.
//!
//! The abstract syntax stays the same up to positions, and formatting twice
//! changes nothing.

mod layout;
mod tree;

use super::{Diagnostics, parse, scan};
use crate::source::SourceFile;

/// Columns a line may have before its block is broken up.
pub const WIDTH: usize = 100;

/// The formatted text; nothing, with diagnostics, where the file cannot be read.
pub fn format(file: &SourceFile, diagnostics: &mut Diagnostics) -> Option<String> {
    let mut found = Diagnostics::new();
    parse(file, &mut found);
    let failed = found.has_errors();
    diagnostics.append(found);
    if failed {
        return None;
    }
    // Without errors, the scan has at most made unusual blanks usual.
    let scan = scan::scan(file).ok()?;
    let tree = tree::read(&scan.text);
    Some(layout::print(&tree))
}
