//! Chattering that fades and never ends.
//!
//! Where a lag rounds off what a relay switches, or a spiral closes in on the point where two surfaces meet, the speed at
//! the surface falls from event to event as v⁺ = v - c v² + O(v³), and so does the time between events,
//!
//! 1/d_n = 1/d_0 + s n,   n ≈ e^{st}/(s d_0):
//!
//! the number of events doubles in equal times, ln 2/s. Unlike the times of a geometric series (Zeno) these have no
//! finite sum: no mode comes after them, and their number at a time to come is known long before.

use crate::event::Simulator;
use crate::event::state::State;
use crate::expansion::mode::Mode;
use crate::hybrid::point::Point;
use crate::hybrid::{Note, Side, Status};
use crate::selector::select::Met;

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

/// Rates that differ from affine ones by less, as a share of their terms, are affine.
const AFFINE: f64 = 1e-12;

/// The cycle of modes that the last events have gone through.
#[derive(Default)]
pub(crate) struct Chatter {
    /// The modes, from the first on; the first comes again once the cycle is closed.
    cycle: Vec<Box<[Side]>>,
    is_closed: bool,
    /// Events so far, and when and where there were 1, 2, 4, ... of them.
    count: usize,
    doubled: Vec<(f64, Box<[f64]>)>,
    last: Option<Last>,
}

/// The last cycle before chattering goes on as sliding.
struct Last {
    /// The number of events at its end.
    until: usize,
    switches: Vec<usize>,
    /// The largest |ψ| of each so far.
    heights: Vec<f64>,
}

/// Where a run is.
#[derive(Clone, Copy)]
pub(crate) struct Here<'h> {
    pub t: f64,
    pub x: &'h [f64],
    pub sides: &'h [Side],
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
    pub(crate) fn record(&mut self, time: f64, x: &[f64], from: &[Side]) {
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

    /// One more cycle is looked at, before the state slides.
    pub(crate) fn look_at_last(&mut self) {
        let switches = self.switches();
        self.last = Some(Last {
            until: self.count + self.cycle.len(),
            heights: vec![0.0; switches.len()],
            switches,
        });
    }

    /// Whether the last cycle is being looked at.
    pub(crate) fn is_last(&self) -> bool {
        self.last.is_some()
    }

    /// How a run ends that has met as many events as it may.
    pub(crate) fn at_limit(&self, time: f64) -> Status {
        self.ends(time).unwrap_or(Status::EventLimit)
    }

    /// How a run ends behind an event of a cycle that goes on until the run has met `most` events, as many as it may, if
    /// nothing but events comes before `goal`; `psi` has the values of all ψ that are not sliding.
    pub(crate) fn chatters(
        &self,
        most: usize,
        here: Here,
        goal: f64,
        psi: impl FnMut(f64, &[f64]) -> Vec<f64>,
    ) -> Option<Status> {
        let count = self.count;
        if !count.is_power_of_two() || count < FEWEST.max(most / SHARE) {
            return None;
        }
        let trend = self.trend()?;
        let left = trend.doubling * (most as f64 / count as f64).log2();
        let lasts = left + trend.doubling * BEYOND.log2() < goal - here.t;
        let found = (lasts && !self.others_switch(&trend, here, left, psi))
            .then(|| self.ends(goal - here.t));
        found.flatten()
    }

    /// Updates the heights of the last cycle, max |ψ| of every switch that chatters, by ψ in the middle of a step and
    /// at its end, where `state` is; before the last cycle there is nothing to do.
    ///
    /// At an event ψ of the switch that it is of is zero: between events its |ψ| is larger, and at them that of other
    /// switches may be. The heights tell how far the motion was from the sliding mode that replaces it.
    pub(crate) fn measure(&mut self, mode: &mut Mode, state: &State, middle: (f64, &[f64])) {
        let Some(last) = &mut self.last else {
            return;
        };
        for (t, x) in [middle, (state.point.t, &state.point.x)] {
            mode.memory.set(t, x, &state.point.alpha);
            for (height, &i) in last.heights.iter_mut().zip(&last.switches) {
                *height = height.max(mode.psi(i).abs());
            }
        }
    }

    /// Whether a switch outside the cycle changes sides within the time that is `left`, where states go on as they have
    /// on average.
    fn others_switch(
        &self,
        trend: &Trend,
        here: Here,
        left: f64,
        mut psi: impl FnMut(f64, &[f64]) -> Vec<f64>,
    ) -> bool {
        let acting = self.switches();
        let others = |i: &usize| !acting.contains(i) && here.sides[*i] != Side::Slide;
        let others: Vec<usize> = (0..here.sides.len()).filter(others).collect();
        let mut signs = |share: f64| -> Vec<bool> {
            let onward = share * left / (3.0 * trend.doubling);
            let moved = here.x.iter().zip(trend.before);
            let x: Vec<f64> = moved.map(|(x, before)| x + (x - before) * onward).collect();
            let values = psi(here.t + share * left, &x);
            others.iter().map(|&i| values[i] > 0.0).collect()
        };
        let now = signs(0.0);
        (1..=AHEAD).any(|k| signs(k as f64 / AHEAD as f64) != now)
    }
}

impl Chatter {
    /// Behind the last cycle: takes the state to where ψ of all its switches, and the derivatives of ψ that contain no
    /// α, are zero, and lets it slide there.
    pub(crate) fn average(
        &mut self,
        simulator: &mut Simulator,
        state: &mut State,
        t1: f64,
    ) -> Result<(), Status> {
        let Some(last) = self.last.take_if(|last| last.until <= self.count) else {
            return Ok(());
        };
        let ends = self.ends(t1 - state.point.t).unwrap_or(Status::EventLimit);
        let (time, x, mut sides) = (
            state.point.t,
            state.point.x.clone(),
            state.point.sides.clone(),
        );
        last.switches.iter().for_each(|&i| sides[i] = Side::Slide);
        state.point.set_sides(&sides);
        simulator.mode.enter(&state.point.sides);
        let solved = simulator.mode.solve_alpha(time, &x, &mut state.point.alpha);
        let mut slides = solved.is_ok() && is_affine(&mut simulator.mode, &state.point);
        if slides {
            simulator.projection.project(&mut simulator.mode, state);
            let on = simulator.selector().place(state, t1 - time, &[])?;
            simulator.pass(state, Met::Surfaces(on), t1)?;
            slides = last
                .switches
                .iter()
                .all(|&i| state.point.sides[i] == Side::Slide);
        }
        if !slides {
            state.point.x = x;
            return Err(ends);
        }
        state.report.note(Note::Averaged {
            time,
            switches: last.switches,
            heights: last.heights,
        });
        *self = Chatter::default();
        Ok(())
    }
}

/// Whether rates are affine in α of all that slides, so that their mean over a cycle is that of mean α.
fn is_affine(mode: &mut Mode, point: &Point) -> bool {
    let sliding = mode.sliding.clone();
    let mut rates = |values: &dyn Fn(usize) -> f64| -> Vec<f64> {
        let mut alpha = point.alpha.clone();
        let of_sliding = sliding.iter().enumerate();
        of_sliding.for_each(|(k, &i)| alpha[i] = values(k));
        mode.eval(point.t, &point.x, &alpha);
        mode.field.f.clone()
    };
    // Of a product of two α, these shares leave something.
    let share = |k: usize| 1.0 / (k as f64 + 2.0);
    let below = rates(&|_| 0.0);
    let found = rates(&share);
    let mut expected = below.clone();
    let mut size: Vec<f64> = below.iter().map(|f| f.abs()).collect();
    for k in 0..point.alpha.len().min(sliding.len()) {
        let above = rates(&|other| f64::from(other == k));
        for (i, (above, below)) in above.iter().zip(&below).enumerate() {
            expected[i] += share(k) * (above - below);
            size[i] += above.abs();
        }
    }
    let differences = found.iter().zip(&expected).zip(size);
    differences
        .into_iter()
        .all(|((found, expected), size)| (found - expected).abs() <= AFFINE * size)
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
