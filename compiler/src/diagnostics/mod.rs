//! What the compiler has to say: the list of diagnostics and its one rendering.

mod beside;
pub mod explain;
mod fix;
pub mod json;
pub mod messages;

pub use fix::{Applicability, Edit, Fix, Fixable, Help, apply};

use std::collections::HashSet;
use std::fmt;
use std::sync::Arc;

use miette::{
    Diagnostic, GraphicalReportHandler, GraphicalTheme, LabeledSpan, Severity, SourceCode,
};

use crate::source::{self, SourceMap};

/// Any diagnostic of any stage.
pub type AnyDiagnostic = Arc<dyn Fixable>;

/// Errors and warnings in the order in which they were found.
#[derive(Clone, Debug, Default)]
pub struct Diagnostics {
    list: Vec<AnyDiagnostic>,
}

impl Diagnostics {
    /// An empty list.
    pub fn new() -> Self {
        Diagnostics::default()
    }

    /// Adds one diagnostic.
    pub fn push(&mut self, diagnostic: impl Fixable) {
        self.list.push(Arc::new(diagnostic));
    }

    /// Adds those of another list.
    pub fn append(&mut self, other: Diagnostics) {
        self.list.extend(other.list);
    }

    /// Drops those that another list has already: same code, place and message.
    pub fn remove_known(&mut self, known: &Diagnostics) {
        let known: HashSet<_> = known.list.iter().map(key).collect();
        self.list
            .retain(|diagnostic| !known.contains(&key(diagnostic)));
    }

    /// Drops those that come again: same code, place and message.
    pub fn remove_repeated(&mut self) {
        let mut seen = HashSet::new();
        self.list.retain(|diagnostic| seen.insert(key(diagnostic)));
    }

    /// Codes of the errors.
    pub fn error_codes(&self) -> Vec<String> {
        self.codes_of(true)
    }

    /// Codes of the warnings.
    pub fn warning_codes(&self) -> Vec<String> {
        self.codes_of(false)
    }

    fn codes_of(&self, of_errors: bool) -> Vec<String> {
        let wanted = self
            .iter()
            .filter(|diagnostic| is_error(diagnostic.as_ref()) == of_errors);
        wanted
            .filter_map(|diagnostic| diagnostic.code())
            .map(|code| code.to_string())
            .collect()
    }

    /// All of them, by position in the source, those without one last.
    pub fn iter(&self) -> impl Iterator<Item = &AnyDiagnostic> {
        let mut sorted: Vec<&AnyDiagnostic> = self.list.iter().collect();
        sorted.sort_by_key(|diagnostic| position(diagnostic.as_ref()).unwrap_or(usize::MAX));
        sorted.into_iter()
    }

    /// Those that stop the compilation.
    pub fn errors(&self) -> impl Iterator<Item = &AnyDiagnostic> {
        self.iter()
            .filter(|diagnostic| is_error(diagnostic.as_ref()))
    }

    /// Those that do not.
    pub fn warnings(&self) -> impl Iterator<Item = &AnyDiagnostic> {
        self.iter()
            .filter(|diagnostic| !is_error(diagnostic.as_ref()))
    }

    /// True where something stops the compilation.
    pub fn has_errors(&self) -> bool {
        self.list
            .iter()
            .any(|diagnostic| is_error(diagnostic.as_ref()))
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// True where there are none.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Their codes, in the order of [`Diagnostics::iter`].
    pub fn codes(&self) -> Vec<String> {
        let code = |diagnostic: &AnyDiagnostic| diagnostic.code().map(|code| code.to_string());
        self.iter().filter_map(code).collect()
    }
}

/// What makes two diagnostics the same.
fn key(diagnostic: &AnyDiagnostic) -> (Option<String>, Option<usize>, String) {
    let code = diagnostic.code().map(|code| code.to_string());
    (code, position(diagnostic.as_ref()), diagnostic.to_string())
}

/// True for what stops the compilation.
pub fn is_error(diagnostic: &dyn Diagnostic) -> bool {
    diagnostic.severity().unwrap_or_default() == Severity::Error
}

/// Position of the primary label, or of the first one.
pub fn position(diagnostic: &dyn Diagnostic) -> Option<usize> {
    let labels: Vec<LabeledSpan> = diagnostic.labels()?.collect();
    let primary = labels.iter().find(|label| label.primary());
    primary.or(labels.first()).map(LabeledSpan::offset)
}

/// Diagnostics that are shown; nobody reads more.
const MOST_SHOWN: usize = 100;

/// The text of all diagnostics, as it is shown to users and kept in snapshots; of very many, the first.
pub fn render(
    diagnostics: &Diagnostics,
    sources: &SourceMap,
    colour: bool,
    width: usize,
) -> String {
    let theme = match colour {
        true => GraphicalTheme::unicode(),
        false => GraphicalTheme::unicode_nocolor(),
    };
    let handler = GraphicalReportHandler::new_themed(theme)
        .with_links(false)
        .with_width(width);
    let mut text = String::new();
    for diagnostic in diagnostics.iter().take(MOST_SHOWN) {
        let report = InSources {
            diagnostic: diagnostic.as_ref(),
            sources,
        };
        if handler.render_report(&mut text, &report).is_err() {
            text.push_str(&format!("{}\n", report.diagnostic));
        }
        text.push('\n');
    }
    if let Some(hidden @ 1..) = diagnostics.len().checked_sub(MOST_SHOWN) {
        text.push_str(&format!("and {hidden} more\n"));
    }
    let lines: Vec<&str> = text.trim_end().lines().map(str::trim_end).collect();
    lines.join("\n") + if lines.is_empty() { "" } else { "\n" }
}

/// A diagnostic together with the files it points into.
#[derive(Debug)]
struct InSources<'a> {
    diagnostic: &'a dyn Fixable,
    sources: &'a SourceMap,
}

impl fmt::Display for InSources<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self.diagnostic, f)
    }
}

impl std::error::Error for InSources<'_> {}

impl Diagnostic for InSources<'_> {
    fn code<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.diagnostic.code()
    }

    fn severity(&self) -> Option<Severity> {
        self.diagnostic.severity()
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.diagnostic.help()
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let labels = self.diagnostic.labels()?.map(|label| {
            let span = source::clip(self.sources, *label.inner());
            let text = label.label().map(str::to_owned);
            match label.primary() {
                true => LabeledSpan::new_primary_with_span(text, span),
                false => LabeledSpan::new_with_span(text, span),
            }
        });
        Some(Box::new(labels))
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        Some(self.sources)
    }
}

/// `1 row`, `2 rows`, `3 entries`.
pub(crate) fn counted(count: usize, noun: &str) -> String {
    match (count, noun) {
        (1, _) => format!("1 {noun}"),
        (_, "index") => format!("{count} indices"),
        (_, "switch") => format!("{count} switches"),
        _ => match noun.strip_suffix('y') {
            Some(stem) => format!("{count} {stem}ies"),
            None => format!("{count} {noun}s"),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::Span;
    use crate::syntax::SyntaxError;
    use insta::assert_snapshot;

    #[test]
    fn shows_the_first_of_very_many() {
        let mut sources = SourceMap::new();
        sources.add("a.nsd", "x");
        let mut diagnostics = Diagnostics::new();
        for word in 0..130 {
            diagnostics.push(SyntaxError::ReservedName {
                word: word.to_string(),
                span: Span::new(0..1),
            });
        }
        let text = render(&diagnostics, &sources, false, 80);
        assert_eq!(text.matches("E0009").count(), 100);
        assert!(text.ends_with("\nand 30 more\n"), "{text}");
    }

    #[test]
    fn renders_by_file_and_position() {
        let mut sources = SourceMap::new();
        let first = sources.add("a.nsd", "model a {\n  x' = 1\n}\n");
        let second = sources.add("b.nsd", "use a;\n  state if = 1;\n");
        let mut diagnostics = Diagnostics::new();
        diagnostics.push(SyntaxError::ReservedName {
            word: "if".into(),
            span: Span::new(second.start + 15..second.start + 17),
        });
        diagnostics.push(SyntaxError::UnclosedBracket {
            bracket: '{',
            closing: '}',
            span: Span::new(8..9),
            before: Some(Span::new(second.start..second.start + 3)),
        });
        diagnostics.push(SyntaxError::MissingSemicolon {
            what: "expression".into(),
            span: Span::new(first.start + 18..first.start + 18),
        });
        assert_eq!(diagnostics.codes(), ["E0007", "E0011", "E0009"]);
        assert_snapshot!(render(&diagnostics, &sources, false, 80), @r"
        E0007

          × `{` is never closed
           ╭─[a.nsd:1:9]
         1 │ model a {
           ·         ┬
           ·         ╰── opened here
         2 │   x' = 1
           ╰────
           ╭─[b.nsd:1:1]
         1 │ use a;
           · ─┬─
           ·  ╰── should be closed before this
         2 │   state if = 1;
           ╰────
          help: close it with `}`

        E0011

          × expected `;` after this expression
           ╭─[a.nsd:2:9]
         1 │ model a {
         2 │   x' = 1
           ·         ▲
           ·         ╰── `;` is missing here
         3 │ }
           ╰────
          help: end the statement with `;`

        E0009

          × `if` is reserved
           ╭─[b.nsd:2:9]
         1 │ use a;
         2 │   state if = 1;
           ·         ─┬
           ·          ╰── cannot be a name
           ╰────
          help: choose another name, such as `if_1`
        ");
    }
}
