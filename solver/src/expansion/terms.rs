//! Memory for the sizes of terms, and for what tells a step from the functions that it stands for.

use wide::f64x4;

use super::layout::Memory;
use crate::hybrid::HybridSystem;
use crate::tape::Rounded;

/// The golden and the silver ratio: their multiples disturb no two terms alike.
pub(super) const GOLDEN: f64 = 0.618_033_988_749_895;
pub(super) const SILVER: f64 = 0.414_213_562_373_095;

/// Sizes of the terms of rates at the expansion point, which may cancel, as changes of all inputs show them.
pub(crate) struct Terms {
    /// Of every f_i.
    pub of_rates: Vec<f64>,
    /// Inputs next to those of the expansion point, and others: terms that happen to cancel once do not do so twice.
    pub perturbed: Vec<f64>,
    pub perturbed_again: Vec<f64>,
    /// By what share they differ.
    pub share: f64,
    /// f where these turn what slips in a plane.
    pub(super) turned: Vec<f64>,
}

impl Terms {
    /// None known of n rates.
    pub(crate) fn new(n: usize) -> Self {
        Terms {
            of_rates: vec![0.0; n],
            perturbed: Vec::new(),
            perturbed_again: Vec::new(),
            share: 0.0,
            turned: vec![0.0; n],
        }
    }

    /// Changes all inputs by about a share of themselves in two ways.
    pub(super) fn perturb_twice(
        &mut self,
        by: f64,
        memory: &Memory,
        sliding: &[usize],
        system: &HybridSystem,
    ) {
        self.share = by;
        self.perturb(SILVER, memory, sliding, system);
        self.perturbed_again.clone_from(&self.perturbed);
        self.perturb(GOLDEN, memory, sliding, system);
    }

    /// Changes no two inputs alike: by multiples of an irrational number.
    pub(super) fn perturb(
        &mut self,
        number: f64,
        memory: &Memory,
        sliding: &[usize],
        system: &HybridSystem,
    ) {
        let by = self.share;
        self.perturbed.clone_from(&memory.values);
        let mut share = 0.0_f64;
        let mut perturb = |input: &mut f64| {
            share = (share + number).fract();
            *input *= 1.0 + by * (2.0 * share - 1.0).signum() * (0.5 + share);
        };
        let n = memory.n_states;
        self.perturbed[..=n].iter_mut().for_each(&mut perturb);
        for &i in sliding {
            let alpha = &mut self.perturbed[1 + n + i];
            match system.is_unilateral(i) && alpha.abs() < 0.5 {
                // A force is 1 - α, and no smaller where α is.
                true => {
                    let mut force = 1.0 - *alpha;
                    perturb(&mut force);
                    *alpha = 1.0 - force;
                }
                false => perturb(alpha),
            }
        }
    }
}

/// What the series of a step say at the probes, and what differences from it are relative to.
#[derive(Default)]
pub(crate) struct Probed {
    /// t, x, α and numbers, as the inputs of functions.
    pub(super) values: Vec<f64x4>,
    pub(super) rates: Vec<f64x4>,
    /// Error scales of the states.
    pub(super) scales: Vec<f64>,
}

impl Probed {
    pub(crate) fn new(n_states: usize) -> Self {
        Probed {
            values: Vec::new(),
            rates: vec![f64x4::splat(0.0); n_states],
            scales: vec![0.0; n_states],
        }
    }

    /// Takes other coefficients of pieces, and parameters.
    pub(crate) fn load(&mut self, memory: &Memory) {
        for place in memory.coefficients().chain(memory.parameters()) {
            if let Some(lanes) = self.values.get_mut(place) {
                *lanes = f64x4::splat(memory.values[place]);
            }
        }
    }
}

/// A point of a step: the inputs of functions there, and the rates that a series has instead.
#[derive(Default)]
pub(super) struct Inputs {
    pub(super) values: Vec<f64>,
    pub(super) rates: Vec<f64>,
}

/// Running errors of rates.
#[derive(Default)]
pub(crate) struct Rounding {
    pub(super) registers: Vec<Rounded>,
    pub(super) points: [Inputs; 4],
    /// Of every rate that is zero within its running error, that error; 0 of others.
    pub(super) errors: Vec<f64>,
    /// How far that moves states that are nothing but rounding.
    pub(super) moved: Vec<f64>,
    /// The errors in the pass at hand.
    pub(super) next: Vec<f64>,
    /// The states whose rates are in doubt.
    pub(super) doubted: Vec<bool>,
}
