//! Source positions and the map from positions back to files.
//!
//! All files of one compilation share one address space, as in rustc's
//! source map: a [`Span`] alone says which file it is in.

use std::ops::Range;
use std::sync::Arc;

use miette::{MietteError, MietteSpanContents, SourceCode, SourceSpan, SpanContents};

/// A half-open range of bytes in the address space of a [`SourceMap`].
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default, PartialOrd, Ord)]
pub struct Span {
    /// First byte.
    pub start: u32,
    /// One past the last byte.
    pub end: u32,
}

impl Span {
    /// The span of the bytes `range`.
    pub fn new(range: Range<usize>) -> Self {
        let clamp = |byte: usize| u32::try_from(byte).unwrap_or(u32::MAX);
        Span {
            start: clamp(range.start),
            end: clamp(range.end.max(range.start)),
        }
    }

    /// The smallest span that covers both.
    pub fn to(self, other: Span) -> Span {
        Span {
            start: self.start.min(other.start),
            end: self.end.max(other.end),
        }
    }

    /// The empty span at its end.
    pub fn after(self) -> Span {
        Span {
            start: self.end,
            end: self.end,
        }
    }
}

impl From<Span> for SourceSpan {
    fn from(span: Span) -> Self {
        (span.start as usize, (span.end - span.start) as usize).into()
    }
}

/// One file of a [`SourceMap`].
#[derive(Debug)]
pub struct SourceFile {
    /// What diagnostics call it.
    pub name: String,
    /// Its text; bytes that are not UTF-8 stand as replacement characters.
    pub text: String,
    /// Position of its first byte in the address space.
    pub start: usize,
    /// First byte that was not UTF-8, counted from the start of the file.
    pub invalid: Option<usize>,
}

impl SourceFile {
    /// The whole file.
    pub fn span(&self) -> Span {
        Span::new(self.start..self.end())
    }

    /// The text under `span`, or nothing where it lies outside.
    pub fn slice(&self, span: Span) -> &str {
        let local = |byte: u32| (byte as usize).checked_sub(self.start);
        local(span.start)
            .zip(local(span.end))
            .and_then(|(start, end)| self.text.get(start..end))
            .unwrap_or_default()
    }

    /// Line and column of a position, both from 1; columns count characters.
    pub fn line_column(&self, position: u32) -> (usize, usize) {
        let local = (position as usize).saturating_sub(self.start);
        let before = self.text.get(..local).unwrap_or(&self.text);
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        let line = before.bytes().filter(|&byte| byte == b'\n').count() + 1;
        (line, before[line_start..].chars().count() + 1)
    }

    fn end(&self) -> usize {
        self.start + self.text.len()
    }
}

/// All files of one compilation, side by side in one address space.
#[derive(Debug, Default)]
pub struct SourceMap {
    files: Vec<Arc<SourceFile>>,
}

impl SourceMap {
    /// A map without files.
    pub fn new() -> Self {
        SourceMap::default()
    }

    /// Adds a file.
    pub fn add(&mut self, name: impl Into<String>, text: impl Into<String>) -> Arc<SourceFile> {
        self.push(name.into(), text.into(), None)
    }

    /// Adds a file as it was read; bytes that are not UTF-8 are kept as
    /// replacement characters and refused by the parser.
    pub fn add_bytes(&mut self, name: impl Into<String>, bytes: Vec<u8>) -> Arc<SourceFile> {
        match String::from_utf8(bytes) {
            Ok(text) => self.push(name.into(), text, None),
            Err(error) => {
                let invalid = Some(error.utf8_error().valid_up_to());
                let text = String::from_utf8_lossy(error.as_bytes()).into_owned();
                self.push(name.into(), text, invalid)
            }
        }
    }

    /// The files, in the order they were added.
    pub fn files(&self) -> &[Arc<SourceFile>] {
        &self.files
    }

    /// The file a position lies in.
    pub fn file(&self, span: Span) -> Option<&Arc<SourceFile>> {
        let position = span.start as usize;
        let after = self.files.partition_point(|file| file.start <= position);
        let file = self.files.get(after.checked_sub(1)?)?;
        (position <= file.end()).then_some(file)
    }

    /// The text under a span.
    pub fn text(&self, span: Span) -> &str {
        self.file(span)
            .map(|file| file.slice(span))
            .unwrap_or_default()
    }

    fn push(&mut self, name: String, text: String, invalid: Option<usize>) -> Arc<SourceFile> {
        // One byte between files keeps the end of one apart from the start of the next.
        let start = self.files.last().map_or(0, |file| file.end() + 1);
        let file = Arc::new(SourceFile {
            name,
            text,
            start,
            invalid,
        });
        self.files.push(Arc::clone(&file));
        file
    }
}

impl SourceCode for SourceMap {
    fn read_span<'a>(
        &'a self,
        span: &SourceSpan,
        lines_before: usize,
        lines_after: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        let global = Span::new(span.offset()..span.offset() + span.len());
        let file = self.file(global).ok_or(MietteError::OutOfBounds)?;
        let local = SourceSpan::from((span.offset() - file.start, span.len()));
        let contents = file.text.read_span(&local, lines_before, lines_after)?;
        let shown = contents.span();
        Ok(Box::new(MietteSpanContents::new_named(
            file.name.clone(),
            contents.data(),
            (shown.offset() + file.start, shown.len()).into(),
            contents.line(),
            contents.column(),
            contents.line_count(),
        )))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_find_their_file() {
        let mut map = SourceMap::new();
        let first = map.add("a.nsd", "model a\n");
        let second = map.add("b.nsd", "const π = 3;\nx");
        assert_eq!(map.file(first.span().after()).unwrap().name, "a.nsd");
        assert_eq!(map.file(second.span()).unwrap().name, "b.nsd");
        assert_eq!(map.text(second.span()), "const π = 3;\nx");
        let x = Span::new(second.start + 14..second.start + 15);
        assert_eq!(map.text(x), "x");
        assert_eq!(second.line_column(x.start), (2, 1));
        assert_eq!(
            second.line_column(second.start as u32 + 9),
            (1, 9),
            "columns count characters"
        );
        assert!(map.file(Span::new(900..901)).is_none());
        assert_eq!(
            map.text(Span::new(0..12)),
            "",
            "a span over two files has no text"
        );
    }

    #[test]
    fn wrong_bytes_are_replaced_and_remembered() {
        let mut map = SourceMap::new();
        let file = map.add_bytes("a.nsd", b"ab\xffc".to_vec());
        assert_eq!(file.text, "ab\u{fffd}c");
        assert_eq!(file.invalid, Some(2));
    }
}
