//! Switching functions that come in twos: w = (ψ_i, ψ_j), a slip velocity with two entries, vanishes at a point of a plane.
//!
//! Neither ψ = 0 alone is an event. What is monitored is w·d with the direction d = w/|w| at the start of a step. Rates have
//! u = w/|w| while w is not zero, whose derivatives have no bound at w = 0.

use super::layout::Memory;
use super::surfaces::Surfaces;
use crate::hybrid::{HybridSystem, Side};

/// What is monitored of two switching functions, by the first of their switches.
#[derive(Clone, Default)]
struct Plane {
    /// The other switch.
    other: usize,
    /// d.
    direction: [f64; 2],
    /// The series of w·d.
    series: Vec<f64>,
    /// The states whose rates have u in them.
    states: Vec<usize>,
    /// Whether w was not zero when sizes of terms were measured last.
    slipped: bool,
}

/// The pairs of a system, by switch.
pub(crate) struct Planes {
    of: Vec<Option<Plane>>,
    /// Switches of those that leave w = 0 within the step.
    pub onsets: Vec<usize>,
}

impl Planes {
    pub fn new(system: &HybridSystem) -> Self {
        let plane = |i: usize| {
            let other = system.second(i)?;
            let is_read = |switch: &usize| [i, other].contains(switch);
            let blocks = system.blocks.iter();
            let blocks = blocks.filter(|block| block.switches.iter().any(is_read));
            Some(Plane {
                other,
                states: blocks.flat_map(|block| block.states.clone()).collect(),
                ..Plane::default()
            })
        };
        Planes {
            of: (0..system.n_switches()).map(plane).collect(),
            onsets: Vec::new(),
        }
    }

    /// Whether the system has any.
    pub fn any(&self) -> bool {
        self.of.iter().any(Option::is_some)
    }

    /// The other switch of a pair that slips on these sides, of which this is the first one.
    pub fn slips_with(
        &self,
        switch: usize,
        system: &HybridSystem,
        sides: &[Side],
    ) -> Option<usize> {
        let other = self.of[switch].as_ref()?.other;
        let slips = sides[switch] != Side::Slide && !system.is_idle(switch, sides);
        slips.then_some(other)
    }

    /// Whether some pair slips on these sides.
    pub fn slip(&self, system: &HybridSystem, sides: &[Side]) -> bool {
        (0..self.of.len()).any(|i| self.slips_with(i, system, sides).is_some())
    }

    /// ψ, or w·d.
    pub fn psi(&self, switch: usize, surfaces: &mut Surfaces, values: &[f64]) -> f64 {
        let mut psi = |i: usize| surfaces.value(i, values);
        match &self.of[switch] {
            Some(Plane {
                other,
                direction: [d, e],
                ..
            }) => d * psi(switch) + e * psi(*other),
            None => psi(switch),
        }
    }

    /// Watches w along the direction that it has where the point is.
    pub fn aim(&mut self, switch: usize, surfaces: &mut Surfaces, values: &[f64]) {
        if let Some(plane) = &mut self.of[switch] {
            plane.direction = direction([switch, plane.other].map(|i| surfaces.value(i, values)));
        }
    }

    /// Whether what is monitored is affine in time and states.
    pub fn is_affine(&self, switch: usize, surfaces: &Surfaces) -> bool {
        let other = self.of[switch].as_ref().map(|plane| plane.other);
        surfaces.is_affine(switch) && other.is_none_or(|other| surfaces.is_affine(other))
    }

    /// Joins the series of both entries to that of w·d.
    pub fn expand(&mut self, switch: usize, surfaces: &Surfaces, memory: &Memory) {
        let Some(plane) = &mut self.of[switch] else {
            return;
        };
        let [first, second] = [switch, plane.other].map(|i| memory.series(surfaces.row(i)));
        plane.direction = direction([first[0], second[0]]);
        let [d, e] = plane.direction;
        let terms = first.iter().zip(second);
        plane.series.clear();
        plane.series.extend(terms.map(|(a, b)| d * a + e * b));
    }

    /// The states whose rates have u in them, where w slips or did so when this was last asked.
    pub fn forgotten(&mut self, switch: usize, slips: bool) -> &[usize] {
        let Some(plane) = &mut self.of[switch] else {
            return &[];
        };
        match std::mem::replace(&mut plane.slipped, slips) || slips {
            true => &plane.states,
            false => &[],
        }
    }

    /// The series of w·d, of the first entry of two.
    pub fn series(&self, switch: usize) -> Option<&[f64]> {
        self.of[switch].as_ref().map(|plane| &plane.series[..])
    }
}

/// w/|w|, or any direction where w is zero.
pub(super) fn direction(w: [f64; 2]) -> [f64; 2] {
    let speed = w[0].hypot(w[1]);
    match speed > 0.0 {
        true => w.map(|w| w / speed),
        false => [1.0, 0.0],
    }
}
