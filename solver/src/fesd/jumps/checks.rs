//! What must hold of a step of contacts besides its equations.

use super::{Impact, Program, SHORTEST, StepProgram, Stepper};
use crate::hybrid::Coefficient;
use crate::integrate::tableau::lagrange;
use crate::linalg::largest;

/// Impulses below this are rounding.
const IMPULSE: f64 = 1e-9;
/// A gap that is so small, relative to the largest state, is closed.
pub const CLOSED: f64 = 1e-11;
/// A gap may be so far below zero between nodes, relative to the largest value.
const BELOW: f64 = 1e-8;
/// A closed contact may begin an element with such a speed, relative to the largest value.
const OPENING: f64 = 1e-8;
/// Points of an element at which gaps are looked at.
const LOOKS: usize = 8;

impl Stepper {
    /// Whether no gap is below zero between the nodes.
    pub(crate) fn stays_above<P>(&self, step: &StepProgram<P>, w: &[f64]) -> bool {
        let basis = |tau: f64| lagrange(&step.points, &[tau]);
        let weights: Vec<Vec<f64>> = (1..LOOKS).map(|i| basis(i as f64 / LOOKS as f64)).collect();
        (0..step.elements.len()).all(|j| {
            self.points.contacts.impacts.iter().all(|impact| {
                let values = (0..step.points.len()).map(|m| step.z(w, j, m, impact.gap));
                let values: Vec<f64> = values.collect();
                let size = largest(&values).max(1.0);
                weights.iter().all(|weights| {
                    let value: f64 = weights.iter().zip(&values).map(|(l, v)| l * v).sum();
                    value >= -BELOW * size
                })
            })
        })
    }

    /// Whether contacts that are closed in an element do not open where it begins: otherwise their forces have
    /// absorbed a bounce, which the equations of an element of few nodes allow where it is slow.
    ///
    /// The law of impacts, gap/τ + J_nᵀ(v⁺ + e v⁻) ≥ 0, leaves speeds open that are gaps of rounding over τ. A contact
    /// that stays closed while none is struck has no bounce: its speed is the error of the elements before, as its gap
    /// is zero at nodes alone.
    pub(crate) fn comes_to_rest<P>(
        &mut self,
        step: &StepProgram<P>,
        w: &[f64],
        start: f64,
    ) -> bool {
        let least = OPENING.max(CLOSED / (step.window * step.length()));
        let (mut t, mut open) = (start, self.open.clone());
        for j in 0..step.elements.len() {
            let from = t;
            t += w[step.elements[j].length].max(0.0);
            let x = step.states(w, j, 0);
            let size = largest(x).max(1.0);
            let lasts = from > 0.0 && self.struck(step, w, j, &open).is_empty();
            let is_closed: Vec<bool> = (self.points.contacts.impacts.iter())
                .map(|impact| (1..=step.nodes).any(|m| step.z(w, j, m, impact.force) > IMPULSE))
                .collect();
            let holds = self
                .points
                .laws(from, x)
                .enumerate()
                .all(|(c, [speed, ..])| {
                    !is_closed[c] || lasts && !open[c] || speed.abs() <= least * size
                });
            if !holds {
                return false;
            }
            open = self.opened(step, w, j, &open);
        }
        true
    }

    /// Contacts that meet at the start.
    pub(crate) fn come_together(&mut self, x: &[f64]) -> Vec<bool> {
        let size = largest(x).max(1.0);
        let laws = self.points.laws(0.0, x);
        laws.map(|[speed, ..]| speed < -OPENING * size).collect()
    }

    /// The contacts that strike where an element begins. `open` were open before it: impulses of those that were
    /// closed are what the others do to them, or keep their speed at zero.
    pub(crate) fn struck<P>(
        &self,
        step: &StepProgram<P>,
        w: &[f64],
        j: usize,
        open: &[bool],
    ) -> Vec<usize> {
        let first = step.elements[j].impulses;
        let contacts = 0..open.len();
        contacts
            .filter(|&c| open[c] && w[first + c] > IMPULSE)
            .collect()
    }

    /// The contacts that are open at a node of an element, if it is long enough to tell; `before` were before.
    pub(crate) fn opened<P>(
        &self,
        step: &StepProgram<P>,
        w: &[f64],
        j: usize,
        before: &[bool],
    ) -> Vec<bool> {
        if w[step.elements[j].length] <= SHORTEST * self.horizon {
            return before.to_vec();
        }
        let size = largest(step.states(w, j, 0));
        let is_open =
            |impact: &Impact| (1..=step.nodes).any(|m| step.z(w, j, m, impact.gap) > CLOSED * size);
        self.points.contacts.impacts.iter().map(is_open).collect()
    }

    /// The first contact that strikes in a step with a restitution outside of [0, 1] or a friction below zero: the time, the
    /// contact, and the coefficient with its value. A coefficient that is no number is not looked at.
    pub fn outside<P: Program>(
        &mut self,
        step: &StepProgram<P>,
        w: &[f64],
        start: f64,
    ) -> Option<(f64, usize, (Coefficient, f64))> {
        let mut t = start;
        (0..step.elements.len()).find_map(|j| {
            let from = t;
            t += w[step.elements[j].length].max(0.0);
            let first = step.elements[j].impulses;
            let mut laws = self.points.laws(from, step.before(w, j)).enumerate();
            laws.find_map(|(c, [_, restitution, friction])| {
                let found = Coefficient::outside(restitution, friction);
                let strikes = w[first + c] > IMPULSE;
                let of = found.filter(|(_, value)| strikes && !value.is_nan())?;
                Some((from, c, of))
            })
        })
    }
}
