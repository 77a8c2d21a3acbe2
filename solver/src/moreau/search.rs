//! Which contacts may be active: those whose gap may vanish while no position moves by more than a radius.
//!
//! An enclosure of the gap over all positions within the radius ([`Ball`]) is above zero for a contact that cannot be
//! active until some position has left its range; such a contact costs nothing until then. Contacts of pairs of
//! bodies are searched for pairs of boxes of bodies at once (`pairs.rs`). The list serves as long as every position is
//! within the radius of where it was; the radius is some steps' worth of motion.

use super::pairs::Pairs;
use super::scene::{Family, Scene};
use crate::tape::Ball;

/// Steps at the present speed that a list is to serve.
const STEPS: f64 = 16.0;
/// Radius at least, as a share of the size of positions.
const LEAST: f64 = 1e-4;
/// Enclosures above this share of the size of positions are open: more than what rounding and touching are.
pub(super) const OPEN: f64 = 1e-9;

/// The contacts that are looked at.
pub(super) struct Search {
    /// By family, ascending.
    near: Vec<Vec<u32>>,
    pairs: Vec<Option<Pairs>>,
    /// States that gaps depend on.
    watched: Vec<usize>,
    /// Whether a state may move within the radius; velocities are in no gap.
    is_watched: Vec<bool>,
    /// What `memory` was when the lists were made, and the radii of time and of positions.
    reference: Vec<f64>,
    radii: [f64; 2],
    is_valid: bool,
    work: Enclosing,
    /// Enclosures that were evaluated.
    pub enclosures: usize,
}

/// Memory for enclosures.
#[derive(Default)]
pub(super) struct Enclosing {
    pub inputs: Vec<Ball>,
    registers: Vec<Ball>,
    pub count: usize,
}

impl Enclosing {
    /// Whether the gap of a family is above `least` for all of the inputs.
    pub fn is_open(&mut self, family: &Family, least: f64) -> bool {
        self.count += 1;
        let n = family.gap.n_registers().max(self.inputs.len());
        self.registers.resize(n, Ball::new(0.0, 0.0));
        let mut gap = [Ball::new(0.0, 0.0)];
        family
            .gap
            .eval_lanes(&self.inputs, &mut gap, &mut self.registers[..n]);
        let [Ball { middle, radius }] = gap;
        middle - radius > least
    }
}

impl Search {
    pub fn new(scene: &Scene, n_states: usize) -> Self {
        let mut is_watched = vec![false; n_states];
        for family in &scene.families {
            for member in 0..family.contacts.len() {
                let places = family.inputs_of(member);
                for &input in &family.positions {
                    is_watched[places[input] as usize - 1] = true;
                }
            }
        }
        Search {
            near: vec![Vec::new(); scene.families.len()],
            pairs: (scene.families.iter())
                .map(|family| Pairs::of(family, scene))
                .collect(),
            watched: (0..n_states).filter(|&i| is_watched[i]).collect(),
            is_watched,
            reference: Vec::new(),
            radii: [0.0; 2],
            is_valid: false,
            work: Enclosing::default(),
            enclosures: 0,
        }
    }

    /// Forgets all lists.
    pub fn reset(&mut self) {
        self.is_valid = false;
        self.enclosures = 0;
    }

    /// The members of a family that may be active.
    pub fn near(&self, family: usize) -> &[u32] {
        &self.near[family]
    }

    /// Makes new lists where a position has left its range. `moved` is how far positions move in a step of length `h`.
    pub fn update(&mut self, scene: &Scene, memory: &[f64], h: f64, moved: f64, size: f64) {
        let n = self.is_watched.len();
        let [of_time, radius] = self.radii;
        let is_near = |i: &usize| (memory[1 + i] - self.reference[1 + i]).abs() <= radius;
        if self.is_valid
            && (memory[0] - self.reference[0]).abs() <= of_time
            && memory[1 + n..] == self.reference[1 + n..]
            && self.watched.iter().all(is_near)
        {
            return;
        }
        self.is_valid = true;
        self.reference.clear();
        self.reference.extend_from_slice(memory);
        self.radii = [STEPS * h, (STEPS * moved).max(LEAST * size)];
        let [of_time, radius] = self.radii;
        let is_watched = &self.is_watched;
        let around = |place: u32| {
            let place = place as usize;
            Ball::new(
                memory[place],
                match place {
                    0 => of_time,
                    place if place <= n && is_watched[place - 1] => radius,
                    _ => 0.0,
                },
            )
        };
        for (f, family) in scene.families.iter().enumerate() {
            let near = &mut self.near[f];
            near.clear();
            let work = &mut self.work;
            let mut keep = |member: u32, work: &mut Enclosing| {
                work.inputs.clear();
                let places = family.inputs_of(member as usize).iter();
                work.inputs.extend(places.map(|&place| around(place)));
                if !work.is_open(family, OPEN * size) {
                    near.push(member);
                }
            };
            match &mut self.pairs[f] {
                Some(pairs) => pairs.search(
                    family,
                    memory,
                    radius,
                    of_time,
                    OPEN * size,
                    work,
                    &mut keep,
                ),
                None => (0..family.contacts.len() as u32).for_each(|member| keep(member, work)),
            }
            near.sort_unstable();
        }
        self.enclosures += std::mem::take(&mut self.work.count);
    }
}
