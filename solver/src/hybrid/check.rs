//! What every [`HybridSystem`] satisfies: whatever one refers to is there, and in order.

use super::form::{Argument, Instance};
use super::periodic::Periodic;
use super::system::{Effect, Guard, HybridSystem, Input, Law, SwitchKind};
use crate::tape::Tape;

/// Why something is none of its kind.
pub type Fault = &'static str;

impl HybridSystem {
    /// Checks that it is one.
    ///
    /// # Errors
    ///
    /// What refers to something that is not there, or is out of order.
    pub fn check(&self) -> Result<(), Fault> {
        Check { system: self }.all()
    }
}

/// A system that is looked at.
struct Check<'s> {
    system: &'s HybridSystem,
}

impl Check<'_> {
    fn all(&self) -> Result<(), Fault> {
        self.blocks()?;
        self.switches()?;
        self.surfaces()?;
        let mut laws = self.system.laws.iter();
        laws.try_for_each(|law| self.law(law))?;
        let is_listed = is_listed(&self.system.algebraics, self.system.n_states());
        must(is_listed, "algebraic states are states, in order")?;
        let are_sound = self.system.data.iter().all(|data| data.is_sound());
        must(
            are_sound,
            "pieces of data follow each other, with as many coefficients each",
        )?;
        let is_sorted = self.system.stops.is_sorted_by(|a, b| a <= b);
        must(is_sorted, "stops are in order")
    }

    fn blocks(&self) -> Result<(), Fault> {
        let mut states: Vec<usize> = Vec::new();
        let blocks = self.system.blocks.iter();
        blocks.for_each(|block| states.extend(&block.states));
        states.sort_unstable();
        let is_each = states.iter().enumerate().all(|(i, &state)| i == state);
        must(is_each, "every state has one rate")?;
        must(
            self.system.rates.len() == self.system.blocks.len(),
            "every block has its rates",
        )?;
        for (block, rates) in self.system.blocks.iter().zip(&self.system.rates) {
            let is_listed = is_listed(&block.switches, self.system.n_switches());
            must(is_listed, "blocks have switches, in order")?;
            self.instance(rates, &block.switches, block.states.len())?;
        }
        Ok(())
    }

    fn switches(&self) -> Result<(), Fault> {
        let n = self.system.n_switches();
        let mut end = n;
        for (i, switch) in self.system.switches.iter().enumerate() {
            let lists = [&switch.couplings, &switch.inside, &switch.idle_above];
            let are_listed = lists.into_iter().all(|list| is_listed(list, n));
            must(are_listed, "switches refer to switches, in order")?;
            let derivatives = switch.derivatives.clone();
            let follow = derivatives.start == end && derivatives.end >= end;
            must(
                follow,
                "derivatives of switching functions follow each other",
            )?;
            end = derivatives.end;
            let is_paired = match switch.kind {
                SwitchKind::Slip { of, across } => {
                    of.is_none_or(|of| of < n && self.system.is_unilateral(of))
                        && across
                            .is_none_or(|j| j < n && j != i && self.system.across(j) == Some(i))
                }
                SwitchKind::Member(j) => {
                    j < n && j != i && self.system.switches[j].kind == SwitchKind::Member(i)
                }
                _ => true,
            };
            must(is_paired, "switches that belong together name each other")?;
        }
        must(
            self.system.surfaces.len() == end,
            "every switch has its functions",
        )
    }

    fn surfaces(&self) -> Result<(), Fault> {
        for (i, switch) in self.system.switches.iter().enumerate() {
            for at in [i].into_iter().chain(switch.derivatives.clone()) {
                self.instance(&self.system.surfaces[at], &switch.inside, 1)?;
            }
        }
        Ok(())
    }

    /// An instance of a form with this number of functions, and no other α than those of `switches`.
    fn instance(
        &self,
        instance: &Instance,
        switches: &[usize],
        n_functions: usize,
    ) -> Result<(), Fault> {
        let form = self
            .system
            .forms
            .get(instance.form)
            .ok_or("instances are of a form")?;
        must(
            form.tape.n_outputs() == n_functions,
            "a form has as many functions as are asked for",
        )?;
        let is_fed = |tape: &Tape, n: usize| tape.n_inputs() == n;
        let n = instance.inputs.len();
        must(
            is_fed(&form.tape, n) && form.arguments.len() == n,
            "a form has all of its inputs",
        )?;
        for (&input, &argument) in instance.inputs.iter().zip(&form.arguments) {
            self.input(input)?;
            let is_alpha = |switch| {
                let is_argument = matches!(
                    argument,
                    Argument::Alpha | Argument::Sticking | Argument::Resting
                );
                is_argument && switches.binary_search(&switch).is_ok()
            };
            let fits = match input {
                Input::Time => argument == Argument::Time,
                Input::State(_) => argument == Argument::State,
                Input::Alpha(switch) => is_alpha(switch),
                Input::Coefficient(_) => argument == Argument::Coefficient,
                Input::Parameter(_) => argument == Argument::Parameter,
                Input::Number(_) => argument == Argument::Number,
            };
            must(fits, "inputs are what a form takes")?;
        }
        Ok(())
    }

    fn law(&self, law: &Law) -> Result<(), Fault> {
        let n = self.system.n_switches();
        let strikes = match &law.guard {
            Guard::Sides {
                switches,
                compared,
                holds,
            } => {
                let are_there = compared.iter().all(|known| known.0 < switches.len());
                let is_of = holds.n_inputs() == switches.len() && holds.n_outputs() == 1;
                let is_of = is_of && are_there;
                must(
                    is_of && switches.iter().all(|i| *i < n),
                    "a guard is a function of sides",
                )?;
                None
            }
            Guard::Strikes(switch) => {
                let is_met = *switch < n && self.system.is_unilateral(*switch);
                must(is_met, "what is struck is a unilateral surface")?;
                Some(*switch)
            }
            Guard::Every(Periodic { period, offset }) => {
                let is_one = *period > 0.0 && period.is_finite() && *offset >= 0.0;
                must(is_one && offset.is_finite(), "a period is positive")?;
                None
            }
        };
        let (inputs, tape) = match &law.effect {
            Effect::Stop => return Ok(()),
            Effect::Reset(reset) => {
                let is_whole = reset.values.n_outputs() == reset.states.len();
                let are_states = reset.states.iter().all(|i| *i < self.system.n_states());
                must(is_whole && are_states, "a reset sets states")?;
                let is_switch = |&(place, _): &(usize, f64)| {
                    matches!(reset.inputs.get(place), Some(Input::Alpha(_)))
                };
                let are_switches = reset.compared.iter().all(is_switch);
                must(are_switches, "a reset compares with surfaces")?;
                (&reset.inputs, &reset.values)
            }
            Effect::Impact(impact) => {
                let slips = &impact.slips;
                let are_slips = slips
                    .iter()
                    .all(|i| *i < n && self.system.slip_of(*i) == strikes);
                must(
                    strikes.is_some() && are_slips,
                    "an impact is that of a contact",
                )?;
                let wanted = 1 + usize::from(!slips.is_empty());
                must(
                    impact.numbers.n_outputs() >= wanted,
                    "an impact has its coefficients",
                )?;
                (&impact.inputs, &impact.numbers)
            }
        };
        must(
            tape.n_inputs() == inputs.len(),
            "a law has all of its inputs",
        )?;
        inputs.iter().try_for_each(|&input| self.input(input))
    }

    fn input(&self, input: Input) -> Result<(), Fault> {
        let is_there = match input {
            Input::State(i) => i < self.system.n_states(),
            Input::Alpha(i) => i < self.system.n_switches(),
            Input::Coefficient(i) => i < self.system.n_coefficients(),
            Input::Parameter(i) => i < self.system.parameters.len(),
            Input::Time | Input::Number(_) => true,
        };
        must(is_there, "inputs are there")
    }
}

/// Nothing where this holds, or the fault.
///
/// # Errors
///
/// The fault.
pub fn must(holds: bool, fault: Fault) -> Result<(), Fault> {
    if holds { Ok(()) } else { Err(fault) }
}

/// Whether these are numbers below n, each larger than the one before.
fn is_listed(list: &[usize], n: usize) -> bool {
    list.is_sorted_by(|a, b| a < b) && list.last().is_none_or(|last| *last < n)
}

/// Writes a type as its fields, and checks it when it is read; it has `#[serde(remote = "Self")]` and a method `check`.
#[macro_export]
macro_rules! checked_when_read {
    ($type:ty $(, $parameter:ident: $bound:path)?) => {
        impl $(<$parameter: $bound + serde::Serialize>)? serde::Serialize for $type {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                <$type>::serialize(self, serializer)
            }
        }

        impl<'de $(, $parameter: $bound + serde::Deserialize<'de>)?> serde::Deserialize<'de>
            for $type
        {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let read = <$type>::deserialize(deserializer)?;
                read.check().map_err(serde::de::Error::custom)?;
                Ok(read)
            }
        }
    };
}

crate::checked_when_read!(HybridSystem);
