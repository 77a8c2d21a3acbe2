//! A branch of sliding modes by its own α in place of time.
//!
//! x' = f(t, x, α, w),   0 = φ(t, x, α),   0 = r(t, x, α, w)
//!
//! has, with σ = ±α and T = dt/dσ, along the branch
//!
//! dx/dσ = T f,   dt/dσ = T,   0 = φ,   0 = r,   where dφ/dσ = ±∂φ/∂α + T (∇φ·f + ∂φ/∂t) = 0 determines T
//!
//! It is smooth where T = 0: a sliding fold, at which α as a function of time is not.

use super::system::{ComplementaritySystem, Reduced, Watched, Zero};
use crate::fesd::system::active::{Active, sides, sliding};
use crate::fesd::system::full::Functions;
use crate::hybrid::Partials;
use crate::tape::Sum;

impl ComplementaritySystem {
    /// The functions while these members are zero, along a branch by one of its unknowns z_i: σ = z_i, or -z_i where it
    /// does not rise, stands for t, t and the time that is left follow x, and dt/dσ is the first of w. The last
    /// two watched members are dt/dσ and the time that is left. None where other unknowns occur in what determines z_i.
    pub(crate) fn branch(&self, zeros: &[Zero], i: usize, rises: bool) -> Option<Reduced> {
        let mut active = Active::of(self, &self.fixed(zeros)?, &[], false)?;
        let phi = active.differentiate().hidden;
        let followed = self.input_of(i);
        let mut others = active.unknowns.clone();
        others.retain(|input| *input != followed);
        let own = (phi.iter()).position(|row| active.sums.reads(row) == [followed])?;

        let [speed, left] = [0, 1].map(|k| active.sums.input(self.behind() + k));
        let sign = if rises { 1.0 } else { -1.0 };
        let along = active.along(&phi[own]);
        let by_alpha = active.slopes(&phi[own], followed..=followed);
        let mut hidden = phi.clone();
        hidden[own] = (by_alpha.iter())
            .fold(active.sums.product(&speed, &along), |sum, (_, slope)| {
                sum.plus(sign, slope)
            });
        let rates = active.rates.clone();
        let rates = rates.iter().map(|rate| active.sums.product(&speed, rate));
        let mut functions: Vec<Sum> = rates.collect();
        functions.extend([speed.clone(), speed.times(-1.0)]);
        functions.extend(phi);
        let (mut watched, mut members) = active.members(zeros, &[])?;
        let pair = self.pairs.len();
        watched.extend([Watched { pair, stops: false }; 2]);
        members.extend([speed, left]);
        let alphas = active.sums.take(&self.full.alphas, &active.inputs);
        let sides = sides(&alphas);
        let sliding = sliding(&alphas, &sides);

        // z_i = ±σ.
        let n = self.n_states();
        let sigma = active.sums.input(followed).times(sign);
        let states = (1..=n).chain([0, self.behind() + 1]);
        let unknowns = [self.behind()].into_iter().chain(others.iter().copied());
        let numbers = self.input_of(self.n_algebraics())..self.behind();
        let inputs = [followed].into_iter().chain(states).chain(unknowns);
        let inputs: Vec<usize> = inputs.chain(numbers).collect();
        let mut tape = |functions: &[Sum]| {
            let by = |input: usize| (input == followed).then_some(&sigma);
            let functions = functions.iter();
            let functions: Vec<Sum> = functions
                .map(|function| active.sums.replace(function, &by))
                .collect();
            active.sums.tape(&functions, &inputs)
        };
        let (equations, hidden) = (tape(&functions), tape(&hidden));
        let (members, alphas) = (tape(&members), tape(&sliding));
        let n_all = 1 + n + 2 + 1 + others.len();
        let by = |input: usize| input < n_all;
        let others = others.iter().map(|z| z - self.input_of(0));
        Some(Reduced {
            unknowns: [i].into_iter().chain(others).collect(),
            equations: Functions::new(equations, by),
            hidden: Functions::new(hidden, by),
            algebraics: Partials::none(0).tape,
            kept: None,
            members: Functions::new(members, by),
            watched,
            sides,
            alphas,
            is_direct: false,
            has_branches: false,
            is_linear: false,
        })
    }
}
