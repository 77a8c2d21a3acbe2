//! Time stepping: Runge-Kutta steps of one length on the complementarity system, as it stands.
//!
//! X_m = x₀ + h Σ_j a_mj V_j,   V_m = f(t_m, X_m, z_m),   0 = g(t_m, X_m, z_m),   0 ≤ a(z_m) ⟂ b(z_m) ≥ 0
//!
//! holds at every node for itself. Nothing finds the instants of switches, so that no method is
//! better than of first order across them; this is what finite elements with switch detection are
//! compared with.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use super::scheme::Scheme;
use super::system::ComplementaritySystem;
use super::uniform::{SLACK, Uniform};
use crate::linalg::DenseLu;
use crate::simulate::dense::ElementSeries;
use crate::simulate::{Event, Observer, Outcome, Segment, Side, Stats, Status};
use crate::tableau::{Family, Tableau, TableauError};

/// What the user may choose.
#[derive(Clone, Debug)]
pub struct SteppingSettings {
    /// The family of Runge-Kutta methods.
    pub family: Family,
    /// Its number of nodes.
    pub nodes: usize,
    /// Number of steps, at least 1, besides those that end at breakpoints.
    pub steps: usize,
    /// Wall time after which the run stops.
    pub time_limit: Option<Duration>,
}

/// Newton iterations for one σ, and by the smaller members, which go in circles if they take longer.
const MAX_ITERATIONS: usize = 30;
const MAX_LEAST: usize = 15;

/// Where σ starts and ends, and what it is multiplied with, one attempt after the other.
const SIGMA: [f64; 2] = [1.0, 1e-16];
const SHRINK: [f64; 3] = [0.1, 0.1, 0.5];

/// From this σ on the smaller members are tried.
const EARLY: f64 = 1e-2;

/// Changes of the unknowns, relative to √σ, at which the next σ is taken up.
const ALONG: f64 = 1e-3;

/// A change of the unknowns of this size is rounding.
const CONVERGED: f64 = 1e-13;

/// Shares of a Newton step below this are not tried.
const SHORTEST: f64 = 1e-4;

/// α within this of 0 or 1 is there.
const END: f64 = 1e-9;

/// How the pairs enter the equations.
#[derive(Clone, Copy)]
enum Rule {
    /// The smaller member is zero.
    Least,
    /// a + b - √(a² + b² + 2σ) = 0.
    Smooth(f64),
}

/// Runs a system step by step.
pub struct Stepper<'s, S> {
    system: &'s S,
    settings: SteppingSettings,
    uniform: Uniform,
    /// V and z of every node.
    unknowns: Vec<f64>,
    inputs: Vec<f64>,
    registers: Vec<f64>,
    matrix: Vec<f64>,
    rhs: Vec<f64>,
    lu: DenseLu,
    series: ElementSeries,
    alpha: Vec<f64>,
}

impl<'s, S: ComplementaritySystem> Stepper<'s, S> {
    /// Memory for a system.
    pub fn new(system: &'s S, settings: SteppingSettings) -> Result<Self, TableauError> {
        let tableau = Tableau::new(settings.family, settings.nodes)?;
        let (n, n_z, s) = (system.n_states(), system.start().len(), tableau.n_nodes());
        let size = s * (n + n_z);
        let full = system.full();
        let tapes = [&full.equations, &full.slopes.tape, &full.alphas];
        let registers = tapes.map(|tape| tape.n_registers().max(tape.n_inputs()));
        Ok(Stepper {
            unknowns: vec![0.0; size],
            inputs: vec![0.0; 1 + n + n_z + system.n_numbers()],
            registers: vec![0.0; registers.into_iter().max().unwrap_or(0)],
            matrix: vec![0.0; size * size],
            rhs: vec![0.0; size],
            lu: DenseLu::new(size),
            series: ElementSeries::default(),
            alpha: vec![0.0; system.n_switches()],
            uniform: Uniform::new(Scheme::new(tableau), n, system.n_numbers()),
            settings,
            system,
        })
    }

    /// Order of the method where nothing switches.
    pub fn order(&self) -> usize {
        self.tableau().order
    }

    /// Integrates from `x0` at `t0` to `t1`.
    pub fn run(&mut self, t0: f64, t1: f64, x0: &[f64], observer: &mut impl Observer) -> Outcome {
        let started = Instant::now();
        let (n, steps) = (x0.len(), self.settings.steps);
        let mut x = x0.to_vec();
        let mut end = x.clone();
        let mut until = self.load_numbers(t0);
        self.begin(t0, x0);
        let mut ends = 0;
        let mut sides: Option<Box<[Side]>> = None;
        let (mut stats, mut t) = (Stats::default(), t0);
        let status = loop {
            if ends == steps {
                break Status::Solved;
            }
            if self
                .settings
                .time_limit
                .is_some_and(|limit| started.elapsed() > limit)
            {
                break Status::TimeLimit;
            }
            // A breakpoint in a step is the end of a part of it.
            let end_of_step = t0 + (t1 - t0) * ((ends + 1) as f64 / steps as f64);
            let near = super::NEAR * end_of_step.abs();
            let next = if until < end_of_step - near {
                until
            } else {
                end_of_step
            };
            let h = next - t;
            if !self.solve(t, h, &x, &mut stats) {
                break Status::Unsolved;
            }
            stats.steps += 1;
            stats.rhs_evaluations += self.tableau().n_nodes();
            self.end(h, &x, &mut end);
            if !end.iter().all(|x| x.is_finite()) {
                break Status::NotFinite;
            }
            let now = self.sides(next, &end);
            self.polynomials(h, &x, &now);
            if let Some(before) = sides.as_ref().filter(|before| **before != now) {
                stats.events += 1;
                // All that is known is the step.
                observer.event(&Event {
                    time: t,
                    x: &x,
                    before: &x,
                    jumps: &[],
                    from: before,
                    to: &now,
                    accumulates: false,
                });
            }
            let segment = Segment {
                start: t,
                length: next - t,
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
        Outcome {
            status,
            time: t,
            sides: sides
                .map(Vec::from)
                .unwrap_or_else(|| vec![Side::Plus; self.alpha.len()]),
            alpha: self.alpha.clone(),
            activity: vec![0.0; n],
            moved: vec![0.0; n],
            drift: 0.0,
            defect: 0.0,
            notes: Vec::new(),
            stats,
            x,
        }
    }

    /// Takes the initial z and rates as the guess of all nodes.
    fn begin(&mut self, t: f64, x: &[f64]) {
        let (n, n_z) = (x.len(), self.system.start().len());
        self.uniform.begin(x);
        self.load(t, x, 0);
        self.inputs[1 + n..][..n_z].copy_from_slice(self.system.start());
        self.registers[..self.inputs.len()].copy_from_slice(&self.inputs);
        let tape = &self.system.full().equations;
        tape.run(&mut self.registers);
        let rates: Vec<f64> = tape.results(&self.registers).take(n).collect();
        for node in self.unknowns.chunks_exact_mut(n + n_z) {
            node[..n].copy_from_slice(&rates);
            node[n..].copy_from_slice(self.system.start());
        }
    }

    fn tableau(&self) -> &Tableau {
        &self.uniform.scheme.tableau
    }

    /// Unknowns per node: V, then z.
    fn per_node(&self) -> usize {
        self.system.n_states() + self.system.start().len()
    }

    /// Takes the numbers that hold from `t` on; the next breakpoint.
    fn load_numbers(&mut self, t: f64) -> f64 {
        let first = self.per_node() + 1;
        let until = self.system.numbers(t, &mut self.inputs[first..]);
        self.uniform.set_numbers(&self.inputs[first..]);
        until
    }

    /// Puts a point into the inputs, with z of a node.
    fn load(&mut self, t: f64, x: &[f64], node: usize) {
        let n = x.len();
        let per_node = self.per_node();
        self.inputs[0] = t;
        self.inputs[1..=n].copy_from_slice(x);
        let z = &self.unknowns[node * per_node + n..(node + 1) * per_node];
        self.inputs[1 + n..=per_node].copy_from_slice(z);
    }

    /// Solves the step, in the active set of the last one if it can be.
    fn solve(&mut self, t: f64, h: f64, x: &[f64], stats: &mut Stats) -> bool {
        if self.uniform.solve((t, h), x, &mut self.unknowns, stats) {
            return true;
        }
        let solved = self.solve_all(t, h, x, stats);
        let last = self.unknowns.len() - self.system.start().len();
        self.uniform.enter(self.system, &self.unknowns[last..]);
        solved
    }

    /// Solves for V and z at once: by the smaller members first, else along smoothed pairs, ever more
    /// slowly and from the middle of what jumps.
    fn solve_all(&mut self, t: f64, h: f64, x: &[f64], stats: &mut Stats) -> bool {
        let start = self.unknowns.clone();
        if self.newton(t, h, x, Rule::Least, stats) {
            return true;
        }
        for (attempt, shrink) in SHRINK.into_iter().enumerate() {
            self.unknowns.copy_from_slice(&start);
            if attempt > 0 {
                self.centre();
            }
            let [mut sigma, last] = SIGMA;
            while sigma > last {
                self.newton(t, h, x, Rule::Smooth(sigma), stats);
                // The smaller members may be the right ones long before σ is zero.
                if sigma <= EARLY {
                    let smooth = self.unknowns.clone();
                    if self.newton(t, h, x, Rule::Least, stats) {
                        return true;
                    }
                    self.unknowns.copy_from_slice(&smooth);
                }
                sigma *= shrink;
            }
        }
        false
    }

    /// Puts what jumps to the middle of its range.
    fn centre(&mut self) {
        let (n, per_node) = (self.system.n_states(), self.per_node());
        for node in self.unknowns.chunks_exact_mut(per_node) {
            for (i, z) in node[n..].iter_mut().enumerate() {
                if !self.system.is_continuous(i) {
                    *z = 0.5;
                }
            }
        }
    }

    /// Newton's method, along smoothed pairs with steps that lessen the residual; whether it
    /// converged.
    fn newton(&mut self, t: f64, h: f64, x: &[f64], rule: Rule, stats: &mut Stats) -> bool {
        let mut residual = self.assemble(t, h, x, rule);
        let mut start = self.unknowns.clone();
        let (most, converged) = match rule {
            Rule::Least => (MAX_LEAST, CONVERGED),
            Rule::Smooth(sigma) => (MAX_ITERATIONS, (ALONG * sigma.sqrt()).max(CONVERGED)),
        };
        for _ in 0..most {
            stats.newton_iterations += 1;
            stats.factorizations += 1;
            if self.lu.factor(&self.matrix).is_err() {
                return false;
            }
            self.lu.solve(&mut self.rhs);
            let step = self.rhs.clone();
            start.copy_from_slice(&self.unknowns);
            let mut share = 1.0;
            let next = loop {
                for ((y, start), step) in self.unknowns.iter_mut().zip(&start).zip(&step) {
                    *y = start + share * step;
                }
                let next = self.assemble(t, h, x, rule);
                let free = matches!(rule, Rule::Least) || share < SHORTEST;
                if free || next <= (1.0 - 1e-4 * share) * residual {
                    break next;
                }
                share *= 0.5;
            };
            residual = next;
            let relative = step.iter().zip(&self.unknowns);
            let relative = relative.map(|(step, y)| step.abs() / (1.0 + y.abs()));
            let change = relative.fold(
                0.0,
                |most: f64, c| if c > most || c.is_nan() { c } else { most },
            );
            if !change.is_finite() {
                return false;
            }
            if share * change <= converged {
                return matches!(rule, Rule::Smooth(_)) || self.is_complementary();
            }
        }
        false
    }

    /// Whether no member is negative.
    fn is_complementary(&self) -> bool {
        let per_node = self.per_node();
        let n = self.system.n_states();
        self.unknowns.chunks_exact(per_node).all(|node| {
            let z = &node[n..];
            let mut pairs = self.system.pairs().iter();
            pairs.all(|pair| pair.left.value(z).min(pair.right.value(z)) >= SLACK)
        })
    }

    /// The negative residual and the Jacobian of all equations. Returns the norm of the residual.
    fn assemble(&mut self, t: f64, h: f64, x0: &[f64], rule: Rule) -> f64 {
        let (system, s, n) = (self.system, self.uniform.scheme.s, x0.len());
        let (full, per_node) = (system.full(), self.per_node());
        let (size, n_rows) = (s * per_node, full.equations.n_outputs());
        self.matrix.fill(0.0);
        for m in 0..s {
            let rows = m * per_node;
            let state = |i: usize| {
                let terms = (0..s).map(|j| {
                    self.uniform.scheme.tableau.a[m * s + j] * self.unknowns[j * per_node + i]
                });
                x0[i] + h * terms.sum::<f64>()
            };
            let x: Vec<f64> = (0..n).map(state).collect();
            self.load(t + self.uniform.scheme.tableau.nodes[m] * h, &x, m);
            self.registers[..self.inputs.len()].copy_from_slice(&self.inputs);
            full.equations.run(&mut self.registers);
            for (i, value) in full.equations.results(&self.registers).enumerate() {
                self.rhs[rows + i] = match i < n {
                    true => value - self.unknowns[rows + i],
                    false => -value,
                };
            }
            for i in 0..n {
                self.matrix[(rows + i) * (size + 1)] = 1.0;
            }
            self.registers[..self.inputs.len()].copy_from_slice(&self.inputs);
            full.slopes.tape.run(&mut self.registers);
            for (&(row, input), slope) in full
                .slopes
                .entries
                .iter()
                .zip(full.slopes.tape.results(&self.registers))
            {
                let sign = if row < n { -1.0 } else { 1.0 };
                let start = (rows + row) * size;
                match input {
                    0 => {}
                    _ if input <= n => {
                        for j in 0..s {
                            let a = self.uniform.scheme.tableau.a[m * s + j];
                            self.matrix[start + j * per_node + input - 1] += sign * h * a * slope;
                        }
                    }
                    _ => self.matrix[start + rows + input - 1] += sign * slope,
                }
            }
            let z = &self.inputs[1 + n..=per_node];
            for (k, pair) in system.pairs().iter().enumerate() {
                let row = rows + n_rows + k;
                let (a, b) = (pair.left.value(z), pair.right.value(z));
                let [by_a, by_b, value] = match rule {
                    Rule::Least if a <= b => [1.0, 0.0, a],
                    Rule::Least => [0.0, 1.0, b],
                    Rule::Smooth(sigma) => {
                        let root = (a * a + b * b + 2.0 * sigma).sqrt();
                        [1.0 - a / root, 1.0 - b / root, a + b - root]
                    }
                };
                self.rhs[row] = -value;
                let at = row * size + rows + n;
                self.matrix[at + pair.left.variable] += by_a * pair.left.slope();
                self.matrix[at + pair.right.variable] += by_b * pair.right.slope();
            }
        }
        self.rhs.iter().map(|r| r * r).sum::<f64>().sqrt()
    }

    /// x₀ + h Σ_j b_j V_j
    fn end(&self, h: f64, x0: &[f64], end: &mut [f64]) {
        let per_node = self.per_node();
        for (i, end) in end.iter_mut().enumerate() {
            let terms = self.tableau().weights.iter().enumerate();
            let mean: f64 = terms
                .map(|(j, b)| b * self.unknowns[j * per_node + i])
                .sum();
            *end = x0[i] + h * mean;
        }
    }

    /// Where the switches stand at the last node.
    fn sides(&mut self, t: f64, x: &[f64]) -> Box<[Side]> {
        self.load(t, x, self.tableau().n_nodes() - 1);
        self.registers[..self.inputs.len()].copy_from_slice(&self.inputs);
        let tape = &self.system.full().alphas;
        tape.run(&mut self.registers);
        for (alpha, value) in self.alpha.iter_mut().zip(tape.results(&self.registers)) {
            *alpha = value;
        }
        let side = |alpha: &f64| match *alpha {
            alpha if alpha <= END => Side::Minus,
            alpha if alpha >= 1.0 - END => Side::Plus,
            _ => Side::Slide,
        };
        self.alpha.iter().map(side).collect()
    }

    /// x(τ) = x₀ + ∫ V, and α as at the last node.
    fn polynomials(&mut self, h: f64, x0: &[f64], sides: &[Side]) {
        let (s, n, per_node) = (self.tableau().n_nodes(), x0.len(), self.per_node());
        self.series.shape(n, sides.len(), s);
        for (i, &x0) in x0.iter().enumerate() {
            let c = self.series.row_mut(i);
            c[0] = x0;
            let mut scale = 1.0;
            for (k, powers) in self.uniform.scheme.powers.chunks_exact(s).enumerate() {
                let terms = powers
                    .iter()
                    .enumerate()
                    .map(|(j, p)| p * self.unknowns[j * per_node + i]);
                c[k + 1] = terms.sum::<f64>() * scale / (k + 1) as f64;
                scale /= h;
            }
        }
        for switch in (0..sides.len()).filter(|switch| sides[*switch] == Side::Slide) {
            self.series.row_mut(n + switch)[0] = self.alpha[switch];
        }
    }
}
