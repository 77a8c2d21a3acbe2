//! Ways from a start to a feasible point of a branch: a relaxation whose σ falls, then the polish.

use std::ops::ControlFlow;

use super::branch::choose;
use super::certificate::Residuals;
use super::lift::Lifted;
use super::options::{Homotopy, Options};
use super::polish::{Guess, Polished, polish};
use super::relaxed::{Coupling, Form, Relaxed};
use super::solution::Stats;
use crate::ipm;
use crate::problem::{Member, Nlp};

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
    /// How the last run ended.
    pub status: ipm::Status,
}

/// σ at which the polish is tried, one after the other.
const CROSSOVERS: [f64; 4] = [1e-3, 1e-5, 1e-7, 0.0];
/// Errors of the relaxed program at which its zero sides are believed.
const SETTLED: f64 = 1e-2;
/// μ at the start.
const FIRST_MU: f64 = 1.0;
/// A run from a point of the relaxation with a larger σ.
const WARM_MU: f64 = 1e-2;

impl Way {
    /// Follows this way from a point of the vertical form.
    pub fn follow(
        &self,
        lifted: &mut Lifted<'_>,
        start: &[f64],
        options: &Options,
        stats: &mut Stats,
    ) -> Result<Polished, DeadEnd> {
        lifted.settle(None);
        match self.homotopy {
            Homotopy::Coupled(coupling) => self.coupled(coupling, lifted, start, options, stats),
            Homotopy::Sequential {
                start: first,
                factor,
                stop,
            } => self.sequential([first, factor, stop], lifted, start, options, stats),
        }
    }

    /// One interior-point run in which σ follows μ, interrupted for the polish.
    fn coupled(
        &self,
        coupling: Coupling,
        lifted: &mut Lifted<'_>,
        start: &[f64],
        options: &Options,
        stats: &mut Stats,
    ) -> Result<Polished, DeadEnd> {
        let sigma = coupling.sigma(FIRST_MU);
        let mut tried: Vec<Member> = Vec::new();
        // Feasible, but not solved to its end.
        let mut unfinished: Option<Polished> = None;
        let mut point: Option<ipm::Point> = None;
        stats.relaxed += 1;
        for crossover in CROSSOVERS {
            lifted.settle(None);
            let mut relaxed = Relaxed::new(lifted, self.form, sigma, start).coupled(coupling);
            let settings = ipm::Options {
                mu_init: FIRST_MU,
                ..settings(options)
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
            let found = ipm::solve(&mut relaxed, &settings, point.as_ref(), &mut observer);
            stats.iterations += found.iterations;
            let is_last = found.status != ipm::Status::Stopped || crossover == 0.0;
            let n_rows = lifted.n_rows();
            let guess = Guess {
                w: found.w[..start.len()].to_vec(),
                y: found.y[..n_rows].to_vec(),
            };
            // The relaxation may end with its point outside of everything; then there is nothing to polish.
            let zeros = choose(lifted, &guess.w);
            if found.status != ipm::Status::Unbounded && zeros != tried {
                match polish(lifted, &guess, &zeros, options, stats) {
                    Ok(polished) if polished.is_optimal => return Ok(polished),
                    Ok(polished) => unfinished = Some(polished),
                    Err(_) => {}
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
        options: &Options,
        stats: &mut Stats,
    ) -> Result<Polished, DeadEnd> {
        let mut sigma = first;
        let mut point: Option<ipm::Point> = None;
        loop {
            stats.relaxed += 1;
            let mut relaxed = Relaxed::new(lifted, self.form, sigma, start);
            let found = ipm::solve(&mut relaxed, &settings(options), point.as_ref(), &mut ());
            stats.iterations += found.iterations;
            let is_over = sigma <= stop || found.status == ipm::Status::Unbounded;
            if is_over {
                let n_rows = lifted.n_rows();
                let guess = Guess {
                    w: found.w[..start.len()].to_vec(),
                    y: found.y[..n_rows].to_vec(),
                };
                let zeros = choose(lifted, &guess.w);
                return polish(lifted, &guess, &zeros, options, stats).map_err(|_| {
                    lifted.settle(None);
                    DeadEnd {
                        residuals: Residuals::new(lifted, &guess.w),
                        w: guess.w,
                        status: found.status,
                    }
                });
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

fn settings(options: &Options) -> ipm::Options {
    ipm::Options {
        max_iterations: options.max_iterations,
        time_limit: options.time_limit,
        ..ipm::Options::default()
    }
}
