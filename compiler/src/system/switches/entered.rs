//! Which surfaces ψ = 0 of a system its functions jump across: its rates, and the ψ of other switches.

use rustc_hash::FxHashSet;

use super::Switches;
use super::continuity::{classify, is_multiple};
use super::interaction::positions;
use super::relay::at_all_sides;
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Var, jacobian};
use crate::system::regions::corners::jumps_somewhere;
use crate::system::regions::coverage::Frame;
use crate::system::regions::sample::Sampler;
use crate::system::{Continuity, Role, Switch, SystemError};

/// The functions that each α of a system enters.
pub(crate) struct Entered<'s, 'e> {
    collected: &'s Switches<'e>,
    /// The switches of the system among those that were collected.
    kept: &'s [usize],
    alphas: &'s [Var],
    /// α of relays.
    relays: Vec<Var>,
    /// Rates and the ψ of other switches by switch, but for kinks that are continuous by form.
    functions: Vec<Vec<Expr<'e>>>,
    sampler: &'s Sampler<'e>,
}

impl<'s, 'e> Entered<'s, 'e> {
    pub fn new(
        collected: &'s Switches<'e>,
        (kept, alphas): (&'s [usize], &'s [Var]),
        rates: &[Expr<'e>],
        switches: &[Switch<'e>],
        sampler: &'s Sampler<'e>,
    ) -> Self {
        let all: Vec<Expr<'e>> = (rates.iter().copied())
            .chain(switches.iter().map(|switch| switch.psi))
            .collect();
        let kinks = (0..alphas.len()).filter(|&k| collected.is_kink(kept[k]));
        let (kinks, kink_alphas): (Vec<usize>, Vec<Var>) = kinks.map(|k| (k, alphas[k])).unzip();
        let slopes = jacobian(&all, &kink_alphas).entries.into_iter();
        let continuous: FxHashSet<(usize, usize)> = slopes
            .map(|(f, j, slope)| (f, kinks[j], slope))
            .filter(|&(_, k, slope)| is_multiple(slope, (alphas[k], switches[k].psi)))
            .map(|(f, k, _)| (f, k))
            .collect();
        let mut functions: Vec<Vec<Expr<'e>>> = vec![Vec::new(); alphas.len()];
        for (number, &f) in all.iter().enumerate() {
            for k in positions(f, alphas) {
                if !continuous.contains(&(number, k)) {
                    functions[k].push(f);
                }
            }
        }
        let relays = (switches.iter().zip(alphas))
            .filter_map(|(switch, &alpha)| switch.relay.map(|_| alpha))
            .collect();
        Entered {
            collected,
            kept,
            alphas,
            relays,
            functions,
            sampler,
        }
    }

    /// What is known about functions across ψ = 0 of a switch. A relay has either value on any surface, and the worse
    /// one counts.
    fn across(&self, functions: &[Expr<'e>], (k, psi): (usize, Expr<'e>)) -> Continuity {
        let Some(sides) = at_all_sides(functions, psi, &self.relays) else {
            return Continuity::Discontinuous;
        };
        let (alpha, is_kink) = (self.alphas[k], self.collected.is_kink(self.kept[k]));
        let classes = (sides.iter())
            .map(|(functions, psi)| classify(functions, (alpha, *psi), is_kink, self.sampler));
        classes.max().unwrap_or(Continuity::Discontinuous)
    }

    /// Classifies the switches that may be continuous.
    pub fn classify(&self, switches: &mut [Switch<'e>], frame: &Frame<'e>) {
        for (k, switch) in switches.iter_mut().enumerate() {
            let functions = &self.functions[k];
            // A hidden term needs no jump to slide by.
            if switch.relay.is_some()
                || switch.is_nonlinear && !functions.is_empty()
                || switch.unilateral
                || switch.slip_of.is_some()
                || switch.role != Role::Step
            {
                continue;
            }
            let known = self.across(functions, (k, switch.psi));
            let jumps =
                known == Continuity::Sampled && jumps_somewhere(functions, k, frame, self.sampler);
            switch.continuity = if jumps {
                Continuity::Discontinuous
            } else {
                known
            };
        }
    }

    /// Reports every ψ that jumps across the surface of a switch that is not decided before it.
    pub fn check_surfaces(&self, switches: &[Switch<'e>], diags: &mut Diagnostics) {
        for outer in switches {
            for k in positions(outer.psi, self.alphas) {
                let inner = &switches[k];
                if self.collected.is_leading(self.kept[k])
                    || !self.functions[k].contains(&outer.psi)
                {
                    continue;
                }
                // What the rates do there is another matter.
                if self.across(&[outer.psi], (k, inner.psi)) == Continuity::Discontinuous {
                    diags.push(SystemError::DiscontinuousSurface {
                        outer: outer.name.clone(),
                        inner: inner.name.clone(),
                        outer_span: outer.spans[0],
                        inner_span: inner.spans[0],
                    });
                }
            }
        }
    }
}
