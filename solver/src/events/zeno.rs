//! When events accumulate: the instant at which infinitely many of them end (Zeno).
//!
//! A cycle of modes that repeats takes times d_n. Near the limit d_{n+1}/d_n tends to some r < 1, and
//! what is left after d_n is the rest of a geometric series,
//!
//! t_∞ = t_n + d_n r/(1 - r) = t_n + d_n²/(d_{n-1} - d_n),
//!
//! exact for constant rates and else up to O(d_n²) (Aitken 1926). The limit itself is a mode like any
//! other: it is taken where the state is on all surfaces of the cycle to rounding.

use std::hash::{Hash, Hasher};

use rustc_hash::FxHasher;

use crate::hybrid::Side;

/// Events of a cycle, at most.
const MAX_CYCLE: usize = 12;

/// Cycles that must agree.
const CYCLES: usize = 3;

/// Differences of ratios that count as settled: what rounding of instants leaves of short cycles.
const SETTLED: f64 = 0.02;

/// The last events of a run.
#[derive(Default)]
pub(crate) struct Events {
    /// When, and the mode before.
    last: Vec<(f64, u64)>,
}

impl Events {
    /// Takes note of an event.
    pub(crate) fn record(&mut self, time: f64, from: &[Side]) {
        if self.last.len() > CYCLES * MAX_CYCLE {
            self.last.remove(0);
        }
        self.last.push((time, key(from)));
    }

    /// Where the events accumulate, if the last one ends a cycle that has repeated and shrunk, and leads out of it. What
    /// goes on in a mode of the cycle, as sticking and slipping do under a force of growing frequency, has not come to
    /// an end.
    pub(crate) fn limit(&self, to: &[Side]) -> Option<f64> {
        let latest = self.last.len().checked_sub(1)?;
        let goes_on = key(to);
        (1..=MAX_CYCLE).find_map(|length| {
            let cycle = self.last.get((latest + 1).checked_sub(length)?..)?;
            if cycle.iter().any(|(_, mode)| *mode == goes_on) {
                return None;
            }
            let at = |cycle: usize| self.last.get(latest.checked_sub(cycle * length)?).copied();
            let (time, mode) = at(0)?;
            let mut durations = [0.0; CYCLES];
            let mut end = time;
            for (cycle, duration) in durations.iter_mut().enumerate() {
                let (start, same) = at(cycle + 1)?;
                if same != mode {
                    return None;
                }
                *duration = end - start;
                end = start;
            }
            let [last, before, first] = durations;
            let (ratio, earlier) = (last / before, before / first);
            let settled = (ratio - earlier).abs() <= SETTLED && ratio < 1.0 - SETTLED;
            (settled && last > 0.0).then(|| time + last * ratio / (1.0 - ratio))
        })
    }
}

fn key(sides: &[Side]) -> u64 {
    let mut hasher = FxHasher::default();
    sides.hash(&mut hasher);
    hasher.finish()
}

#[cfg(test)]
mod tests {
    use super::{Events, Side};

    fn recorded(times: &[f64]) -> Events {
        let mut events = Events::default();
        let modes = [[Side::Plus], [Side::Minus]];
        for (k, &time) in times.iter().enumerate() {
            events.record(time, &modes[k % 2]);
        }
        events
    }

    fn limit(times: &[f64]) -> Option<f64> {
        recorded(times).limit(&[Side::Slide])
    }

    #[test]
    fn a_geometric_series_ends_at_its_sum() {
        // Two kinds of intervals that halve in each cycle: 1 + 0.3, 0.5 + 0.15, ...
        let mut times = vec![0.0];
        for k in 0..4 {
            let shrunk = 0.5_f64.powi(k);
            times.push(times[times.len() - 1] + shrunk);
            times.push(times[times.len() - 1] + 0.3 * shrunk);
        }
        let found = limit(&times).unwrap();
        assert!((found - 2.6).abs() <= 1e-14, "{found}");
        assert_eq!(recorded(&times).limit(&[Side::Minus]), None);
    }

    #[test]
    fn what_goes_on_for_ever_has_no_end() {
        let periodic: Vec<f64> = (0..20).map(f64::from).collect();
        assert_eq!(limit(&periodic), None);
        let growing: Vec<f64> = (0..20).map(|k| 1.3_f64.powi(k)).collect();
        assert_eq!(limit(&growing), None);
        assert_eq!(limit(&[0.0, 1.0, 1.5]), None);
    }
}
