//! Helps that are edits of the text, as data.

use std::fmt;

use miette::Diagnostic;
use serde::Serialize;

use crate::source::{SourceFile, Span};

/// Whether an edit may be made without being looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Applicability {
    /// The new text means what the old one was obviously meant to.
    Safe,
    /// It may mean that.
    Suggestion,
}

/// A piece of text in the place of another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Edit {
    /// What is replaced; empty where text is inserted.
    pub span: Span,
    /// What stands there then; empty where text is removed.
    pub replacement: String,
}

/// The edits that mend what a diagnostic is about.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fix {
    /// What they do, as an action in lower case.
    pub title: String,
    /// All of them, by position; they do not overlap.
    pub edits: Vec<Edit>,
    /// Whether they may be made without being looked at.
    pub applicability: Applicability,
}

impl Fix {
    /// One edit, with the title that it explains itself by.
    pub fn one(span: Span, replacement: impl Into<String>, applicability: Applicability) -> Self {
        let replacement = replacement.into();
        let title = match (replacement.trim(), span.start == span.end) {
            ("", _) => "remove it".to_owned(),
            (text, true) => format!("insert `{text}`"),
            (text, false) => format!("write `{text}`"),
        };
        Fix {
            title,
            edits: vec![Edit { span, replacement }],
            applicability,
        }
    }

    /// More words at the end of a statement, in front of its `;`.
    pub fn at_end(statement: Span, words: &str) -> Self {
        let end = statement.end.saturating_sub(1);
        let place = Span { start: end, end };
        Fix::one(place, format!(" {words}"), Applicability::Suggestion)
    }

    /// A region behind another one, for all that the regions of its partition leave: there these states rest.
    pub fn rest<'e>(region: Span, states: impl IntoIterator<Item = &'e str>) -> Self {
        let start = region.end;
        let place = Span { start, ..region };
        let rates = states.into_iter().map(|state| format!("{state}' = 0; "));
        let rest = format!("\n  region rest else {{ {}}}", rates.collect::<String>());
        Fix::one(place, rest, Applicability::Suggestion)
    }
}

/// A diagnostic that may know how to mend what it is about.
pub trait Fixable: Diagnostic + Send + Sync + 'static {
    /// The edits that its help asks for, where these are certain in form.
    fn fix(&self) -> Option<Fix> {
        None
    }

    /// Edits besides, of which a reader may choose one: what the help asks for with a value that is to be thought about.
    fn choices(&self) -> Vec<Fix> {
        Vec::new()
    }
}

/// What a diagnostic says to do, with what takes the place of what it points at, where that is known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Help {
    text: Box<str>,
    instead: Option<(Box<str>, Applicability)>,
}

impl Help {
    /// The words alone.
    pub fn without_edit(self) -> Self {
        Help {
            instead: None,
            ..self
        }
    }

    /// Words with an edit.
    pub fn edit(
        text: impl Into<String>,
        replacement: impl Into<String>,
        applicability: Applicability,
    ) -> Self {
        Help {
            text: text.into().into(),
            instead: Some((replacement.into().into(), applicability)),
        }
    }

    /// A name that is close to the one that is written: only a reader knows whether it is the one.
    pub fn did_you_mean(name: &str) -> Self {
        Help::edit(
            format!("did you mean `{name}`?"),
            name,
            Applicability::Suggestion,
        )
    }

    /// The same words, and others behind them.
    pub fn followed_by(self, more: &str) -> Self {
        Help {
            text: format!("{} {more}", self.text).into(),
            ..self
        }
    }

    /// The same words with another text that takes the place, where there is one.
    pub fn written(mut self, form: impl FnOnce(&str) -> String) -> Self {
        if let Some((replacement, _)) = &mut self.instead {
            *replacement = form(replacement).into();
        }
        self
    }

    /// The edit, for what the diagnostic points at.
    pub fn fix(&self, span: Span) -> Option<Fix> {
        let (replacement, applicability) = self.instead.as_ref()?;
        Some(Fix::one(span, &**replacement, *applicability))
    }
}

impl<T: Into<String>> From<T> for Help {
    fn from(text: T) -> Self {
        Help {
            text: text.into().into(),
            instead: None,
        }
    }
}

impl fmt::Display for Help {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// A text with the edits of fixes made in it, and the fixes that were made; of those that overlap or touch, the
/// first alone.
pub fn apply(file: &SourceFile, mut fixes: Vec<Fix>) -> (String, Vec<Fix>) {
    fixes.retain(|fix| fix.edits.iter().all(|edit| file.contains(edit.span)));
    fixes.sort_by_key(|fix| fix.edits.first().map(|edit| edit.span));
    let mut made: Vec<Fix> = Vec::new();
    for fix in fixes {
        let reached = made.last().and_then(|fix| fix.edits.last());
        let first = fix.edits.first();
        if let (Some(reached), Some(first)) = (reached, first)
            && first.span.start <= reached.span.end
        {
            continue;
        }
        made.push(fix);
    }
    let mut text = String::with_capacity(file.text.len());
    let mut done = file.span().start;
    for edit in made.iter().flat_map(|fix| &fix.edits) {
        let kept = Span::new(done as usize..edit.span.start as usize);
        text.push_str(file.slice(kept));
        text.push_str(&edit.replacement);
        done = edit.span.end;
    }
    text.push_str(file.slice(Span::new(done as usize..file.span().end as usize)));
    (text, made)
}
