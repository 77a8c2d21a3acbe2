//! The complementarity system at all nodes of a Runge-Kutta step, as it stands.
//!
//! X_m = x₀ + h Σ_j a_mj V_j,   V_m = f(t_m, X_m, z_m),   0 = g(t_m, X_m, z_m),   0 ≤ a(z_m) ⟂ b(z_m) ≥ 0
//!
//! Nothing is assumed about which members are zero. Newton's method solves for V and z with the smaller
//! member of every pair zero, and where that goes in circles along smoothed pairs: the solutions of the
//! Fischer-Burmeister equation a + b - √(a² + b² + 2σ) = 0 satisfy ab = σ, a, b > 0 (Kanzow 1996).

use super::scheme::Scheme;
use super::stages::{by_node, by_node_mut};
use crate::fesd::system::evaluator::Evaluator;
use crate::fesd::system::{ComplementaritySystem, Pair};
use crate::fesd::uniform::SLACK;
use crate::hybrid::Stats;
use crate::integrate::tableau::Tableau;
use crate::linalg::DenseLu;
use crate::runtime::limit::Limit;
use crate::tape::Tape;

/// Newton iterations for one σ, and by the smaller members, which go in circles if they take longer.
const MAX_ITERATIONS: usize = 30;
const MAX_LEAST: usize = 15;

/// Where σ starts and ends, and what it is multiplied with, one attempt after the other.
const SIGMA: [f64; 2] = [1.0, 1e-16];
const SHRINK: [f64; 3] = [0.1, 0.1, 0.5];

/// Of so many σ in a row without a solution, the next ones have none either.
const MAX_LOST: usize = 3;

/// From this σ on the smaller members are tried.
const EARLY: f64 = 1e-2;

/// Changes of the unknowns, relative to √σ, at which the next σ is taken up.
const ALONG: f64 = 1e-3;

/// A change of the unknowns of this size is rounding.
const CONVERGED: f64 = 1e-13;

/// Shares of a Newton step below this are not tried.
const SHORTEST: f64 = 1e-4;

/// How the pairs enter the equations.
#[derive(Clone, Copy)]
enum Rule {
    /// The smaller member is zero.
    Least,
    /// a + b - √(a² + b² + 2σ) = 0.
    Smooth(f64),
}

/// A step: its start and its length.
#[derive(Clone, Copy)]
pub(crate) struct Step<'a> {
    pub t: f64,
    pub h: f64,
    pub x: &'a [f64],
    /// Sizes of the states.
    pub scale: &'a [f64],
}

/// The nodes, and the memory to solve for them.
pub(crate) struct Nodes {
    /// V and z of every node.
    pub unknowns: Vec<f64>,
    /// Sizes of the terms of the rates, at the places of V, here and where they were assembled before.
    terms: [Vec<f64>; 2],
    /// t, x, z and the numbers.
    at: Evaluator,
    matrix: Vec<f64>,
    rhs: Vec<f64>,
    lu: DenseLu,
    n: usize,
    n_z: usize,
    /// By the place of V and z in a node: the units of algebraic states whose rates they are, known as far as these are.
    follows: Vec<Option<f64>>,
}

impl Nodes {
    /// Memory for `s` nodes of a system.
    pub fn new(system: &ComplementaritySystem, s: usize) -> Self {
        let (n, n_z) = (system.n_states(), system.n_algebraics());
        let size = s * (n + n_z);
        let full = &system.full;
        let tapes = [&full.equations, &full.slopes.tape, &full.alphas];
        let units = &system.surfaces.units;
        let mut follows = vec![None; n + n_z];
        for &state in &system.algebraic_states {
            let unit = units.of_state(state);
            follows[state] = Some(unit);
            let entries = full.slopes.entries.iter();
            for (_, input) in entries.filter(|(row, input)| *row == state && *input > n) {
                follows[input - 1] = Some(unit / units.of_z(input - 1 - n));
            }
        }
        Nodes {
            unknowns: vec![0.0; size],
            terms: [vec![0.0; size], vec![0.0; size]],
            at: Evaluator::new(1 + n + n_z + system.n_numbers(), tapes),
            matrix: vec![0.0; size * size],
            rhs: vec![0.0; size],
            lu: DenseLu::new(size),
            n,
            n_z,
            follows,
        }
    }

    /// Unknowns per node: V, then z.
    pub fn per_node(&self) -> usize {
        self.n + self.n_z
    }

    /// z of a node.
    pub fn z(&self, node: usize) -> &[f64] {
        let per_node = self.per_node();
        &self.unknowns[node * per_node + self.n..(node + 1) * per_node]
    }

    /// By how much a state has moved at every node, over h: Σ_j a_mj V_j.
    pub fn moves(&self, tableau: &Tableau, state: usize) -> impl Iterator<Item = f64> {
        let rates = move |j: usize| self.unknowns[j * self.per_node() + state];
        let rows = tableau.a.chunks(tableau.nodes.len());
        rows.map(move |row| row.iter().enumerate().map(|(j, a)| a * rates(j)).sum())
    }

    /// What changes at breakpoints, to be written.
    pub fn numbers(&mut self) -> &mut [f64] {
        let first = self.per_node() + 1;
        &mut self.at.inputs[first..]
    }

    /// Takes z and the rates at a point as the guess of all nodes.
    pub fn begin(&mut self, system: &ComplementaritySystem, t: f64, x: &[f64], z: &[f64]) {
        self.at.set(t, x.iter().chain(z).copied());
        let n = self.n;
        let rates: Vec<f64> = self.at.eval(&system.full.equations).take(n).collect();
        let per_node = self.per_node();
        for node in by_node_mut(&mut self.unknowns, per_node) {
            node[..n].copy_from_slice(&rates);
            node[n..].copy_from_slice(z);
        }
    }

    /// Evaluates a tape at a point, with z of a node.
    pub fn eval_at<'e>(
        &'e mut self,
        tape: &'e Tape,
        (t, x): (f64, &[f64]),
        node: usize,
    ) -> impl Iterator<Item = f64> + 'e {
        self.at.set(t, x.iter().copied());
        self.load_z(node);
        self.at.eval(tape)
    }

    /// Puts z of a node into the inputs.
    fn load_z(&mut self, node: usize) {
        let per_node = self.per_node();
        let z = &self.unknowns[node * per_node + self.n..(node + 1) * per_node];
        self.at.inputs[1 + self.n..][..self.n_z].copy_from_slice(z);
    }

    /// Solves for V and z at once: by the smaller members first, else along smoothed pairs, ever more
    /// slowly and from the middle of what jumps, as long as `limit` allows. Whether no member of the solution is
    /// negative.
    pub fn solve(
        &mut self,
        system: &ComplementaritySystem,
        scheme: &Scheme,
        step: Step,
        limit: &Limit,
        stats: &mut Stats,
    ) -> bool {
        let start = self.unknowns.clone();
        if self.newton(system, scheme, step, Rule::Least, stats) {
            return true;
        }
        for (attempt, shrink) in SHRINK.into_iter().enumerate() {
            self.unknowns.copy_from_slice(&start);
            if attempt > 0 {
                self.centre(system);
            }
            let [mut sigma, last] = SIGMA;
            let mut lost = 0;
            while sigma > last && lost < MAX_LOST && !limit.is_over() {
                let found = self.newton(system, scheme, step, Rule::Smooth(sigma), stats);
                lost = if found { 0 } else { lost + 1 };
                // The smaller members may be the right ones long before σ is zero.
                if sigma <= EARLY {
                    let smooth = self.unknowns.clone();
                    if self.newton(system, scheme, step, Rule::Least, stats) {
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
    fn centre(&mut self, system: &ComplementaritySystem) {
        let (n, per_node) = (self.n, self.per_node());
        for node in by_node_mut(&mut self.unknowns, per_node) {
            for (i, z) in node[n..].iter_mut().enumerate() {
                if !system.is_continuous(i) {
                    *z = 0.5;
                }
            }
        }
    }

    /// Newton's method, along smoothed pairs with steps that lessen the residual; whether it
    /// converged.
    fn newton(
        &mut self,
        system: &ComplementaritySystem,
        scheme: &Scheme,
        step: Step,
        rule: Rule,
        stats: &mut Stats,
    ) -> bool {
        let mut residual = self.assemble(system, scheme, step, rule);
        let mut start = self.unknowns.clone();
        let largest = (system.surfaces.units).largest(&system.algebraic_states, step.x);
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
            let change = self.rhs.clone();
            start.copy_from_slice(&self.unknowns);
            let mut share = 1.0;
            let next = loop {
                for ((y, start), change) in self.unknowns.iter_mut().zip(&start).zip(&change) {
                    *y = start + share * change;
                }
                let next = self.assemble(system, scheme, step, rule);
                let free = matches!(rule, Rule::Least) || share < SHORTEST;
                if free || next <= (1.0 - 1e-4 * share) * residual {
                    break next;
                }
                share *= 0.5;
            };
            residual = next;
            let relative = change.iter().zip(&self.unknowns).enumerate();
            let relative = relative.map(|(at, (change, y))| {
                let size = match self.size_of_rate(at, step) {
                    Some(size) => y.abs().max(size),
                    None => 1.0 + y.abs(),
                };
                let size = match self.follows[at % self.per_node()] {
                    Some(unit) => size.max(largest * unit / step.h),
                    None => size,
                };
                change.abs() / size
            });
            let largest = relative.fold(
                0.0,
                |most: f64, c| if c > most || c.is_nan() { c } else { most },
            );
            if !largest.is_finite() {
                return false;
            }
            if share * largest <= converged {
                return matches!(rule, Rule::Smooth(_)) || self.is_complementary(system);
            }
        }
        false
    }

    /// Whether no member is negative.
    fn is_complementary(&self, system: &ComplementaritySystem) -> bool {
        let per_node = self.per_node();
        by_node(&self.unknowns, per_node).all(|node| {
            let z = &node[self.n..];
            let mut pairs = system.pairs.iter();
            pairs.all(|pair| pair.left.value(z).min(pair.right.value(z)) >= SLACK)
        })
    }

    /// The negative residual and the Jacobian of all equations. Returns the norm of the residual.
    fn assemble(
        &mut self,
        system: &ComplementaritySystem,
        scheme: &Scheme,
        step: Step,
        rule: Rule,
    ) -> f64 {
        let Step { t, h, x: x0, scale } = step;
        let (s, n, a) = (scheme.s, self.n, &scheme.tableau.a);
        let (full, per_node) = (&system.full, self.per_node());
        let (size, n_rows) = (s * per_node, full.equations.n_outputs());
        self.matrix.fill(0.0);
        self.terms.swap(0, 1);
        self.terms[0].fill(0.0);
        for m in 0..s {
            let rows = m * per_node;
            self.at.inputs[0] = t + scheme.tableau.nodes[m] * h;
            for (i, (input, x0)) in self.at.inputs[1..=n].iter_mut().zip(x0).enumerate() {
                let terms = (0..s).map(|j| a[m * s + j] * self.unknowns[j * per_node + i]);
                *input = x0 + h * terms.sum::<f64>();
            }
            self.load_z(m);
            for (i, value) in self.at.eval(&full.equations).enumerate() {
                self.rhs[rows + i] = match i < n {
                    true => value - self.unknowns[rows + i],
                    false => -value,
                };
            }
            for i in 0..n {
                self.matrix[(rows + i) * (size + 1)] = 1.0;
            }
            let slopes = self.at.eval(&full.slopes.tape);
            for (&(row, input), slope) in full.slopes.entries.iter().zip(slopes) {
                let sign = if row < n { -1.0 } else { 1.0 };
                let start = (rows + row) * size;
                let term = match input {
                    0 => 0.0,
                    // A state at rest is what rounding leaves of the terms of its rate.
                    _ if input <= n => scale[input - 1].max(h * self.terms[1][rows + input - 1]),
                    _ => 1.0 + self.unknowns[rows + input - 1].abs(),
                };
                if row < n {
                    self.terms[0][rows + row] += slope.abs() * term;
                }
                match input {
                    0 => {}
                    _ if input <= n => {
                        for j in 0..s {
                            self.matrix[start + j * per_node + input - 1] +=
                                sign * h * a[m * s + j] * slope;
                        }
                    }
                    _ => self.matrix[start + rows + input - 1] += sign * slope,
                }
            }
            let z = &self.at.inputs[1 + n..=per_node];
            for (k, pair) in system.pairs.iter().enumerate() {
                let row = rows + n_rows + k;
                let (a, b) = (pair.left.value(z), pair.right.value(z));
                let [by_a, by_b, value] = match rule {
                    Rule::Least if a + tie(system, pair) <= b => [1.0, 0.0, a],
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
        // Rates count as shares of their terms, and so do equations in their units.
        let rows = self.rhs.iter().enumerate();
        let weighted = rows.map(|(at, r)| r / self.size_of_rate(at, step).unwrap_or(1.0));
        weighted.map(|r| r * r).sum::<f64>().sqrt()
    }

    /// How large the terms of the rate are whose V has this place; none where z has it.
    fn size_of_rate(&self, at: usize, step: Step) -> Option<f64> {
        let size = step.scale.get(at % self.per_node())? / step.h;
        Some(size.max(self.terms[0][at]).max(f64::MIN_POSITIVE))
    }
}

/// What the left member of a pair has to be below the right one by to be the smaller: where both are zero it is the one
/// that jumps, since equations say what the other one is.
fn tie(system: &ComplementaritySystem, pair: &Pair) -> f64 {
    let members = [pair.left, pair.right];
    match members.map(|member| system.is_continuous(member.variable)) {
        [true, false] => CONVERGED,
        [false, true] => -CONVERGED,
        _ => 0.0,
    }
}
