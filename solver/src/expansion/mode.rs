//! The present mode: its functions, its Taylor expansion, and its algebra.
//!
//! Entering a mode takes up the functions of those blocks and surfaces alone whose own sides have
//! changed; they were compiled when a run first met these sides.
//!
//! While surfaces K slide, α_K solves φ_K(t, x, α_K) = 0, φ_i = ∇ψ_i·f + ∂ψ_i/∂t. Along the solution
//! φ_i = dψ_i/dt, so the order-k coefficient of φ_i is k + 1 times the order-(k+1) coefficient of
//! ψ_i. It is linear in the order-k coefficient of α_K with the matrix A = ∂φ_K/∂α_K of the expansion
//! point, so one factorization serves all orders: evaluate f with α_K,k = 0, from it x and ψ_K of
//! order k + 1, solve A α_K,k = -(k + 1) ψ_K,k+1, and evaluate again what contains α_K.

use std::sync::Arc;

use super::field::Field;
use super::layout::Memory;
use super::monitor::Monitored;
use super::planes::Planes;
use super::sliding::Sliding;
use super::surfaces::Surfaces;
use crate::hybrid::form::Library;
use crate::hybrid::point::Point;
use crate::hybrid::{Few, HybridSystem, Side};
use crate::linalg::Singular;

pub(crate) struct Mode {
    pub(crate) system: Arc<HybridSystem>,
    pub sides: Box<[Side]>,
    /// K: the sliding switches but those that rest, whose α has no equation (`integrate/singular_rates.rs`).
    pub sliding: Vec<usize>,
    pub n: usize,
    pub(crate) memory: Memory,
    /// What has been made of forms.
    pub(crate) library: Library,
    pub(crate) field: Field,
    pub(crate) surfaces: Surfaces,
    pub(crate) equations: Sliding,
    /// Switching functions that come in twos.
    pub(crate) planes: Planes,
    pub monitored: Monitored,
    pub focus: Focus,
}

/// A few switches whose α are varied while all else stays as it is.
#[derive(Default)]
pub(crate) struct Focus {
    switches: Vec<usize>,
    /// States that their ψ depend on, in order.
    pub states: Vec<usize>,
    blocks: Vec<usize>,
}

/// Newton iterations for α before the equations count as unsolvable.
const MAX_NEWTON: usize = 30;

impl Mode {
    /// No mode yet: `enter` takes one.
    pub(crate) fn new(system: &Arc<HybridSystem>, order: usize) -> Self {
        let (n, m) = (system.n_states(), system.n_switches());
        Mode {
            system: system.clone(),
            sides: vec![Side::Plus; m].into(),
            sliding: Vec::new(),
            n,
            memory: Memory::new(system, order),
            library: Library::new(system.clone()),
            field: Field::new(system),
            surfaces: Surfaces::new(system),
            equations: Sliding::new(n, m),
            planes: Planes::new(system),
            monitored: Monitored::new(system),
            focus: Focus::default(),
        }
    }

    /// Takes the functions of these sides.
    pub(crate) fn enter(&mut self, sides: &[Side]) {
        let entered = self.field.n_functions > 0;
        self.enter_surfaces(sides);
        // On the same sides, too: `stand_for` may have let switches stand for other derivatives.
        self.surfaces.stand(sides);
        if entered && *self.sides == *sides {
            return;
        }
        if entered {
            for (i, side) in sides.iter().enumerate() {
                if self.sides[i] != *side {
                    for at in 0..self.field.of_switch(i).len() {
                        let block = self.field.of_switch(i)[at];
                        let functions = &mut self.library;
                        self.field.enter(functions, &mut self.memory, block, sides);
                    }
                }
            }
        } else {
            for block in 0..self.field.n_blocks() {
                let functions = &mut self.library;
                self.field.enter(functions, &mut self.memory, block, sides);
            }
        }
        self.sides.copy_from_slice(sides);
        self.sliding.clear();
        let slides = |&i: &usize| sides[i] == Side::Slide && !self.system.switches[i].rests();
        self.sliding.extend((0..sides.len()).filter(slides));
        self.equations.arranged = false;
    }

    /// Moves to a point where the α of some switches are to be varied.
    pub(crate) fn focus(&mut self, t: f64, x: &[f64], alpha: &[f64], switches: &[usize]) {
        self.memory.set(t, x, alpha);
        let focus = &mut self.focus;
        focus.switches.clear();
        focus.switches.extend_from_slice(switches);
        focus.states.clear();
        focus.blocks.clear();
        for &i in switches {
            let states = self.surfaces.gradient(i).iter().map(|&(state, _)| state);
            focus.states.extend(states);
            focus.blocks.extend_from_slice(self.field.of_switch(i));
        }
        focus.states.sort_unstable();
        focus.states.dedup();
        let blocks = focus.states.iter().map(|&state| self.field.block_of(state));
        focus.blocks.extend(blocks);
        focus.blocks.sort_unstable();
        focus.blocks.dedup();
    }

    /// Evaluates what the α in focus and their rates φ depend on.
    pub(crate) fn vary(&mut self, alpha: &[f64]) {
        for &i in &self.focus.switches {
            self.memory.values[1 + self.n + i] = alpha[i];
        }
        for &block in &self.focus.blocks {
            self.field.eval_block(block, &self.memory.values);
        }
    }

    /// Takes the switching functions of these sides, and no rates.
    pub(crate) fn enter_surfaces(&mut self, sides: &[Side]) {
        let functions = &mut self.library;
        self.surfaces.enter(functions, &mut self.memory, sides);
    }

    /// Functions taken up so far.
    pub(crate) fn n_functions(&self) -> usize {
        self.field.n_functions + self.surfaces.n_functions
    }

    /// Moves to a point of a run without evaluating anything.
    pub(crate) fn move_to(&mut self, point: &Point) {
        self.memory.set(point.t, &point.x, &point.alpha);
    }

    /// Evaluates f at a point.
    pub(crate) fn eval(&mut self, t: f64, x: &[f64], alpha: &[f64]) {
        self.memory.set(t, x, alpha);
        self.field.eval(&self.memory.values);
    }

    /// Evaluates ∇ψ, ∂ψ/∂t and ∂f/∂α for the rates φ of some switches, where the point is.
    pub(crate) fn linearize(&mut self, switches: &[usize]) {
        for &i in switches {
            self.surfaces.linearize(i, &self.memory.values);
            for at in 0..self.surfaces.gradient(i).len() {
                let state = self.surfaces.gradient(i)[at].0;
                self.field.linearize(state, &self.memory.values);
            }
        }
    }

    /// ψ where the point is.
    pub(crate) fn psi(&mut self, switch: usize) -> f64 {
        self.surfaces.value(switch, &self.memory.values)
    }

    /// φ = ∇ψ·f + ∂ψ/∂t, from the gradient where it was last linearized.
    pub(crate) fn phi(&self, switch: usize) -> f64 {
        self.surfaces.rate(switch, &self.field.f)
    }

    /// Σ |∇ψ_j f_j| + |∂ψ/∂t|, the terms of φ.
    pub(crate) fn terms_of_phi(&self, switch: usize) -> f64 {
        let terms = self.surfaces.gradient(switch).iter();
        let terms = terms.map(|&(state, g)| (g * self.field.f[state]).abs());
        terms.sum::<f64>() + self.surfaces.time_gradient(switch).abs()
    }

    /// ∂φ_switch/∂α_alpha of a sliding α, where it was last linearized.
    pub(crate) fn coupling(&self, switch: usize, alpha: usize) -> f64 {
        let gradient = self.surfaces.gradient(switch).iter();
        let by_alpha = gradient.flat_map(|&(state, g)| {
            let slopes = self.field.slopes(state).filter(move |(j, _)| *j == alpha);
            slopes.map(move |(_, slope)| g * slope)
        });
        by_alpha.sum::<f64>() + self.surfaces.now(switch).mixed(alpha, &self.field.f)
    }

    /// Finds what interacts where a mode begins.
    pub(crate) fn start_equations(&mut self, point: &Point) {
        self.move_to(point);
        self.linearize_surfaces();
        self.equations
            .arrange(&self.sliding, &self.field, &self.surfaces);
    }

    /// Factors A where the point is.
    pub(crate) fn factor(&mut self) -> Result<(), Singular> {
        self.field.linearize_sliding(&self.memory.values);
        self.equations.factor(&self.field, &self.surfaces)
    }

    /// Evaluates the gradients of the sliding surfaces where the point is.
    pub(crate) fn linearize_surfaces(&mut self) {
        for &i in &self.sliding {
            self.surfaces.linearize(i, &self.memory.values);
        }
    }

    /// Solves φ_K(α_K) = 0 by Newton's method from the given α; leaves A factored.
    pub(crate) fn solve_alpha(
        &mut self,
        t: f64,
        x: &[f64],
        alpha: &mut [f64],
    ) -> Result<(), Singular> {
        self.eval(t, x, alpha);
        if self.sliding.is_empty() {
            return Ok(());
        }
        self.linearize_surfaces();
        self.equations
            .arrange(&self.sliding, &self.field, &self.surfaces);
        let mut last = f64::INFINITY;
        for _ in 0..MAX_NEWTON {
            self.factor()?;
            for at in 0..self.sliding.len() {
                self.equations.rhs[at] = match self.equations.tie(at) {
                    _ if self.equations.is_held(at) => 0.0,
                    None => self.phi(self.equations.switches()[at]),
                    Some(tie) => tie.residual(alpha),
                };
            }
            self.equations.solve();
            let mut change = 0.0_f64;
            for (i, delta) in self.equations.solution() {
                alpha[i] -= delta;
                change = change.max(delta.abs() / (1.0 + alpha[i].abs()));
            }
            self.memory.set(t, x, alpha);
            self.field.eval_sliding(&self.memory.values);
            // Close to a fold, what rounding does to φ is large in α.
            if change <= 1e-13 || change <= 1e-9 && change > 0.5 * last {
                return Ok(());
            }
            last = change;
        }
        Err(Singular { column: 0 })
    }

    /// Solves for α where a step starts, and takes note of ∂φ_K/∂α_K there.
    pub(crate) fn start(&mut self, t: f64, x: &[f64], alpha: &mut [f64]) -> Result<(), Singular> {
        self.solve_alpha(t, x, alpha)?;
        self.equations.expand_here();
        Ok(())
    }

    /// True when a determinant of ∂φ_K/∂α_K has another sign where `eval` was last called than at the
    /// expansion point: in between, α_K was not determined.
    pub(crate) fn turned_over(&mut self) -> bool {
        if self.sliding.is_empty() {
            return false;
        }
        self.linearize_surfaces();
        self.factor().is_err() || self.equations.turned_over()
    }

    /// Series of state i.
    pub(crate) fn x_series(&self, i: usize) -> &[f64] {
        self.memory.series(self.memory.state(i))
    }

    /// Series of α of a sliding switch.
    pub(crate) fn alpha_series(&self, switch: usize) -> &[f64] {
        self.memory.series(self.memory.alpha(switch))
    }

    /// Series of ψ of a switch, or of what is monitored of two entries, after `expand_psi`.
    pub(crate) fn psi_series(&self, switch: usize) -> &[f64] {
        let along = self.planes.series(switch);
        along.unwrap_or_else(|| self.memory.series(self.surfaces.row(switch)))
    }

    /// ψ of all switches at a point of a run.
    pub(crate) fn all_psi(&mut self, point: &Point) -> Few<f64> {
        self.move_to(point);
        self.enter_surfaces(&point.sides);
        (0..point.sides.len()).map(|i| self.psi(i)).collect()
    }

    /// Takes the switching functions on the sides of a choice: one may have a kink where another is zero, and then its
    /// rate depends on the other's side.
    pub(crate) fn enter_choice(&mut self, point: &Point, group: &[usize], choice: &[Side]) {
        let sides = point.sides_with(group, choice);
        self.enter_surfaces(&sides);
    }

    /// ψ of a switch where the point is, or what is monitored of two entries.
    pub(crate) fn monitored_psi(&mut self, switch: usize) -> f64 {
        let (surfaces, values) = (&mut self.surfaces, &self.memory.values);
        self.planes.psi(switch, surfaces, values)
    }
}
