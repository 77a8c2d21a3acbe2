//! The active set where switches are nonlinear.
//!
//! Several sliding modes may satisfy the complementarity conditions at once, so that these do not say which one is
//! taken: a mode selector does, from the side that the state comes from. The active set follows from the sides that it names,
//! and z from the α that it names, as the solution of the directional equations next to them.

use super::bands::Bands;
use super::directional::{Choice, Directional, Solved, TIE};
use super::independent::rate_scale;
use crate::fesd::modes::Modes;
use crate::fesd::run::Run;
use crate::fesd::system::{ComplementaritySystem, Member, Pair, Zero};
use crate::hybrid::{Side, Status};
use crate::selector::{ModeSelector, Next, Query};

/// How far α of the directional equations may be from the α that was named.
const SAME: f64 = 1e-7;

/// Chooses among sliding modes.
pub(crate) struct Guided<'s> {
    pub selector: Box<dyn ModeSelector + 's>,
}

impl Guided<'_> {
    /// The set that a run starts with.
    pub fn begin(
        &mut self,
        directional: &mut Directional,
        run: &mut Run,
        bands: &Bands,
    ) -> Result<Choice, Status> {
        let choice = self.ask(directional, run, None, &[], bands);
        run.decisions.clear();
        choice
    }

    /// The set that goes on where an element has ended on its boundary.
    pub fn select(
        &mut self,
        directional: &mut Directional,
        modes: &mut Modes,
        run: &mut Run,
        bands: &Bands,
    ) -> Result<Choice, Status> {
        let (sides, alpha) = modes.switches(run);
        let mut triggers = triggers(bands, &run.place.z, &sides, &alpha);
        triggers.extend(run.fold);
        self.ask(directional, run, Some((&sides, &alpha)), &triggers, bands)
    }

    /// The set that goes on where functions of time do with other pieces, on which no ψ depends: what slides, with α of
    /// the pieces before, may slide otherwise. λ is computed anew from x.
    pub fn pass(
        &mut self,
        directional: &mut Directional,
        (sides, alpha): (Box<[Side]>, Vec<f64>),
        (modes, run): (&Modes, &mut Run),
        bands: &Bands,
    ) -> Result<Choice, Status> {
        let slides = (0..sides.len()).filter(|&i| sides[i] == Side::Slide);
        let triggers: Vec<usize> = slides.collect();
        run.place.z = bands.system.z_at(run.place.point(&modes.numbers), &[]);
        self.ask(directional, run, Some((&sides, &alpha)), &triggers, bands)
    }

    fn ask(
        &mut self,
        directional: &mut Directional,
        run: &mut Run,
        before: Option<(&[Side], &[f64])>,
        triggers: &[usize],
        bands: &Bands,
    ) -> Result<Choice, Status> {
        let next = self.selector.next(Query {
            t: run.place.t,
            t1: run.t1,
            x: &run.place.x,
            scale: &run.scale,
            before,
            triggers,
            fold: run.fold.take(),
        })?;
        let choice = named(directional, run, &next, bands)?;
        run.decisions = next.decisions;
        Ok(choice)
    }
}

/// The switches that have come to their surface, or whose α is at its bound.
fn triggers(bands: &Bands, z: &[f64], sides: &[Side], alpha: &[f64]) -> Vec<usize> {
    let system = bands.system;
    let is_near = |switch: usize| {
        let pairs = system.pairs.iter().zip(&bands.of).enumerate();
        let mut own = pairs.filter(|(pair, _)| system.switches_of[*pair].contains(&switch));
        own.all(|(_, (pair, band))| {
            let (continuous, _) = members(system, pair);
            continuous.is_none_or(|member| member.value(z) <= *band)
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
fn sides_of(
    directional: &mut Directional,
    bands: &Bands,
    solved: &Solved,
    z: &[f64],
) -> Vec<Solved> {
    let system = bands.system;
    let mut found = Vec::new();
    for (at, pair) in system.pairs.iter().enumerate() {
        let own = |other: &usize| system.switches_of[*other] == system.switches_of[at];
        let own: Vec<usize> = (0..system.pairs.len()).filter(own).collect();
        let is_near = own.iter().all(|&other| {
            let (continuous, _) = members(system, &system.pairs[other]);
            continuous.is_some_and(|member| member.value(z) <= bands.of[other])
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
        let side = directional.solve(system, &zeros, u);
        found.extend(side.map(|u| (zeros, u)));
    }
    found
}

/// The choice with the mode that a selector has named.
fn named(
    directional: &mut Directional,
    run: &mut Run,
    next: &Next,
    bands: &Bands,
) -> Result<Choice, Status> {
    let (system, z) = (bands.system, &run.place.z);
    let mut zeros = Vec::with_capacity(system.pairs.len());
    let mut u: Vec<f64> = (z.iter().enumerate())
        .map(|(i, z)| if system.is_continuous(i) { 0.0 } else { *z })
        .collect();
    let mut named = Vec::new();
    for (at, pair) in system.pairs.iter().enumerate() {
        let (Some(member), [switch]) = (members(system, pair).1, system.switches_of[at].as_slice())
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
    directional.set(run.place.t, &run.place.x, z);
    let undetermined = |switches: Vec<usize>| Status::Undetermined { switches };
    let solved = directional.solve(system, &zeros, u);
    let changed = (0..next.sides.len()).filter(|&i| next.sides[i] == Side::Slide);
    let u = solved.ok_or_else(|| undetermined(changed.collect()))?;
    let off =
        |(variable, switch): &&(usize, usize)| (u[*variable] - next.alpha[*switch]).abs() > SAME;
    if let Some((_, switch)) = named.iter().find(off) {
        return Err(undetermined(vec![*switch]));
    }
    let gaps = bands.largest_size();
    let mut found = vec![(zeros, u)];
    found.extend(sides_of(directional, bands, &found[0], z));
    let rate_scale = rate_scale(system, &found).max(f64::EPSILON * gaps / bands.length);
    let solved = found.swap_remove(0);
    let choice = directional.choice(system, solved, z, &bands.of, rate_scale);
    let choice = choice.ok_or_else(|| Status::NoSolution {
        switches: named.iter().map(|(_, switch)| *switch).collect(),
    })?;
    run.record.rungs.predicted += 1;
    Ok(choice)
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
