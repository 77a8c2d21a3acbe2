//! What a run tells its observer: elements as polynomials, and multipliers at their points.

use std::ops::ControlFlow;

use super::system::measure;
use super::watch::{BAND, Start};
use super::{Run, Simulator};
use crate::event::Segment;
use crate::expansion::series;
use crate::hybrid::{Side, Status};

/// z at the points of an element.
pub struct Multipliers<'a> {
    /// Instants, ascending.
    pub times: &'a [f64],
    /// One row of z per instant.
    pub z: &'a [f64],
}

/// Sees a run while it happens.
pub trait Observer: crate::event::Observer {
    /// Whether [`Observer::multipliers`] is to be called.
    fn wants_multipliers(&self) -> bool {
        false
    }
    /// z in an element that was accepted.
    fn multipliers(&mut self, _multipliers: &Multipliers) {}
}

impl Simulator<'_> {
    /// Reports the elements solved since the last report, and moves the run to their end, which is
    /// `end` where the step ends there too.
    pub(super) fn report(
        &mut self,
        run: &mut Run,
        count: usize,
        end: Option<f64>,
        observer: &mut impl Observer,
    ) -> Result<(), Status> {
        for at in 0..count {
            let solved = &self.solved[at];
            solved.end(&mut run.x, &mut run.low);
            let start = solved.t;
            let length = match end.filter(|_| at + 1 == count) {
                Some(end) => {
                    run.go_to(end);
                    (end - start) - solved.t_low
                }
                None => {
                    (run.t, run.t_low) = solved.stop();
                    solved.h
                }
            };
            measure(&mut run.scale, &run.x, &self.system.algebraic_states);
            let activity = &self.modes[run.mode].element.activity;
            for (work, activity) in run.work.iter_mut().zip(activity) {
                *work += activity * length;
            }
            run.stats.steps += 1;
            if !run.x.iter().all(|x| x.is_finite()) {
                return Err(Status::NotFinite);
            }
            self.series(run, at);
            let segment = Segment {
                start,
                length,
                until: run.t,
                sides: &self.modes[run.mode].element.reduced.sides,
                end: &run.x,
                dense: &self.series,
            };
            if length > 0.0 && observer.segment(&segment) == ControlFlow::Break(()) {
                return Err(Status::Stopped);
            }
            if observer.wants_multipliers() {
                self.tell_multipliers(run, at, observer);
            }
        }
        let last = &self.solved[count - 1];
        let unknowns = &self.modes[run.mode].element.reduced.unknowns;
        for (&z, w) in unknowns.iter().zip(&last.w) {
            run.z[z] = *w;
        }
        self.go_on(run, self.solved[count - 1].h);
        Ok(())
    }

    /// How the members start in an element that follows on one of length `h` in the same mode: one that
    /// has not left zero yet starts as it did.
    fn go_on(&self, run: &mut Run, h: f64) {
        let sizes = run.sizes.iter().enumerate();
        for (start, (member, size)) in run.starts.iter_mut().zip(sizes) {
            let values = self.values.of(&self.scheme, member).iter();
            let largest = values.fold(0.0_f64, |largest, value| largest.max(value.abs()));
            if *start != Start::Tangent || largest > BAND * size.max(run.rate_scale * h) {
                *start = Start::Inside;
            }
        }
    }

    /// Writes the polynomials of an element: x(τ) = x₀ + ∫ V, and α through its values at the points.
    pub(super) fn series(&mut self, run: &Run, at: usize) {
        let (scheme, solved) = (&self.scheme, &self.solved[at]);
        let element = &self.modes[run.mode].element;
        let (n, s, per_node) = (run.x.len(), scheme.s, element.per_node());
        let sides = &element.reduced.sides;
        let n_points = scheme.points.len();
        let degree = s.max(n_points - 1);
        let series = &mut self.series;
        series.shape(n, sides.len(), degree);
        for i in 0..n {
            let c = series.row_mut(i);
            c[0] = solved.x[i];
            for (j, powers) in scheme.integrals.chunks_exact(s).enumerate() {
                let rate = solved.unknowns[j * per_node + i];
                for (c, power) in c[1..=s].iter_mut().zip(powers) {
                    *c += rate * power;
                }
            }
            if element.is_projected() {
                // What the end was moved by, evenly over the element.
                c[1] += solved.mean[i] - c[1..=s].iter().sum::<f64>();
            }
            // σ = τ/h
            let mut scale = 1.0;
            for c in &mut c[1..=s] {
                *c *= scale;
                scale /= solved.h;
            }
        }
        let sliding = (0..sides.len()).filter(|i| sides[*i] == Side::Slide);
        for (place, switch) in sliding.enumerate() {
            let values = &solved.alphas[place * n_points..(place + 1) * n_points];
            let c = series.row_mut(n + switch);
            scheme.point_series(values, c);
            let mut scale = 1.0;
            for c in &mut c[..n_points] {
                *c *= scale;
                scale /= solved.h;
            }
        }
    }

    /// α of all switches where the run is.
    pub(super) fn alphas(&mut self, run: &Run, alpha: &mut [f64]) {
        let mode = &mut self.modes[run.mode];
        let reduced = mode.element.reduced.clone();
        let w = run.z_of(&reduced.unknowns);
        mode.hidden.set(run.t, run.x.iter().copied(), &w);
        if run.fold.is_none() && mode.hidden.solve(&reduced).is_err() {
            return;
        }
        let sliding = (0..alpha.len()).filter(|i| reduced.sides[*i] == Side::Slide);
        for (switch, value) in sliding.zip(mode.hidden.eval(&reduced.alphas)) {
            alpha[switch] = value;
        }
    }

    fn tell_multipliers(&mut self, run: &Run, at: usize, observer: &mut impl Observer) {
        let (scheme, solved) = (&self.scheme, &self.solved[at]);
        let mode = &mut self.modes[run.mode];
        let reduced = mode.element.reduced.clone();
        let w = solved.unknowns[mode.element.n..mode.element.per_node()].to_vec();
        let mut x = vec![0.0; run.x.len()];
        let (mut times, mut z) = (Vec::new(), Vec::new());
        for sigma in &scheme.points {
            let tau = sigma * solved.h;
            for (i, x) in x.iter_mut().enumerate() {
                *x = series::value(self.series.row(i), tau);
            }
            mode.hidden.set(solved.t + tau, x.iter().copied(), &w);
            if mode.hidden.solve(&reduced).is_err() {
                return;
            }
            times.push(solved.t + tau);
            z.extend(mode.hidden.eval(&reduced.algebraics));
        }
        observer.multipliers(&Multipliers {
            times: &times,
            z: &z,
        });
    }

    /// Takes note of how far below zero members are in the element just evaluated.
    pub(super) fn measure(&self, run: &mut Run) {
        for (member, size) in run.sizes.iter().enumerate() {
            for &value in self.values.of(&self.scheme, member) {
                if value < 0.0 {
                    run.least_member = run.least_member.min(value / size.max(BAND));
                }
            }
        }
    }
}
