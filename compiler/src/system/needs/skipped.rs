//! What an experiment does without, in a few lines: `part b[2..200]: 199 states, 199 switches`.

use std::collections::BTreeMap;

use rustc_hash::{FxHashMap, FxHashSet};

use crate::diagnostics::counted;
use crate::expr::{Expr, Var, variables_of};
use crate::model::{Model, SwitchKind};
use crate::system::Switch;
use crate::system::needs::Needs;

/// Names of one kind before the rest is only counted.
const MAX_NAMES: usize = 4;

/// Skipped states and switches: first whole parts, then what is not in such a part.
///
/// `kept` are the switches of the system; `dropped` are others that were collected, by name.
pub(crate) fn describe<'e>(
    model: &Model<'e>,
    needs: &Needs<'e>,
    kept: &[Switch<'e>],
    dropped: Vec<(String, Expr<'e>)>,
) -> Vec<String> {
    let vars: Vec<Var> = model.state_vars().filter_map(Expr::as_variable).collect();
    let names = Names::new(model, &vars);
    let mut alive: FxHashSet<&str> = FxHashSet::default();
    let mut dead: BTreeMap<usize, Tally> = BTreeMap::new();
    let mut loose = Tally::default();

    for (entry, &is_kept) in needs.entries.iter().enumerate() {
        if is_kept {
            alive.extend(names.part(vars[entry]));
        }
    }
    alive.extend(kept.iter().filter_map(|switch| names.part_of(switch.psi)));
    let known = kept.iter().map(|switch| switch.psi.split_scale().1);
    let mut known: FxHashSet<Expr<'e>> = known.collect();
    let others = model
        .surfaces
        .iter()
        .filter(|surface| !surface.is_alias && !needs.holds_all(surface.psi));
    let others = others.map(|surface| (surface.name.clone(), surface.psi));
    let relays = model
        .switches
        .iter()
        .filter(|switch| matches!(switch.kind, SwitchKind::Relay(_)));
    let relays = relays.flat_map(|switch| {
        let entries = (0..switch.psi.len()).filter(|&k| !needs.holds(switch.vars[k].as_variable()));
        entries.map(|k| (switch.shape.entry_name(&switch.name, k), switch.psi[k]))
    });
    let switches = dropped.into_iter().chain(others).chain(relays);
    let switches: Vec<(String, Expr<'e>)> = switches
        .filter(|(_, psi)| known.insert(psi.split_scale().1))
        .collect();

    let whole = |part: Option<&str>| {
        let dead = part.filter(|part| !alive.contains(part));
        dead.map(|part| names.order[part])
    };
    for (entry, &is_kept) in needs.entries.iter().enumerate() {
        if !is_kept {
            let part = whole(names.part(vars[entry]));
            let tally = part.map_or(&mut loose, |part| dead.entry(part).or_default());
            tally.states.push(model.entry_name(entry));
        }
    }
    for (name, psi) in switches {
        let part = whole(names.part_of(psi));
        let tally = part.map_or(&mut loose, |part| dead.entry(part).or_default());
        tally.switches.push(name);
    }
    let mut lines = parts(&names, dead);
    lines.extend(loose.lines());
    lines
}

/// Skipped states and switches.
#[derive(Default)]
struct Tally {
    states: Vec<String>,
    switches: Vec<String>,
}

impl Tally {
    /// `states x[2..200]`, `switch `c``
    fn lines(&self) -> Vec<String> {
        let states = ranges(&self.states);
        let mut lines = Vec::new();
        match states.len() {
            0 => {}
            1..=MAX_NAMES => {
                let word = if self.states.len() == 1 {
                    "state"
                } else {
                    "states"
                };
                lines.push(format!("{word} {}", states.join(", ")));
            }
            _ => lines.push(counted(self.states.len(), "state")),
        }
        match self.switches.len() {
            0 => {}
            1..=MAX_NAMES => {
                lines.extend(self.switches.iter().map(|name| format!("switch `{name}`")));
            }
            count => lines.push(counted(count, "switch")),
        }
        lines
    }
}

/// One line for neighbours of one array that have as many states and switches each.
fn parts(names: &Names<'_>, dead: BTreeMap<usize, Tally>) -> Vec<String> {
    let mut shown: Vec<(Vec<String>, usize, usize)> = Vec::new();
    for (order, tally) in dead {
        let name = names.parts[order].to_owned();
        let base = |name: &str| name.split('[').next().unwrap_or(name).to_owned();
        match shown.last_mut() {
            Some((members, states, switches)) if base(&members[0]) == base(&name) => {
                members.push(name);
                *states += tally.states.len();
                *switches += tally.switches.len();
            }
            _ => shown.push((vec![name], tally.states.len(), tally.switches.len())),
        }
    }
    let line = |(members, states, switches): (Vec<String>, usize, usize)| {
        let counts = [
            (states > 0).then(|| counted(states, "state")),
            (switches > 0).then(|| counted(switches, "switch")),
        ];
        let counts: Vec<String> = counts.into_iter().flatten().collect();
        format!(
            "part {}: {}",
            ranges(&members).join(", "),
            counts.join(", ")
        )
    };
    shown.into_iter().map(line).collect()
}

/// `x[2], x[3], x[4], y` as `x[2..4], y`.
fn ranges(names: &[String]) -> Vec<String> {
    let split = |name: &str| -> Option<(String, usize)> {
        let (base, index) = name.strip_suffix(']')?.rsplit_once('[')?;
        Some((base.to_owned(), index.parse().ok()?))
    };
    let mut found: Vec<(String, Option<(usize, usize)>)> = Vec::new();
    for name in names {
        match (split(name), found.last_mut()) {
            (Some((base, index)), Some((last, Some((_, to)))))
                if *last == base && *to + 1 == index =>
            {
                *to = index;
            }
            (Some((base, index)), _) => found.push((base, Some((index, index)))),
            (None, _) => found.push((name.clone(), None)),
        }
    }
    let text = |(base, range): (String, Option<(usize, usize)>)| match range {
        None => base,
        Some((from, to)) if from == to => format!("{base}[{from}]"),
        Some((from, to)) => format!("{base}[{from}..{to}]"),
    };
    found.into_iter().map(text).collect()
}

/// The part of the model that every state is in.
struct Names<'n> {
    /// Parts in order of their states.
    parts: Vec<&'n str>,
    order: FxHashMap<&'n str, usize>,
    of: FxHashMap<Var, &'n str>,
}

impl<'n> Names<'n> {
    fn new(model: &'n Model<'_>, vars: &[Var]) -> Self {
        let quantities = model.quantities.states.iter();
        let parts = quantities.flat_map(|state| {
            let part = state.name.split_once('.').map(|(part, _)| part);
            state.vars.iter().map(move |_| part)
        });
        let mut names = Names {
            parts: Vec::new(),
            order: FxHashMap::default(),
            of: FxHashMap::default(),
        };
        for (&var, part) in vars.iter().zip(parts) {
            if let Some(part) = part {
                let next = names.parts.len();
                if *names.order.entry(part).or_insert(next) == next {
                    names.parts.push(part);
                }
                names.of.insert(var, part);
            }
        }
        names
    }

    fn part(&self, state: Var) -> Option<&'n str> {
        self.of.get(&state).copied()
    }

    /// The part that the states of a switching function are in, where that is one.
    fn part_of(&self, psi: Expr<'_>) -> Option<&'n str> {
        let states = variables_of(&[psi]);
        let mut parts = states.iter().filter_map(|&var| self.part(var));
        let first = parts.next()?;
        parts.all(|part| part == first).then_some(first)
    }
}

#[cfg(test)]
mod tests {
    use super::ranges;

    #[test]
    fn neighbours_are_one_range() {
        let of = |names: &[&str]| {
            let names: Vec<String> = names.iter().map(|&name| name.to_owned()).collect();
            ranges(&names).join(" ")
        };
        assert_eq!(
            of(&["x[2]", "x[3]", "x[5]", "y", "b[1].q"]),
            "x[2..3] x[5] y b[1].q"
        );
        assert_eq!(of(&["A[1,1]", "A[1,2]"]), "A[1,1] A[1,2]");
    }
}
