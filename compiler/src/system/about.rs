//! What a system says of one name of its model: the rows that set it, and the switches that these meet.

use std::collections::BTreeSet;
use std::fmt;

use super::display::{Printed, write_impulsive, write_output};
use super::{Contact, Role, System};
use crate::expr::{Expr, variables_of};

/// The printed form of a system, but for what has nothing to do with a name; empty where nothing has.
pub struct About<'s, 'e>(pub &'s System<'e>, pub &'s str);

impl fmt::Display for About<'_, '_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let &About(system, name) = self;
        let mut rows = Rows {
            printed: Printed { system, all: true },
            name,
            read: Vec::new(),
            met: BTreeSet::new(),
        };
        rows.write_equations(f)?;
        rows.write_jumps(f)?;
        rows.write_partitions(f)?;
        rows.write_switches(f)
    }
}

/// What is written, as far as that is.
struct Rows<'s, 'e> {
    printed: Printed<'s, 'e>,
    name: &'s str,
    /// The expressions in it.
    read: Vec<Expr<'e>>,
    /// Switches that are in it by themselves.
    met: BTreeSet<usize>,
}

impl Rows<'_, '_> {
    /// Whether a name, or one of its entries, is meant.
    fn is_it(&self, name: &str) -> bool {
        let rest = name.strip_prefix(self.name);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('['))
    }

    /// Whether one of these states is meant.
    fn is_among(&self, states: &[usize]) -> bool {
        let system = self.printed.system;
        states.iter().any(|&s| self.is_it(&system.states[s].name))
    }

    /// Rates and outputs.
    fn write_equations(&mut self, f: &mut impl fmt::Write) -> fmt::Result {
        let system = self.printed.system;
        for state in &system.states {
            if self.is_it(&state.name) {
                writeln!(f, "der({}) = {}", state.name, state.rate)?;
                self.read.push(state.rate);
            }
        }
        for output in &system.recorded.outputs {
            if self.is_it(&output.name) {
                write_output(f, "output", output)?;
                self.read.extend(&output.exprs);
            }
        }
        Ok(())
    }

    /// Laws that are called so or set it, bodies that it is of, contacts.
    fn write_jumps(&mut self, f: &mut impl fmt::Write) -> fmt::Result {
        let system = self.printed.system;
        let jumps = &system.jumps;
        for law in &jumps.laws {
            let set: Vec<usize> = law.resets.iter().map(|reset| reset.0).collect();
            if self.is_it(&law.name) || self.is_among(&set) {
                self.printed.write_law(f, law)?;
                self.read.extend(law.exprs());
                self.met.extend(law.strikes);
            }
        }
        for body in &jumps.bodies {
            if self.is_among(&body.positions) || self.is_among(&body.velocities) {
                self.printed.write_body(f, body)?;
                self.read.extend(&body.force);
            }
        }
        let touches = |contact: &Contact<'_>| {
            let owner = contact.feature_of.as_deref();
            let moves = contact.normal.iter().map(|direction| direction.state);
            self.is_it(&contact.name)
                || owner.is_some_and(|owner| self.is_it(owner))
                || self.is_among(&moves.collect::<Vec<_>>())
        };
        let contacts: Vec<&Contact<'_>> = jumps.contacts.iter().filter(|c| touches(c)).collect();
        for contact in contacts {
            self.printed.write_contact(f, contact)?;
            self.met.insert(contact.switch);
        }
        for contact in &jumps.impulsive {
            let owner = contact.feature_of.as_deref();
            if self.is_it(&contact.name) || owner.is_some_and(|owner| self.is_it(owner)) {
                write_impulsive(f, contact)?;
            }
        }
        Ok(())
    }

    /// Partitions that set it, or have a region of that name.
    fn write_partitions(&mut self, f: &mut impl fmt::Write) -> fmt::Result {
        let system = self.printed.system;
        for partition in &system.coupling.partitions {
            let mut regions = partition.regions.iter();
            if self.is_among(&partition.states) || regions.any(|region| self.is_it(&region.name)) {
                self.printed.write_partition(f, partition)?;
                self.met.extend(&partition.switches);
            }
        }
        Ok(())
    }

    /// Switches that are read there, and those that these read.
    fn write_switches(&mut self, f: &mut impl fmt::Write) -> fmt::Result {
        let system = self.printed.system;
        let switches = &system.switches;
        for (k, switch) in switches.iter().enumerate() {
            let mut named = switch.named.iter();
            if named.any(|reading| self.is_it(&reading.name)) {
                self.met.insert(k);
            }
        }
        self.read.extend(self.met.iter().map(|&k| switches[k].psi));
        let mut seen = 0;
        while seen < self.read.len() {
            let inside = variables_of(&self.read[seen..]);
            seen = self.read.len();
            for (k, switch) in switches.iter().enumerate() {
                let alpha = switch.alpha.as_variable();
                let compared = system.jumps.comparisons.iter();
                let compared = compared.filter(|known| known.switch == k);
                let mut stands = alpha.into_iter().chain(compared.map(|known| known.var));
                if stands.any(|var| inside.contains(&var)) && self.met.insert(k) {
                    self.read.push(switch.psi);
                }
                // A pair is written at its first member.
                if let (Role::Member(other), true) = (switch.role, self.met.contains(&k))
                    && self.met.insert(other)
                {
                    self.read.push(switches[other].psi);
                }
            }
        }
        for &k in &self.met {
            self.printed.write_switch(f, k)?;
        }
        Ok(())
    }
}
