//! Runs of one system again and again, with other data, initial states and horizons: what differences are made of.
//!
//! Its functions are compiled once, as they are met.

use std::ops::ControlFlow;
use std::sync::Arc;

use nsd_solver::event as solver;
use nsd_solver::event::{Observer, Segment, Simulator};
use nsd_solver::hybrid::Status;

use crate::limit::Limit;
use crate::lowering::hybrid;
use crate::source::table::Table;
use crate::system::System;

/// A system that is ready to be run.
pub(crate) struct Again {
    simulator: Simulator,
}

/// What a run gives.
#[derive(Clone, Debug)]
pub(crate) struct Values {
    /// The state at the end, behind what jumps there, and α.
    pub end: Vec<f64>,
    /// The state and α at the instants that were asked for, before what jumps there.
    pub at: Vec<Vec<f64>>,
    /// Steps that were taken.
    pub steps: usize,
    /// How often a side changed, or something jumped.
    pub events: usize,
}

impl Again {
    /// A system as it stands, for runs to about this horizon, with some parameters open, by their numbers.
    pub fn new(system: &System, horizon: f64, tolerance: f64, open: &[usize]) -> Self {
        let settings = nsd_solver::hybrid::Settings {
            tolerance,
            ..nsd_solver::hybrid::Settings::default()
        };
        let simulator = Simulator::new(hybrid::lower_open(system, horizon, open), settings);
        Again { simulator }
    }

    /// Gives the open parameters other values.
    pub fn set_parameters(&mut self, values: &[f64]) {
        self.simulator.set_parameters(values);
    }

    /// Gives the data from number `first` on other values, of the same fits.
    pub fn replace_data(&mut self, first: usize, tables: &[Arc<Table>]) {
        let pieces = tables.iter().map(|table| table.pieces.clone());
        let pieces: Vec<_> = pieces.collect();
        self.simulator.set_data(first, &pieces);
    }

    /// A run to the horizon, with values at ascending instants; nothing where it ends before, or takes longer than the
    /// limit.
    pub fn values(
        &mut self,
        x0: &[f64],
        horizon: f64,
        instants: &[f64],
        limit: &Limit,
    ) -> Option<Values> {
        let mut seen = Seen {
            instants,
            at: Vec::with_capacity(instants.len()),
            row: vec![0.0; x0.len()],
            alpha: Vec::new(),
            events: 0,
        };
        self.simulator.set_limit(limit.clone());
        let outcome = self.simulator.run(0.0, horizon, x0, &mut seen);
        if outcome.status != Status::Solved {
            return None;
        }
        let end: Vec<f64> = outcome.x.into_iter().chain(outcome.alpha).collect();
        // The last instants may be beyond the last step by rounding.
        let missing = instants.len() - seen.at.len();
        seen.at.extend((0..missing).map(|_| end.clone()));
        Some(Values {
            end,
            at: seen.at,
            steps: outcome.stats.steps,
            events: seen.events,
        })
    }
}

/// The rows at instants of a run.
struct Seen<'i> {
    instants: &'i [f64],
    at: Vec<Vec<f64>>,
    row: Vec<f64>,
    alpha: Vec<f64>,
    events: usize,
}

impl Observer for Seen<'_> {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        let end = segment.start + segment.length;
        self.alpha.resize(segment.sides.len(), 0.0);
        while let Some(&t) = self.instants.get(self.at.len()).filter(|t| **t <= end) {
            let tau = t - segment.start;
            segment.state(tau, &mut self.row);
            segment.alpha(tau, &mut self.alpha);
            self.at.push([&self.row[..], &self.alpha].concat());
        }
        ControlFlow::Continue(())
    }

    fn event(&mut self, event: &solver::Event) {
        self.events += usize::from(event.from != event.to || !event.jumps.is_empty());
    }
}
