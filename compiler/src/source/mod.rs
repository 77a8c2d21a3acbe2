//! Source positions and the map from positions back to files.
//!
//! All files of one compilation share one address space, as in rustc's
//! source map: a [`Span`] alone says which file it is in.

pub mod files;
pub mod imports;
pub mod table;
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
    /// What a user wrote of the text, which alone is shown: all of a file.
    written: Range<usize>,
}

impl SourceFile {
    /// The whole file.
    pub fn span(&self) -> Span {
        Span::new(self.start..self.end())
    }

    /// The bytes of the text under `span`, which lies in it.
    pub fn bytes(&self, span: Span) -> Range<usize> {
        let local = |byte: u32| (byte as usize).saturating_sub(self.start);
        local(span.start)..local(span.end)
    }

    /// The text under `span`, or nothing where it lies outside.
    pub fn slice(&self, span: Span) -> &str {
        let local = |byte: u32| (byte as usize).checked_sub(self.start);
        local(span.start)
            .zip(local(span.end))
            .and_then(|(start, end)| self.text.get(start..end))
            .unwrap_or_default()
    }

    /// Whether a span lies within, between whole characters.
    pub fn contains(&self, span: Span) -> bool {
        let local = |byte: u32| (byte as usize).checked_sub(self.start);
        let ends = local(span.start).zip(local(span.end));
        ends.is_some_and(|(start, end)| self.text.get(start..end).is_some())
    }

    /// What a user wrote of the text, and the position of its first byte.
    pub fn written(&self) -> (&str, usize) {
        let Range { start, .. } = self.written;
        (&self.text[self.written.clone()], self.start + start)
    }

    /// Line and column of a position in what a user wrote, both from 1; columns count characters.
    pub fn line_column(&self, position: u32) -> (usize, usize) {
        let (text, start) = self.written();
        let local = (position as usize).saturating_sub(start);
        let before = text.get(..local).unwrap_or(text);
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        let line = before.bytes().filter(|&byte| byte == b'\n').count() + 1;
        (line, before[line_start..].chars().count() + 1)
    }

    fn end(&self) -> usize {
        self.start + self.text.len()
    }
}

/// All files of one compilation, side by side in one address space.
#[derive(Clone, Debug, Default)]
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

    /// Adds words of a user in a text that was made up around them.
    pub fn add_within(
        &mut self,
        name: impl Into<String>,
        [before, words, after]: [&str; 3],
    ) -> Arc<SourceFile> {
        let written = before.len()..before.len() + words.len();
        let text = [before, words, after].concat();
        self.push_part(name.into(), text, None, written)
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
        let all = 0..text.len();
        self.push_part(name, text, invalid, all)
    }

    fn push_part(
        &mut self,
        name: String,
        text: String,
        invalid: Option<usize>,
        written: Range<usize>,
    ) -> Arc<SourceFile> {
        // One byte between files keeps the end of one apart from the start of the next.
        let start = self.files.last().map_or(0, |file| file.end() + 1);
        let file = Arc::new(SourceFile {
            name,
            text,
            start,
            invalid,
            written,
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
        // What was made up around the words of a user is not there.
        let first = file.start + file.written.start;
        let text = &file.text[file.written.clone()];
        let start = (span.offset().checked_sub(first)).ok_or(MietteError::OutOfBounds)?;
        let end = start + span.len();
        if !text.is_char_boundary(start) || !text.is_char_boundary(end) {
            return Err(MietteError::OutOfBounds);
        }

        // A line that no terminal holds is shown in part.
        let fits = |shown: &Range<usize>| {
            !text[shown.clone()]
                .lines()
                .any(|line| line.len() > LONG_LINE)
        };
        let with_context = lines_around(text, start..end, lines_before, lines_after);
        let alone = lines_around(text, start..end, 0, 0);
        let shown = if (lines_before, lines_after) == (0, 0) {
            start..end
        } else if fits(&with_context) {
            with_context
        } else if fits(&alone) {
            alone
        } else if span.len() <= LONG_LINE {
            part_of_line(text, start..end)
        } else {
            return Err(MietteError::OutOfBounds);
        };
        let before = &text[..shown.start];
        let line_start = line_start(text, shown.start);
        Ok(Box::new(MietteSpanContents::new_named(
            file.name.clone(),
            &text.as_bytes()[shown.clone()],
            (shown.start + first, shown.len()).into(),
            before.bytes().filter(|&byte| byte == b'\n').count(),
            text[line_start..shown.start].chars().count(),
            text[shown].lines().count(),
        )))
    }
}

/// Bytes of a line that diagnostics still show as a whole.
const LONG_LINE: usize = 400;

/// Bytes shown on both sides of what is wrong in a longer line.
const AROUND: usize = 60;

/// A label that can be drawn: one on or over long lines ends early, and one beyond the words of a user where these end.
pub(crate) fn clip(sources: &SourceMap, span: SourceSpan) -> SourceSpan {
    let global = Span::new(span.offset()..span.offset() + span.len());
    let span = match sources.file(global) {
        Some(file) => {
            let [first, last] = [file.written.start, file.written.end].map(|at| file.start + at);
            // Made-up text follows the line break behind the words, which is no place to point at.
            let is_part = file.written.end < file.text.len();
            let words = &file.text[file.written.clone()];
            let behind = last - usize::from(is_part && words.ends_with('\n'));
            let within = |at: usize| at.clamp(first, behind);
            let (start, end) = (within(span.offset()), within(span.offset() + span.len()));
            (start, end - start).into()
        }
        None => span,
    };
    let global = Span::new(span.offset()..span.offset() + span.len());
    let text = sources.text(global);
    if text.len() <= AROUND || !text.lines().any(|line| line.len() > LONG_LINE / 2) {
        return span;
    }
    let first = text.lines().next().unwrap_or_default();
    (span.offset(), boundary(first, AROUND)).into()
}

fn line_start(text: &str, at: usize) -> usize {
    text[..at].rfind('\n').map_or(0, |newline| newline + 1)
}

/// One past the line break that ends the line of `at`.
fn line_end(text: &str, at: usize) -> usize {
    text[at..]
        .find('\n')
        .map_or(text.len(), |newline| at + newline + 1)
}

fn lines_around(text: &str, range: Range<usize>, before: usize, after: usize) -> Range<usize> {
    let mut start = line_start(text, range.start);
    for _ in 0..before {
        start = start.checked_sub(1).map_or(0, |end| line_start(text, end));
    }
    // A range that ends with a line break does not reach into the next line.
    let breaks = range.len() > 1 && text[range.clone()].ends_with('\n');
    let mut end = line_end(text, range.end - usize::from(breaks));
    for _ in 0..after {
        end = line_end(text, end);
    }
    start..end
}

/// What surrounds a range in its line.
fn part_of_line(text: &str, range: Range<usize>) -> Range<usize> {
    let line = line_start(text, range.start)..line_end(text, range.end);
    let start = boundary(text, range.start.saturating_sub(AROUND).max(line.start));
    let end = boundary(text, (range.end + AROUND).min(line.end));
    start..end
}

/// The last boundary of a character that is not behind `at`.
fn boundary(text: &str, at: usize) -> usize {
    let at = at.min(text.len());
    (0..=at)
        .rev()
        .find(|&at| text.is_char_boundary(at))
        .unwrap_or_default()
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

    /// The text that is shown for a range, with its first line and column.
    fn shown(text: &str, range: Range<usize>, lines: usize) -> String {
        let mut map = SourceMap::new();
        map.add("first.nsd", "nothing");
        let file = map.add("a.nsd", text);
        let span = (file.start + range.start, range.len()).into();
        let contents = map.read_span(&span, lines, lines).unwrap();
        let data = String::from_utf8_lossy(contents.data());
        format!("{}:{}:{data}", contents.line(), contents.column())
    }

    #[test]
    fn spans_are_shown_with_their_lines() {
        let text = "a\nθb\nc\nd";
        assert_eq!(shown(text, 4..5, 0), "1:1:b");
        assert_eq!(shown(text, 4..5, 1), "0:0:a\nθb\nc\n");
        assert_eq!(shown(text, 8..9, 1), "2:0:c\nd");
        assert_eq!(shown("", 0..0, 1), "0:0:");
    }

    #[test]
    fn long_lines_are_shown_in_part() {
        let text = format!("first\n{}here{}\nlast", "<".repeat(900), ">".repeat(900));
        let expected = format!("1:840:{}here{}", "<".repeat(60), ">".repeat(60));
        assert_eq!(shown(&text, 906..910, 1), expected);
        assert_eq!(shown(&text, 0..5, 1), "0:0:first\n");
    }

    #[test]
    fn what_is_made_up_around_words_is_not_shown() {
        let mut map = SourceMap::new();
        map.add("first.nsd", "nothing");
        let file = map.add_within("--set", ["with {\n", "k = (2\n", "; }"]);
        let at = |start: usize, len: usize| clip(&map, (file.start + start, len).into());
        let shown = |span: SourceSpan| {
            let contents = map.read_span(&span, 1, 1).unwrap();
            let text = String::from_utf8_lossy(contents.data()).into_owned();
            (contents.line(), contents.column(), text)
        };
        assert_eq!(shown(at(7, 1)), (0, 0, "k = (2\n".to_owned()));
        let behind = at(15, 1);
        let end = SourceSpan::from((file.start + 13, 0));
        assert_eq!(behind, end, "where the words end");
        assert_eq!(shown(behind).2, "k = (2\n");
        assert!(map.read_span(&(file.start + 15, 1).into(), 1, 1).is_err());
    }

    #[test]
    fn wrong_bytes_are_replaced_and_remembered() {
        let mut map = SourceMap::new();
        let file = map.add_bytes("a.nsd", b"ab\xffc".to_vec());
        assert_eq!(file.text, "ab\u{fffd}c");
        assert_eq!(file.invalid, Some(2));
    }
}
