//! Algebraic states z: equations 0 = F(t, x, z), and pairs 0 ≤ a(t, x, z) ⟂ b(t, x, z) ≥ 0.
//!
//! Equations and members of pairs are switches with ψ = F, ψ = -a and ψ = -b, and z' are their α. An equation
//! slides always, and of a pair one member at a time: then φ = dψ/dt = 0 determines z' where the Jacobian by z is
//! regular, which is index one, and the drift off ψ = 0 is projected away by z alone. A member that is off its
//! surface is monitored like any other switch; where it gets there, the rates decide which of the two slides on.
//!
//! z itself is computed where a run starts and where anything jumps: for every choice of members by Newton's method
//! from the z there is, damped by the length of the step that follows (Deuflhard 2011); a choice is a solution where no other member
//! is above its surface.

use std::sync::Arc;

use crate::event::state::State;
use crate::events::bands::BandWidths;
use crate::expansion::mode::Mode;
use crate::hybrid::point::Point;
use crate::hybrid::status::Candidate;
use crate::hybrid::{HybridSystem, Note, Role, Side, Status};
use crate::linalg::DenseLu;
use crate::optimization::lcp::lemke;

/// Up to this many pairs all choices are solved, which shows whether there is one solution.
const MAX_PAIRS: usize = 8;

/// Solutions of other choices that Newton's method starts from.
const MAX_GUESSES: usize = 8;

/// Linear complementarity problems one after the other.
const MAX_LINEARIZED: usize = 20;

/// Newton iterations.
const MAX_NEWTON: usize = 60;

/// The shortest part of a Newton step that is taken.
const SHORTEST: f64 = 1e-5;

/// Relative changes below this are taken without a test.
const CLOSE: f64 = 1e-9;

/// Solutions that differ less than this fraction of themselves are one.
const SAME: f64 = 1e-8;

/// Bands that ψ may be off its surface before z has jumped.
const UNSETTLED: f64 = 1e3;

/// Terms below this fraction of the others are their rounding.
const ROUNDED: f64 = 64.0 * f64::EPSILON;

/// Why a choice of members has no z.
enum Failure {
    Singular,
    Diverged,
}

/// A state, and of each pair whether its second member is the one that is kept.
type Chosen = (Vec<f64>, Vec<bool>);

/// All choices of n members; none where they are too many.
fn all_choices(n: usize) -> Vec<Vec<bool>> {
    match n <= MAX_PAIRS {
        true => (0..1_usize << n)
            .map(|bits| (0..n).map(|k| bits >> k & 1 == 1).collect())
            .collect(),
        false => Vec::new(),
    }
}

/// Finds algebraic states that are consistent with the others, which stay where they are.
pub(crate) struct Initialization<'a> {
    mode: &'a mut Mode,
    system: Arc<HybridSystem>,
    /// Switches of equations, and both members of each pair.
    equations: Vec<usize>,
    pairs: Vec<(usize, usize)>,
    /// How long the run goes on.
    horizon: f64,
    /// Whether it has begun: then switches of time are decided, also where ψ is rounding.
    has_begun: bool,
}

impl<'a> Initialization<'a> {
    fn new(mode: &'a mut Mode, state: &State, horizon: f64) -> Self {
        let has_begun = state.selection.begun;
        let system = mode.system.clone();
        let all = || (0..system.n_switches()).map(|i| (i, system.role(i)));
        let equations = all().filter(|(_, role)| *role == Role::Equation);
        let pairs = all().filter_map(|(i, role)| match role {
            Role::Member(other) if i < other => Some((i, other)),
            _ => None,
        });
        Initialization {
            equations: equations.map(|(i, _)| i).collect(),
            pairs: pairs.collect(),
            mode,
            system,
            horizon,
            has_begun,
        }
    }

    /// Computes the algebraic states where the others are, and takes the members that are zero there.
    pub(crate) fn settle(
        mode: &'a mut Mode,
        state: &mut State,
        horizon: f64,
    ) -> Result<(), Status> {
        match mode.system.algebraics.is_empty() {
            true => Ok(()),
            false => Initialization::new(mode, state, horizon).find(state),
        }
    }

    fn find(&mut self, state: &mut State) -> Result<(), Status> {
        let guess = state.point.x.clone();
        let (mut found, mut regular) = self.search_members(state);
        if self.pairs.len() > MAX_PAIRS {
            state.point.x.clone_from(&guess);
            let choice = self.linear_pairs(state);
            regular = true;
            found.extend(choice.map(|choice| (state.point.x.clone(), choice)));
            if !found.is_empty() {
                state.report.note(Note::Unsearched {
                    time: state.point.t,
                    switches: self.pairs.iter().map(|pair| pair.0).collect(),
                });
            }
        }
        let mut distinct = self.distinct(&found, &state.scales.floor);
        if distinct.len() > 1 {
            found.retain(|(x, choice)| self.goes_on(state, x, choice));
            distinct = self.distinct(&found, &state.scales.floor);
        }
        if distinct.len() > 1 {
            state.point.x = guess;
            let name = |&at: &usize| candidate(&self.pairs, &found[at].1);
            return Err(Status::NonUnique(distinct.iter().map(name).collect()));
        }
        let first = distinct.first().map(|&at| found.swap_remove(at));
        let Some((x, choice)) = first else {
            state.point.x = guess;
            let members = self.pairs.iter().flat_map(|&(a, b)| [a, b]);
            let switches = self.equations.iter().copied().chain(members).collect();
            return Err(match regular {
                true => Status::Inconsistent { switches },
                false => Status::HighIndex { switches },
            });
        };
        state.point.x = x;
        self.take_members(&mut state.point, &choice);
        self.measure_algebraics(state);
        Ok(())
    }

    /// Solutions with every choice of members, few as they are, and whether some choice has a regular system.
    fn search_members(&mut self, state: &mut State) -> (Vec<Chosen>, bool) {
        let (mut found, mut regular) = (Vec::new(), false);
        let scale = state.scales.largest.clone();
        // What other choices of members lead to are guesses, too.
        let mut guesses = vec![state.point.x.clone()];
        let mut unsolved: Vec<Vec<bool>> = Vec::new();
        for again in [false, true] {
            let (tried, starts) = match again {
                true => (std::mem::take(&mut unsolved), guesses[1..].to_vec()),
                false => (all_choices(self.pairs.len()), guesses.clone()),
            };
            for choice in tried {
                let mut solved = None;
                for start in &starts {
                    state.point.x.clone_from(start);
                    state.scales.largest.clone_from(&scale);
                    let outcome = self.solve_choice(&mut state.point, &choice);
                    regular |= !matches!(outcome, Err(Failure::Singular));
                    if outcome.is_ok() {
                        solved = Some(state.point.x.clone());
                        break;
                    }
                }
                let Some(x) = solved else {
                    unsolved.push(choice);
                    continue;
                };
                if !again && guesses.len() <= MAX_GUESSES {
                    guesses.push(x.clone());
                }
                if self.violated(state, &choice).is_none() {
                    found.push((x, choice));
                }
            }
            if guesses.len() == 1 {
                break;
            }
        }
        state.scales.largest.clone_from(&scale);
        (found, regular)
    }

    /// True where the equations do not hold as they stand, since something in them has jumped.
    pub(crate) fn is_unsettled(mode: &'a mut Mode, state: &mut State, t1: f64) -> bool {
        let horizon = t1 - state.point.t;
        !mode.system.algebraics.is_empty()
            && Initialization::new(mode, state, horizon).is_off(state)
    }

    fn is_off(&mut self, state: &mut State) -> bool {
        let kept = |i: &usize| self.system.role(*i) != Role::Step;
        let kept: Vec<usize> = (0..state.point.sides.len()).filter(kept).collect();
        self.mode.enter_surfaces(&state.point.sides);
        self.measure_algebraics(state);
        BandWidths { mode: self.mode }.measure(state, &kept, self.horizon);
        kept.into_iter().any(|i| {
            let psi = self.mode.psi(i);
            let off = match state.point.sides[i] {
                Side::Slide => psi.abs(),
                _ => psi,
            };
            !off.is_finite() || off > UNSETTLED * state.bands.width[i]
        })
    }

    /// The first of each of the solutions that differ.
    fn distinct(&self, found: &[(Vec<f64>, Vec<bool>)], floor: &[f64]) -> Vec<usize> {
        let mut distinct: Vec<usize> = Vec::new();
        for (at, (x, _)) in found.iter().enumerate() {
            if !(distinct.iter()).any(|&other| self.is_same(&found[other].0, x, floor)) {
                distinct.push(at);
            }
        }
        distinct
    }

    /// Whether members on their surface that are not held there come off it. Where more rows of a program hold as
    /// equations than z has entries, as in a corner that another row is about to cut off, their multipliers are not
    /// determined in that instant; those that are left without the row that comes off are.
    fn goes_on(&mut self, state: &mut State, x: &[f64], choice: &[bool]) -> bool {
        state.point.x.copy_from_slice(x);
        self.take_members(&mut state.point, choice);
        let others = self.pairs.iter().zip(choice);
        let others = others.map(|(&(a, b), &second)| if second { a } else { b });
        let mut others: Vec<usize> = others.collect();
        BandWidths { mode: self.mode }.measure(state, &others, self.horizon);
        others.retain(|&i| self.mode.psi(i).abs() <= state.bands.width[i]);
        self.mode.enter(&state.point.sides);
        let mut alpha = state.point.alpha.clone();
        if self.mode.solve_alpha(state.point.t, x, &mut alpha).is_err() {
            return false;
        }
        self.mode.linearize(&others);
        let mut others = others.into_iter();
        others.all(|i| self.mode.phi(i) <= ROUNDED * self.mode.terms_of_phi(i))
    }

    /// Whether two solutions are one. Where both members of a pair are zero, two choices have the same solution, up to
    /// the rounding of what z balances.
    fn is_same(&self, a: &[f64], b: &[f64], floor: &[f64]) -> bool {
        let mut algebraics = self.system.algebraics.iter();
        algebraics.all(|&z| (a[z] - b[z]).abs() <= SAME * a[z].abs().max(b[z].abs()).max(floor[z]))
    }

    /// Takes note of how large algebraic states are, and of what they balance: z_k = 0 is known to the rounding of the
    /// other terms of its rows, the least of (Σ_{j≠k} |∂ψ/∂x_j x_j| + |ψ - ∇ψ·x|) / |∂ψ/∂z_k|.
    fn measure_algebraics(&mut self, state: &mut State) {
        if self.system.algebraics.is_empty() {
            return;
        }
        let mode = &mut self.mode;
        mode.move_to(&state.point);
        for &z in &self.system.algebraics {
            state.scales.largest[z] = state.scales.largest[z].max(state.point.x[z].abs());
            state.scales.floor[z] = f64::INFINITY;
        }
        for i in (0..state.point.sides.len()).filter(|&i| self.system.role(i) != Role::Step) {
            mode.surfaces.stand_for(i, 0);
            mode.surfaces.linearize(i, &mode.memory.values);
            let along: f64 = mode
                .surfaces
                .gradient(i)
                .iter()
                .map(|&(j, g)| g * state.point.x[j])
                .sum();
            let terms =
                mode.surfaces.weigh(i, |j| state.scales.largest[j]) + (mode.psi(i) - along).abs();
            for &(j, g) in mode
                .surfaces
                .gradient(i)
                .iter()
                .filter(|(j, _)| mode.system.is_algebraic(*j))
            {
                let others = terms - g.abs() * state.scales.largest[j];
                if g != 0.0 && others > ROUNDED * terms {
                    state.scales.floor[j] = state.scales.floor[j].min(others / g.abs());
                }
            }
        }
        for &z in &self.system.algebraics {
            if state.scales.floor[z].is_infinite() {
                state.scales.floor[z] = 0.0;
            }
        }
    }

    /// Sets the sides of equations and members.
    fn take_members(&mut self, point: &mut Point, choice: &[bool]) {
        let mut sides = point.sides.clone();
        for &i in &self.equations {
            sides[i] = Side::Slide;
        }
        for (i, side) in candidate(&self.pairs, choice) {
            sides[i] = side;
        }
        point.set_sides(&sides);
    }

    /// Takes the sides of all switches that may be inside an equation.
    fn take_kinks(&mut self, point: &mut Point) {
        for _ in 0..=point.sides.len() {
            let psi = self.mode.all_psi(point);
            let is_free = |i: usize| {
                self.system.role(i) == Role::Step
                    && self.system.relay(i).is_none()
                    && !self.system.is_unilateral(i)
                    && !(self.has_begun && self.system.switches[i].is_timed)
            };
            let mut sides = point.sides.clone();
            for (i, &psi) in psi.iter().enumerate().filter(|(i, _)| is_free(*i)) {
                sides[i] = Side::of(psi);
            }
            if sides == point.sides {
                break;
            }
            point.set_sides(&sides);
        }
    }

    /// Solves for z where these members are zero.
    fn solve_choice(&mut self, point: &mut Point, choice: &[bool]) -> Result<(), Failure> {
        self.take_members(point, choice);
        let members = self.pairs.iter().zip(choice);
        let members = members.map(|(&(a, b), &second)| if second { b } else { a });
        let rows: Vec<usize> = self.equations.iter().copied().chain(members).collect();
        let system = self.system.clone();
        let unknowns = &system.algebraics;
        let n = unknowns.len();
        let mut lu = DenseLu::new(n);
        let (mut scales, mut last) = (Vec::new(), f64::INFINITY);
        for round in 0..MAX_NEWTON {
            let mut step = self.residuals(point, &rows);
            let matrix = self.jacobian_of(&rows);
            if lu.factor(&matrix).is_err() {
                return Err(match round {
                    0 => Failure::Singular,
                    _ => Failure::Diverged,
                });
            }
            lu.solve(&mut step);
            if scales.is_empty() {
                let scale = |(&z, d): (&usize, &f64)| match point.x[z].abs().max(d.abs()) {
                    0.0 => 1.0,
                    scale => scale,
                };
                scales = unknowns.iter().zip(&step).map(scale).collect();
            }
            let norm = |step: &[f64]| {
                let relative = step.iter().zip(&scales).map(|(d, s)| (d / s).powi(2));
                relative.sum::<f64>().sqrt()
            };
            let size = norm(&step);
            if !size.is_finite() {
                return Err(Failure::Diverged);
            }
            let before = point.x.clone();
            let mut part = 1.0;
            loop {
                for (&z, d) in unknowns.iter().zip(&step) {
                    point.x[z] = before[z] - part * d;
                }
                if size <= CLOSE {
                    break;
                }
                // The step that follows with the same matrix must be shorter.
                let mut next = self.residuals(point, &rows);
                lu.solve(&mut next);
                if norm(&next) <= (1.0 - 0.25 * part) * size {
                    break;
                }
                part *= 0.5;
                if part < SHORTEST {
                    return Err(Failure::Diverged);
                }
            }
            if size <= f64::EPSILON || size <= CLOSE && size >= 0.5 * last {
                self.take_kinks(point);
                return Ok(());
            }
            last = size;
        }
        Err(Failure::Diverged)
    }

    /// ψ of some switches.
    fn residuals(&mut self, point: &mut Point, rows: &[usize]) -> Vec<f64> {
        self.take_kinks(point);
        self.mode.move_to(point);
        rows.iter().map(|&i| self.mode.psi(i)).collect()
    }

    /// The first pair whose other member is above its surface.
    fn violated(&mut self, state: &mut State, choice: &[bool]) -> Option<usize> {
        self.measure_algebraics(state);
        let others = self.pairs.iter().zip(choice);
        let others = others.map(|(&(a, b), &second)| if second { a } else { b });
        let others: Vec<usize> = others.collect();
        BandWidths { mode: self.mode }.measure(state, &others, self.horizon);
        let mut others = others.into_iter();
        others.position(|i| self.mode.psi(i) > state.bands.width[i])
    }

    /// The choice of many pairs, from linear complementarity problems by Lemke's method, one around the solution of the
    /// other (Josephy 1979).
    fn linear_pairs(&mut self, state: &mut State) -> Option<Vec<bool>> {
        for _ in 0..MAX_LINEARIZED {
            let (choice, x) = self.linearized(&mut state.point)?;
            state.point.x.clone_from(&x);
            let solved = self.solve_choice(&mut state.point, &choice).is_ok();
            if solved && self.violated(state, &choice).is_none() {
                return Some(choice);
            }
            state.point.x = x;
        }
        None
    }

    /// The members that are zero in the complementarity problem linearized where the state is, and its solution.
    ///
    /// With a = s the equations give z + d, F + F_z d = 0 and a + a_z d = s, so that b + b_z d = q + M s.
    fn linearized(&mut self, point: &mut Point) -> Option<(Vec<bool>, Vec<f64>)> {
        self.take_members(point, &vec![false; self.pairs.len()]);
        let firsts = self.pairs.iter().map(|pair| pair.0);
        let rows: Vec<usize> = self.equations.iter().copied().chain(firsts).collect();
        let seconds: Vec<usize> = self.pairs.iter().map(|pair| pair.1).collect();
        let mut step = self.residuals(point, &rows);
        let others = self.residuals(point, &seconds);
        let (n, m) = (self.system.algebraics.len(), self.pairs.len());
        let mut lu = DenseLu::new(n);
        lu.factor(&self.jacobian_of(&rows)).ok()?;
        lu.solve(&mut step);
        let slopes = self.jacobian_of(&seconds);
        let along = |row: usize, d: &[f64]| {
            let terms = slopes[row * n..][..n].iter().zip(d);
            terms.map(|(slope, d)| slope * d).sum::<f64>()
        };
        // ψ = -a and -b.
        let q: Vec<f64> = (0..m).map(|row| along(row, &step) - others[row]).collect();
        let mut by_member = Vec::with_capacity(m);
        for k in 0..m {
            let mut unit = vec![0.0; n];
            unit[self.equations.len() + k] = 1.0;
            lu.solve(&mut unit);
            by_member.push(unit);
        }
        let entries = (0..m).flat_map(|row| by_member.iter().map(move |d| (row, d)));
        let matrix: Vec<f64> = entries.map(|(row, d)| along(row, d)).collect();
        let s = lemke(&matrix, &q, &vec![1.0; m]).ok()?;
        let mut x = point.x.clone();
        for (at, &z) in self.system.algebraics.iter().enumerate() {
            let moved = by_member.iter().zip(&s).map(|(d, s)| d[at] * s);
            x[z] -= step[at] + moved.sum::<f64>();
        }
        Some((s.iter().map(|&s| s > 0.0).collect(), x))
    }

    /// ∂ψ/∂z of some switches where the point is, row by row.
    fn jacobian_of(&mut self, rows: &[usize]) -> Vec<f64> {
        let unknowns = &self.system.algebraics;
        let n = unknowns.len();
        let mut matrix = vec![0.0; rows.len() * n];
        for (row, &i) in rows.iter().enumerate() {
            let mode = &mut self.mode;
            mode.surfaces.linearize(i, &mode.memory.values);
            for &(j, g) in self.mode.surfaces.gradient(i) {
                if let Ok(column) = unknowns.binary_search(&j) {
                    matrix[row * n + column] = g;
                }
            }
        }
        matrix
    }
}

/// The sides of all members.
fn candidate(pairs: &[(usize, usize)], choice: &[bool]) -> Candidate {
    let sides = pairs.iter().zip(choice).flat_map(|(&(a, b), &second)| {
        let (zero, positive) = if second { (b, a) } else { (a, b) };
        [(zero, Side::Slide), (positive, Side::Minus)]
    });
    sides.collect()
}
