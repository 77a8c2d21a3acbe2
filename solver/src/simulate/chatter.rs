//! Chattering that fades and never ends.
//!
//! Where a lag rounds off what a relay switches, or a spiral closes in on the point where two surfaces meet, the speed at
//! the surface falls from event to event as v⁺ = v - c v² + O(v³), and so does the time between events,
//!
//! 1/d_n = 1/d_0 + s n,   n ≈ e^{st}/(s d_0):
//!
//! the number of events doubles in equal times, ln 2/s. Unlike the times of a geometric series (Zeno) these have no
//! finite sum: no mode comes after them, and their number at a time to come is known long before.

use super::state::State;
use super::{Side, Simulator, Status, SwitchedSystem};

/// Events of a cycle, at most.
const MAX_CYCLE: usize = 12;

/// The fewest events that show the law, and their share of those that a run may have.
const FEWEST: usize = 2048;
const SHARE: usize = 64;

/// How far times of doubling may differ.
const SETTLED: f64 = 0.05;

/// How many times more events than it may have a run must need.
const BEYOND: f64 = 4.0;

/// Points of the time until the limit of events at which other switches are looked at.
const AHEAD: usize = 8;

/// The cycle of modes that the last events have gone through.
#[derive(Default)]
pub(super) struct Chatter {
    /// The modes, from the first on; the first comes again once the cycle is closed.
    cycle: Vec<Box<[Side]>>,
    is_closed: bool,
    /// Events so far, and when and where there were 1, 2, 4, ... of them.
    count: usize,
    doubled: Vec<(f64, Box<[f64]>)>,
}

/// How chattering has gone on while the number of events doubled three times.
struct Trend<'c> {
    /// The time in which it doubles.
    doubling: f64,
    /// The state before.
    before: &'c [f64],
}

impl Chatter {
    /// Takes note of an event, with the mode before and the state.
    pub(super) fn record(&mut self, time: f64, x: &[f64], from: &[Side]) {
        let goes_on = if self.is_closed {
            *self.cycle[self.count % self.cycle.len()] == *from
        } else {
            self.is_closed = self.cycle.first().is_some_and(|first| **first == *from);
            self.is_closed || self.cycle.len() < MAX_CYCLE
        };
        if !goes_on {
            *self = Chatter::default();
        }
        if !self.is_closed {
            self.cycle.push(from.into());
        }
        self.count += 1;
        if self.count.is_power_of_two() {
            self.doubled.push((time, x.into()));
        }
    }

    /// The time in which the number of events doubles, where that has settled.
    fn trend(&self) -> Option<Trend<'_>> {
        let [.., (a, before), (b, _), (c, _), (d, _)] = &self.doubled[..] else {
            return None;
        };
        let times = [b - a, c - b, d - c];
        let longest = times.into_iter().fold(0.0, f64::max);
        let shortest = times.into_iter().fold(f64::INFINITY, f64::min);
        let is_settled = shortest > 0.0 && longest <= (1.0 + SETTLED) * shortest;
        is_settled.then_some(Trend {
            doubling: longest,
            before,
        })
    }

    /// The switches that act in it.
    fn switches(&self) -> Vec<usize> {
        let first = &self.cycle[0];
        let acts = |i: &usize| self.cycle.iter().any(|mode| mode[*i] != first[*i]);
        (0..first.len()).filter(acts).collect()
    }

    /// How a run ends in this cycle, where that has settled and takes the `time` that is left.
    fn ends(&self, time: f64) -> Option<Status> {
        let doubling = self.trend()?.doubling;
        let count = self.count as f64;
        Some(Status::Chattering {
            switches: self.switches(),
            spacing: doubling / (count * std::f64::consts::LN_2),
            events: count * (time / doubling).exp2(),
        })
    }

    /// How a run ends that has met as many events as it may.
    pub(super) fn at_limit(&self, time: f64) -> Status {
        self.ends(time).unwrap_or(Status::EventLimit)
    }
}

impl<S: SwitchedSystem> Simulator<'_, S> {
    /// How a run ends behind an event of a cycle that goes on until the run has met as many events as it may, if
    /// nothing but events comes before `goal`.
    pub(super) fn chatters(
        &mut self,
        chatter: &Chatter,
        state: &State,
        goal: f64,
    ) -> Option<Status> {
        let (count, most) = (chatter.count, self.settings.max_events);
        if !count.is_power_of_two() || count < FEWEST.max(most / SHARE) {
            return None;
        }
        let trend = chatter.trend()?;
        let left = trend.doubling * (most as f64 / count as f64).log2();
        let lasts = left + trend.doubling * BEYOND.log2() < goal - state.t;
        let found = (lasts && !self.others_switch(chatter, &trend, state, left))
            .then(|| chatter.ends(goal - state.t));
        found.flatten()
    }

    /// Whether a switch outside the cycle changes sides within the time that is `left`, where states go on as they have
    /// on average.
    fn others_switch(
        &mut self,
        chatter: &Chatter,
        trend: &Trend,
        state: &State,
        left: f64,
    ) -> bool {
        let acting = chatter.switches();
        let others = |i: &usize| !acting.contains(i) && state.sides[*i] != Side::Slide;
        let others: Vec<usize> = (0..state.sides.len()).filter(others).collect();
        let mut signs = |share: f64| -> Vec<bool> {
            let onward = share * left / (3.0 * trend.doubling);
            let moved = state.x.iter().zip(trend.before);
            let x: Vec<f64> = moved.map(|(x, before)| x + (x - before) * onward).collect();
            self.mode.set(state.t + share * left, &x, &state.alpha);
            others.iter().map(|&i| self.mode.psi(i) > 0.0).collect()
        };
        let now = signs(0.0);
        (1..=AHEAD).any(|k| signs(k as f64 / AHEAD as f64) != now)
    }
}

#[cfg(test)]
mod tests {
    use super::{Chatter, Side};

    /// Events that change sides in turn, each after `spacing(n)`.
    fn recorded(spacing: impl Fn(f64) -> f64) -> Chatter {
        let mut chatter = Chatter::default();
        let modes = [[Side::Plus], [Side::Minus]];
        let mut time = 0.0;
        for n in 0..4096_u32 {
            time += spacing(f64::from(n));
            chatter.record(time, &[], &modes[n as usize % 2]);
        }
        chatter
    }

    #[test]
    fn a_number_of_events_that_grows_as_the_exponential_of_time_doubles_in_equal_times() {
        // t_n = ln(1 + n/3)/7, so that the number doubles in ln 2/7.
        let found = recorded(|n| ((1.0 + 1.0 / (n + 3.0)).ln()) / 7.0);
        let doubling = found.trend().unwrap().doubling;
        assert!((doubling * 7.0 / 2.0_f64.ln() - 1.0).abs() < 0.01);
        assert_eq!(found.switches(), [0]);
    }

    #[test]
    fn what_keeps_its_pace_or_has_a_limit_is_no_such_chattering() {
        assert!(recorded(|_| 1e-6).trend().is_none());
        assert!(recorded(|n| 0.999_f64.powf(n)).trend().is_none());
        assert!(recorded(|n| 1.0 / (1.0 + n).powf(1.5)).trend().is_none());
        assert!(recorded(|n| 1.0 / (1.0 + n).sqrt()).trend().is_none());
        assert!(recorded(|n| 1.0 + 0.9 * (0.01 * n).sin()).trend().is_none());
    }
}
