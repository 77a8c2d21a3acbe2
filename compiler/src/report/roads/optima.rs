//! Optima of one task with several lowerings.
//!
//! A task has many local optima, and which one is found is no matter of its lowering. What is asked of each lowering is
//! something else: that the best point that is known, with its grid, states and controls, is a point of its program,
//! too, and that solving from there, in the branch of that point, comes back to the same objective. Where it comes to a
//! smaller one, that is the best point, which all others have to confirm.
//!
//! Programs of other kinds, in numerical time or with impulses, have other grids. They start from the trajectory, and
//! may end in an optimum of their own.

use super::Refusal;
use crate::report::{Status, Trajectory};

/// Violations up to this are none.
const FEASIBLE: f64 = 1e-6;
/// An objective that is above another one by this, relative to max(1, |f|), is a worse one.
const WORSE: f64 = 1e-2;
/// A simulation with the controls that is further away than this, relatively, ends elsewhere.
const ELSEWHERE: f64 = 1e-2;

/// The optima of one experiment.
#[derive(Debug)]
pub struct Optima {
    /// Name of the experiment.
    pub experiment: String,
    /// Name of the model.
    pub model: String,
    /// The difference of objectives that is allowed, relative to max(1, |f|).
    pub tolerance: f64,
    /// With every lowering; the first is the one that is written.
    pub found: Vec<Found>,
    /// Which one the others were solved again from.
    pub best: Option<usize>,
}

/// What came of one lowering.
#[derive(Debug)]
pub struct Found {
    /// The lowering.
    pub name: String,
    /// From the start of the experiment, or why it is not for the lowering.
    pub run: Result<Box<Trajectory>, Refusal>,
    /// From the best point.
    pub resumed: Option<Resumed>,
}

/// What came of solving again from the best point.
#[derive(Debug)]
pub struct Resumed {
    /// Whether the point is one of this program, too.
    pub is_same_point: bool,
    /// The result.
    pub run: Box<Trajectory>,
}

/// What a lowering says about the best point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// Nothing: it is not applicable, or has no result.
    Silent,
    /// It is the one that has found it.
    Itself,
    /// The same objective.
    Confirms,
    /// Another optimum, by so much; its program has other points.
    Another(f64),
    /// Another objective at the same point, by so much, or none.
    Differs(f64),
}

/// Whether a point satisfies its program.
pub fn is_feasible(run: &Trajectory) -> bool {
    let has_result = matches!(run.status, Status::Solved | Status::NumericalFailure);
    has_result && run.objective.is_some() && run.quality.certificate.max_violation <= FEASIBLE
}

impl Optima {
    /// The smallest objective of all results.
    pub fn objective(&self) -> Option<f64> {
        let found = &self.found[self.best?];
        let resumed = found.resumed.as_ref().map(|resumed| &resumed.run);
        let runs = found.run.iter().chain(resumed);
        let objectives = runs
            .filter(|run| is_feasible(run))
            .filter_map(|run| run.objective);
        objectives.min_by(f64::total_cmp)
    }

    /// The difference that is allowed.
    pub fn allowed(&self) -> f64 {
        self.tolerance
            * self
                .objective()
                .map_or(1.0, |objective| objective.abs().max(1.0))
    }

    /// What a lowering says.
    pub fn verdict(&self, number: usize) -> Verdict {
        let found = &self.found[number];
        if self.best == Some(number) {
            return Verdict::Itself;
        }
        let (Some(resumed), Some(best)) = (&found.resumed, self.objective()) else {
            return Verdict::Silent;
        };
        let objective = resumed.run.objective.filter(|_| is_feasible(&resumed.run));
        let difference = objective.map_or(f64::INFINITY, |objective| objective - best);
        match (difference.abs() <= self.allowed(), resumed.is_same_point) {
            (true, _) => Verdict::Confirms,
            (false, true) => Verdict::Differs(difference),
            (false, false) => Verdict::Another(difference),
        }
    }

    /// The optimum of the experiment as it is written.
    fn written(&self) -> Option<&Trajectory> {
        let run = self.found[0].run.as_deref().ok()?;
        (run.status == Status::Solved && is_feasible(run)).then_some(run)
    }

    /// By how much the experiment as it is written stops above a point of its own program that another lowering has
    /// led to; none where it does not.
    pub fn excess(&self) -> Option<f64> {
        let own = self.written()?.objective?;
        let resumed = self.found[0].resumed.as_ref()?;
        let better = resumed
            .run
            .objective
            .filter(|_| is_feasible(&resumed.run))?;
        let excess = own - better;
        (excess > WORSE * better.abs().max(1.0)).then_some(excess)
    }

    /// Whether there is no other lowering of the same points that takes the experiment.
    pub fn is_alone(&self) -> bool {
        let is_other = |found: &Found| {
            let resumed = found.resumed.as_ref();
            found.run.is_err() || resumed.is_some_and(|resumed| !resumed.is_same_point)
        };
        self.found[1..].iter().all(is_other)
    }

    /// Whether the experiment as it is written has an optimum that is none of the worse ones, no lowering contradicts
    /// it, and another one confirms it if there is one.
    pub fn agree(&self) -> bool {
        self.written().is_some()
            && self.n_differing() == 0
            && self.excess().is_none()
            && (self.n_agreeing() > 1 || self.is_alone())
    }

    /// How many lowerings contradict the best point.
    pub fn n_differing(&self) -> usize {
        let differs = |number: &usize| matches!(self.verdict(*number), Verdict::Differs(_));
        (0..self.found.len()).filter(differs).count()
    }

    /// Lowerings whose controls lead elsewhere in a simulation. That says nothing about the lowering: programs are as
    /// accurate as their grids, and an unstable motion forgets small errors as little as large ones.
    pub fn elsewhere(&self) -> Vec<usize> {
        let is_elsewhere = |number: &usize| {
            let run = self.found[*number].run.as_ref().ok();
            let error = run.and_then(|run| run.quality.error_estimate);
            error.is_some_and(|error| error > ELSEWHERE)
        };
        (0..self.found.len()).filter(is_elsewhere).collect()
    }

    /// How many lowerings have the same objective, the best one among them.
    pub fn n_agreeing(&self) -> usize {
        let agrees =
            |number: &usize| matches!(self.verdict(*number), Verdict::Confirms | Verdict::Itself);
        (0..self.found.len()).filter(agrees).count()
    }
}
