//! What a run tells while it goes on.

use std::fmt;
use std::ops::ControlFlow;

/// One iteration: a row of the log.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// The number of steps so far.
    pub iteration: usize,
    /// Whether the violation of the constraints is being minimized.
    pub is_restoration: bool,
    /// The objective in the units of the problem.
    pub objective: f64,
    /// The largest residual of a row, scaled.
    pub primal: f64,
    /// The largest entry of the gradient of the Lagrangian, scaled.
    pub dual: f64,
    /// The barrier parameter.
    pub mu: f64,
    /// By how much the objective of a solved barrier problem is above that of the problem, to first order: the number
    /// of active bounds times μ, in the units of the objective.
    pub gap: f64,
    /// The largest entry of the last step.
    pub step: f64,
    /// What the last step added to the diagonal of the Hessian.
    pub regularization: f64,
    /// The last step lengths of variables and of multipliers.
    pub step_lengths: (f64, f64),
    /// How many points the last line search tried.
    pub trials: usize,
    /// The variables.
    pub w: &'a [f64],
}

/// Sees every iteration and may end the run.
pub trait Observer {
    /// Called once per iteration.
    fn iteration(&mut self, progress: &Progress<'_>) -> ControlFlow<()>;
}

/// Sees nothing.
impl Observer for () {
    fn iteration(&mut self, _: &Progress<'_>) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

impl<F: FnMut(&Progress<'_>) -> ControlFlow<()>> Observer for F {
    fn iteration(&mut self, progress: &Progress<'_>) -> ControlFlow<()> {
        self(progress)
    }
}

impl Progress<'_> {
    /// The names of the columns that `Display` writes.
    pub const HEADER: &'static str = " iter     objective   primal     dual       mu     step      reg  alpha_d  alpha_p  trials";
}

impl fmt::Display for Progress<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mark = if self.is_restoration { 'r' } else { ' ' };
        let (primal, dual) = self.step_lengths;
        write!(
            f,
            "{:5}{mark}{:13.6e} {:8.1e} {:8.1e} {:8.1e} {:8.1e} {:8.1e} {dual:8.1e} {primal:8.1e} {:7}",
            self.iteration,
            self.objective,
            self.primal,
            self.dual,
            self.mu,
            self.step,
            self.regularization,
            self.trials,
        )
    }
}
