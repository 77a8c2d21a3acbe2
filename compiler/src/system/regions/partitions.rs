//! Regions of the model -> partitions with weights in α.

use super::conjunction::conjunction;
use super::coverage::{Proof, prove};
use crate::diagnostics::Diagnostics;
use crate::expr::Expr;
use crate::source::Span;
use crate::system::lower::instance::Instance;
use crate::system::lower::translation::Translation;
use crate::system::switches::interaction::positions;
use crate::system::switches::switched::Switched;
use crate::system::{Coverage, Partition, Region, State, SystemError, regions};

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

impl<'e> Regions<'e> {
    /// Weights of all regions, zero where one is skipped.
    pub fn of(translation: &mut Translation<'_, 'e>) -> Self {
        let instance = translation.instance;
        let model = instance.model;
        let kept = &instance.needs.regions;
        let zero = model.exprs.constant(0.0);
        let (mut guards, mut indicators) = (Vec::new(), Vec::new());
        for (region, &kept) in model.statements.regions.iter().zip(kept) {
            let mut value = |e: Expr<'e>| match kept {
                true => translation.in_alphas(e, region.guard_span),
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
        let switches = &translation.switches;
        // What is no surface has no sides; it is reported.
        if !switches.refused.is_empty() || model.statements.regions.is_empty() {
            return found;
        }
        let surface = switches.list.iter().map(|switch| {
            // A relay may have either value.
            let alpha = model.exprs.expr(switch.alpha);
            let psi = if switch.relay.is_some() {
                alpha
            } else {
                switch.psi
            };
            (switch.alpha, psi)
        });
        let frame = translation.frame(surface.collect());
        for partition in instance.partitions() {
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

    /// The partitions, checked.
    pub fn partitions(
        &self,
        instance: &Instance<'_, 'e>,
        switched: &Switched<'_, 'e>,
        states: &[State<'e>],
        diags: &mut Diagnostics,
    ) -> Vec<Partition<'e>> {
        let (model, alphas) = (instance.model, switched.alphas);
        let region = |&r: &usize| Region {
            name: model.statements.regions[r].name.clone(),
            weight: self.weights[r],
            literals: conjunction(self.weights[r], alphas),
            span: model.statements.regions[r].span,
        };
        let mut partitions = Vec::new();
        for (partition, proof) in instance.partitions().zip(&self.proofs) {
            let numbers = &partition.regions;
            let mut built = Partition {
                regions: numbers.iter().map(region).collect(),
                switches: Vec::new(),
                states: (partition.entries.iter())
                    .filter_map(|&entry| instance.place(entry))
                    .collect(),
                coverage: Coverage::Proven,
                indicators: Vec::new(),
            };
            let guards: Vec<Expr<'e>> = numbers.iter().map(|&r| self.guards[r]).collect();
            let weights = built.regions.iter().map(|region| region.weight);
            built.switches = (weights.chain(guards.iter().copied()))
                .flat_map(|weight| positions(weight, alphas))
                .collect();
            built.switches.sort_unstable();
            built.switches.dedup();
            let indicators: Option<Vec<Expr<'e>>> =
                numbers.iter().map(|&r| self.indicators[r]).collect();
            match indicators {
                // A smallest indicator there always is.
                Some(indicators) => {
                    if regions::decide_all(&built, switched) {
                        built.indicators = indicators;
                    }
                }
                None => {
                    let spans = numbers
                        .iter()
                        .map(|&r| model.statements.regions[r].guard_span);
                    let spans: Vec<Span> = spans.collect();
                    let found = (guards.as_slice(), proof);
                    match regions::check(&built, found, states, &spans, switched) {
                        Ok(coverage) => built.coverage = coverage,
                        Err(error) => diags.push(error),
                    }
                }
            }
            partitions.push(built);
        }
        for &r in &self.thin {
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
