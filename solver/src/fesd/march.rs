//! One step of the grid: elements of equal length from switch to switch.

use super::element::Unsolved;
use super::emit::Observer;
use super::fold::Length;
use super::watch::{BAND, Verdict};
use super::{Run, Simulator};
use crate::hybrid::{Side, Status};

/// Below this share of the largest state one may be rounding of terms that cancel.
const SMALL: f64 = 1e-8;

/// An element that is solved.
#[derive(Default)]
pub(super) struct Solved {
    /// t₀, and what rounding took from it.
    pub t: f64,
    pub t_low: f64,
    pub h: f64,
    /// x₀, and what rounding took from it.
    pub x: Vec<f64>,
    pub low: Vec<f64>,
    pub unknowns: Vec<f64>,
    pub mean: Vec<f64>,
    /// α of the sliding switches at the points of the scheme, one row each.
    pub alphas: Vec<f64>,
    /// w at the end.
    pub w: Vec<f64>,
}

impl Solved {
    /// t₀ + h, and what rounding takes from it.
    pub fn stop(&self) -> (f64, f64) {
        sum(self.t, self.h + self.t_low)
    }

    /// x₀ + h Σ b_j V_j, added up with what rounding takes.
    pub fn end(&self, x: &mut [f64], low: &mut [f64]) {
        for i in 0..x.len() {
            (x[i], low[i]) = sum(self.x[i], self.h * self.mean[i] + self.low[i]);
        }
    }
}

/// a + b rounded, and what rounding took from it (Dekker 1971).
fn sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let taken = sum - a;
    (sum, (a - (sum - taken)) + (b - taken))
}

/// Elements from one switch, or end of a step, to the next.
struct Piece {
    elements: usize,
    /// The watched member that vanishes at its end.
    event: Option<usize>,
    /// Whether it ends with the step.
    reaches_end: bool,
}

/// Halvings of an element in which a member is negative from the start although it must rise.
const MAX_HALVINGS: usize = 30;

/// A switch closer to the start of an element, relative to its length, is at the start; and one this
/// close to the end of a step is at its end.
const AT_ONCE: f64 = 1e-12;

/// Rounds that make the lengths before a switch equal, and how equal they become.
const MAX_ROUNDS: usize = 8;
const EQUAL: f64 = 1e-13;

/// Events in a row without progress in time that count as an accumulation.
const MAX_STALLED: usize = 100;

impl Simulator<'_> {
    /// Integrates over one step of the grid.
    pub(super) fn interval(
        &mut self,
        run: &mut Run,
        end: f64,
        elements: usize,
        observer: &mut impl Observer,
    ) -> Result<(), Status> {
        let length = run.left(end);
        let mut left = elements;
        while run.t < end {
            self.limit(run)?;
            if let Some(ahead) = self.fold_ahead(run) {
                let length = Length {
                    h: length / elements as f64,
                    target: None,
                };
                if self.approach(run, ahead, end, length, observer)? {
                    run.added += usize::from(left == 1);
                    left = left.saturating_sub(1).max(1);
                    continue;
                }
            }
            let piece = self.piece(run, end, left, length)?;
            self.know_rounding(run);
            let count = piece.elements;
            // A step with more switches than elements less one has elements added.
            run.added += (count + usize::from(piece.event.is_some())).saturating_sub(left);
            left = left.saturating_sub(count).max(1);
            self.report(run, count, piece.reaches_end.then_some(end), observer)?;
            // What comes after a breakpoint is decided there.
            if piece.event.is_some() && !run.is_at_breakpoint() {
                self.change(run, length, observer)?;
            }
        }
        Ok(())
    }

    /// Looks in every new mode which rates are rounding, where a state is small enough next to others to be nothing
    /// else: on a grid no element is rejected for it, and such states have no error to be relative to.
    fn know_rounding(&mut self, run: &Run) {
        let rounding = &mut self.modes[run.mode].element.rounding;
        if rounding.has_looked || self.solved[0].h == 0.0 {
            return;
        }
        rounding.has_looked = true;
        let largest = run.scale.iter().fold(0.0_f64, |size, x| size.max(*x));
        if run.scale.iter().any(|size| *size <= SMALL * largest) {
            self.series(run, 0);
            self.misses_by_rounding(run);
        }
    }

    /// Solves for up to `left` elements of equal length that end with the step, or with a switch.
    fn piece(
        &mut self,
        run: &mut Run,
        end: f64,
        left: usize,
        length: f64,
    ) -> Result<Piece, Status> {
        let h = run.left(end) / left as f64;
        for at in 0..left {
            let Some(member) = self.element(run, at, h)? else {
                continue;
            };
            let (switch, _) = self.solved[at].stop();
            // The last element of the step is kept for what comes after the switch.
            let count = match at + 1 {
                count if count == left && count > 1 => count - 1,
                count => count,
            };
            if at > 0 {
                self.equalize(run, count, (switch - run.t) / count as f64, member)?;
            }
            // A switch within rounding of the end is one at the end.
            let reaches_end = end - switch <= AT_ONCE * length + 16.0 * f64::EPSILON * end.abs();
            if reaches_end {
                self.snap(run, count, end);
            }
            return Ok(Piece {
                elements: count,
                event: Some(member),
                reaches_end,
            });
        }
        Ok(Piece {
            elements: left,
            event: None,
            reaches_end: true,
        })
    }

    /// Solves for element `at` since the last report, which is h long unless a member vanishes in
    /// it. Returns that member.
    pub(super) fn element(
        &mut self,
        run: &mut Run,
        at: usize,
        h: f64,
    ) -> Result<Option<usize>, Status> {
        self.place(run, at);
        let mut tried = h;
        for _ in 0..MAX_HALVINGS {
            let Solved { t, ref x, .. } = self.solved[at];
            let mode = &mut self.modes[run.mode];
            if run.last > 0.0 {
                mode.element
                    .extrapolate(&self.scheme, 1.0, tried / run.last);
            } else {
                mode.element
                    .guess(&run.rates, &run.z_of(&mode.element.reduced.unknowns));
                if at == 0 && run.slips.at == run.t {
                    let departures = &run.slips.departures;
                    mode.element.set_off(&self.scheme, departures, tried);
                }
            }
            let solved = mode.element.solve(&self.scheme, t, tried, x, &run.scale);
            solved.map_err(|_| Status::Unsolved)?;
            self.evaluate(run, at)?;
            // Only the first element after a switch has members that start at zero.
            let starts = if at == 0 { &run.starts[..] } else { &[] };
            let scales = (&run.sizes[..], run.rate_scale * tried);
            let verdict = self
                .values
                .judge(&self.scheme, starts, scales, &mut self.roots);
            match verdict {
                Verdict::Stays => {
                    run.last = tried;
                    if tried < h {
                        // Found nothing in a part of the element only: the whole is too long.
                        return Err(Status::Unsolved);
                    }
                    self.keep(run, at);
                    return Ok(None);
                }
                Verdict::Leaves { sigma, member } if sigma <= AT_ONCE => {
                    // The switch is where the element starts: no member is negative in what is left of it.
                    let least = run.least_member;
                    self.keep(run, at);
                    self.solved[at].h = 0.0;
                    run.least_member = least;
                    run.last = 0.0;
                    return Ok(Some(member));
                }
                // A sliding mode that ends has no next node.
                Verdict::Leaves { member, .. }
                    if member == self.modes[run.mode].element.reduced.watched.len() =>
                {
                    return Err(Status::Unsolved);
                }
                Verdict::Leaves { sigma, member } => {
                    let end = (member, BAND * run.sizes[member]);
                    let mode = &mut self.modes[run.mode];
                    mode.element.shorten(&self.scheme, sigma);
                    let length =
                        mode.element
                            .solve_to(&self.scheme, &mut mode.hidden, end, &run.scale);
                    let length = length.map_err(|_| Status::Unsolved)?;
                    if !(length > 0.0 && length <= tried * (1.0 + 1e-9)) {
                        return Err(Status::Unsolved);
                    }
                    run.last = length;
                    self.evaluate(run, at)?;
                    self.keep(run, at);
                    return Ok(Some(member));
                }
                Verdict::Wrong { .. } => {
                    run.last = 0.0;
                    tried *= 0.5;
                }
            }
        }
        Err(Status::Unsolved)
    }

    /// Makes `count` elements equal that end where a member vanishes, near a length `h` each.
    fn equalize(
        &mut self,
        run: &mut Run,
        count: usize,
        mut h: f64,
        member: usize,
    ) -> Result<(), Status> {
        let unsolved = |_: Unsolved| Status::Unsolved;
        let end = (member, BAND * run.sizes[member]);
        for _ in 0..MAX_ROUNDS {
            for at in 0..count {
                self.place(run, at);
                let Solved { t, ref x, .. } = self.solved[at];
                let mode = &mut self.modes[run.mode];
                mode.element.restore(&self.solved[at].unknowns);
                mode.element
                    .solve(&self.scheme, t, h, x, &run.scale)
                    .map_err(unsolved)?;
                if at + 1 == count {
                    let hidden = &mut mode.hidden;
                    mode.element
                        .solve_to(&self.scheme, hidden, end, &run.scale)
                        .map_err(unsolved)?;
                }
                self.evaluate(run, at)?;
                self.keep(run, at);
            }
            let last = self.solved[count - 1].h;
            run.last = last;
            if (last - h).abs() <= EQUAL * h || count == 1 {
                return Ok(());
            }
            h += (last - h) / count as f64;
        }
        Ok(())
    }

    /// Where element `at` since the last report starts.
    fn place(&mut self, run: &Run, at: usize) {
        if self.solved.len() <= at {
            self.solved.resize_with(at + 1, Solved::default);
        }
        let n = run.x.len();
        let (before, here) = self.solved.split_at_mut(at);
        let here = &mut here[0];
        here.x.resize(n, 0.0);
        here.low.resize(n, 0.0);
        match before.last() {
            None => {
                (here.t, here.t_low) = (run.t, run.t_low);
                here.x.copy_from_slice(&run.x);
                here.low.copy_from_slice(&run.low);
            }
            Some(last) => {
                (here.t, here.t_low) = last.stop();
                last.end(&mut here.x, &mut here.low);
            }
        }
    }

    /// Takes over the element that the mode has solved, and `values` evaluated.
    fn keep(&mut self, run: &mut Run, at: usize) {
        self.measure(run);
        let mode = &mut self.modes[run.mode];
        let (element, solved) = (&mode.element, &mut self.solved[at]);
        solved.h = element.h;
        solved.unknowns.clone_from(&element.unknowns);
        solved.mean.clone_from(&element.mean);
        self.values.w_at_end(&element.reduced, &mut solved.w);
        self.values
            .alphas(&self.scheme, element, &mut mode.hidden, &mut solved.alphas);
    }

    /// Evaluates the watched members of element `at` since the last report, which the mode has solved.
    fn evaluate(&mut self, run: &Run, at: usize) -> Result<(), Status> {
        let mode = &mut self.modes[run.mode];
        let evaluated = self
            .values
            .evaluate(&self.scheme, &mode.element, &mut mode.hidden);
        evaluated.map_err(|_| Status::Unsolved)?;
        // No comparison with what is not a number finds a root.
        if self.values.at_points.iter().any(|value| value.is_nan()) {
            return Err(Status::NotFinite);
        }
        let reduced = &mode.element.reduced;
        self.values.lower_stops(&self.scheme, reduced, &run.sizes);
        let unknowns = reduced.unknowns.iter().enumerate();
        let before = unknowns.map(|(k, &z)| match at {
            0 => run.z[z],
            _ => self.solved[at - 1].w[k],
        });
        let goes_on = self.values.starts_at(reduced, before);
        goes_on.then_some(()).ok_or(Status::Unsolved)
    }

    /// Moves the end of the last of `count` elements, which is within rounding, to the end of a step.
    fn snap(&mut self, run: &Run, count: usize, end: f64) {
        debug_assert!(run.t < end, "a step has a length");
        let last = &mut self.solved[count - 1];
        last.h = (end - last.t) - last.t_low;
    }

    /// Chooses the next active set where the last element ended, and reports the change; steps are
    /// about as long as `length`.
    pub(super) fn change(
        &mut self,
        run: &mut Run,
        length: f64,
        observer: &mut impl Observer,
    ) -> Result<(), Status> {
        run.stalled = if run.last <= 1e-13 * length {
            run.stalled + 1
        } else {
            0
        };
        if run.stalled > MAX_STALLED {
            return Err(Status::Accumulation);
        }
        let before = self.modes[run.mode].element.reduced.sides.clone();
        self.select(run, length)?;
        run.last = 0.0;
        self.tell_change(run, before, observer)
    }

    /// Reports a change of sides.
    pub(super) fn tell_change(
        &mut self,
        run: &mut Run,
        before: Box<[Side]>,
        observer: &mut impl Observer,
    ) -> Result<(), Status> {
        let after = &self.modes[run.mode].element.reduced.sides;
        if before != *after || run.decisions.iter().any(|decision| decision.folds) {
            run.stats.events += 1;
            run.events.record(run.t, &before);
            let slides = |sides: &[Side]| sides.iter().filter(|s| **s == Side::Slide).count();
            // Elements as short as rounding do not show what infinitely many would do.
            if slides(after) > slides(&before) && run.events.limit(after).is_some() {
                return Err(Status::Accumulation);
            }
            observer.event(&crate::event::Event {
                time: run.t,
                x: &run.x,
                before: &run.x,
                jumps: &[],
                decisions: &run.decisions,
                from: &before,
                to: after,
                accumulates: false,
            });
        }
        Ok(())
    }
}
