//! What must hold of a step of contacts besides its equations.

use miette::LabeledSpan;
use nsd_solver::simulate::Coefficient;

use super::super::super::outcome::outside;
use super::{CLOSED, IMPULSE, Run, SHORTEST, Step};
use crate::discretize::WINDOW;
use crate::expr::{Expr, Var};
use crate::report::Failure;

/// A gap may be so far below zero between nodes, relative to the largest value.
const BELOW: f64 = 1e-8;
/// A closed contact may begin an element with such a speed, relative to the largest value.
const OPENING: f64 = 1e-8;
/// Points of an element at which gaps are looked at.
const LOOKS: usize = 8;

impl Run<'_, '_> {
    /// Whether no gap is below zero between the nodes.
    pub(super) fn stays_above(&self, Step { layout, w }: &Step) -> bool {
        let basis = |tau: f64| nsd_solver::tableau::lagrange(&layout.points, &[tau]);
        let weights: Vec<Vec<f64>> = (1..LOOKS).map(|i| basis(i as f64 / LOOKS as f64)).collect();
        let gaps: Vec<usize> = self.dcs.impacts.iter().map(|impact| impact.gap).collect();
        layout.all_elements().all(|(k, j)| {
            gaps.iter().all(|&gap| {
                let at = |m: usize| layout.z(k, j, m, gap).map_or(0.0, |index| w[index]);
                let values: Vec<f64> = (0..=layout.end).map(at).collect();
                let size = values.iter().fold(1.0, |m: f64, v| m.max(v.abs()));
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
    pub(super) fn comes_to_rest(&self, step: &Step, start: f64) -> bool {
        let Step { layout, w } = step;
        let window = WINDOW * self.horizon / (self.steps * layout.elements) as f64;
        let least = OPENING.max(CLOSED / window);
        let (mut t, mut open) = (start, self.open.clone());
        layout.all_elements().all(|(k, j)| {
            let from = t;
            t += w[layout.h(k, j)].max(0.0);
            let x = &w[layout.x(k, j, 0)..][..layout.n_states()];
            let value = self.values(x, from);
            let size = x.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
            let lasts = from > 0.0 && self.struck(step, (k, j), &open).is_empty();
            let impacts = self.dcs.impacts.iter().enumerate();
            let holds = impacts.clone().all(|(c, impact)| {
                let force = |m: usize| {
                    layout
                        .z(k, j, m, impact.force)
                        .map_or(0.0, |index| w[index])
                };
                let is_closed = (1..=layout.nodes).any(|m| force(m) > IMPULSE);
                !is_closed || lasts && !open[c] || impact.speed.eval(&value).abs() <= least * size
            });
            open = self.opened(step, (k, j), &open);
            holds
        })
    }

    /// Contacts that meet at the start.
    pub(super) fn come_together(&self) -> Vec<bool> {
        let value = self.values(&self.x, 0.0);
        let size = self.x.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
        let impacts = self.dcs.impacts.iter();
        impacts
            .map(|impact| impact.speed.eval(&value) < -OPENING * size)
            .collect()
    }

    /// The contacts that strike where an element begins. `open` were open before it: impulses of those that were
    /// closed are what the others do to them, or keep their speed at zero.
    pub(super) fn struck(
        &self,
        Step { layout, w }: &Step,
        (k, j): (usize, usize),
        open: &[bool],
    ) -> Vec<usize> {
        let first = layout.impulses(k, j).expect("contacts give impulses");
        let contacts = 0..self.dcs.impacts.len();
        contacts
            .filter(|&c| open[c] && w[first + c] > IMPULSE)
            .collect()
    }

    /// The contacts that are open at a node of an element, if it is long enough to tell; `before` were before.
    pub(super) fn opened(
        &self,
        Step { layout, w }: &Step,
        (k, j): (usize, usize),
        before: &[bool],
    ) -> Vec<bool> {
        if w[layout.h(k, j)] <= SHORTEST * self.horizon {
            return before.to_vec();
        }
        let x = &w[layout.x(k, j, 0)..][..layout.n_states()];
        let size = x.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
        let is_open = |gap: usize| {
            let at = |m: usize| layout.z(k, j, m, gap).map_or(0.0, |index| w[index]);
            (1..=layout.nodes).any(|m| at(m) > CLOSED * size)
        };
        let impacts = self.dcs.impacts.iter();
        impacts.map(|impact| is_open(impact.gap)).collect()
    }

    /// A contact that strikes in a step with a coefficient that no contact has.
    pub(super) fn outside(&self, Step { layout, w }: &Step, start: f64) -> Option<Failure> {
        let mut t = start;
        layout.all_elements().find_map(|(k, j)| {
            let from = t;
            t += w[layout.h(k, j)].max(0.0);
            let value = self.values(&w[layout.before(k, j)..][..layout.n_states()], from);
            let first = layout.impulses(k, j).expect("contacts give impulses");
            let mut impacts = self.dcs.impacts.iter().enumerate();
            impacts.find_map(|(c, impact)| {
                let friction = impact.friction.as_ref();
                let friction = friction.map_or(0.0, |friction| friction.coefficient.eval(&value));
                let found = Coefficient::outside(impact.restitution.eval(&value), friction);
                let strikes = w[first + c] > IMPULSE;
                let of = found.filter(|(_, value)| strikes && !value.is_nan())?;
                let label = LabeledSpan::new_with_span(
                    Some(format!("contact `{}`", impact.name)),
                    impact.span,
                );
                Some(outside(of, (from, impact.name.clone()), vec![label]))
            })
        })
    }

    /// Parameters, states and time, as numbers.
    pub(super) fn values<'x>(&'x self, x: &'x [f64], time: f64) -> impl Fn(Var) -> f64 + 'x {
        move |var: Var| {
            let is = |e: Expr| e.as_variable() == Some(var);
            let state = self.dcs.states.iter().position(|state| is(state.var));
            let param = || self.dcs.params.iter().find(|param| is(param.var));
            match state {
                Some(i) => x[i],
                None if is(self.dcs.time) => time,
                None => param().map_or(f64::NAN, |param| param.value),
            }
        }
    }
}
