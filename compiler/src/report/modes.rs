//! Modes in few words, for tables and legends.
//!
//! A mode is a list of words: regions, and what each switch does. Words of every mode of a run tell nothing and are left
//! out; no two modes have the same text.

use rustc_hash::FxHashSet;

use super::{Event, History, Side};

/// Switches on one side that are named before they are counted.
const MAX_NAMES: usize = 4;
/// How many times the length is taken by names before switches are counted.
const MAX_LINES: usize = 3;

impl Side {
    /// All of them.
    const ALL: [Side; 11] = [
        Side::Below,
        Side::Sliding,
        Side::Above,
        Side::Off,
        Side::On,
        Side::Open,
        Side::Closed,
        Side::Stick,
        Side::Slip,
        Side::Inactive,
        Side::Active,
    ];

    /// The word of the language.
    pub fn as_str(self) -> &'static str {
        match self {
            Side::Below => "below",
            Side::Sliding => "sliding",
            Side::Above => "above",
            Side::Off => "off",
            Side::On => "on",
            Side::Open => "open",
            Side::Closed => "closed",
            Side::Stick => "stick",
            Side::Slip => "slip",
            Side::Inactive => "inactive",
            Side::Active => "active",
        }
    }
}

/// How the modes of a run are told.
pub struct ModeTexts<'h> {
    history: &'h History,
    /// The modes, each once.
    modes: Vec<Vec<&'h str>>,
    /// Words of all of them.
    common: FxHashSet<&'h str>,
    /// About how many characters a text has.
    length: usize,
}

impl History {
    /// The text of a surface in figures and tables.
    pub fn surface<'h>(&'h self, name: &'h str) -> &'h str {
        self.aliases.get(name).map_or(name, String::as_str)
    }
}

impl<'h> ModeTexts<'h> {
    /// The modes of a run, in about `length` characters.
    pub fn new(history: &'h History, length: usize) -> Self {
        let mut seen = FxHashSet::default();
        let modes = history.modes.iter().map(|interval| interval.mode.as_str());
        let modes: Vec<_> = modes.filter(|mode| seen.insert(*mode)).map(words).collect();
        let mut common = FxHashSet::default();
        if let [first, others @ ..] = &modes[..]
            && !others.is_empty()
        {
            let is_common = |word: &&&str| others.iter().all(|mode| mode.contains(word));
            common.extend(first.iter().filter(is_common).copied());
        }
        ModeTexts {
            history,
            modes,
            common,
            length,
        }
    }

    /// What tells a mode from the others of the run.
    pub fn text(&self, mode: &'h str) -> String {
        let all = words(mode);
        let telling = |word: &&&str| !self.common.contains(**word);
        let own: Vec<&str> = all.iter().filter(telling).copied().collect();
        let own = if own.is_empty() { all } else { own };
        if let Some(text) = self.named(&own) {
            return text;
        }
        let mut text = self.counted(&own);
        let is_twin = |other: &&Vec<&str>| {
            let other: Vec<&str> = other.iter().filter(telling).copied().collect();
            own != other && self.counted(&other) == text
        };
        let mut twins: Vec<_> = self.modes.iter().filter(is_twin).collect();
        for word in &own {
            if twins.iter().any(|twin| !twin.contains(word)) {
                text += &format!(", {}", self.told(word));
                twins.retain(|twin| twin.contains(word));
            }
        }
        text
    }

    /// What changes at an event: the words that end there, and those that begin, where these are many, those of its
    /// surface; nothing where the mode stays.
    pub fn change(&self, event: &Event) -> String {
        let [from, to] = [&event.from, &event.to].map(|mode| words(mode));
        if from == to {
            return String::new();
        }
        let text = |is_told: &dyn Fn(&str) -> bool| {
            let text = |own: &[&str], other: &[&str]| {
                let own = own
                    .iter()
                    .filter(|word| !other.contains(word) && is_told(word));
                let own: Vec<&str> = own.copied().collect();
                self.named(&own).unwrap_or_else(|| self.counted(&own))
            };
            let [from, to] = [text(&from, &to), text(&to, &from)];
            match from.is_empty() {
                true => to,
                false => format!("{from} -> {to}"),
            }
        };
        let whole = text(&|_| true);
        let of_surface = text(&|word| parsed(word).is_some_and(|(_, name)| name == event.surface));
        match whole.chars().count() <= 2 * self.length || of_surface.is_empty() {
            true => whole,
            false => of_surface,
        }
    }

    /// All words, those of one kind together where that is shorter; none where it is too long.
    fn named(&self, own: &[&str]) -> Option<String> {
        let told: Vec<String> = own.iter().map(|word| self.told(word)).collect();
        let text = told.join(", ");
        if text.chars().count() <= self.length {
            return Some(text);
        }
        let text = self.grouped(own);
        (text.chars().count() <= MAX_LINES * self.length).then_some(text)
    }

    /// All words, those of one kind together: `above(a, c)`.
    fn grouped(&self, words: &[&str]) -> String {
        let told: Vec<String> = words.iter().map(|word| self.told(word)).collect();
        let told: Vec<&str> = told.iter().map(String::as_str).collect();
        let text = |(kind, words): (Option<&str>, Vec<&str>)| match kind {
            Some(kind) => {
                let names = words.iter().filter_map(|word| Some(parsed(word)?.1));
                format!("{kind}({})", names.collect::<Vec<_>>().join(", "))
            }
            None => words.join(", "),
        };
        let texts: Vec<String> = by_kind(&told).into_iter().map(text).collect();
        texts.join(", ")
    }

    /// The words of a mode with many switches: a few of one kind, and numbers of others.
    fn counted(&self, words: &[&str]) -> String {
        let text = |(kind, words): (Option<&str>, Vec<&str>)| match kind {
            Some(kind) if words.len() > MAX_NAMES => format!("{} {kind}", words.len()),
            _ => self.grouped(&words),
        };
        let texts: Vec<String> = by_kind(words).into_iter().map(text).collect();
        texts.join(", ")
    }

    /// `above(x - b)`, as `x above b` where a kink has its words for people.
    fn told(&self, word: &str) -> String {
        let own = parsed(word).and_then(|(kind, name)| {
            let alias = self.history.aliases.get(name)?;
            Some((kind, alias, halves(alias)))
        });
        match own {
            Some((kind @ ("above" | "below"), _, Some((left, right)))) => {
                format!("{left} {kind} {right}")
            }
            Some((kind, alias, _)) => format!("{kind}({alias})"),
            None => word.to_owned(),
        }
    }
}

/// Words by what they say of a switch; of regions, and of kinks in their own words, it is nothing.
fn by_kind<'w>(words: &[&'w str]) -> Vec<(Option<&'w str>, Vec<&'w str>)> {
    let mut groups: Vec<(Option<&str>, Vec<&str>)> = Vec::new();
    for word in words {
        let kind = parsed(word).map(|(kind, _)| kind);
        match groups.iter_mut().find(|(other, _)| *other == kind) {
            Some((_, words)) => words.push(word),
            None => groups.push((kind, vec![word])),
        }
    }
    groups
}

/// `above` and `x` of `above(x)`.
fn parsed(word: &str) -> Option<(&str, &str)> {
    let (kind, name) = word.strip_suffix(')')?.split_once('(')?;
    Side::ALL
        .iter()
        .any(|side| side.as_str() == kind)
        .then_some((kind, name))
}

/// The words of a mode, which may hold commas in brackets.
fn words(mode: &str) -> Vec<&str> {
    let commas = outside(mode).filter(|(_, rest)| rest.starts_with(", "));
    let mut start = 0;
    let mut words = Vec::new();
    for (at, _) in commas {
        words.push(&mode[start..at]);
        start = at + 2;
    }
    words.push(&mode[start..]);
    words
}

/// `x` and `b` of `x - b`, `x` and `-b` of `x + b`.
fn halves(name: &str) -> Option<(&str, String)> {
    let is_sign = |(_, rest): &(usize, &str)| rest.starts_with(" - ") || rest.starts_with(" + ");
    let (at, rest) = outside(name).filter(is_sign).last()?;
    let sign = if rest.starts_with(" + ") { "-" } else { "" };
    Some((&name[..at], format!("{sign}{}", &rest[3..])))
}

/// The places of a text outside of brackets, with what follows.
fn outside(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut depth = 0;
    text.char_indices().filter_map(move |(at, c)| {
        match c {
            '(' | '[' | '{' => depth += 1,
            ')' | ']' | '}' => depth -= 1,
            _ => {}
        }
        (depth == 0).then(|| (at, &text[at..]))
    })
}

#[cfg(test)]
mod tests {
    use rustc_hash::FxHashMap;

    use super::ModeTexts;
    use crate::report::{Event, History, ModeInterval, sample};

    fn history(modes: &[&str]) -> History {
        let mut history = sample::oscillator().history;
        let interval = |mode: &&str| ModeInterval {
            mode: (*mode).to_owned(),
            ..history.modes[0].clone()
        };
        history.modes = modes.iter().map(interval).collect();
        history
    }

    fn texts(history: &History, length: usize) -> String {
        let texts = ModeTexts::new(history, length);
        let modes = history.modes.iter().map(|mode| texts.text(&mode.mode));
        modes.collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn what_does_not_change_is_left_out() {
        let run = history(&[
            "inside, above(dot(x, y)), on(r)",
            "inside, below(dot(x, y)), on(r)",
        ]);
        insta::assert_snapshot!(texts(&run, 40), @r"
        above(dot(x, y))
        below(dot(x, y))
        ");
        let run = history(&["inside, above(x)", "above(x)"]);
        insta::assert_snapshot!(texts(&run, 40), @r"
        inside
        above(x)
        ");
        insta::assert_snapshot!(texts(&history(&["open(a), closed(b)"]), 9), @"open(a), closed(b)");
    }

    #[test]
    fn kinks_have_words_and_switches_of_one_kind_stand_together() {
        let mut run = history(&[
            "above(u - hi), above(u - lo), on(r)",
            "below(u - hi), above(u - lo), on(s)",
        ]);
        let aliases = [
            ("u - hi", "law[1, 2] - c.y - c.hi"),
            ("u - lo", "law[1, 2] + 1"),
        ];
        run.aliases = aliases
            .map(|(name, words)| (name.to_owned(), words.to_owned()))
            .into_iter()
            .collect::<FxHashMap<_, _>>()
            .into();
        insta::assert_snapshot!(texts(&run, 40), @r"
        law[1, 2] - c.y above c.hi, on(r)
        law[1, 2] - c.y below c.hi, on(s)
        ");
        assert_eq!(run.surface("u - lo"), "law[1, 2] + 1");
        let run = history(&[
            "above(a), below(b), above(c)",
            "below(a), above(b), below(c)",
        ]);
        insta::assert_snapshot!(texts(&run, 20), @r"
        above(a, c), below(b)
        below(a, c), above(b)
        ");
    }

    #[test]
    fn modes_that_count_the_same_are_told_apart() {
        let mode = |above: usize| {
            let word = |k: usize| {
                if k == above {
                    format!("above(s[{k}])")
                } else {
                    format!("below(s[{k}])")
                }
            };
            (1..=8).map(word).collect::<Vec<_>>().join(", ")
        };
        let modes = [mode(2), mode(5)];
        let mut run = history(&modes.each_ref().map(String::as_str));
        run.modes[1].mode = run.modes[1].mode.replace("below(s[6])", "above(s[6])");
        run.modes.extend(history(&[&mode(6), "inside"]).modes);
        insta::assert_snapshot!(texts(&run, 10), @r"
        7 below, above(s[2])
        6 below, above(s[5], s[6])
        7 below, above(s[6])
        inside
        ");
    }

    #[test]
    fn a_change_is_told_by_the_words_that_change() {
        let mut run = history(&["above(x), open(a)", "above(x), closed(a)"]);
        let event = |from: &str, to: &str| Event {
            from: from.into(),
            to: to.into(),
            ..sample::oscillator().history.events[0].clone()
        };
        run.events = vec![
            event("above(x), open(a)", "above(x), closed(a)"),
            event("above(x), open(a)", "above(x), open(a)"),
            event("above(c), above(x)", "below(c), below(x)"),
        ];
        let texts = ModeTexts::new(&run, 40);
        assert_eq!(texts.change(&run.events[0]), "open(a) -> closed(a)");
        assert_eq!(texts.change(&run.events[1]), "");
        let change = |length| ModeTexts::new(&run, length).change(&run.events[2]);
        assert_eq!(change(40), "above(c), above(x) -> below(c), below(x)");
        assert_eq!(change(10), "above(c) -> below(c)");
    }
}
