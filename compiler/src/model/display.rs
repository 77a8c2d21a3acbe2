//! A model as text: one declaration or equation per line.

use std::fmt;

use super::{
    Contact, Domain, Model, Named, NamedSwitch, Quantity, Rate, Shape, SwitchKind, Tensor,
    Thresholds,
};
use crate::expr::Expr;

impl<'e> fmt::Display for Model<'e> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "model {}", self.name)?;
        let quantities = [
            ("param", &self.quantities.params),
            ("state", &self.quantities.states),
            ("algebraic", &self.quantities.algebraics),
            ("control", &self.quantities.controls),
            ("input", &self.quantities.inputs),
        ];
        for (word, list) in quantities {
            for quantity in list {
                write_quantity(f, word, quantity)?;
            }
        }
        for signal in &self.definitions.signals {
            let data = self
                .definitions
                .data
                .iter()
                .find(|data| data.name == signal.name);
            match data {
                Some(data) => writeln!(f, "signal {} = {}", data.name, data.text)?,
                None => write_named(f, "signal", std::slice::from_ref(signal))?,
            }
        }
        write_named(f, "let", &self.definitions.lets)?;
        self.switches
            .iter()
            .try_for_each(|switch| write_switch(f, switch))?;
        self.write_rates(f, "", &self.statements.dynamics)?;
        for region in &self.statements.regions {
            write!(f, "region {} ", region.name)?;
            match region.indicator {
                Some(indicator) => writeln!(f, "indicator {indicator}")?,
                None if region.is_else => writeln!(f, "else {}", region.guard)?,
                None => writeln!(f, "{}", region.guard)?,
            }
            self.write_rates(f, "  ", &region.rates)?;
        }
        for hidden in &self.statements.hidden {
            writeln!(f, "hidden on {}", self.switches[hidden.switch].name)?;
            self.write_rates(f, "  ", &hidden.rates)?;
        }
        self.write_decompositions(f)?;
        self.statements
            .contacts
            .iter()
            .try_for_each(|contact| write_contact(f, contact))?;
        self.write_projections(f)?;
        for equation in &self.statements.equations {
            writeln!(f, "0 = {}", equation.residual)?;
        }
        for pair in &self.statements.complementarities {
            let [a, b] = pair.members;
            writeln!(f, "0 <= {a} perp {b} >= 0")?;
        }
        for jump in &self.statements.jumps {
            writeln!(f, "jump {} {}", jump.name, jump.when)?;
            for reset in &jump.resets {
                writeln!(f, "  {} := {}", self.entry_name(reset.entry), reset.value)?;
            }
        }
        write_named(f, "output", &self.definitions.outputs)
    }
}

impl Model<'_> {
    fn write_rates(
        &self,
        f: &mut fmt::Formatter<'_>,
        indent: &str,
        rates: &[Rate<'_>],
    ) -> fmt::Result {
        for rate in rates {
            let sign = if rate.adds { "+=" } else { "=" };
            writeln!(
                f,
                "{indent}{}' {sign} {}",
                self.entry_name(rate.entry),
                rate.value
            )?;
        }
        Ok(())
    }

    fn write_projections(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for projection in &self.statements.projections {
            let entries = projection.entries.iter();
            let names: Vec<String> = entries.map(|&entry| self.entry_name(entry)).collect();
            writeln!(f, "project {}", names.join(", "))?;
            for row in &projection.constraints {
                writeln!(f, "  {} >= 0", row.c)?;
            }
            if let Some(metric) = &projection.metric {
                writeln!(f, "  metric [{}]", list(metric))?;
            }
        }
        Ok(())
    }
}

fn write_switch(f: &mut fmt::Formatter<'_>, switch: &NamedSwitch<'_>) -> fmt::Result {
    let tensor = |data: &[Expr<'_>]| switch.shape.text(data);
    let (name, psi) = (&switch.name, tensor(&switch.psi));
    let sliding = switch
        .sliding
        .map(|reading| format!(" sliding {}", reading.word()));
    let sliding = sliding.unwrap_or_default();
    match &switch.kind {
        SwitchKind::Sign => writeln!(f, "switch {name} = sign({psi}){sliding}"),
        SwitchKind::Step => writeln!(f, "switch {name} = step({psi}){sliding}"),
        SwitchKind::Relay(Thresholds { on, off, start }) => {
            let (on, off) = (tensor(on), tensor(off));
            write!(f, "switch {name} = hysteresis({psi}")?;
            write!(f, ", on = {on}, off = {off}")?;
            if let Some(start) = start {
                write!(f, ", start = {}", tensor(start))?;
            }
            writeln!(f, ")")
        }
    }
}

fn write_contact(f: &mut fmt::Formatter<'_>, contact: &Contact<'_>) -> fmt::Result {
    writeln!(f, "contact {} {} >= 0", contact.name, contact.gap)?;
    writeln!(f, "  restitution {}", contact.restitution)?;
    if let Some((friction, _)) = contact.friction {
        writeln!(f, "  friction {friction}")?;
    }
    match contact.slip.0.is_empty() {
        true => Ok(()),
        false => writeln!(f, "  slip {}", list(&contact.slip.0)),
    }
}

fn write_quantity(f: &mut fmt::Formatter<'_>, word: &str, quantity: &Quantity<'_>) -> fmt::Result {
    let sizes = quantity
        .shape
        .sizes()
        .iter()
        .map(usize::to_string)
        .collect::<Vec<_>>();
    write!(f, "{word} {}", quantity.name)?;
    if !sizes.is_empty() {
        write!(f, "[{}]", sizes.join(","))?;
    }
    match &quantity.domain {
        Some(Domain::Box(lower, upper)) => {
            write!(f, " in [{}, {}]", uniform(lower), uniform(upper))?;
        }
        Some(Domain::Set(values)) => {
            write!(f, " in {{{}}}", list(values))?;
        }
        None => {}
    }
    match &quantity.value {
        Some(value) => writeln!(f, " = {value}"),
        None => writeln!(f),
    }
}

/// A repeated entry once.
fn uniform(tensor: &Tensor<'_>) -> String {
    match tensor.data.split_first() {
        Some((first, rest)) if rest.iter().all(|other| other == first) => first.to_string(),
        _ => tensor.to_string(),
    }
}

fn write_named(f: &mut fmt::Formatter<'_>, word: &str, list: &[Named<'_>]) -> fmt::Result {
    list.iter()
        .try_for_each(|named| writeln!(f, "{word} {} = {}", named.name, named.value))
}

fn list(entries: &[impl ToString]) -> String {
    let entries: Vec<String> = entries.iter().map(ToString::to_string).collect();
    entries.join(", ")
}

impl Shape {
    /// Entries of this shape, as they are written in a model.
    fn text(self, entries: &[Expr<'_>]) -> String {
        match self {
            Shape::Scalar => list(entries),
            Shape::Vector(_) => format!("[{}]", list(entries)),
            Shape::Matrix(1, _) => format!("[{};]", list(entries)),
            Shape::Matrix(_, columns) => {
                let rows: Vec<String> = entries.chunks(columns.max(1)).map(list).collect();
                format!("[{}]", rows.join("; "))
            }
        }
    }
}

impl fmt::Display for Tensor<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.shape.text(&self.data))
    }
}

/// Checks the invariants of a model that its types do not.
pub(super) fn verify(model: &Model<'_>) -> Result<(), String> {
    let quantities = model
        .quantities
        .params
        .iter()
        .chain(&model.quantities.states)
        .chain(&model.quantities.algebraics)
        .chain(&model.quantities.controls)
        .chain(&model.quantities.inputs);
    let mut seen = rustc_hash::FxHashSet::default();
    for quantity in quantities {
        if quantity.vars.len() != quantity.shape.len() {
            return Err(format!("`{}` has the entries of its shape", quantity.name));
        }
        if !quantity
            .vars
            .iter()
            .all(|&var| var.as_variable().is_some() && seen.insert(var))
        {
            return Err(format!(
                "the entries of `{}` are variables of their own",
                quantity.name
            ));
        }
    }
    let mut regions = rustc_hash::FxHashSet::default();
    if !model
        .partitions
        .iter()
        .flat_map(|partition| &partition.regions)
        .all(|region| regions.insert(*region))
    {
        return Err("a region stands in one partition".to_owned());
    }
    Ok(())
}
