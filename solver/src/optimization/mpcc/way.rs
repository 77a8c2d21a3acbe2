//! Ways from a start to a feasible point of a branch: a relaxation whose σ falls, then the polish.

use std::ops::ControlFlow;

use super::branch::choose;
use super::certificate::Residuals;
use super::lift::Lifted;
use super::observer::Program;
use super::options::{Homotopy, Options};
use super::relaxed::{Coupling, Form, Relaxed};
use super::work::Work;
use crate::optimization::ipm;
use crate::optimization::mpcc::branch::polish::{Goal, Guess, Polished, polish};
use crate::optimization::mpcc::relaxed::relaxation::{Relaxation, Steering};
use crate::optimization::problem::{Member, Nlp};

/// One way.
#[derive(Clone, Copy, Debug)]
pub struct Way {
    /// The relaxation.
    pub form: Form,
    /// How σ is driven to zero.
    pub homotopy: Homotopy,
}

/// Why a way has led nowhere.
#[derive(Clone, Debug)]
pub struct DeadEnd {
    /// The last point.
    pub w: Vec<f64>,
    /// What its violation and complementarity are.
    pub residuals: Residuals,
    /// How the last relaxed program ended.
    pub status: ipm::Status,
    /// How the last branch ended, if one was tried.
    pub branch: Option<ipm::Status>,
}

/// σ at which the polish is tried, one after the other.
const CROSSOVERS: [f64; 4] = [1e-3, 1e-5, 1e-7, 0.0];
/// Errors of the relaxed program at which its zero sides are believed.
const SETTLED: f64 = 1e-2;
/// μ at the start.
const FIRST_MU: f64 = 1.0;
/// A run from a point of the relaxation with a larger σ.
const WARM_MU: f64 = 1e-2;
/// σ at which the polish is tried between the programs of a sequence.
const NEAR: f64 = 1e-4;
/// A relaxed program that takes longer than this has gone astray.
const MAX_ITERATIONS: usize = 500;

impl Way {
    /// Follows this way from a point of the vertical form.
    pub fn follow(
        &self,
        lifted: &mut Lifted<'_>,
        start: &[f64],
        work: &mut Work<'_>,
    ) -> Result<Polished, DeadEnd> {
        lifted.settle(None);
        match self.homotopy {
            Homotopy::Coupled(coupling) => self.coupled(coupling, lifted, start, work),
            Homotopy::Sequential {
                start: first,
                factor,
                stop,
            } => self.sequential([first, factor, stop], lifted, start, work),
        }
    }

    /// One interior-point run in which σ follows μ, interrupted for the polish.
    fn coupled(
        &self,
        coupling: Coupling,
        lifted: &mut Lifted<'_>,
        start: &[f64],
        work: &mut Work<'_>,
    ) -> Result<Polished, DeadEnd> {
        let sigma = coupling.sigma(FIRST_MU);
        let form = self.form;
        let program = Program::Relaxed { form, coupling };
        let mut tried: Vec<Member> = Vec::new();
        let mut branch = None;
        // Feasible, but not solved to its end.
        let mut unfinished: Option<Polished> = None;
        let mut point: Option<ipm::Point> = None;
        work.stats.relaxed += 1;
        for crossover in CROSSOVERS {
            lifted.settle(None);
            let mut relaxed = Relaxed::new(lifted, self.form, sigma, start).coupled(coupling);
            let settings = ipm::Options {
                mu_init: FIRST_MU,
                max_iterations: MAX_ITERATIONS,
                ..ipm::Options::default()
            };
            let mut observer = |progress: &ipm::Progress<'_>| {
                let is_settled = coupling.sigma(progress.mu) <= crossover
                    && !progress.is_restoration
                    && progress.primal.max(progress.dual) <= SETTLED;
                match is_settled {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                }
            };
            let found = work.minimize(
                program,
                &mut relaxed,
                settings,
                point.as_ref(),
                &mut observer,
            );
            let is_last = found.status != ipm::Status::Stopped || crossover == 0.0;
            let n_rows = lifted.n_rows();
            let guess = Guess {
                w: found.w[..start.len()].to_vec(),
                y: found.y[..n_rows].to_vec(),
            };
            // The relaxation may end with its point outside of everything; then there is nothing to polish.
            let zeros = choose(lifted, &guess.w);
            if found.status != ipm::Status::Unbounded && zeros != tried {
                match polish(lifted, &guess, &zeros, Goal::Solution, work) {
                    Ok(polished) if polished.is_optimal => return Ok(polished),
                    Ok(polished) => unfinished = Some(polished),
                    Err(status) => branch = Some(status),
                }
                tried = zeros;
            }
            if is_last {
                if let Some(polished) = unfinished {
                    return Ok(polished);
                }
                lifted.settle(None);
                return Err(DeadEnd {
                    residuals: Residuals::new(lifted, &guess.w),
                    w: guess.w,
                    status: found.status,
                    branch,
                });
            }
            point = Some(ipm::Point {
                w: found.w,
                y: found.y,
                z_l: found.z_l,
                z_u: found.z_u,
                mu: found.mu,
            });
        }
        unreachable!("the last crossover ends the loop")
    }

    /// One interior-point run for every σ, then the polish.
    fn sequential(
        &self,
        [first, factor, stop]: [f64; 3],
        lifted: &mut Lifted<'_>,
        start: &[f64],
        work: &mut Work<'_>,
    ) -> Result<Polished, DeadEnd> {
        let mut sigma = first;
        let mut point: Option<ipm::Point> = None;
        loop {
            work.stats.relaxed += 1;
            let program = Program::Relaxed {
                form: self.form,
                coupling: Coupling::constant(sigma),
            };
            let mut relaxed = Relaxed::new(lifted, self.form, sigma, start);
            let settings = ipm::Options {
                max_iterations: MAX_ITERATIONS,
                ..ipm::Options::default()
            };
            let found = work.minimize(program, &mut relaxed, settings, point.as_ref(), &mut ());
            let is_over = sigma <= stop || found.status == ipm::Status::Unbounded;
            let is_near = found.status.is_solved() && sigma <= NEAR;
            if is_over || is_near {
                let n_rows = lifted.n_rows();
                let guess = Guess {
                    w: found.w[..start.len()].to_vec(),
                    y: found.y[..n_rows].to_vec(),
                };
                let zeros = choose(lifted, &guess.w);
                match polish(lifted, &guess, &zeros, Goal::Solution, work) {
                    Ok(polished) if polished.is_optimal || is_over => return Ok(polished),
                    Err(branch) if is_over => {
                        lifted.settle(None);
                        return Err(DeadEnd {
                            residuals: Residuals::new(lifted, &guess.w),
                            w: guess.w,
                            status: found.status,
                            branch: Some(branch),
                        });
                    }
                    _ => lifted.settle(None),
                }
            }
            sigma = (sigma * factor).max(stop);
            point = Some(ipm::Point {
                w: found.w,
                y: found.y,
                z_l: found.z_l,
                z_u: found.z_u,
                mu: WARM_MU.min(10.0 * sigma),
            });
        }
    }
}

/// What is tried, one after the other: relaxations end in different local minima, and fail on different problems.
pub fn ways(options: &Options) -> Vec<Way> {
    let Options { form, homotopy, .. } = *options;
    let coupled = |form: Form, factor: f64| Way {
        form,
        homotopy: Homotopy::Coupled(Coupling {
            factor,
            largest: factor,
            ..Coupling::default()
        }),
    };
    let natural = Form {
        relaxation: Relaxation::NaturalResidual,
        ..Form::default()
    };
    let sequential = |form: Form, stop: f64| Way {
        form,
        homotopy: Homotopy::Sequential {
            start: 1.0,
            factor: 0.1,
            stop,
        },
    };
    let penalty = Form {
        steering: Steering::L1,
        ..Form::default()
    };
    let other_curvature = Form {
        keeps_curvature: !form.keeps_curvature,
        ..form
    };
    let mut ways = vec![
        Way { form, homotopy },
        Way {
            form: other_curvature,
            homotopy,
        },
        coupled(Form::default(), 10.0),
        coupled(natural, 100.0),
        sequential(Form::default(), 1e-8),
        sequential(penalty, 1e-6),
    ];
    ways.truncate(1 + options.max_restarts);
    ways
}
