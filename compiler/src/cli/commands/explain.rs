//! `nsdc explain`

use std::io;

use crate::cli::{Exit, Streams};
use crate::diagnostics::explain::{PAGES, closest, page, title};

/// Prints the page of a code, or all codes with their titles.
pub fn run(code: Option<&str>, streams: &mut Streams<'_>) -> io::Result<Exit> {
    let Some(code) = code else {
        for (code, page) in PAGES {
            writeln!(streams.out, "{code}  {}", title(page))?;
        }
        return Ok(Exit::Success);
    };
    if let Some(page) = page(code) {
        writeln!(streams.out, "{}", page.trim_end())?;
        return Ok(Exit::Success);
    }
    writeln!(streams.err, "error: there is no diagnostic `{code}`")?;
    match closest(code) {
        Some(known) => writeln!(streams.err, "  help: did you mean `{known}`?")?,
        None => writeln!(streams.err, "  help: `nsdc explain` lists all codes")?,
    }
    Ok(Exit::Wrong)
}
