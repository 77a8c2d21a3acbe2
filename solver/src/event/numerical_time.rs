//! Runs in numerical time, until a clock among the states shows a given time.
//!
//! The clock t' >= 0 stands still while states jump. The numerical time T with t(T) = H is between two runs of which
//! one ends before it; where the clock reaches H within a step, its mean rate r there gives a first T, and runs that end
//! at T correct it to T + (H - t(T)) / r, with r of their last steps.

use std::ops::ControlFlow;

use super::observer::{Event, Observer, Segment};
use crate::fesd;
use crate::hybrid::{Outcome, Status};

/// A clock with a smaller rate stands still.
const STANDS: f64 = 1e-6;
/// H is reached to this, relative to it.
const NEAR: f64 = 1e-10;
/// The share of that to which T is corrected.
const CORRECTED: f64 = 1e-3;
/// A first run in numerical time is so much longer than H, and every other than the one before.
const LONGER: f64 = 4.0;
/// Corrections of T.
const CORRECTIONS: usize = 8;

/// A state that is a clock, and the time H at which a run ends.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    /// The state.
    pub state: usize,
    /// H.
    pub horizon: f64,
}

/// Watches the clock of a run that another observer sees.
#[derive(Debug)]
pub struct Clocked<O> {
    /// The other one.
    pub observer: O,
    clock: Clock,
    /// Whether the run ends where the clock is at H.
    ends: bool,
    /// t and the mean t' of the last step in which it went on, and whether the clock stands still.
    time: f64,
    rate: f64,
    stands: bool,
    /// The numerical time at which it was at H.
    reached: Option<f64>,
}

impl Clock {
    /// How far the clock goes in a step; nothing where it stands still.
    pub fn advance(&self, segment: &Segment) -> Option<f64> {
        let advance = segment.end[self.state] - segment.state_series(self.state)[0];
        // What is no number does not stand still.
        let stands = Clock::stands(advance, segment.length);
        (!stands).then_some(advance)
    }

    /// Whether a clock stands still that goes so far in a time.
    pub(crate) fn stands(advance: f64, length: f64) -> bool {
        advance < STANDS * length
    }

    /// Whether a time is H to what H is reached to.
    pub fn is_at_end(&self, time: f64) -> bool {
        (time - self.horizon).abs() <= NEAR * self.horizon
    }

    /// Whether a run that has ended at a state has missed H.
    pub fn is_missed(&self, x: &[f64]) -> bool {
        self.horizon - x[self.state] > NEAR * self.horizon
    }

    /// A run that `observer` sees, watched.
    pub fn watch<O>(&self, observer: O) -> Clocked<O> {
        Clocked {
            observer,
            clock: *self,
            ends: false,
            time: 0.0,
            rate: 1.0,
            stands: false,
            reached: None,
        }
    }

    /// T, or where runs end before it, a numerical time beyond their end. `run` is given the time at which it ends, and
    /// what observes it: every time a new `observer`.
    pub fn numerical_time<O>(
        &self,
        mut observer: impl FnMut() -> O,
        mut run: impl FnMut(f64, &mut Clocked<O>) -> Outcome,
    ) -> f64 {
        let (mut end, mut before) = (LONGER * self.horizon, -1.0);
        loop {
            let mut probe = self.watch(observer());
            probe.ends = true;
            let outcome = run(end, &mut probe);
            if let Some(reached) = probe.reached {
                end = reached;
                break;
            }
            let stands = probe.stands && probe.time == before;
            if outcome.status != Status::Solved || stands {
                break;
            }
            before = probe.time;
            end *= LONGER;
        }
        for _ in 0..CORRECTIONS {
            let mut probe = self.watch(observer());
            let outcome = run(end, &mut probe);
            let miss = self.horizon - outcome.x[self.state];
            let is_open = outcome.status == Status::Solved && !probe.stands;
            if !is_open || miss.abs() <= CORRECTED * NEAR * self.horizon {
                break;
            }
            end += miss / probe.rate;
        }
        end
    }
}

impl<O: Observer> Observer for Clocked<O> {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        let Some(advance) = self.clock.advance(segment) else {
            self.stands = true;
            return self.observer.segment(segment);
        };
        self.rate = advance / segment.length;
        let shown = segment.end[self.clock.state];
        let over = shown - self.clock.horizon;
        if self.ends && over >= 0.0 {
            self.reached = Some(segment.until - over / self.rate);
            return ControlFlow::Break(());
        }
        let is_over = self.time >= self.clock.horizon || self.clock.is_at_end(self.time);
        if !is_over {
            (self.time, self.stands) = (shown, false);
        }
        self.observer.segment(segment)
    }

    fn event(&mut self, event: &Event) {
        self.observer.event(event);
    }

    fn displace(&mut self, x: &mut [f64], roundings: &[f64]) {
        self.observer.displace(x, roundings);
    }

    fn displaces(&self) -> bool {
        self.observer.displaces()
    }
}

impl<O: fesd::Observer> fesd::Observer for Clocked<O> {
    fn wants_multipliers(&self) -> bool {
        self.observer.wants_multipliers()
    }

    fn multipliers(&mut self, multipliers: &fesd::Multipliers) {
        self.observer.multipliers(multipliers);
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::{Clock, Clocked, Event, Observer, Segment, Status};
    use crate::expansion::dense::Polynomials;
    use crate::hybrid::Outcome;
    use crate::hybrid::status::Stats;

    /// The series of one state.
    struct Series([f64; 2]);

    impl Polynomials for Series {
        fn degree(&self) -> usize {
            1
        }

        fn x(&self, _: usize) -> &[f64] {
            &self.0
        }

        fn alpha(&self, _: usize) -> &[f64] {
            &[]
        }
    }

    struct Silent;

    impl Observer for Silent {
        fn segment(&mut self, _: &Segment) -> ControlFlow<()> {
            ControlFlow::Continue(())
        }

        fn event(&mut self, _: &Event) {}
    }

    /// t' = 1/10 in steps of half a unit of numerical time, but for the unit from 1 to 2 in which the clock stands still.
    fn run(end: f64, observer: &mut Clocked<Silent>) -> Outcome {
        let [mut tau, mut t, mut steps] = [0.0_f64, 0.0, 0.0];
        let mut status = Status::Solved;
        while tau < end {
            let length = (end - tau).min(0.5);
            let rate = match (1.0..2.0).contains(&tau) {
                true => 0.0,
                false => 0.1,
            };
            let series = Series([t, rate]);
            t += rate * length;
            (tau, steps) = (tau + length, steps + 1.0);
            let end = [t];
            let segment = Segment::new(tau - length, length, tau, &[], &end, &series);
            if observer.segment(&segment).is_break() {
                status = Status::Stopped;
                break;
            }
        }
        Outcome {
            status,
            time: tau,
            x: vec![t],
            sides: Vec::new(),
            alpha: Vec::new(),
            activity: vec![steps],
            moved: vec![0.0],
            violation: 0.0,
            complementarity: 0.0,
            notes: Vec::new(),
            approaches: Vec::new(),
            stats: Stats::default(),
        }
    }

    /// Ten times the horizon, and the unit in which it stands still: beyond a first run of four times the horizon.
    #[test]
    fn the_clock_is_at_its_horizon() {
        for (horizon, exact) in [(0.05, 0.5), (0.3, 4.0), (4.0, 41.0)] {
            let clock = Clock { state: 0, horizon };
            let found = clock.numerical_time(|| Silent, run);
            assert!((found - exact).abs() <= 1e-11 * exact, "{horizon}: {found}");
        }
    }

    /// A clock that stands still before its horizon: the run ends where it does not go on.
    #[test]
    fn a_clock_that_stops_is_no_horizon() {
        let clock = Clock {
            state: 0,
            horizon: 2.0,
        };
        let stops = |end: f64, observer: &mut Clocked<Silent>| run(end.min(1.5), observer);
        let end = clock.numerical_time(|| Silent, stops);
        assert!(end.is_finite() && clock.is_missed(&run(end.min(1.5), &mut clock.watch(Silent)).x));
    }
}
