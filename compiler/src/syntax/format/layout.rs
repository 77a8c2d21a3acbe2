//! Blocks and tokens -> lines.

use super::WIDTH;
use super::tree::{Block, EntryKind, Part, Piece};

/// A line of the result.
struct Line {
    blank_before: bool,
    indent: usize,
    text: String,
    /// A comment behind the text.
    comment: Option<String>,
}

/// The text of a file.
pub fn print(file: &Block) -> String {
    let mut lines = Vec::new();
    block(file, 0, &mut lines);
    join(&lines)
}

/// Lays out the entries of a block at a depth of braces.
fn block(block: &Block, depth: usize, lines: &mut Vec<Line>) {
    let indent = 2 * depth;
    let mut first = true;
    for entry in &block.entries {
        let start = lines.len();
        match &entry.kind {
            EntryKind::Comment(text) => lines.push(Line {
                blank_before: false,
                indent,
                text: (*text).to_owned(),
                comment: None,
            }),
            EntryKind::Member { parts, trailing } => {
                member(parts, depth, lines);
                let comment = trailing.map(str::to_owned);
                match lines.last_mut() {
                    Some(line) if line.comment.is_none() => line.comment = comment,
                    // A comment before the end of the member is there already.
                    _ => lines.extend(comment.map(|text| Line {
                        blank_before: false,
                        indent,
                        text,
                        comment: None,
                    })),
                }
            }
        }
        if let Some(line) = lines.get_mut(start) {
            line.blank_before = entry.blank_before && !first;
        }
        first = false;
    }
}

/// Lays out one member, on one line where it was on one and fits.
fn member(parts: &[Part], depth: usize, lines: &mut Vec<Line>) {
    let mut writer = Writer::new(depth);
    if let Some(text) = flat(parts).filter(|text| fits(2 * depth, text)) {
        writer.text = text;
        writer.end_line(lines);
        return;
    }
    for (position, part) in parts.iter().enumerate() {
        match part {
            Part::Piece(piece) => writer.piece(piece, lines),
            Part::Comment { text, own_line } => writer.comment(text, *own_line, lines),
            Part::Block(inner) => writer.block(inner, &parts[position + 1..], lines),
        }
    }
    writer.end_line(lines);
}

fn fits(indent: usize, text: &str) -> bool {
    indent + text.chars().count() <= WIDTH
}

/// The parts on one line, where they stood on one line.
fn flat(parts: &[Part]) -> Option<String> {
    let mut text = String::new();
    let mut last = None;
    for part in parts {
        match part {
            Part::Comment { .. } => return None,
            Part::Piece(piece) if piece.new_line => return None,
            Part::Piece(piece) => {
                push(&mut text, last, piece);
                last = Some(*piece);
            }
            Part::Block(block) => {
                text.push_str(if text.is_empty() { "" } else { " " });
                text.push_str(&flat_block(block)?);
                last = Some(Piece {
                    text: "}",
                    new_line: false,
                    attached: false,
                    binary: false,
                    tight: false,
                });
            }
        }
        // A line that is too long already needs no more work.
        if text.len() > 8 * WIDTH {
            return None;
        }
    }
    Some(text)
}

/// `{ a; b; }`, where the block stood on one line.
fn flat_block(block: &Block) -> Option<String> {
    if block.entries.is_empty() && block.opening.is_none() {
        return Some("{}".to_owned());
    }
    if !block.one_line {
        return None;
    }
    let mut text = String::from("{");
    for entry in &block.entries {
        let EntryKind::Member { parts, .. } = &entry.kind else {
            return None;
        };
        text.push(' ');
        text.push_str(&flat(parts)?);
        if text.len() > 8 * WIDTH {
            return None;
        }
    }
    text.push_str(" }");
    Some(text)
}

/// Adds a token behind another one; a number gets digits on both sides of its point.
fn push(text: &mut String, last: Option<Piece>, piece: &Piece) {
    if last.is_some_and(|last| spaced(&last, piece)) {
        text.push(' ');
    }
    let starts = |text: &str| text.starts_with(|c: char| c.is_ascii_digit());
    match piece.text.split_once('.') {
        // `1.*x` would be another operator than `1. * x`.
        Some((whole, rest)) if starts(whole) && !starts(rest) => {
            text.push_str(&format!("{whole}.0{rest}"));
        }
        Some(("", rest)) if starts(rest) => text.push_str(&format!("0.{rest}")),
        _ => text.push_str(piece.text),
    }
}

/// Whether a blank stands between two tokens.
fn spaced(left: &Piece, right: &Piece) -> bool {
    let opens = |piece: &Piece| matches!(piece.text, "(" | "[" | "{");
    let is_tight = |piece: &Piece| match piece.text {
        "+" | "-" => piece.tight,
        "*" | "/" | "^" | ".*" | "./" | ".^" | ".." | "." => true,
        _ => false,
    };
    let is_unary = left.text == "-" && !left.binary;
    let closes = matches!(right.text, ")" | "]" | "}" | "," | ";" | "'");
    !(opens(left) || closes || right.attached || is_unary || is_tight(left) || is_tight(right))
}

/// The lines of one member under construction.
struct Writer<'t> {
    depth: usize,
    /// Open parentheses and brackets.
    brackets: usize,
    indent: usize,
    text: String,
    comment: Option<String>,
    last: Option<Piece<'t>>,
    /// Whether what comes next starts a line whatever it is.
    broken: bool,
}

impl<'t> Writer<'t> {
    fn new(depth: usize) -> Self {
        Writer {
            depth,
            brackets: 0,
            indent: 2 * depth,
            text: String::new(),
            comment: None,
            last: None,
            broken: false,
        }
    }

    fn end_line(&mut self, lines: &mut Vec<Line>) {
        self.broken = false;
        if self.text.is_empty() && self.comment.is_none() {
            return;
        }
        lines.push(Line {
            blank_before: false,
            indent: self.indent,
            text: std::mem::take(&mut self.text),
            comment: self.comment.take(),
        });
        self.last = None;
    }

    /// Starts a line inside the member; a closing bracket stands where its line began.
    fn continue_line(&mut self, closing: bool, lines: &mut Vec<Line>) {
        self.end_line(lines);
        let level = match closing {
            true => self.brackets,
            false => self.brackets.max(1),
        };
        self.indent = 2 * (self.depth + level);
    }

    fn piece(&mut self, piece: &Piece<'t>, lines: &mut Vec<Line>) {
        let closing = matches!(piece.text, ")" | "]" | "}");
        if closing {
            self.brackets = self.brackets.saturating_sub(1);
        }
        // What ends a piece of text stays with it, before a comment if need be.
        let sticks = matches!(piece.text, ";" | ",") && !self.text.is_empty();
        let breaks = piece.new_line || self.comment.is_some() || self.broken;
        if breaks && !sticks {
            self.continue_line(closing, lines);
        }
        push(&mut self.text, self.last, piece);
        self.last = Some(*piece);
        if matches!(piece.text, "(" | "[" | "{") {
            self.brackets += 1;
        }
    }

    fn comment(&mut self, text: &str, own_line: bool, lines: &mut Vec<Line>) {
        if own_line || self.comment.is_some() || self.text.is_empty() {
            self.continue_line(false, lines);
            self.text = text.to_owned();
            self.end_line(lines);
            self.broken = true;
            self.continue_line(false, lines);
        } else {
            self.comment = Some(text.to_owned());
        }
    }

    /// A block, followed by the rest of its member.
    fn block(&mut self, inner: &Block, rest: &[Part], lines: &mut Vec<Line>) {
        if !self.text.is_empty() {
            self.text.push(' ');
        }
        let tail = flat(rest).unwrap_or_default();
        let one_line = flat_block(inner).filter(|_| self.comment.is_none());
        let one_line = one_line.filter(|text| {
            fits(
                self.indent,
                format!("{}{text} {tail}", self.text).trim_end(),
            )
        });
        match one_line {
            Some(text) => self.text.push_str(&text),
            None => {
                self.text.push('{');
                let mut opening = inner.opening;
                if self.comment.is_none() {
                    self.comment = opening.take().map(str::to_owned);
                }
                self.end_line(lines);
                if let Some(text) = opening {
                    lines.push(Line {
                        blank_before: false,
                        indent: 2 * (self.depth + 1),
                        text: text.to_owned(),
                        comment: None,
                    });
                }
                block(inner, self.depth + 1, lines);
                self.indent = 2 * self.depth;
                self.text.push('}');
            }
        }
        self.last = Some(Piece {
            text: "}",
            new_line: false,
            attached: false,
            binary: false,
            tight: false,
        });
    }
}

/// Columns up to which a line takes part in the alignment of comments.
const ALIGNED: usize = 80;

/// Lines to text; comments behind neighbouring lines are aligned.
fn join(lines: &[Line]) -> String {
    let width = |line: &Line| line.indent + line.text.chars().count();
    let mut text = String::new();
    let mut column = 0;
    for (position, line) in lines.iter().enumerate() {
        if line.blank_before {
            text.push('\n');
        }
        let indent = line.indent;
        text.push_str(&format!("{:indent$}{}", "", line.text));
        if let Some(comment) = &line.comment {
            let before = position.checked_sub(1).and_then(|before| lines.get(before));
            let goes_on =
                !line.blank_before && before.is_some_and(|before| before.comment.is_some());
            if !goes_on {
                let run = lines[position..].iter().enumerate();
                let run = run.take_while(|(offset, line)| {
                    line.comment.is_some() && (*offset == 0 || !line.blank_before)
                });
                column = run
                    .map(|(_, line)| width(line))
                    .filter(|width| *width <= ALIGNED)
                    .max()
                    .unwrap_or(0);
            }
            let gap = column.saturating_sub(width(line)) + 2;
            text.push_str(&format!("{:gap$}{comment}", ""));
        }
        text.push('\n');
    }
    text
}
