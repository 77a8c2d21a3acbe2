//! Letters, integers and numbers of a file, as text or in binary form.

use super::{Error, Fault, Place};

/// Reads a file from its start.
#[derive(Clone, Debug)]
pub(crate) struct Scanner<'f> {
    bytes: &'f [u8],
    at: usize,
    binary: bool,
    /// What is left of the present line of a text.
    line: &'f [u8],
    line_number: usize,
}

type Result<T> = std::result::Result<T, Error>;

impl<'f> Scanner<'f> {
    pub(crate) fn new(bytes: &'f [u8]) -> Self {
        Scanner {
            bytes,
            at: 0,
            binary: false,
            line: &[],
            line_number: 0,
        }
    }

    /// Goes on in binary form.
    pub(crate) fn set_binary(&mut self) {
        self.binary = true;
    }

    /// How long the file is.
    pub(crate) fn length(&self) -> usize {
        self.bytes.len()
    }

    pub(crate) fn place(&self) -> Place {
        match self.binary {
            true => Place::Byte(self.at),
            false => Place::Line(self.line_number),
        }
    }

    pub(crate) fn error<T>(&self, fault: Fault) -> Result<T> {
        let place = self.place();
        Err(Error { place, fault })
    }

    /// Takes the next line of a text, without its comment.
    pub(crate) fn next_line(&mut self) -> Option<&'f [u8]> {
        let rest = &self.bytes[self.at..];
        if rest.is_empty() {
            return None;
        }
        let length = rest.iter().position(|&byte| byte == b'\n');
        let line = &rest[..length.unwrap_or(rest.len())];
        self.at += length.map_or(rest.len(), |length| length + 1);
        self.line_number += 1;
        let comment = line.iter().position(|&byte| byte == b'#');
        Some(line[..comment.unwrap_or(line.len())].trim_ascii())
    }

    /// The letter that a segment or an operand starts with; `None` at the end of the file.
    pub(crate) fn letter(&mut self) -> Option<u8> {
        if self.binary {
            let letter = *self.bytes.get(self.at)?;
            self.at += 1;
            return Some(letter);
        }
        loop {
            if let Some((&letter, rest)) = self.next_line()?.split_first() {
                self.line = rest;
                return Some(letter);
            }
        }
    }

    /// Starts a line of numbers.
    pub(crate) fn row(&mut self, expected: &'static str) -> Result<()> {
        while !self.binary {
            match self.next_line() {
                Some([]) => {}
                Some(line) => {
                    self.line = line;
                    break;
                }
                None => return self.error(Fault::End(expected)),
            }
        }
        Ok(())
    }

    /// The next word of the present line.
    fn word(&mut self, expected: &'static str) -> Result<&'f [u8]> {
        let line = self.line.trim_ascii_start();
        let end = line.iter().position(u8::is_ascii_whitespace);
        let (word, rest) = line.split_at(end.unwrap_or(line.len()));
        self.line = rest;
        if word.is_empty() {
            return self.error(Fault::Unexpected {
                expected,
                found: "the end of the line".to_owned(),
            });
        }
        Ok(word)
    }

    fn take<const N: usize>(&mut self, expected: &'static str) -> Result<[u8; N]> {
        match self.bytes[self.at..].first_chunk() {
            Some(&chunk) => {
                self.at += N;
                Ok(chunk)
            }
            None => self.error(Fault::End(expected)),
        }
    }

    fn parse<T: std::str::FromStr>(&mut self, expected: &'static str) -> Result<T> {
        let word = self.word(expected)?;
        let parsed = std::str::from_utf8(word)
            .ok()
            .and_then(|word| word.parse().ok());
        match parsed {
            Some(value) => Ok(value),
            None => self.error(Fault::Unexpected {
                expected,
                found: shown(word),
            }),
        }
    }

    /// An integer.
    pub(crate) fn integer(&mut self, expected: &'static str) -> Result<i64> {
        match self.binary {
            true => Ok(i32::from_le_bytes(self.take(expected)?).into()),
            false => self.parse(expected),
        }
    }

    /// A short integer.
    pub(crate) fn short(&mut self, expected: &'static str) -> Result<i64> {
        match self.binary {
            true => Ok(i16::from_le_bytes(self.take(expected)?).into()),
            false => self.parse(expected),
        }
    }

    /// A number that is one.
    pub(crate) fn number(&mut self, expected: &'static str) -> Result<f64> {
        let number = match self.binary {
            true => f64::from_le_bytes(self.take(expected)?),
            false => self.parse(expected)?,
        };
        match number.is_nan() {
            true => self.error(Fault::NaN(expected)),
            false => Ok(number),
        }
    }

    /// One letter within a line.
    pub(crate) fn digit(&mut self, expected: &'static str) -> Result<i64> {
        match self.binary {
            true => Ok(i64::from(self.take::<1>(expected)?[0]) - i64::from(b'0')),
            false => self.parse(expected),
        }
    }

    /// A name.
    pub(crate) fn name(&mut self, expected: &'static str) -> Result<String> {
        if !self.binary {
            return self.word(expected).map(shown);
        }
        let length = self.integer(expected)?;
        let rest = &self.bytes[self.at..];
        match usize::try_from(length)
            .ok()
            .and_then(|length| rest.get(..length))
        {
            Some(name) => {
                self.at += name.len();
                Ok(shown(name))
            }
            None => self.error(Fault::End(expected)),
        }
    }

    /// A number from 0 to `count` - 1.
    pub(crate) fn index(&mut self, what: &'static str, count: usize) -> Result<usize> {
        let number = self.integer(what)?;
        self.within(what, number, count)
    }

    /// Checks a number from 0 to `count` - 1.
    pub(crate) fn within(&self, what: &'static str, number: i64, count: usize) -> Result<usize> {
        match usize::try_from(number) {
            Ok(index) if index < count => Ok(index),
            _ => self.error(Fault::Range {
                what,
                number,
                count,
            }),
        }
    }
}

/// Bytes for a message: what is not text or too long is left out.
fn shown(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let visible = text.chars().filter(|c| !c.is_control());
    visible.take(40).collect()
}
