//! Detection of contacts: which gaps are closed, or nearly, at given positions.
//!
//! Gaps that count as zero are shares of a length, which is the largest position |q|. Where places are far from zero,
//! |q| says nothing of lengths: a gap that is closed is a small share of what steps move positions by, but no less than
//! four roundings of the positions that it balances.

use super::bodies::{Bodies, ROUNDING};
use super::rows::{self, Linear, Resolution, TOUCH};
use super::scene::Scene;
use super::search::Search;
use crate::tape::LaneScratch;

/// No gap is closed above this share of what steps move positions by.
const CLOSED: f64 = 1e-2;
/// A contact is closed by more than rounding at the start where its gap is below minus this share of its length.
const PENETRATES: f64 = 1e-9;

/// Evaluates gaps of contacts.
pub(super) struct Detector {
    scene: Scene,
    search: Search,
    /// t, x, coefficients, numbers.
    memory: Vec<f64>,
    n_states: usize,
    lanes: Vec<[LaneScratch; 2]>,
    gaps: Vec<f64>,
    inputs: Vec<f64>,
    members: Vec<u32>,
    evaluated: usize,
    /// The largest |q|, and the length of which gaps that count as zero are shares.
    size: f64,
    length: f64,
    /// The most that a step of the run has moved a position by.
    moved: f64,
}

impl Detector {
    pub fn new(scene: Scene, n_states: usize, coefficients: &[f64]) -> Self {
        let mut memory = vec![0.0; 1 + n_states];
        memory.extend_from_slice(coefficients);
        memory.extend_from_slice(&scene.numbers);
        Detector {
            search: Search::new(&scene, n_states),
            memory,
            n_states,
            lanes: (scene.families.iter())
                .map(|family| [family.gap.lane_scratch(), family.row.lane_scratch()])
                .collect(),
            gaps: Vec::new(),
            inputs: Vec::new(),
            members: Vec::new(),
            evaluated: 0,
            size: 0.0,
            length: 0.0,
            moved: 0.0,
            scene,
        }
    }

    /// Begins a run.
    pub fn begin(&mut self) {
        self.search.reset();
        self.evaluated = 0;
        self.moved = 0.0;
    }

    /// Gaps that were evaluated, and enclosures of gaps.
    pub fn n_evaluated(&self) -> usize {
        self.evaluated + self.search.enclosures
    }

    /// Takes the coefficients from a breakpoint on.
    pub fn load(&mut self, coefficients: &[f64]) {
        self.memory[1 + self.n_states..][..coefficients.len()].copy_from_slice(coefficients);
    }

    /// Goes to (t, x).
    pub fn go_to(&mut self, t: f64, x: &[f64]) {
        self.memory[0] = t;
        self.memory[1..=self.n_states].copy_from_slice(x);
    }

    /// Finds the contacts that may be active at (t, x), where positions move by `moved` in a step of length h.
    pub fn look(&mut self, t: f64, h: f64, x: &[f64], moved: f64) {
        self.go_to(t, x);
        let positions = self.scene.bodies.iter().flat_map(|body| &body.positions);
        self.size = positions.fold(f64::MIN_POSITIVE, |size, &q| size.max(x[q].abs()));
        self.measure(moved);
        self.search
            .update(&self.scene, &self.memory, h, moved, self.size);
    }

    /// Sets the length of gaps where positions move by `moved` in a step; where nothing has moved yet, it is their size.
    fn measure(&mut self, moved: f64) {
        self.moved = self.moved.max(moved);
        self.length = match self.moved > 0.0 {
            true => self.size.min(CLOSED / TOUCH * self.moved),
            false => self.size,
        };
    }

    /// The rows of the contacts near x of which the number and the gap are wanted.
    pub fn find(
        &mut self,
        bodies: &Bodies,
        found: &mut Linear,
        wanted: impl Fn(u32, f64, Resolution) -> bool,
    ) {
        found.clear();
        for f in 0..self.scene.families.len() {
            let resolution = self.select(f, &wanted);
            let (family, lanes) = (&self.scene.families[f], &mut self.lanes[f][1]);
            found.add(
                family,
                &self.members,
                &self.memory,
                bodies,
                lanes,
                resolution,
            );
        }
    }

    /// A contact at (t, x) that is closed by more than rounding, where positions move by `moved` in a step.
    pub fn penetrating(&mut self, t: f64, x: &[f64], moved: f64) -> Option<usize> {
        self.look(t, 0.0, x, 0.0);
        self.measure(moved);
        (0..self.scene.families.len()).find_map(|f| {
            self.select(f, |_, gap, resolution| {
                gap.is_nan() || gap < -resolution.share(PENETRATES)
            });
            let member = *self.members.first()?;
            Some(self.scene.families[f].contacts[member as usize] as usize)
        })
    }

    /// What gaps of a family are told apart.
    fn resolution(&self, f: usize) -> Resolution {
        let (length, mut size) = (self.length, 0.0_f64);
        if length < self.size {
            let family = &self.scene.families[f];
            for &member in self.search.near(f) {
                let places = family.inputs_of(member as usize);
                let positions = family.positions.iter().map(|&input| places[input] as usize);
                size = positions.fold(size, |size, place| size.max(self.memory[place].abs()));
            }
        }
        Resolution {
            length,
            rounding: ROUNDING * size,
        }
    }

    /// Keeps the members of a family of which the number and the gap are wanted.
    fn select(&mut self, f: usize, wanted: impl Fn(u32, f64, Resolution) -> bool) -> Resolution {
        let resolution = self.resolution(f);
        let (family, near) = (&self.scene.families[f], self.search.near(f));
        self.members.clear();
        self.gaps.clear();
        if near.is_empty() {
            return resolution;
        }
        rows::gather(family, near, &self.memory, &mut self.inputs);
        self.gaps.resize(near.len(), 0.0);
        let lanes = &mut self.lanes[f][0];
        (family.gap).eval_many(&self.inputs, &mut self.gaps, near.len(), lanes);
        self.evaluated += near.len();
        let close = near.iter().zip(&self.gaps);
        let close = close
            .filter(|&(&member, &gap)| wanted(family.contacts[member as usize], gap, resolution));
        self.members.extend(close.map(|(&member, _)| member));
        resolution
    }

    /// The gap of a contact at (t, x).
    pub fn gap_of(&mut self, contact: u32) -> f64 {
        for (family, lanes) in self.scene.families.iter().zip(&mut self.lanes) {
            if let Ok(member) = family.contacts.binary_search(&contact) {
                rows::gather(family, &[member as u32], &self.memory, &mut self.inputs);
                let mut gap = [0.0];
                family
                    .gap
                    .eval_many(&self.inputs, &mut gap, 1, &mut lanes[0]);
                return gap[0];
            }
        }
        0.0
    }
}

/// Whether a gap is not above `most`: one that is no number is none that is known to be open.
pub(super) fn is_up_to(gap: f64, most: f64) -> bool {
    gap.is_nan() || gap <= most
}
