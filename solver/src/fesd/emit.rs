//! What a run tells its observer: elements as polynomials, and multipliers at their points.

use std::sync::Arc;

use super::modes::Mode;
use crate::expansion::dense::ElementSeries;
use crate::expansion::series;
use crate::fesd::element::scheme::Scheme;
use crate::fesd::element::solved::Solved;
use crate::fesd::system::Reduced;
use crate::fesd::system::units::Units;
use crate::hybrid::Side;

/// z at the points of an element.
pub struct Multipliers<'a> {
    /// Instants, ascending.
    pub times: &'a [f64],
    /// One row of z per instant.
    pub z: &'a [f64],
}

/// Elements of equal length in one active set, as they have been solved.
pub struct Elements<'a> {
    pub(super) reduced: &'a Arc<Reduced>,
    /// What changes at breakpoints.
    pub(super) numbers: &'a [f64],
    pub(super) solved: &'a [Solved],
    /// The watched member that vanishes at their end; none where that is an instant.
    pub(super) member: Option<usize>,
    /// When they end.
    pub(super) until: f64,
}

/// Sees a run while it happens.
pub trait Observer: crate::event::Observer {
    /// Whether [`Observer::multipliers`] is to be called.
    fn wants_multipliers(&self) -> bool {
        false
    }
    /// Elements that were accepted, before they are told as steps.
    fn elements(&mut self, _elements: &Elements) {}
    /// z in an element that was accepted.
    fn multipliers(&mut self, _multipliers: &Multipliers) {}
}

impl Observer for &mut dyn crate::event::Observer {}

/// x and α along an element.
#[derive(Default)]
pub(crate) struct Polynomials {
    pub series: ElementSeries,
}

impl Polynomials {
    /// Writes the polynomials of an element: x(τ) = x₀ + ∫ V, and α through its values at the points.
    pub fn write(&mut self, scheme: &Scheme, mode: &Mode, solved: &Solved) {
        let element = &mode.element;
        let (n, s, per_node) = (solved.x.len(), scheme.s, element.stages.per_node);
        let sides = &element.reduced.sides;
        let n_points = scheme.points.at.len();
        let degree = s.max(n_points - 1);
        let series = &mut self.series;
        series.shape(n, sides.len(), degree);
        for i in 0..n {
            let Some((start, c)) = series.row_mut(i).split_first_mut() else {
                continue;
            };
            *start = solved.x[i];
            let c = &mut c[..s];
            let nodes = solved.unknowns.chunks_exact(per_node);
            for (powers, node) in scheme.integrals.chunks_exact(s).zip(nodes) {
                let rate = node[i];
                for (c, power) in c.iter_mut().zip(powers) {
                    *c += rate * power;
                }
            }
            if element.is_projected() {
                // What the end was moved by, evenly over the element.
                c[0] += solved.mean[i] - c.iter().sum::<f64>();
            }
            // σ = τ/h
            let mut scale = 1.0;
            for c in c {
                *c *= scale;
                scale /= solved.h;
            }
        }
        let sliding = (0..sides.len()).filter(|i| sides[*i] == Side::Slide);
        for (place, switch) in sliding.enumerate() {
            let values = &solved.alphas[place * n_points..(place + 1) * n_points];
            let c = series.row_mut(n + switch);
            scheme.points.all.series(values, c);
            let mut scale = 1.0;
            for c in &mut c[..n_points] {
                *c *= scale;
                scale /= solved.h;
            }
        }
    }

    /// Tells an observer of z at these points of the element that was written last.
    pub fn tell_multipliers(
        &self,
        (points, units): (&[f64], &Units),
        mode: &mut Mode,
        solved: &Solved,
        observer: &mut dyn Observer,
    ) {
        let Mode { element, hidden } = mode;
        let reduced = &*element.reduced;
        let w = &solved.unknowns[element.stages.n..element.stages.per_node];
        let (mut times, mut z) = (Vec::new(), Vec::new());
        for sigma in points {
            let tau = sigma * solved.h;
            let x = (0..element.stages.n).map(|i| series::value(self.series.row(i), tau));
            hidden.set(solved.t + tau, x, w);
            if hidden.solve(reduced).is_err() {
                return;
            }
            times.push(solved.t + tau);
            let values = hidden.eval(&reduced.algebraics).enumerate();
            z.extend(values.map(|(i, value)| value * units.of_z(i)));
        }
        observer.multipliers(&Multipliers {
            times: &times,
            z: &z,
        });
    }
}
