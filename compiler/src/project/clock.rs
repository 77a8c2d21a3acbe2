//! Where the time goes.

use std::time::Duration;

pub use nsd_solver::runtime::clock::Instant;

/// Durations of the phases of a compilation and a run, in order of their first appearance.
#[derive(Clone, Debug, Default)]
pub struct Clock {
    phases: Vec<(&'static str, Duration)>,
}

impl Clock {
    /// Runs `work` and counts its time to `phase`.
    pub fn time<T>(&mut self, phase: &'static str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        let duration = start.elapsed();
        match self.phases.iter_mut().find(|(name, _)| *name == phase) {
            Some((_, total)) => *total += duration,
            None => self.phases.push((phase, duration)),
        }
        result
    }

    /// Adds the phases of another clock.
    pub fn add(&mut self, other: &Clock) {
        for &(phase, duration) in &other.phases {
            match self.phases.iter_mut().find(|(name, _)| *name == phase) {
                Some((_, total)) => *total += duration,
                None => self.phases.push((phase, duration)),
            }
        }
    }

    /// Phases and seconds.
    pub fn phases(&self) -> impl Iterator<Item = (&'static str, f64)> {
        self.phases
            .iter()
            .map(|(phase, duration)| (*phase, duration.as_secs_f64()))
    }

    /// Seconds of all phases.
    pub fn total(&self) -> f64 {
        self.phases().map(|(_, seconds)| seconds).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::Clock;

    #[test]
    fn a_phase_is_counted_once_with_all_its_time() {
        let mut clock = Clock::default();
        assert_eq!(clock.time("parse", || 1), 1);
        clock.time("solve", || ());
        let mut other = Clock::default();
        other.time("parse", || ());
        clock.add(&other);
        let names: Vec<_> = clock.phases().map(|(name, _)| name).collect();
        assert_eq!(names, ["parse", "solve"]);
    }
}
