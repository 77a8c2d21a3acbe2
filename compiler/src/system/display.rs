//! The printed form: one equation per line, with the names of the model.

use std::fmt;

use super::{
    Body, Contact, Continuity, Coverage, Direction, Impulsive, Law, Output, Partition, Recorded,
    Role, Switch, System,
};

impl fmt::Display for System<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (system, all) = (self, true);
        Printed { system, all }.write(f)
    }
}

/// The structure of a system, as goldens keep it.
pub struct Structure<'s, 'e>(pub &'s System<'e>);

impl fmt::Display for Structure<'_, '_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (system, all) = (self.0, false);
        Printed { system, all }.write(f)
    }
}

/// What of a system is printed.
pub(super) struct Printed<'s, 'e> {
    pub(super) system: &'s System<'e>,
    /// Or else nothing that another value of a parameter, another start or another horizon would change: no values, and
    /// not what was found at sample points.
    pub(super) all: bool,
}

impl Printed<'_, '_> {
    fn write(&self, f: &mut impl fmt::Write) -> fmt::Result {
        let &Printed { system, all } = self;
        let valued = |value: &dyn fmt::Display| match all {
            true => format!(" = {value}"),
            false => String::new(),
        };
        writeln!(f, "system {}", system.name)?;
        for param in &system.exogenous.params {
            writeln!(f, "param {}{}", param.name, valued(&param.value))?;
        }
        for data in &system.exogenous.data {
            writeln!(f, "signal {}{}", data.var, valued(&data.text))?;
        }
        for state in &system.states {
            writeln!(f, "state {}{}", state.name, valued(&state.initial))?;
        }
        for state in &system.states {
            writeln!(f, "der({}) = {}", state.name, state.rate)?;
        }
        for switch in 0..system.switches.len() {
            self.write_switch(f, switch)?;
        }
        for law in &system.jumps.laws {
            self.write_law(f, law)?;
        }
        for body in &system.jumps.bodies {
            self.write_body(f, body)?;
        }
        for contact in &system.jumps.contacts {
            self.write_contact(f, contact)?;
        }
        for contact in &system.jumps.impulsive {
            write_impulsive(f, contact)?;
        }
        for partition in &system.coupling.partitions {
            self.write_partition(f, partition)?;
        }
        let Recorded {
            outputs, controls, ..
        } = &system.recorded;
        for (word, list) in [("output", outputs), ("control", controls)] {
            for output in list {
                write_output(f, word, output)?;
            }
        }
        if let Some(task) = &system.task {
            task.write(f, all)?;
        }
        for subsystem in &system.coupling.subsystems {
            let alphas = (subsystem.switches.iter()).map(|&k| system.switches[k].alpha);
            let regions = subsystem
                .regions
                .map(|_| "  // disjoint regions")
                .unwrap_or_default();
            writeln!(f, "subsystem {}{regions}", listed(alphas))?;
        }
        for skipped in &system.provenance.skipped {
            writeln!(f, "skipped {skipped}")?;
        }
        Ok(())
    }

    /// α of a switch: a member of a pair, or a step with its readings.
    pub(super) fn write_switch(&self, f: &mut impl fmt::Write, i: usize) -> fmt::Result {
        let switch = &self.system.switches[i];
        let (name, alpha, psi) = (&switch.name, switch.alpha, switch.psi);
        match switch.role {
            Role::Step => {}
            Role::Equation => return writeln!(f, "0 = {psi}  // by {alpha}"),
            Role::Member(other) if other > i => {
                let other = &self.system.switches[other];
                let (a, b) = (-psi, -other.psi);
                return writeln!(f, "0 <= {a} perp {b} >= 0  // by {alpha}, {}", other.alpha);
            }
            Role::Member(_) => return Ok(()),
        }
        if switch.unilateral {
            return writeln!(f, "0 <= 1 - {alpha} perp {psi} >= 0  // {name}");
        }
        writeln!(
            f,
            "{alpha} in step({psi})  // {name}, {}",
            kind(switch, self.all)
        )?;
        if let Some(relay) = switch.relay {
            let start = if relay.start { "on" } else { "off" };
            return match self.all {
                true => writeln!(
                    f,
                    "  on at {}, off at {}, starts {start}",
                    relay.on, relay.off
                ),
                false => Ok(()),
            };
        }
        for reading in &switch.named {
            let sign = if reading.flipped { "-" } else { "" };
            let index = reading
                .index
                .map(|k| format!("[{}]", k + 1))
                .unwrap_or_default();
            writeln!(f, "  read by {}{index} as {sign}psi", reading.name)?;
        }
        Ok(())
    }

    pub(super) fn write_law(&self, f: &mut impl fmt::Write, law: &Law) -> fmt::Result {
        match law.strikes {
            Some(k) => writeln!(
                f,
                "jump {} when {} is struck",
                law.name, self.system.switches[k].psi
            )?,
            None if law.stops => writeln!(f, "stop {}", law.when)?,
            // What has no name is called by its instants.
            None if law.name.starts_with("every ") => writeln!(f, "jump {}", law.when)?,
            None => writeln!(f, "jump {} {}", law.name, law.when)?,
        }
        for (state, value) in &law.resets {
            writeln!(f, "  {} := {value}", self.system.states[*state].name)?;
        }
        Ok(())
    }

    /// Names of states.
    fn names(&self, states: &[usize]) -> String {
        listed(states.iter().map(|&s| &self.system.states[s].name))
    }

    pub(super) fn write_body(&self, f: &mut impl fmt::Write, body: &Body) -> fmt::Result {
        let [positions, velocities] = [&body.positions, &body.velocities].map(|s| self.names(s));
        writeln!(f, "body {positions} with {velocities}")?;
        writeln!(f, "  mass [{}]", listed(&body.mass))?;
        writeln!(f, "  force [{}]", listed(&body.force))
    }

    pub(super) fn write_contact(&self, f: &mut impl fmt::Write, contact: &Contact) -> fmt::Result {
        let directions = |list: &[Direction]| {
            let entry = |d: &Direction| format!("{}: {}", self.system.states[d.state].name, d.row);
            listed(list.iter().map(entry))
        };
        writeln!(f, "contact {} {} >= 0", contact.name, contact.gap)?;
        writeln!(f, "  normal {}", directions(&contact.normal))?;
        writeln!(f, "  restitution {}", contact.restitution)?;
        if let Some(friction) = &contact.friction {
            for slip in &friction.slips {
                let (velocity, tangent) = (slip.velocity, directions(&slip.tangent));
                writeln!(f, "  slip {velocity}, tangent {tangent}")?;
            }
            writeln!(f, "  friction {}", friction.coefficient)?;
        }
        Ok(())
    }

    pub(super) fn write_partition(
        &self,
        f: &mut impl fmt::Write,
        partition: &Partition,
    ) -> fmt::Result {
        let coverage = match partition.coverage {
            _ if !self.all => "",
            Coverage::Proven => "  // one region everywhere: proven",
            Coverage::Sampled => "  // one region everywhere: no counterexample at sampled points",
        };
        let states = self.names(&partition.states);
        writeln!(f, "partition of {states}{coverage}")?;
        for (r, region) in partition.regions.iter().enumerate() {
            write!(f, "  {}: {}", region.name, region.weight)?;
            match partition.indicators.get(r) {
                Some(indicator) => writeln!(f, "  // indicator {indicator}")?,
                None => writeln!(f)?,
            }
        }
        Ok(())
    }
}

/// What a step is, and whether f is continuous across its surface.
fn kind(switch: &Switch, all: bool) -> &'static str {
    match switch.continuity {
        _ if switch.relay.is_some() => "relay",
        _ if switch.across.is_some() && switch.slip_of.is_some() => {
            "slips in the plane of both where it is closed"
        }
        _ if switch.across.is_some() => "one of two in a disc",
        _ if switch.slip_of.is_some() => "slips where it is closed",
        Continuity::Discontinuous => "discontinuous",
        Continuity::Certain => "continuous",
        Continuity::Sampled if all => "continuous at sampled points",
        Continuity::Sampled => "continuous",
    }
}

pub(super) fn write_output(
    f: &mut impl fmt::Write,
    word: &str,
    output: &Output<'_>,
) -> fmt::Result {
    let (name, entries) = (&output.name, listed(&output.exprs));
    match output.shape[..] {
        [] => writeln!(f, "{word} {name} = {entries}"),
        _ => writeln!(f, "{word} {name} = [{entries}]"),
    }
}

pub(super) fn write_impulsive(f: &mut impl fmt::Write, contact: &Impulsive) -> fmt::Result {
    writeln!(
        f,
        "contact {} {} >= 0 by impulses",
        contact.name, contact.gap
    )?;
    writeln!(f, "  restitution {}", contact.restitution)?;
    if let Some((friction, slips)) = &contact.friction {
        for slip in slips {
            writeln!(f, "  slip {slip}")?;
        }
        writeln!(f, "  friction {friction}")?;
    }
    Ok(())
}

/// a, b, c
fn listed<T: ToString>(items: impl IntoIterator<Item = T>) -> String {
    let items: Vec<String> = items.into_iter().map(|item| item.to_string()).collect();
    items.join(", ")
}
