//! Regions of the model -> partitions with weights in α.

use super::coverage::{Frame, Proof, prove};
use super::sample::Sampler;
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Var};
use crate::source::Span;
use crate::system::lower::Lowering;
use crate::system::switches::interaction::positions;
use crate::system::{Coverage, Partition, Region, State, Switch, SystemError, regions};

/// What the guards of all regions of a model say, by region.
pub(crate) struct Regions<'e> {
    /// 1 where the guard holds.
    pub guards: Vec<Expr<'e>>,
    /// The same off the surfaces, and right where they meet.
    pub weights: Vec<Expr<'e>>,
    /// g of a region with an indicator.
    pub indicators: Vec<Option<Expr<'e>>>,
    /// By partition.
    proofs: Vec<Proof<'e>>,
    /// Regions that hold on a thin set at most.
    thin: Vec<usize>,
}

impl<'e> Lowering<'_, 'e> {
    /// Weights of all regions, zero where one is skipped.
    pub(crate) fn regions(&mut self) -> Regions<'e> {
        let model = self.model;
        let kept = self.needs.regions.clone();
        let zero = model.exprs.constant(0.0);
        let (mut guards, mut indicators) = (Vec::new(), Vec::new());
        for (region, &kept) in model.statements.regions.iter().zip(&kept) {
            let mut value = |e: Expr<'e>| match kept {
                true => self.weight(e, region.guard_span),
                false => zero,
            };
            guards.push(value(region.guard));
            indicators.push(region.indicator.map(value));
        }
        let mut found = Regions {
            weights: guards.clone(),
            guards,
            indicators,
            proofs: Vec::new(),
            thin: Vec::new(),
        };
        // What is no surface has no sides; it is reported.
        if !self.switches.refused.is_empty() || model.statements.regions.is_empty() {
            return found;
        }
        let switches = self.switches.list.iter();
        let surface = switches.map(|switch| {
            // A relay may have either value.
            let alpha = model.exprs.expr(switch.alpha);
            let psi = if switch.relay.is_some() {
                alpha
            } else {
                switch.psi
            };
            (switch.alpha, psi)
        });
        let frame = self.frame(surface.collect());
        for partition in self.kept_partitions() {
            let numbers = &partition.regions;
            let guards: Vec<Expr<'e>> = numbers.iter().map(|&r| found.guards[r]).collect();
            let rest = numbers
                .iter()
                .position(|&r| model.statements.regions[r].is_else);
            let proof = prove(&guards, rest, &frame);
            for (&r, &weight) in numbers.iter().zip(proof.weights.iter().flatten()) {
                found.weights[r] = weight;
            }
            found.thin.extend(proof.thin.iter().map(|&r| numbers[r]));
            found.proofs.push(proof);
        }
        // Regions that only add stand alone.
        let mut alone: Vec<usize> = (0..model.statements.regions.len()).collect();
        alone.retain(|&r| kept[r] && !model.partitions.iter().any(|p| p.regions.contains(&r)));
        alone.retain(|&r| !prove(&found.guards[r..=r], None, &frame).thin.is_empty());
        found.thin.extend(alone);
        found
    }

    /// What is the same for all points: parameters that are not free, and where and when the run begins and ends.
    pub(crate) fn frame(&self, switches: Vec<(Var, Expr<'e>)>) -> Frame<'e> {
        let exprs = self.model.exprs;
        let time = self.model.time.as_variable().expect("time is a variable");
        let number = |var: &Expr<'e>| {
            let var = var.as_variable()?;
            Some((var, *self.values.numbers.get(&var)?))
        };
        let fixed = |var: &Expr<'e>| {
            let var = var.as_variable()?;
            Some((var, exprs.constant(self.values.fixed(var)?)))
        };
        let params = self.model.params.iter().flat_map(|param| &param.vars);
        let ranges = &self.switches.params.ranges;
        let freed = ranges
            .keys()
            .filter_map(|var| Some((*var, *self.values.numbers.get(var)?)));
        let states: Vec<Expr<'e>> = self.model.state_vars().collect();
        let initial = states.iter().filter_map(number);
        let data = self.kept_data();
        let data = data.filter_map(|data| Some((data.var.as_variable()?, data.table.value(0.0))));
        Frame {
            switches,
            params: params.filter_map(fixed).collect(),
            origin: initial
                .chain([(time, 0.0)])
                .chain(data)
                .chain(freed)
                .collect(),
            free: ranges.iter().map(|(&var, &range)| (var, range)).collect(),
            time: (time, self.settings.horizon),
        }
    }

    /// The partitions, checked.
    #[allow(
        clippy::too_many_arguments,
        reason = "parts of the system that is assembled"
    )]
    pub(crate) fn partitions(
        &self,
        found: &Regions<'e>,
        rates: &[Expr<'e>],
        switches: &[Switch<'e>],
        alphas: &[Var],
        sampler: &Sampler<'e>,
        states: &[State<'e>],
        diags: &mut Diagnostics,
    ) -> Vec<Partition<'e>> {
        let model = self.model;
        let region = |&r: &usize| Region {
            name: model.statements.regions[r].name.clone(),
            weight: found.weights[r],
            literals: regions::conjunction(found.weights[r], alphas),
            span: model.statements.regions[r].span,
        };
        let place: Vec<usize> = self.kept_states().map(|(entry, _)| entry).collect();
        let mut partitions = Vec::new();
        for (partition, proof) in self.kept_partitions().zip(&found.proofs) {
            let numbers = &partition.regions;
            let mut built = Partition {
                regions: numbers.iter().map(region).collect(),
                switches: Vec::new(),
                states: (partition.entries.iter())
                    .filter_map(|entry| place.binary_search(entry).ok())
                    .collect(),
                coverage: Coverage::Proven,
                indicators: Vec::new(),
            };
            let guards: Vec<Expr<'e>> = numbers.iter().map(|&r| found.guards[r]).collect();
            let weights = built.regions.iter().map(|region| region.weight);
            built.switches = (weights.chain(guards.iter().copied()))
                .flat_map(|weight| positions(weight, alphas))
                .collect();
            built.switches.sort_unstable();
            built.switches.dedup();
            let indicators: Option<Vec<Expr<'e>>> =
                numbers.iter().map(|&r| found.indicators[r]).collect();
            match indicators {
                // A smallest indicator there always is.
                Some(indicators) => {
                    if regions::decide_all(&built, rates, switches, alphas) {
                        built.indicators = indicators;
                    }
                }
                None => {
                    let spans = numbers
                        .iter()
                        .map(|&r| model.statements.regions[r].guard_span);
                    let spans: Vec<Span> = spans.collect();
                    let found = (guards.as_slice(), proof);
                    match regions::check(&built, found, states, switches, &spans, sampler) {
                        Ok(coverage) => built.coverage = coverage,
                        Err(error) => diags.push(error),
                    }
                }
            }
            partitions.push(built);
        }
        for &r in &found.thin {
            diags.push(SystemError::ThinGuard {
                region: model.statements.regions[r].name.clone(),
                why: match model.statements.regions[r].indicator {
                    Some(_) => "is nowhere the smallest indicator",
                    None => "its comparisons exclude each other",
                },
                span: model.statements.regions[r].guard_span,
            });
        }
        partitions
    }
}
