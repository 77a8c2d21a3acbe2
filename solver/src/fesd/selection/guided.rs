//! The active set where switches are nonlinear.
//!
//! Several sliding modes may satisfy the complementarity conditions at once, so that these do not say which one is
//! taken: a mode selector does, from the side that the state comes from. The active set follows from the sides that it names,
//! and z from the α that it names, as the solution of the directional equations next to them.

use super::directional::{Solved, TIE};
use super::independent::rate_scale;
use crate::fesd::system::{ComplementaritySystem, Zero};
use crate::fesd::watch::BAND;
use crate::fesd::{Member, Pair, Run, Simulator};
use crate::hybrid::{Side, Status};
use crate::selector::{Next, Query};

/// How far α of the directional equations may be from the α that was named.
const SAME: f64 = 1e-7;

impl Simulator<'_> {
    /// Finds the set that a run starts with.
    pub(crate) fn begin_guided(&mut self, run: &mut Run, horizon: f64) -> Result<(), Status> {
        let bands = self.bands(run);
        let (x, scale) = (run.x.clone(), run.scale.clone());
        let next = self.ask(Query {
            t: run.t,
            t1: run.t1,
            x: &x,
            scale: &scale,
            before: None,
            triggers: &[],
            fold: None,
        })?;
        self.take_guided(run, next, &bands, horizon)?;
        run.decisions.clear();
        Ok(())
    }

    /// Finds the set that goes on where an element has ended on its boundary.
    pub(crate) fn select_guided(
        &mut self,
        run: &mut Run,
        bands: &[f64],
        length: f64,
    ) -> Result<(), Status> {
        let (sides, alpha) = self.query(run);
        let mut triggers = self.triggers(run, &sides, &alpha, bands);
        triggers.extend(run.fold);
        self.ask_from(run, (&sides, &alpha), &triggers, bands, length)
    }

    /// Finds the set that goes on where functions of time do with other pieces, on which no ψ depends: what slides may
    /// slide otherwise.
    pub(crate) fn pass_guided(&mut self, run: &mut Run, length: f64) -> Result<(), Status> {
        let (sides, alpha) = self.query(run);
        let slides = (0..sides.len()).filter(|&i| sides[i] == Side::Slide);
        let triggers: Vec<usize> = slides.collect();
        let bands = self.bands(run);
        self.ask_from(run, (&sides, &alpha), &triggers, &bands, length)
    }

    /// Sides and α of all switches.
    fn query(&mut self, run: &Run) -> (Box<[Side]>, Vec<f64>) {
        let sides = self.modes[run.mode].element.reduced.sides.clone();
        let mut alpha: Vec<f64> = sides.iter().map(|side| 0.5 + 0.5 * side.sign()).collect();
        self.alphas(run, &mut alpha);
        (sides, alpha)
    }

    /// Asks for the mode after this one, and takes it.
    fn ask_from(
        &mut self,
        run: &mut Run,
        before: (&[Side], &[f64]),
        triggers: &[usize],
        bands: &[f64],
        length: f64,
    ) -> Result<(), Status> {
        let (x, scale) = (run.x.clone(), run.scale.clone());
        let next = self.ask(Query {
            t: run.t,
            t1: run.t1,
            x: &x,
            scale: &scale,
            before: Some(before),
            triggers,
            fold: run.fold.take(),
        })?;
        self.take_guided(run, next, bands, length)
    }

    fn ask(&mut self, query: Query) -> Result<Next, Status> {
        let selector = self.mode_selector.as_mut();
        selector
            .expect("only asked for where there is a selector")
            .next(query)
    }

    /// The switches that have come to their surface, or whose α is at its bound.
    fn triggers(&self, run: &Run, sides: &[Side], alpha: &[f64], bands: &[f64]) -> Vec<usize> {
        let is_near = |switch: usize| {
            let pairs = self.system.pairs.iter().zip(bands).enumerate();
            let mut own =
                pairs.filter(|(pair, _)| self.system.switches_of[*pair].contains(&switch));
            own.all(|(_, (pair, band))| {
                let (continuous, _) = members(self.system, pair);
                continuous.is_none_or(|member| member.value(&run.z) <= *band)
            })
        };
        let is_trigger = |&i: &usize| match sides[i] {
            Side::Slide => alpha[i].min(1.0 - alpha[i]) <= TIE,
            _ => is_near(i),
        };
        (0..sides.len()).filter(is_trigger).collect()
    }

    /// What the directional equations are on both sides of every surface that holds the state: their rates are what
    /// a rate that vanishes is small next to.
    fn sides_of(&mut self, solved: &Solved, bands: &[f64], z: &[f64]) -> Vec<Solved> {
        let system = self.system;
        let mut found = Vec::new();
        for (at, pair) in system.pairs.iter().enumerate() {
            let own = |other: &usize| system.switches_of[*other] == system.switches_of[at];
            let own: Vec<usize> = (0..system.pairs.len()).filter(own).collect();
            let is_near = own.iter().all(|&other| {
                let (continuous, _) = members(system, &system.pairs[other]);
                continuous.is_some_and(|member| member.value(z) <= bands[other])
            });
            let (_, Some(member)) = members(system, pair) else {
                continue;
            };
            if !is_near {
                continue;
            }
            // Every pair of a switch stands for one of its sides: α = 0 here, and 1 - α elsewhere.
            let (mut zeros, mut u) = solved.clone();
            for other in own {
                let pair = &system.pairs[other];
                let is_continuous_left = system.is_continuous(pair.left.variable);
                zeros[other] = match (other == at, is_continuous_left) {
                    (true, true) | (false, false) => Zero::Right,
                    (true, false) | (false, true) => Zero::Left,
                };
            }
            u[member.variable] = if member.complement { 1.0 } else { 0.0 };
            let side = self.directional.solve(system, &zeros, u);
            found.extend(side.map(|u| (zeros, u)));
        }
        found
    }

    /// Goes on with the mode that a selector has named.
    fn take_guided(
        &mut self,
        run: &mut Run,
        next: Next,
        bands: &[f64],
        length: f64,
    ) -> Result<(), Status> {
        let system = self.system;
        let mut zeros = Vec::with_capacity(system.pairs.len());
        let mut u: Vec<f64> = (run.z.iter().enumerate())
            .map(|(i, z)| if system.is_continuous(i) { 0.0 } else { *z })
            .collect();
        let mut named = Vec::new();
        for (at, pair) in system.pairs.iter().enumerate() {
            let (Some(member), [switch]) =
                (members(system, pair).1, system.switches_of[at].as_slice())
            else {
                return Err(Status::Undetermined {
                    switches: system.switches_of[at].to_vec(),
                });
            };
            // α is zero below the surface, 1 - α above it, and what is continuous everywhere else.
            let ends = if member.complement {
                Side::Plus
            } else {
                Side::Minus
            };
            let continuous = if member == pair.left {
                Zero::Right
            } else {
                Zero::Left
            };
            zeros.push(match next.sides[*switch] == ends {
                true => continuous.other(),
                false => continuous,
            });
            u[member.variable] = next.alpha[*switch];
            named.push((member.variable, *switch));
        }
        self.directional.set(run.t, &run.x, &run.z);
        let undetermined = |switches: Vec<usize>| Status::Undetermined { switches };
        let solved = self.directional.solve(system, &zeros, u);
        let changed = (0..next.sides.len()).filter(|&i| next.sides[i] == Side::Slide);
        let u = solved.ok_or_else(|| undetermined(changed.collect()))?;
        let off = |(variable, switch): &&(usize, usize)| {
            (u[*variable] - next.alpha[*switch]).abs() > SAME
        };
        if let Some((_, switch)) = named.iter().find(off) {
            return Err(undetermined(vec![*switch]));
        }
        let gaps = bands
            .iter()
            .fold(0.0_f64, |size, band| size.max(band / BAND));
        let mut found = vec![(zeros, u)];
        found.extend(self.sides_of(&found[0], bands, &run.z));
        let rate_scale = rate_scale(system, &found).max(f64::EPSILON * gaps / length);
        let solved = found.swap_remove(0);
        let choice = self
            .directional
            .choice(system, solved, &run.z, bands, rate_scale);
        let choice = choice.ok_or_else(|| Status::NoSolution {
            switches: named.iter().map(|(_, switch)| *switch).collect(),
        })?;
        run.rungs.predicted += 1;
        run.decisions = next.decisions;
        self.take(run, choice, bands)
    }
}

/// The member of a pair that is continuous, and the one that jumps.
fn members(system: &ComplementaritySystem, pair: &Pair) -> (Option<Member>, Option<Member>) {
    let both = [pair.left, pair.right];
    let is_continuous = |member: &Member| system.is_continuous(member.variable);
    let continuous = both.into_iter().find(is_continuous);
    (
        continuous,
        both.into_iter().find(|member| !is_continuous(member)),
    )
}
