//! What every [`ComplementaritySystem`] satisfies: whatever one refers to is there, and functions fit each other.

use super::pointwise::{Rule, Rules};
use super::units::Units;
use crate::fesd::system::ComplementaritySystem;
use crate::hybrid::Partials;
use crate::hybrid::check::{Fault, must};
use crate::tape::Tape;

impl ComplementaritySystem {
    /// Checks that it is one.
    ///
    /// # Errors
    ///
    /// What refers to something that is not there, or does not fit.
    pub fn check(&self) -> Result<(), Fault> {
        let are_sound = self.data.iter().all(|data| data.is_sound());
        must(
            are_sound,
            "pieces of data follow each other, with as many coefficients each",
        )?;
        must(self.stops.is_sorted(), "stops are in order")?;
        let is_listed = self.algebraic_states.is_sorted_by(|a, b| a < b);
        let is_there = |list: &[usize], n: usize| list.iter().all(|i| *i < n);
        let are_states = is_listed && is_there(&self.algebraic_states, self.n_states());
        must(are_states, "algebraic states are states, in order")?;
        must(
            self.continuous.len() == self.n_algebraics(),
            "every z has its kind",
        )?;
        self.check_full()?;
        self.check_pairs()?;
        self.check_surfaces()?;
        let mut followers = self.followers.iter();
        let are_there = followers.all(|&(i, j)| is_there(&[i, j], self.n_switches()));
        must(are_there, "what follows a switch is a switch")
    }

    fn check_full(&self) -> Result<(), Fault> {
        let full = &self.full;
        let (n, n_z, n_numbers) = (self.n_states(), self.n_algebraics(), self.n_numbers());
        let (plain, with_u) = (1 + n + n_z + n_numbers, 1 + n + 2 * n_z + n_numbers);
        let n_rows = full.directional.n_outputs();
        let is = |tape: &Tape, n_inputs: usize, n_outputs: usize| {
            tape.n_inputs() == n_inputs && tape.n_outputs() == n_outputs
        };
        let fit = is(&full.equations, plain, n + n_rows)
            && is(&full.directional, with_u, n_rows)
            && is(&full.rates, with_u, n)
            && is(&full.alphas, plain, self.n_switches())
            && full.determines_state.len() == n_rows
            && n_rows + self.pairs.len() == n_z;
        must(
            fit,
            "there are as many functions as unknowns, and all have their inputs",
        )?;
        let are_slopes = |slopes: &Partials, n_rows: usize, inputs: std::ops::Range<usize>| {
            let mut entries = slopes.entries.iter();
            slopes.tape.n_outputs() == slopes.entries.len()
                && slopes.entries.is_sorted_by_key(|&(row, _)| row)
                && entries.all(|(row, input)| *row < n_rows && inputs.contains(input))
        };
        let z = 1 + n + n_z..1 + n + 2 * n_z;
        let fit = full.slopes.tape.n_inputs() == plain
            && are_slopes(&full.slopes, n + n_rows, 0..plain - n_numbers)
            && full.directional_slopes.tape.n_inputs() == with_u
            && are_slopes(&full.directional_slopes, n_rows, z);
        must(fit, "derivatives are those of functions by their inputs")
    }

    fn check_pairs(&self) -> Result<(), Fault> {
        let (n_z, n_rows) = (self.n_algebraics(), self.full.directional.n_outputs());
        let mut members = self.pairs.iter().flat_map(|pair| [pair.left, pair.right]);
        must(
            members.all(|member| member.variable < n_z),
            "members of pairs are among z",
        )?;
        let mut switches = self.switches_of.iter().flatten();
        let are_there = switches.all(|switch| *switch < self.n_switches());
        must(
            self.switches_of.len() == self.pairs.len() && are_there,
            "every pair has its switches",
        )?;
        let mut discs = self.discs.iter();
        let are_there = discs.all(|disc| {
            disc.pair < self.pairs.len()
                && disc.own().iter().all(|z| *z < n_z)
                && disc.all_rows().iter().all(|row| *row < n_rows)
                && disc.switches.iter().all(|k| *k < self.n_switches())
        });
        must(are_there, "discs have their pairs, equations and switches")?;
        let mut members = self.switches.iter().filter_map(|switch| switch.member);
        let are_there = members.all(|(pair, _)| pair < self.pairs.len());
        must(are_there, "members of complementarities have their pairs")
    }

    fn check_surfaces(&self) -> Result<(), Fault> {
        let surfaces = &self.surfaces;
        let (n, n_switches) = (self.n_states(), self.n_switches());
        let n_inputs = 1 + n + n_switches + self.n_numbers();
        must(
            surfaces.psi.n_inputs() == n_inputs && surfaces.psi.n_outputs() >= n_switches,
            "every switch has its function",
        )?;
        let mut leading = surfaces.leading.iter();
        let lead = leading.all(|leading| {
            let terms = &leading.terms;
            leading.switch < n_switches && terms.n_inputs() == n_inputs && terms.n_outputs() > 0
        });
        must(lead, "what leads is a switch with its function")?;
        let mut gaps = surfaces.gaps.iter();
        must(gaps.all(|k| *k < n_switches), "gaps are those of switches")?;
        let n_rows = self.full.directional.n_outputs();
        let rules = &surfaces.rules;
        let is_fed = |rule: &Rule| rules.is_fed(rule, n_switches, n_rows);
        let terms = rules.compared.iter().flatten();
        let mut terms = terms.map(|&(j, _)| j);
        let Units { z, states, .. } = &surfaces.units;
        let are_units = |units: &[f64], n: usize| {
            units.is_empty() || units.len() == n && units.iter().all(|unit| unit.is_normal())
        };
        must(
            are_units(z, rules.z.len()) && are_units(states, n),
            "every z and every state has its unit",
        )?;
        must(
            rules.z.iter().all(is_fed) && terms.all(|j| j < surfaces.psi.n_outputs()),
            "every z has its rule",
        )
    }
}

impl Rules {
    /// Whether all that a rule refers to is there.
    fn is_fed(&self, rule: &Rule, n_switches: usize, n_rows: usize) -> bool {
        match rule {
            Rule::Zero => true,
            Rule::Alpha(k) | Rule::Above(k) | Rule::Below(k) | Rule::Force(k) => *k < n_switches,
            Rule::Speed(both) | Rule::Inside(both) => both.iter().all(|k| *k < n_switches),
            Rule::Share(own) => own.iter().all(|(k, _)| *k < n_switches),
            Rule::Excess(own, all) => all.contains(own) && all.end <= self.compared.len(),
            Rule::Least(all) => all.start <= all.end && all.end <= self.compared.len(),
            Rule::Product(row) => *row < n_rows,
        }
    }
}

crate::checked_when_read!(ComplementaritySystem);
