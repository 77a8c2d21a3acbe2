//! Time stepping: Runge-Kutta steps of one length on the complementarity system, as it stands.
//!
//! The equations and the pairs hold at every node for itself (`nodes.rs`). Nothing finds the instants of switches, so that no method is
//! better than of first order across them; this is what finite elements with switch detection are
//! compared with.

use std::ops::ControlFlow;

use super::system::{ComplementaritySystem, Switch};
use super::uniform::Uniform;
use crate::event::{Cause, Event, Observer, Segment};
use crate::expansion::dense::ElementSeries;
use crate::fesd::element::nodes::{Nodes, Step};
use crate::fesd::element::scheme::Scheme;
use crate::fesd::run::NEAR;
use crate::fesd::system::library::Library;
use crate::fesd::system::pointwise::Point;
use crate::hybrid::{Outcome, Side, Stats, Status};
use crate::integrate::tableau::{Family, Tableau, TableauError};
use crate::runtime::limit::Limit;

/// What the user may choose.
#[derive(Clone, Debug)]
pub struct SteppingSettings {
    /// The family of Runge-Kutta methods.
    pub family: Family,
    /// Its number of nodes.
    pub nodes: usize,
    /// Number of steps, at least 1, besides those that end at breakpoints.
    pub steps: usize,
    /// When the run stops.
    pub limit: Limit,
}

/// A change of sides, of which nothing but the step is known.
fn switching<'x>(time: f64, x: &'x [f64], from: &'x [Side], to: &'x [Side]) -> Event<'x> {
    Event {
        time,
        x,
        before: x,
        jumps: &[],
        decisions: &[],
        from,
        to,
        accumulates: false,
        cause: Cause::default(),
    }
}

/// α within this of 0 or 1 is there.
const END: f64 = 1e-9;

/// Runs a system step by step.
pub struct Stepper<'s> {
    system: &'s ComplementaritySystem,
    settings: SteppingSettings,
    uniform: Uniform<'s>,
    nodes: Nodes,
    series: ElementSeries,
    alpha: Vec<f64>,
    /// Switches whose 1 - α is a force without a bound.
    forces: Vec<usize>,
}

impl<'s> Stepper<'s> {
    /// Memory for a system.
    pub fn new(
        system: &'s ComplementaritySystem,
        settings: SteppingSettings,
    ) -> Result<Self, TableauError> {
        let tableau = Tableau::new(settings.family, settings.nodes)?;
        let s = tableau.n_nodes();
        let pairs = system.pairs.iter().enumerate();
        let forces = pairs.filter(|(_, pair)| !pair.is_bounded);
        let forces = forces.flat_map(|(at, _)| &system.switches_of[at]);
        Ok(Stepper {
            nodes: Nodes::new(system, s),
            series: ElementSeries::default(),
            alpha: vec![0.0; system.n_switches()],
            forces: forces.copied().collect(),
            uniform: Uniform::new(Scheme::new(tableau), system),
            settings,
            system,
        })
    }

    /// Order of the method where nothing switches.
    pub fn order(&self) -> usize {
        self.tableau().order
    }

    /// The same with the functions of active sets that another stepper of the system has compiled.
    pub fn knowing(mut self, library: Library) -> Self {
        self.uniform.modes.library = library;
        self
    }

    /// What it has made of them.
    pub fn library(&self) -> &Library {
        &self.uniform.modes.library
    }

    /// Integrates from `x0` at `t0` to `t1`.
    pub fn run(&mut self, t0: f64, t1: f64, x0: &[f64], observer: &mut dyn Observer) -> Outcome {
        let steps = self.settings.steps;
        let mut x = x0.to_vec();
        let mut end = x.clone();
        let mut until = self.load_numbers(t0);
        self.uniform.begin(x0);
        let z = self.point(t0, x0).start(self.system);
        self.nodes.begin(self.system, t0, x0, &z);
        let mut ends = 0;
        let mut sides: Option<Box<[Side]>> = None;
        let (mut stats, mut t) = (Stats::default(), t0);
        let status = loop {
            if ends == 0
                && let Some(switch) = self.below(t, &x)
            {
                break Status::Penetrates { switch };
            }
            if ends == steps {
                break Status::Solved;
            }
            if let Some(over) = self.settings.limit.over() {
                break Status::Over(over);
            }
            // A breakpoint in a step is the end of a part of it.
            let end_of_step = t0 + (t1 - t0) * ((ends + 1) as f64 / steps as f64);
            let near = NEAR * end_of_step.abs();
            let next = if until < end_of_step - near {
                until
            } else {
                end_of_step
            };
            let h = next - t;
            if let Err(status) = self.step((t, h), &x, &mut end, &mut stats) {
                break status;
            }
            let now = self.sides(next, &end);
            self.polynomials(h, &x, &now);
            if let Some(before) = sides.as_ref().filter(|before| **before != now) {
                stats.events += 1;
                observer.event(&switching(t, &x, before, &now));
            }
            let segment = Segment {
                start: t,
                length: next - t,
                until: next,
                sides: &now,
                end: &end,
                dense: &self.series,
            };
            let flow = observer.segment(&segment);
            if next == end_of_step {
                ends += 1;
            }
            if until <= next + near {
                until = self.load_numbers(next.max(until));
            }
            (t, sides) = (next, Some(now));
            std::mem::swap(&mut x, &mut end);
            if flow == ControlFlow::Break(()) {
                break Status::Stopped;
            }
        };
        let sides = sides.map(Vec::from);
        let sides = sides.unwrap_or_else(|| vec![Side::Plus; self.alpha.len()]);
        Outcome {
            alpha: self.alpha.clone(),
            stats,
            ..Outcome::at(status, t, x, sides)
        }
    }

    /// The state at the end of a step, or why there is none.
    fn step(
        &mut self,
        (t, h): (f64, f64),
        x: &[f64],
        end: &mut [f64],
        stats: &mut Stats,
    ) -> Result<(), Status> {
        if !self.solve((t, h), x, stats) {
            let over = self.settings.limit.over();
            return Err(over.map_or(Status::Unsolved, Status::Over));
        }
        stats.steps += 1;
        stats.rhs_evaluations += self.tableau().n_nodes();
        self.end(h, x, end);
        match end.iter().all(|x| x.is_finite()) {
            true => Ok(()),
            false => Err(Status::NotFinite),
        }
    }

    /// The switch of a gap that is negative.
    fn below(&self, t: f64, x: &[f64]) -> Option<usize> {
        self.system.below(self.point(t, x))
    }

    fn point<'p>(&'p self, t: f64, x: &'p [f64]) -> Point<'p> {
        let numbers = &self.uniform.modes.numbers;
        Point { t, x, numbers }
    }

    fn tableau(&self) -> &Tableau {
        &self.uniform.modes.scheme.tableau
    }

    /// Takes the numbers that hold from `t` on; the next breakpoint.
    fn load_numbers(&mut self, t: f64) -> f64 {
        let modes = &mut self.uniform.modes;
        let until = modes.load(t);
        self.nodes.numbers().copy_from_slice(&modes.numbers);
        until
    }

    /// Solves the step, in the active set of the last one if it can be.
    fn solve(&mut self, (t, h): (f64, f64), x: &[f64], stats: &mut Stats) -> bool {
        let nodes = &mut self.nodes;
        if self.uniform.solve((t, h), x, &mut nodes.unknowns, stats) {
            return true;
        }
        let (scheme, limit) = (&self.uniform.modes.scheme, &self.settings.limit);
        let scale = &self.uniform.scale;
        let step = Step { t, h, x, scale };
        let solved = nodes.solve(self.system, scheme, step, limit, stats);
        let last = scheme.s - 1;
        self.uniform.enter(nodes.z(last));
        solved
    }

    /// x₀ + h Σ_j b_j V_j
    fn end(&self, h: f64, x0: &[f64], end: &mut [f64]) {
        let (unknowns, per_node) = (&self.nodes.unknowns, self.nodes.per_node());
        for (i, end) in end.iter_mut().enumerate() {
            let terms = self.tableau().weights.iter().enumerate();
            let mean: f64 = terms.map(|(j, b)| b * unknowns[j * per_node + i]).sum();
            *end = x0[i] + h * mean;
        }
    }

    /// Where the switches stand at the last node: members of pairs as its active set has them, the others by α.
    fn sides(&mut self, t: f64, x: &[f64]) -> Box<[Side]> {
        let last = self.tableau().n_nodes() - 1;
        let alphas = &self.system.full.alphas;
        let values = self.nodes.eval_at(alphas, (t, x), last);
        // The share of one of two regions of which the point is in neither has no value: it stays what it was.
        for (alpha, value) in self.alpha.iter_mut().zip(values) {
            *alpha = if value.is_nan() { *alpha } else { value };
        }
        let (forces, zeros) = (&self.forces, &self.uniform.zeros);
        let side = |(alpha, (k, switch)): (&f64, (usize, &Switch))| match (switch.member, *alpha) {
            (Some((pair, zero)), _) if zeros[pair] == zero => Side::Slide,
            (Some(_), _) => Side::Minus,
            (None, alpha) if alpha <= END && !forces.contains(&k) => Side::Minus,
            (None, alpha) if alpha >= 1.0 - END => Side::Plus,
            _ => Side::Slide,
        };
        let switches = self.system.switches.iter().enumerate();
        self.alpha.iter().zip(switches).map(side).collect()
    }

    /// x(τ) = x₀ + ∫ V, and α as at the last node.
    fn polynomials(&mut self, h: f64, x0: &[f64], sides: &[Side]) {
        let (s, n) = (self.tableau().n_nodes(), x0.len());
        let (unknowns, per_node) = (&self.nodes.unknowns, self.nodes.per_node());
        self.series.shape(n, sides.len(), s);
        for (i, &x0) in x0.iter().enumerate() {
            let c = self.series.row_mut(i);
            c[0] = x0;
            let mut scale = 1.0;
            for (k, powers) in self.uniform.modes.scheme.powers.chunks_exact(s).enumerate() {
                let terms = powers
                    .iter()
                    .enumerate()
                    .map(|(j, p)| p * unknowns[j * per_node + i]);
                c[k + 1] = terms.sum::<f64>() * scale / (k + 1) as f64;
                scale /= h;
            }
        }
        for switch in (0..sides.len()).filter(|switch| sides[*switch] == Side::Slide) {
            self.series.row_mut(n + switch)[0] = self.alpha[switch];
        }
    }
}
