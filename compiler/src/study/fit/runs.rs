//! Runs of a fit: numbers of free parameters and initial values -> weighted differences from the data, with derivatives.
//!
//! r and J have the rows of all runs one below another (`single`), and a column of zeros where a run has no such number.

use nalgebra::{DMatrix, DVector};
use nsd_solver::optimization::least_squares::{Linearized, Residuals};
use nsd_solver::optimization::mpcc::deviate;

use super::single::{Here, Single};
use crate::Compiled;
use crate::diagnostics::{Diagnostics, counted};
use crate::limit::Limit;
use crate::project::watch::Watch;
use crate::report::{Trajectory, Warning};
use crate::simulate::Request;
use crate::system::experiment::{Column, Fit, Starts};

/// Derivatives are known up to this many times the tolerance of runs, and differences up to as many times its power 2/3.
const RANK: f64 = 100.0;

/// The runs of one fit.
pub(super) struct Runs<'f, 'e> {
    fit: &'f Fit<'e>,
    /// That of the experiment, then those of data with a run of their own.
    all: Vec<Single<'e>>,
    limit: Limit,
    tolerance: f64,
    /// What there is to say of the last runs.
    last: Seen,
    /// The same where the search is.
    taken: Seen,
    /// The numbers of events on the way of a search, each time it was another one.
    events: Vec<usize>,
}

/// The way of a search.
pub(super) struct Way {
    pub events: Vec<usize>,
    lost: Vec<Option<String>>,
}

/// What there is to say of runs.
#[derive(Clone, Default)]
struct Seen {
    events: usize,
    /// For each direction, why its derivative is a difference of runs.
    lost: Vec<Option<String>>,
}

impl<'f, 'e> Runs<'f, 'e> {
    /// Compiles the experiment for runs.
    ///
    /// # Errors
    ///
    /// Where a run is not differentiated by something that is free.
    pub fn new(
        compiled: &Compiled<'e>,
        fit: &'f Fit<'e>,
        limit: &Limit,
    ) -> Result<Self, Diagnostics> {
        let all = [compiled].into_iter().chain(&compiled.others);
        let all = all.map(|one| Single::new(one, fit, limit));
        Ok(Runs {
            fit,
            all: all.collect::<Result<_, _>>()?,
            limit: limit.clone(),
            tolerance: compiled.settings.numerics.tolerance,
            last: Seen::default(),
            taken: Seen::default(),
            events: Vec::new(),
        })
    }

    /// How many there were.
    pub fn count(&self) -> usize {
        self.all.iter().map(|one| one.count).sum()
    }

    /// What was measured, in the order of r, with what is given to the run that it is compared with alone.
    pub fn columns(&self) -> impl Iterator<Item = (&Column<'e>, Option<&String>)> {
        let all = self.all.iter();
        all.flat_map(|one| one.columns.iter().map(|column| (column, one.with.as_ref())))
    }

    /// The way of a search that has ended: the number of events, each time it was another one, and for each direction why its
    /// derivative at the end is a difference of runs.
    pub fn take_way(&mut self) -> Way {
        Way {
            events: std::mem::take(&mut self.events),
            lost: std::mem::take(&mut self.taken.lost),
        }
    }

    /// What free quantities may be.
    pub fn bounds(&self) -> Vec<[f64; 2]> {
        let free = self.fit.free.iter();
        free.map(|freed| [freed.lower, freed.upper]).collect()
    }

    /// What they are in the experiment, within their bounds.
    pub fn guess(&self) -> Vec<f64> {
        let guess = self.fit.free.iter().enumerate().map(|(k, freed)| {
            let mut all = self.all.iter();
            let value = all.find_map(|one| one.guess(k));
            let value = value.expect("what is free is free in some run");
            value.max(freed.lower).min(freed.upper)
        });
        guess.collect()
    }

    /// The size of free quantities at a point: their magnitudes there, or in the experiment if these are larger; the widths of
    /// their bounds, or one, where they are zero in the experiment.
    fn sizes_at(&self, point: &[f64]) -> Vec<f64> {
        let all = point.iter().zip(self.guess()).zip(self.bounds());
        let sizes = all.map(|((p, guess), [low, high])| {
            let width = high - low;
            let usual = match guess.abs() {
                size if size > 0.0 => size,
                _ if width > 0.0 && width.is_finite() => width,
                _ => 1.0,
            };
            p.abs().max(usual)
        });
        sizes.collect()
    }

    /// Where a search begins: the first one where the experiment says, others around it.
    pub fn start(&self, number: u64, starts: Option<&Starts>) -> Vec<f64> {
        let guess = self.guess();
        let Some(starts) = starts.filter(|_| number > 0) else {
            return guess;
        };
        let sizes = self.sizes_at(&guess);
        let moved = guess.iter().zip(sizes).enumerate().map(|(k, (p, size))| {
            p + starts.deviation * size * deviate(starts.seed, number, k as u64)
        });
        moved.collect()
    }

    /// The run of the experiment with what was found, with all that it says; the system of `compiled` is that of it.
    pub fn told(
        &mut self,
        compiled: &mut Compiled<'e>,
        point: &[f64],
        request: &Request,
        watch: &mut dyn Watch,
    ) -> Trajectory {
        // What this run does not depend on, too, has the value that was found.
        for (sensed, &p) in self.fit.sensed.iter().zip(point) {
            if let Some(var) = sensed.var.as_variable().filter(|_| !sensed.is_initial) {
                compiled.settings.values.numbers.insert(var, p);
            }
        }
        self.all[0].told(compiled, point, request, watch)
    }
}

impl Way {
    /// Derivatives that are those of differences, and why, and that events have come or gone, where the objective is not smooth.
    pub fn warnings(&self, fit: &Fit<'_>) -> Vec<Warning> {
        let all = self.lost.iter().zip(&fit.sensed);
        let differences = all.filter_map(|(why, sensed)| {
            let why = why.as_ref()?;
            Some(Warning {
                code: "W0744".into(),
                message: format!(
                    "derivatives by `{}` are differences of runs where they are not known: {why}",
                    sensed.name
                ),
                span: Some(sensed.span),
            })
        });
        let mut warnings: Vec<Warning> = differences.collect();
        if let [first, .., last] = self.events[..] {
            let times = counted(self.events.len() - 1, "time");
            warnings.push(Warning {
                code: "W0743".into(),
                message: format!(
                    "the number of events has changed {times} on the way, from {first} to {last}: the sum of squares is not smooth there, and other minima may be near; several `starts` look for them"
                ),
                span: fit.free.first().map(|freed| freed.span),
            });
        }
        warnings
    }
}

impl Residuals for Runs<'_, '_> {
    fn at(&mut self, point: &[f64]) -> Option<Linearized> {
        let (n, tolerance) = (point.len(), self.tolerance);
        let here = Here {
            point,
            sizes: self.sizes_at(point),
            bounds: self.bounds(),
        };
        self.last = Seen {
            events: 0,
            lost: vec![None; n],
        };
        let (mut residuals, mut rows) = (Vec::new(), Vec::new());
        let mut changes: f64 = 0.0;
        for one in self.all.iter_mut().filter(|one| !one.columns.is_empty()) {
            let found = one.at(&here, &mut self.last.lost)?;
            self.last.events += found.events;
            changes = changes.hypot(found.changes);
            residuals.extend(found.residuals);
            rows.push(found.slopes);
        }
        let mut jacobian = DMatrix::zeros(residuals.len(), n);
        let mut row = 0;
        for slopes in &rows {
            let block = (slopes.nrows(), n);
            jacobian.view_mut((row, 0), block).copy_from(slopes);
            row += slopes.nrows();
        }
        let has_differences = self.last.lost.iter().any(Option::is_some);
        let accuracy = match has_differences {
            true => tolerance.powf(2.0 / 3.0),
            false => tolerance,
        };
        // By how much numbers that are rounded change r.
        let rounding = (jacobian.abs() * DVector::from_vec(here.sizes)).norm();
        Some(Linearized {
            noise: tolerance * changes + f64::EPSILON * rounding,
            rank: (RANK * accuracy).clamp(f64::EPSILON.sqrt(), 1e-2),
            residuals: DVector::from_vec(residuals),
            jacobian,
        })
    }

    fn taken(&mut self) {
        self.taken = self.last.clone();
        if self.events.last() != Some(&self.taken.events) {
            self.events.push(self.taken.events);
        }
    }

    fn sizes(&self, point: &[f64]) -> Vec<f64> {
        self.sizes_at(point)
    }

    fn is_over(&self) -> bool {
        self.limit.is_over()
    }
}
