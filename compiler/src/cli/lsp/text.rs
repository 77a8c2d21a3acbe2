//! Positions of the protocol, lines and UTF-16 units from 0, in texts that are counted in bytes; names of files as URIs.

use std::borrow::Cow;
use std::ops::Range;
use std::path::{Path, PathBuf};

use lsp_types::{Position, Uri};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, percent_decode_str, utf8_percent_encode};

/// What does not stand in the path of a URI as it is (RFC 3986, 2.3).
const ENCODED: &AsciiSet = &NON_ALPHANUMERIC
    .remove(b'-')
    .remove(b'.')
    .remove(b'_')
    .remove(b'~')
    .remove(b'/');

/// A text with its lines.
#[derive(Clone, Debug)]
pub struct Lines<'t> {
    text: &'t str,
    /// The first byte of each line.
    starts: Cow<'t, [usize]>,
}

/// The first bytes of the lines of a text, which end with `\n`, `\r\n` or `\r`.
pub fn starts(text: &str) -> Vec<usize> {
    let bytes = text.as_bytes();
    let ends = (0..bytes.len()).filter(|&at| match bytes[at] {
        b'\n' => true,
        b'\r' => bytes.get(at + 1) != Some(&b'\n'),
        _ => false,
    });
    std::iter::once(0).chain(ends.map(|at| at + 1)).collect()
}

impl<'t> Lines<'t> {
    /// The lines of a text.
    pub fn new(text: &'t str) -> Self {
        let starts = Cow::Owned(starts(text));
        Lines { text, starts }
    }

    /// The same where it is known how they start.
    pub fn known(text: &'t str, starts: &'t [usize]) -> Self {
        let starts = Cow::Borrowed(starts);
        Lines { text, starts }
    }

    /// The position of a byte.
    pub fn position(&self, byte: usize) -> Position {
        let byte = byte.min(self.text.len());
        let line = self.starts.partition_point(|&start| start <= byte) - 1;
        let before = self.text.get(self.starts[line]..byte).unwrap_or_default();
        let units = match before.is_ascii() {
            true => before.len(),
            false => before.encode_utf16().count(),
        };
        Position::new(number(line), number(units))
    }

    /// The byte at a position; behind the end of a line its end, inside of a character its start.
    pub fn byte(&self, position: Position) -> usize {
        let line = position.line as usize;
        let Some(&start) = self.starts.get(line) else {
            return self.text.len();
        };
        let end = self.starts.get(line + 1).copied();
        let whole = &self.text[start..end.unwrap_or(self.text.len())];
        let line = whole.trim_end_matches(['\n', '\r']);
        let mut units = 0;
        for (at, c) in line.char_indices() {
            units += c.len_utf16();
            if units > position.character as usize {
                return start + at;
            }
        }
        start + line.len()
    }

    /// The positions of the ends of a range of bytes.
    pub fn range(&self, range: Range<usize>) -> lsp_types::Range {
        lsp_types::Range::new(self.position(range.start), self.position(range.end))
    }

    /// The bytes between positions.
    pub fn bytes(&self, range: lsp_types::Range) -> Range<usize> {
        let (start, end) = (self.byte(range.start), self.byte(range.end));
        start.min(end)..end.max(start)
    }
}

/// A number of the protocol.
pub fn number(count: usize) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}

/// The path of a file; of what is no file, its URI.
pub fn path_of(uri: &Uri) -> PathBuf {
    let text = uri.as_str();
    let Some(path) = text.strip_prefix("file://") else {
        return PathBuf::from(text);
    };
    // Behind the name of a host, which is empty.
    let path = &path[path.find('/').unwrap_or(path.len())..];
    let path = percent_decode_str(path).decode_utf8_lossy();
    // `/c:/models` is `c:/models` where folders have drives.
    match path.strip_prefix('/') {
        Some(drive) if cfg!(windows) => PathBuf::from(drive),
        _ => PathBuf::from(&*path),
    }
}

/// The URI of a path, or of what was one.
pub fn uri_of(path: &Path) -> Option<Uri> {
    let text = path.to_string_lossy();
    let is_uri = text
        .split_once(':')
        .is_some_and(|(scheme, _)| scheme.len() > 1)
        && !path.is_absolute();
    if is_uri {
        return text.parse().ok();
    }
    let text = text.replace('\\', "/");
    let mut uri = String::from("file://");
    if !text.starts_with('/') {
        uri.push('/');
    }
    uri.extend(utf8_percent_encode(&text, ENCODED));
    uri.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_units_of_utf_16() {
        let text = "θ = 𝛼;\r\nx\ry";
        let lines = Lines::new(text);
        let at = |line, column| lines.byte(Position::new(line, column));
        assert_eq!(lines.position(text.find(';').unwrap()), Position::new(0, 6));
        assert_eq!(
            [at(0, 0), at(0, 1), at(0, 4), at(0, 5), at(0, 6)],
            [0, 2, 5, 5, 9]
        );
        assert_eq!(
            [at(0, 99), at(1, 0), at(1, 9), at(2, 0), at(9, 0)],
            [10, 12, 13, 14, 15]
        );
        for (byte, _) in text.char_indices().filter(|(_, c)| !c.is_control()) {
            assert_eq!(lines.byte(lines.position(byte)), byte);
        }
    }

    #[test]
    fn paths_are_uris_and_back() {
        for path in ["/models/ball.nsd", "/a b/θ%.nsd", "untitled:Untitled-1"] {
            let uri = uri_of(Path::new(path)).unwrap();
            assert_eq!(path_of(&uri), Path::new(path), "{}", uri.as_str());
        }
    }
}
