//! The printed form: one equation per line, with the names of the model.

use std::fmt;

use super::{Continuity, Coverage, Direction, Role, System};
use crate::expr::Expr;

impl fmt::Display for System<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.write(f, Shows::All)
    }
}

/// What of a system is printed.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Shows {
    All,
    /// Nothing that another value of a parameter, another start or another horizon would change: no values, and not
    /// what was found at sample points.
    Structure,
}

/// The structure of a system, as goldens keep it.
pub struct Structure<'s, 'e>(pub &'s System<'e>);

impl fmt::Display for Structure<'_, '_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.write(f, Shows::Structure)
    }
}

impl System<'_> {
    fn write(&self, f: &mut impl fmt::Write, shows: Shows) -> fmt::Result {
        let all = shows == Shows::All;
        let valued = |value: &dyn fmt::Display| match all {
            true => format!(" = {value}"),
            false => String::new(),
        };
        writeln!(f, "system {}", self.name)?;
        for param in &self.params {
            writeln!(f, "param {}{}", param.name, valued(&param.value))?;
        }
        for data in &self.data {
            writeln!(f, "signal {}{}", data.var, valued(&data.text))?;
        }
        for state in &self.states {
            writeln!(f, "state {}{}", state.name, valued(&state.initial))?;
        }
        for state in &self.states {
            writeln!(f, "der({}) = {}", state.name, state.rate)?;
        }
        for (i, switch) in self.switches.iter().enumerate() {
            let kind = match switch.continuity {
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
            };
            match switch.role {
                Role::Step => {}
                Role::Equation => {
                    writeln!(f, "0 = {}  // by {}", switch.psi, switch.alpha)?;
                    continue;
                }
                Role::Member(other) if other > i => {
                    let other = &self.switches[other];
                    let (a, b) = (-switch.psi, -other.psi);
                    let (by_a, by_b) = (switch.alpha, other.alpha);
                    writeln!(f, "0 <= {a} perp {b} >= 0  // by {by_a}, {by_b}")?;
                    continue;
                }
                Role::Member(_) => continue,
            }
            if switch.unilateral {
                let (alpha, psi) = (switch.alpha, switch.psi);
                writeln!(f, "0 <= 1 - {alpha} perp {psi} >= 0  // {}", switch.name)?;
                continue;
            }
            writeln!(
                f,
                "{} in step({})  // {}, {kind}",
                switch.alpha, switch.psi, switch.name
            )?;
            if switch.relay.is_some() && !all {
                continue;
            }
            if let Some(relay) = switch.relay {
                let start = if relay.start { "on" } else { "off" };
                writeln!(
                    f,
                    "  on at {}, off at {}, starts {start}",
                    relay.on, relay.off
                )?;
                continue;
            }
            for reading in &switch.named {
                let sign = if reading.flipped { "-" } else { "" };
                let index = reading
                    .index
                    .map(|k| format!("[{}]", k + 1))
                    .unwrap_or_default();
                writeln!(f, "  read by {}{index} as {sign}psi", reading.name)?;
            }
        }
        for law in &self.laws {
            match law.strikes {
                Some(k) => writeln!(
                    f,
                    "jump {} when {} is struck",
                    law.name, self.switches[k].psi
                )?,
                None => writeln!(f, "jump {} when {}", law.name, law.guard)?,
            }
            for (state, value) in &law.resets {
                writeln!(f, "  {} := {value}", self.states[*state].name)?;
            }
        }
        for body in &self.bodies {
            let names = |states: &[usize]| {
                let names: Vec<&str> = states
                    .iter()
                    .map(|&s| self.states[s].name.as_str())
                    .collect();
                names.join(", ")
            };
            let list = |exprs: &[Expr]| {
                let texts: Vec<String> = exprs.iter().map(Expr::to_string).collect();
                texts.join(", ")
            };
            writeln!(
                f,
                "body {} with {}",
                names(&body.positions),
                names(&body.velocities)
            )?;
            writeln!(f, "  mass [{}]", list(&body.mass))?;
            writeln!(f, "  force [{}]", list(&body.force))?;
        }
        for contact in &self.contacts {
            let directions = |list: &[Direction]| {
                let entry = |d: &Direction| format!("{}: {}", self.states[d.state].name, d.row);
                list.iter().map(entry).collect::<Vec<_>>().join(", ")
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
        }
        for contact in &self.impulsive {
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
        }
        for partition in &self.partitions {
            let states: Vec<&str> = partition
                .states
                .iter()
                .map(|&s| self.states[s].name.as_str())
                .collect();
            let coverage = match partition.coverage {
                _ if !all => "",
                Coverage::Proven => "  // one region everywhere: proven",
                Coverage::Sampled => {
                    "  // one region everywhere: no counterexample at sampled points"
                }
            };
            writeln!(f, "partition of {}{coverage}", states.join(", "))?;
            for (r, region) in partition.regions.iter().enumerate() {
                write!(f, "  {}: {}", region.name, region.weight)?;
                match partition.indicators.get(r) {
                    Some(indicator) => writeln!(f, "  // indicator {indicator}")?,
                    None => writeln!(f)?,
                }
            }
        }
        for (word, list) in [("output", &self.outputs), ("control", &self.controls)] {
            for output in list {
                let entries: Vec<String> = output.exprs.iter().map(|e| e.to_string()).collect();
                match output.shape[..] {
                    [] => writeln!(f, "{word} {} = {}", output.name, entries.join(", "))?,
                    _ => writeln!(f, "{word} {} = [{}]", output.name, entries.join(", "))?,
                }
            }
        }
        if let Some(task) = &self.task {
            task.write(f, all)?;
        }
        for subsystem in &self.subsystems {
            let alphas: Vec<String> = subsystem
                .switches
                .iter()
                .map(|&k| self.switches[k].alpha.to_string())
                .collect();
            let regions = subsystem
                .regions
                .map(|_| "  // disjoint regions")
                .unwrap_or_default();
            writeln!(f, "subsystem {}{regions}", alphas.join(", "))?;
        }
        for skipped in &self.skipped {
            writeln!(f, "skipped {skipped}")?;
        }
        Ok(())
    }
}
