//! What changed from one text to another, line by line.

use similar::{ChangeTag, TextDiff};

/// Lines around a change that did not.
const CONTEXT: usize = 2;
/// Lines that are shown at most.
const MOST: usize = 60;

/// Lines that are gone with `-`, new ones with `+`, and some around them; none where the texts are the same.
///
/// Ends of lines may be those of any system, and the last line may have none.
pub fn lines(before: &str, now: &str) -> Vec<String> {
    let (before, now) = (unified(before), unified(now));
    let diff = TextDiff::from_lines(&before, &now);
    let mut shown = Vec::new();
    for (number, group) in diff.grouped_ops(CONTEXT).iter().enumerate() {
        if number > 0 {
            shown.push("  ..".to_owned());
        }
        for change in group.iter().flat_map(|op| diff.iter_changes(op)) {
            let sign = match change.tag() {
                ChangeTag::Delete => '-',
                ChangeTag::Insert => '+',
                ChangeTag::Equal => ' ',
            };
            let line = format!("{sign} {}", change.value());
            shown.push(line.trim_end().to_owned());
        }
    }
    let more = shown.len().saturating_sub(MOST);
    if more > 1 {
        shown.truncate(MOST);
        shown.push(format!("  .. and {more} lines more"));
    }
    shown
}

/// A text with a line feed behind every line.
fn unified(text: &str) -> String {
    let lines = text.trim_end().lines();
    lines.map(|line| format!("{}\n", line.trim_end())).collect()
}

#[cfg(test)]
mod tests {
    use insta::assert_snapshot;

    use super::lines;

    #[test]
    fn ends_of_lines_are_no_difference() {
        assert!(lines("a\r\nb\r\n", "a\nb").is_empty());
        assert!(lines("", "").is_empty());
    }

    #[test]
    fn changes_stand_between_lines_that_stay() {
        let before = "a\nb\nc\nd\ne\nf\ng\nh\ni\n";
        let now = "a\nb\nC\nd\ne\nf\ng\nh\n";
        assert_snapshot!(lines(before, now).join("\n"), @r"
          a
          b
        - c
        + C
          d
          e
          ..
          g
          h
        - i
        ");
    }

    #[test]
    fn a_long_difference_is_cut() {
        let now: String = (0..100).map(|line| format!("{line}\n")).collect();
        let shown = lines("", &now);
        assert_eq!(shown.len(), 61);
        assert_eq!(shown[60], "  .. and 40 lines more");
    }
}
