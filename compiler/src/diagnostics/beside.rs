//! A diagnostic with a place beside those that it points at: in which of several readings of one text it was found.

use std::fmt;
use std::sync::Arc;

use miette::{Diagnostic, LabeledSpan, Severity};

use super::{AnyDiagnostic, Diagnostics, Fix, Fixable};
use crate::source::Span;

#[derive(Debug)]
struct Beside {
    found: AnyDiagnostic,
    place: LabeledSpan,
}

impl Diagnostics {
    /// Lets all of them point at a place, too, behind their own.
    pub fn point_beside(&mut self, text: &str, span: Span) {
        let place = LabeledSpan::new_with_span(Some(text.to_owned()), span);
        let beside = |found: AnyDiagnostic| -> AnyDiagnostic {
            let place = place.clone();
            Arc::new(Beside { found, place })
        };
        self.list = self.list.drain(..).map(beside).collect();
    }
}

impl fmt::Display for Beside {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.found.fmt(f)
    }
}

impl std::error::Error for Beside {}

impl Diagnostic for Beside {
    fn code<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.found.code()
    }

    fn severity(&self) -> Option<Severity> {
        self.found.severity()
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.found.help()
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let own = self.found.labels().into_iter().flatten();
        Some(Box::new(own.chain([self.place.clone()])))
    }
}

impl Fixable for Beside {
    fn fix(&self) -> Option<Fix> {
        self.found.fix()
    }

    fn choices(&self) -> Vec<Fix> {
        self.found.choices()
    }
}
