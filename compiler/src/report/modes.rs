//! Modes in few words, for tables and legends.

use super::{Event, History, ModeInterval, Side};

/// Names that are listed before the rest is counted.
const MAX_NAMES: usize = 4;

impl Side {
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

impl History {
    /// The mode in at most about `length` characters: where it has many switches, regions and
    /// sliding surfaces are named and the others counted, but for as many as tell it from other modes of the run that
    /// count the same.
    pub fn short_mode(&self, interval: &ModeInterval, length: usize) -> String {
        if interval.mode.chars().count() <= length {
            return interval.mode.clone();
        }
        let mut text = self.counted(interval);
        let is_twin =
            |other: &&ModeInterval| other.mode != interval.mode && self.counted(other) == text;
        let mut twins: Vec<_> = self.modes.iter().filter(is_twin).collect();
        for (i, (name, side)) in self.switches.iter().zip(&interval.sides).enumerate() {
            if twins.iter().any(|twin| twin.sides[i] != *side) {
                text += &format!(", {}({name})", side.as_str());
                twins.retain(|twin| twin.sides[i] == *side);
            }
        }
        text
    }

    /// Regions and sliding surfaces by their names, others by their numbers.
    fn counted(&self, interval: &ModeInterval) -> String {
        let on = |side: Side| {
            let pairs = self.switches.iter().zip(&interval.sides);
            pairs
                .filter(move |(_, own)| **own == side)
                .map(|(name, _)| name.as_str())
        };
        let mut words: Vec<String> = interval.regions.clone();
        let sliding: Vec<&str> = on(Side::Sliding).collect();
        match sliding.len() {
            0 => {}
            n if n > MAX_NAMES => words.push(format!("{n} sliding")),
            _ => words.push(format!("sliding({})", sliding.join(", "))),
        }
        for side in [
            Side::Below,
            Side::Above,
            Side::Off,
            Side::On,
            Side::Open,
            Side::Closed,
            Side::Stick,
            Side::Slip,
            Side::Inactive,
            Side::Active,
        ] {
            match on(side).count() {
                0 => {}
                n => words.push(format!("{n} {}", side.as_str())),
            }
        }
        words.join(", ")
    }

    /// What changes at an event: the mode where it is short, else the side of the surface.
    pub fn change(&self, event: &Event, length: usize) -> String {
        if event.from == event.to {
            return self.shortened(&event.to, length);
        }
        let whole = format!("{} -> {}", event.from, event.to);
        if whole.chars().count() <= length {
            return whole;
        }
        let sides = || {
            let switch = self
                .switches
                .iter()
                .position(|name| *name == event.surface)?;
            let after = self
                .modes
                .iter()
                .position(|mode| mode.from == event.time && mode.mode == event.to)?;
            let before = self.modes.get(after.checked_sub(1)?)?;
            Some((
                before.sides.get(switch)?,
                self.modes[after].sides.get(switch)?,
            ))
        };
        match sides() {
            Some((before, after)) => format!("{} -> {}", before.as_str(), after.as_str()),
            None => self.shortened(&event.to, length),
        }
    }

    /// A mode by its name in few words.
    fn shortened(&self, mode: &str, length: usize) -> String {
        match self.modes.iter().find(|interval| interval.mode == mode) {
            Some(interval) => self.short_mode(interval, length),
            None => mode.to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::report::{ModeInterval, Side, sample};

    #[test]
    fn many_switches_are_counted() {
        let mut trajectory = sample::oscillator();
        trajectory.history.switches = (1..=8).map(|k| format!("s[{k}]")).collect();
        let mut interval = ModeInterval {
            mode: "above(s[1]), and so on".into(),
            regions: vec!["inside".into()],
            sides: vec![Side::Above; 8],
            ..trajectory.history.modes[0].clone()
        };
        interval.sides[2] = Side::Sliding;
        interval.sides[3] = Side::Below;
        let short = |interval: &ModeInterval| trajectory.history.short_mode(interval, 10);
        insta::assert_snapshot!(short(&interval), @"inside, sliding(s[3]), 1 below, 6 above");
        interval.sides = vec![Side::Sliding; 8];
        insta::assert_snapshot!(short(&interval), @"inside, 8 sliding");
        assert_eq!(trajectory.history.short_mode(&interval, 30), interval.mode);
    }

    #[test]
    fn modes_that_count_the_same_are_told_apart() {
        let mut trajectory = sample::oscillator();
        trajectory.history.switches = ["x", "y", "z"].map(str::to_owned).into();
        let mode = |name: &str, sides: [Side; 3]| ModeInterval {
            mode: name.into(),
            regions: Vec::new(),
            sides: sides.into(),
            ..trajectory.history.modes[0].clone()
        };
        let (above, below) = (Side::Above, Side::Below);
        let modes = vec![
            mode("above(x), below(y), above(z)", [above, below, above]),
            mode("below(x), above(y), above(z)", [below, above, above]),
            mode("below(x), below(y), above(z)", [below, below, above]),
        ];
        trajectory.history.modes = modes;
        let short: Vec<String> = (trajectory.history.modes.iter())
            .map(|interval| trajectory.history.short_mode(interval, 10))
            .collect();
        insta::assert_snapshot!(short.join("\n"), @r"
        1 below, 2 above, above(x)
        1 below, 2 above, below(x)
        2 below, 1 above
        ");
    }

    #[test]
    fn a_change_of_many_switches_is_told_by_its_surface() {
        let trajectory = sample::oscillator();
        let event = &trajectory.history.events[0];
        assert_eq!(trajectory.history.change(event, 40), "inside -> outside");
        assert_eq!(trajectory.history.change(event, 10), "below -> above");
    }
}
