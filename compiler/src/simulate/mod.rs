//! Simulations: a system becomes a trajectory by the method of its experiment.
//!
//! A method is compiled once (`methods/`) and makes runs (`driver.rs`); one driver makes trajectories of them, whatever the
//! method. Every run is made twice, the second time more accurately: the difference is the estimate of the global error
//! (`estimate/`), and a different sequence of modes is reported instead of being trusted.

pub(crate) mod again;
mod bench;
mod decided;
mod driver;
mod estimate;
mod methods;
mod outcome;
mod record;
mod reference;
mod request;
mod sensing;
mod settle;
mod watch;

use crate::project::clock::Instant;
use crate::report::Trajectory;
pub(crate) use crate::simulate::record::elements::Elements;
pub(crate) use crate::simulate::record::schedule;
use crate::system::System;
use crate::system::experiment::Settings;
pub use bench::{Bench, End, Variant};
pub(crate) use decided::Decided;
pub(crate) use methods::solver_settings;
pub use methods::{Plan, fesd, moreau};
pub(crate) use methods::{adaptive, frozen};
pub use outcome::sampled;
pub(crate) use reference::{ReferenceRun, impacts};
pub use request::Request;
pub(crate) use sensing::Sensing;
pub(crate) use settle::Consistent;
pub use settle::settle;
pub use watch::Progress;

/// Integrates the system over the horizon of the experiment.
pub fn run(system: &System, settings: &Settings, request: &Request) -> Trajectory {
    run_watched(system, settings, request, &mut |_| {})
}

/// [`run`], which calls `watch` every few steps.
pub fn run_watched(
    system: &System,
    settings: &Settings,
    request: &Request,
    watch: &mut dyn FnMut(Progress),
) -> Trajectory {
    run_sensed(system, settings, (request, None), watch)
}

/// [`run_watched`], differentiated where that is asked for.
pub(crate) fn run_sensed(
    system: &System,
    settings: &Settings,
    (request, sensing): (&Request, Option<&Sensing>),
    watch: &mut dyn FnMut(Progress),
) -> Trajectory {
    let started = Instant::now();
    let open = sensing.map_or(&[][..], |sensing| &sensing.open);
    let mut plan = Plan::of_method(system, settings, open);
    let mut trajectory = plan.run_sensed(system, settings, (request, sensing), watch);
    trajectory.quality.stats.solve_s = started.elapsed().as_secs_f64();
    trajectory
}
