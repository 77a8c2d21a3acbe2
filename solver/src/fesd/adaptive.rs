//! Elements as long as a tolerance allows.
//!
//! Between its nodes the polynomial of an element misses x' = f by a defect of order h^s, and
//! misses x by about h times that, a local error of order s + 1; at the end of the element the
//! method is of order p > s. The length keeps the defect at ε^((s+1)/(p+1)), so that what the end is
//! off by is about the local tolerance ε.

use super::emit::Observer;
use super::fold::Length;
use super::watch::BAND;
use super::{Grid, Run, Simulator};
use crate::hybrid::Status;

/// A hundredth of the global aim, which the growth of errors along well-conditioned runs does not
/// use up.
const LOCAL: f64 = 0.01;

/// Bounds of the change of length from one element to the next, and what it stays below the best.
pub(super) const GROWTH: [f64; 2] = [0.2, 4.0];
pub(super) const SAFETY: f64 = 0.85;

/// Rounding of a rate, relative to the size of its terms.
pub(super) const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// What a polynomial of a member may miss it by, as a share of its values (chosen by trial).
const FOLLOWS: f64 = 0.01;

/// Members below this share of what they have been are not looked at so closely.
const NEGLIGIBLE_MEMBER: f64 = 1e-6;

/// Elements in a row without length that count as the end of all progress.
const MAX_STALLED: usize = 100;

/// Lengths below this part of the horizon count as none.
const SHORTEST: f64 = 1e-14;

impl Simulator<'_> {
    /// What elements may miss their equations by between the nodes; none on a grid of steps.
    pub fn allowed_defect(&self) -> Option<f64> {
        match self.settings.grid {
            Grid::Steps { .. } => None,
            Grid::Adaptive { tolerance } => Some(self.target(tolerance)),
        }
    }

    fn target(&self, tolerance: f64) -> f64 {
        let order = self.scheme.tableau.order as f64;
        let local = (LOCAL * tolerance).max(f64::EPSILON);
        local.powf((self.scheme.s + 1) as f64 / (order + 1.0))
    }

    /// Integrates to `t1` with a global error of about `tolerance`.
    pub(super) fn adapt(
        &mut self,
        run: &mut Run,
        t1: f64,
        tolerance: f64,
        observer: &mut impl Observer,
    ) -> Result<(), Status> {
        let target = self.target(tolerance);
        let exponent = (self.scheme.s + 1) as f64;
        let horizon = run.left(t1);
        let mut h = match run.next {
            0.0 => 0.01 * horizon,
            next => next,
        };
        let mut stalled = 0;
        while run.t < t1 {
            self.limit(run)?;
            if let Some(ahead) = self.fold_ahead(run) {
                let length = Length {
                    h,
                    target: Some((target, exponent)),
                };
                if self.approach(run, ahead, t1, length, observer)? {
                    continue;
                }
            }
            let left = run.left(t1);
            // No sliver is left at the end.
            let length = match h {
                h if h >= left => left,
                h if h >= 0.5 * left => 0.5 * left,
                h => h,
            };
            let least_member = run.least_member;
            let event = match self.element(run, 0, length) {
                Ok(event) => event,
                Err(Status::Unsolved | Status::NotFinite) if length > SHORTEST * horizon => {
                    (run.last, run.least_member) = (0.0, least_member);
                    h = 0.25 * length;
                    continue;
                }
                Err(status) => return Err(status),
            };
            let mut error = self.defect(run, target);
            if error > target && self.misses_by_rounding(run) {
                error = self.defect(run, target);
            }
            let taken = self.solved[0].h;
            let best = SAFETY * (target / error.max(f64::MIN_POSITIVE)).powf(1.0 / exponent);
            let next = taken * best.clamp(GROWTH[0], GROWTH[1]);
            if error > target && taken > SHORTEST * horizon {
                run.stats.rejected += 1;
                (run.last, run.least_member) = (0.0, least_member);
                h = next.min(0.9 * taken);
                continue;
            }
            run.defect = run.defect.max(error);
            stalled = if taken <= SHORTEST * horizon {
                stalled + 1
            } else {
                0
            };
            if stalled > MAX_STALLED {
                return Err(Status::Unsolved);
            }
            let reaches_end = event.is_none() && length == left;
            self.report(run, 1, reaches_end.then_some(t1), observer)?;
            // What was cut off by a switch or the end says less than what was tried.
            h = if event.is_some() || length == left {
                next.max(h)
            } else {
                next
            };
            run.next = h;
            if event.is_some() && !run.is_at_breakpoint() {
                self.change(run, h, observer)?;
            }
        }
        Ok(())
    }

    /// ‖x' - f‖ h between the nodes of the element just solved, relative to the size of each state.
    fn defect(&mut self, run: &Run, target: f64) -> f64 {
        if self.solved[0].h == 0.0 {
            return 0.0;
        }
        self.series(run, 0);
        let mode = &mut self.modes[run.mode];
        let (solved, scheme) = (&self.solved[0], &self.scheme);
        let reduced = &mode.element.reduced;
        let (n, h) = (run.x.len(), solved.h);
        let algebraic = &self.system.algebraic_states;
        let largest = algebraic.iter().map(|&i| run.scale[i]).fold(0.0, f64::max);
        let mut worst = 0.0_f64;
        for sigma in scheme.probes() {
            let tau = sigma * h;
            let x = (0..n).map(|i| crate::expansion::series::value(self.series.row(i), tau));
            mode.hidden
                .set(solved.t + tau, x, mode.element.w(scheme.s / 2));
            if mode.hidden.solve(reduced).is_err() {
                return f64::INFINITY;
            }
            // Roots of members were looked for in polynomials, which have to be the members.
            for (member, value) in mode.hidden.eval(&reduced.members).enumerate() {
                let stops = reduced.watched.get(member).is_some_and(|w| w.stops);
                let end = if stops { BAND * run.sizes[member] } else { 0.0 };
                let value = value - end;
                let size = run.sizes[member].max(run.rate_scale * h);
                let floor = NEGLIGIBLE_MEMBER * size;
                if self.values.misses(scheme, member, (sigma, value), floor) > FOLLOWS {
                    return f64::INFINITY;
                }
            }
            for (i, f) in mode.hidden.eval(&reduced.equations).take(n).enumerate() {
                let rate = crate::expansion::series::slope(self.series.row(i), tau);
                // What rounding leaves of the rate is no reason for a shorter element. Equations leave that of
                // their terms in all that they determine, a multiplier that is zero, too.
                let terms = match algebraic.contains(&i) {
                    true => largest,
                    false => h * mode.element.activity[i],
                };
                let rounding = ROUNDING * terms / target;
                let scale = run.scale[i].max((h * rate).abs()).max(rounding);
                let scale = scale.max(f64::MIN_POSITIVE);
                let relative = h * (rate - f).abs() / scale;
                if relative.is_nan() {
                    return f64::INFINITY;
                }
                worst = worst.max(relative);
            }
        }
        worst
    }
}
