//! A second run beside the recorded points of the first: differences, jumps and modes.

use std::ops::ControlFlow;

use nsd_solver::event::{Event, Observer, Segment};
use nsd_solver::events::Approach;
use nsd_solver::hybrid::Side;

use super::parting;
use crate::simulate::record::Record;
use crate::simulate::record::points::is_one_instant;

/// Compares a second run with what is recorded of the first.
pub struct Comparison<'r> {
    record: &'r Record,
    /// The next of its points.
    next: usize,
    /// How many of its jumps this one has met.
    jumped: usize,
    x: Vec<f64>,
    /// By state: the largest difference, and the largest magnitude.
    pub difference: Vec<f64>,
    pub scale: Vec<f64>,
    /// The surfaces that the first run came close to.
    approaches: &'r [Approach],
    /// How many states of this one have been displaced from those behind events of the first.
    displaced: usize,
    /// The modes, with the instants at which they begin.
    modes: Vec<(f64, Box<[Side]>)>,
    /// What the differences so far make of ψ, at the approaches that were passed.
    pub misses: Vec<f64>,
    /// States that jump within steps, and their differences at the points so far, one point after another.
    jumping: Vec<usize>,
    apart: Vec<f64>,
}

impl<'r> Comparison<'r> {
    /// With a run that came close to surfaces at `approaches`, of whose states some jump within steps.
    pub fn new(
        record: &'r Record,
        x0: &[f64],
        approaches: &'r [Approach],
        jumping: Vec<usize>,
    ) -> Self {
        let n = x0.len();
        Comparison {
            jumping,
            apart: Vec::new(),
            record,
            next: 0,
            jumped: 0,
            x: vec![0.0; n],
            difference: vec![0.0; n],
            scale: x0.iter().map(|x| x.abs()).collect(),
            approaches,
            displaced: 0,
            modes: Vec::new(),
            misses: Vec::new(),
        }
    }
}

impl Comparison<'_> {
    /// When the modes were first others, as far as a run is `known`.
    pub fn parted(&self, known: f64) -> Option<f64> {
        let one = self
            .record
            .changes
            .iter()
            .map(|change| (change.0, &*change.2));
        let other = self.modes.iter().map(|(time, mode)| (*time, &**mode));
        let [one, other] = [one.collect::<Vec<_>>(), other.collect()];
        let near = parting::closeness(self.record.horizon, known);
        // A jump that one run alone has made moves its end.
        let end = match self.jumped == self.record.points.jumps.len() {
            true => self.record.horizon,
            false => f64::INFINITY,
        };
        parting::parted(&one, &other, (near, end))
    }

    /// The largest magnitudes of states, with those at the end of the first run.
    pub fn sizes(&self, end: &[f64]) -> Vec<f64> {
        let scale = self.scale.iter().zip(end);
        scale.map(|(scale, x)| scale.max(x.abs())).collect()
    }

    /// Compares the present state with a recorded one.
    fn compare(&mut self, point: usize) {
        let n = self.x.len();
        let recorded = &self.record.points.states[point * n..(point + 1) * n];
        for (i, (&x, &other)) in self.x.iter().zip(recorded).enumerate() {
            self.scale[i] = self.scale[i].max(x.abs());
            self.difference[i] = self.difference[i].max((x - other).abs());
        }
        let apart = self.jumping.iter();
        (self.apart).extend(apart.map(|&i| (self.x[i] - recorded[i]).abs()));
    }

    /// Leaves out the differences of states that jump within steps inside of such intervals of time, in which they have
    /// jumped in one run and not yet in the other.
    pub fn leave_out(&mut self, mut intervals: Vec<(f64, f64)>) {
        intervals.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut intervals = intervals.into_iter().peekable();
        let mut until = f64::NEG_INFINITY;
        for &i in &self.jumping {
            self.difference[i] = 0.0;
        }
        let rows = self.apart.chunks_exact(self.jumping.len().max(1));
        for (row, &t) in rows.zip(&self.record.points.times) {
            while let Some((_, end)) = intervals.next_if(|(start, _)| *start < t) {
                until = until.max(end);
            }
            if t < until {
                continue;
            }
            for (&i, difference) in self.jumping.iter().zip(row) {
                self.difference[i] = self.difference[i].max(*difference);
            }
        }
    }
}

/// Roundings by which the second run is displaced at an event: more than the first one makes in a step.
const DISPLACED: f64 = 2.0;

/// Where in a step magnitudes are looked at: a state may be zero at every end of a step.
const BETWEEN: [f64; 3] = [0.25, 0.5, 0.75];

impl Observer for Comparison<'_> {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        for share in BETWEEN {
            segment.state(share * segment.length, &mut self.x);
            for (scale, x) in self.scale.iter_mut().zip(&self.x) {
                *scale = scale.max(x.abs());
            }
        }
        let end = segment.until;
        // Beyond the next jump of the first run, which this one has not met yet.
        let known = self
            .record
            .points
            .jumps
            .get(self.jumped)
            .map_or(usize::MAX, |jump| jump.n_points);
        let is_reached = |t: &&f64| **t <= end || is_one_instant(**t, end);
        while let Some(&t) = self.record.points.times.get(self.next).filter(is_reached) {
            if self.next >= known {
                break;
            }
            segment.state(t - segment.start, &mut self.x);
            self.compare(self.next);
            self.next += 1;
        }
        let approaches = &self.approaches[self.misses.len()..];
        for approach in approaches.iter().take_while(|a| a.time <= end) {
            segment.state(approach.time - segment.start, &mut self.x);
            for (i, (x, other)) in self.x.iter().zip(&approach.x).enumerate() {
                self.difference[i] = self.difference[i].max((x - other).abs());
            }
            let terms = approach.gradient.iter();
            let miss = terms.map(|&(j, g)| g.abs() * self.difference[j]).sum();
            self.misses.push(miss);
        }
        ControlFlow::Continue(())
    }

    fn event(&mut self, event: &Event) {
        self.modes.push((event.time, event.to.into()));
        if event.jumps.is_empty() {
            return;
        }
        // Jumps are compared one by one: next to an instant, a run may be before or after it.
        if let Some(jump) = self.record.points.jumps.get(self.jumped) {
            for (seen, other) in [(event.before, &jump.before), (event.x, &jump.after)] {
                for (i, (x, other)) in seen.iter().zip(other).enumerate() {
                    self.scale[i] = self.scale[i].max(x.abs());
                    self.difference[i] = self.difference[i].max((x - other).abs());
                }
            }
            self.next = self.next.max(jump.n_points);
        }
        self.jumped += 1;
    }

    /// Moves the state away from that of the first run. Both make the same roundings where events cut their steps alike;
    /// what a system makes of other ones grows by itself from here, and nothing takes it back.
    fn displace(&mut self, x: &mut [f64], roundings: &[f64]) {
        let other = self
            .record
            .behind
            .chunks_exact(x.len().max(1))
            .nth(self.displaced);
        self.displaced += 1;
        for (i, (x, rounding)) in x.iter_mut().zip(roundings).enumerate() {
            let is_below = other.is_some_and(|other| *x < other[i]);
            *x += DISPLACED * rounding * if is_below { -1.0 } else { 1.0 };
        }
    }

    fn displaces(&self) -> bool {
        true
    }
}
