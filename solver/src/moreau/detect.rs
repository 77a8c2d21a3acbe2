//! Detection of contacts: which gaps are closed, or nearly, at given positions.

use super::bodies::Bodies;
use super::resolution::{Lengths, Resolution};
use super::rows::{self, Linear};
use super::scene::Scene;
use super::search::Search;
use crate::tape::LaneScratch;

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
    lengths: Lengths,
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
            lengths: Lengths::default(),
            scene,
        }
    }

    /// Begins a run.
    pub fn begin(&mut self) {
        self.search.reset();
        self.evaluated = 0;
        self.lengths = Lengths::default();
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
        let size = positions.fold(f64::MIN_POSITIVE, |size, &q| size.max(x[q].abs()));
        self.lengths.measure(size, moved);
        self.search
            .update(&self.scene, &self.memory, h, moved, size);
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
            self.select(f, &wanted);
            let (family, lanes) = (&self.scene.families[f], &mut self.lanes[f][1]);
            found.add(
                family,
                &self.members,
                &self.memory,
                bodies,
                lanes,
                self.lengths,
            );
        }
    }

    /// A contact at (t, x) that is closed by more than rounding, where positions move by `moved` in the run.
    pub fn penetrating(&mut self, t: f64, x: &[f64], moved: f64) -> Option<usize> {
        self.look(t, 0.0, x, 0.0);
        self.lengths.start(moved);
        (0..self.scene.families.len()).find_map(|f| {
            self.select(f, |_, gap, resolution| resolution.is_below(gap));
            let member = *self.members.first()?;
            Some(self.scene.families[f].contacts[member as usize] as usize)
        })
    }

    /// Keeps the members of a family of which the number and the gap are wanted.
    fn select(&mut self, f: usize, wanted: impl Fn(u32, f64, Resolution) -> bool) {
        let (family, near) = (&self.scene.families[f], self.search.near(f));
        self.members.clear();
        self.gaps.clear();
        if near.is_empty() {
            return;
        }
        rows::gather(family, near, &self.memory, &mut self.inputs);
        self.gaps.resize(near.len(), 0.0);
        let lanes = &mut self.lanes[f][0];
        (family.gap).eval_many(&self.inputs, &mut self.gaps, near.len(), lanes);
        self.evaluated += near.len();
        let close = near.iter().zip(&self.gaps);
        let close = close.filter(|&(&member, &gap)| {
            let resolution = self.lengths.of(family, member, &self.memory);
            wanted(family.contacts[member as usize], gap, resolution)
        });
        self.members.extend(close.map(|(&member, _)| member));
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
