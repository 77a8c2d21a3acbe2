//! The JSON form of diagnostics: one object on one line each, with the fields of the language reference.

use serde::Serialize;

use super::{AnyDiagnostic, Diagnostics};
use crate::diagnostics::messages::Message;
use crate::source::SourceMap;

/// A message, and the file that was asked about.
#[derive(Serialize)]
struct Line<'a> {
    checked: &'a str,
    #[serde(flatten)]
    message: Message,
}

/// All of them, by position, a line for each; `checked` is the file that was asked about.
pub fn write(diagnostics: &Diagnostics, sources: &SourceMap, checked: &str) -> String {
    let line = |diagnostic: &AnyDiagnostic| {
        let message = Message::of(diagnostic, sources);
        // Words and numbers only: nothing that serialization can refuse.
        serde_json::to_string(&Line { checked, message }).unwrap_or_default() + "\n"
    };
    diagnostics.iter().map(line).collect()
}
