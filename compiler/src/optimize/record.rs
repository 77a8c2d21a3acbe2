//! The solution of a program as a trajectory.
//!
//! In an element, states are polynomials through their values at its nodes, and α through its values. A switch has one
//! side in an element: α is 0 or 1 at all of its nodes, or the state slides. Where states have jumped there are two
//! values at one time.

use nsd_solver::simulate::Side;

use super::Problem;
use crate::expr::{Expr, Var};
use crate::report::{Dense, Piece, Trajectory};
use crate::simulate::{Points, recorded};
use crate::system::experiment::Sampling;
use crate::system::{Role, System};

/// α that is so close to 0 or 1 is.
const ROUNDING: f64 = 1e-7;
/// Elements that are so short, as a share of the horizon, have no mode of their own.
const SHORTEST: f64 = 1e-9;

/// Nodes that are closer, as a share of their element, make no polynomial.
const CLOSEST: f64 = 1e-4;

/// The value of a member of a pair, without kinks, at a time and a state.
fn member(system: &System, switch: usize, t: f64, x: &[f64]) -> f64 {
    let value = |var: Var| {
        let is = |e: Expr| e.as_variable() == Some(var);
        let state = system.states.iter().position(|state| is(state.var));
        let param = || system.params.iter().find(|param| is(param.var));
        let data = || system.data.iter().find(|data| is(data.var));
        match state {
            Some(state) => x[state],
            None if is(system.time) => t,
            None => (param().map(|param| param.value))
                .or_else(|| data().map(|data| data.table.value(t)))
                .unwrap_or(0.5),
        }
    };
    -system.switches[switch].psi.eval(&value)
}

/// States, α and modes of a system without integrals; nothing about how they were found.
pub(super) fn trajectory(problem: &Problem, system: &System, w: &[f64]) -> Trajectory {
    let layout = &problem.layout;
    let horizon = problem.horizon(w);
    let n = system.states.len();
    let n_coefficients = layout.points.len();

    let mut points = Points::default();
    let mut pieces: Vec<Piece> = Vec::new();
    let mut sides: Vec<(f64, Box<[Side]>)> = Vec::new();
    // The state when the clock stopped, and the laws that have acted since.
    let mut stopped: Option<(&[f64], Vec<usize>)> = None;
    let mut t = 0.0_f64;
    for (k, j) in layout.all_elements() {
        if j == 1 {
            t = t.max(horizon * (k - 1) as f64 / layout.steps as f64);
        }
        let instants = problem.instants(w, (k, j), t);
        // Clocks are continuous but for rounding.
        let from = instants[0].max(t).min(horizon);
        let to = instants[layout.end].max(from).min(horizon);
        let x = |m: usize| &w[layout.x(k, j, m)..][..n];
        let alphas: Vec<Vec<f64>> = (1..=layout.nodes)
            .map(|m| problem.alphas(w, (k, j, m)))
            .collect();
        if (k, j) == (1, 1) {
            points.push(0.0, x(0), &alphas[0]);
        }
        if problem.stands(w, (k, j), &instants) {
            let (_, laws) = stopped.get_or_insert_with(|| (x(0), Vec::new()));
            laws.extend(problem.acting(w, (k, j)));
            continue;
        }
        if let Some((before, laws)) = stopped.take().filter(|(_, laws)| !laws.is_empty()) {
            points.jump(from, laws, before, x(0));
            points.push(from, x(0), &alphas[0]);
        }
        if to - from > SHORTEST * horizon {
            let nodes = apart(&instants, &layout.points);
            let through = basis(&nodes);
            let inner = basis(&nodes[1..=layout.nodes]);
            let mut coefficients = Vec::with_capacity((n + alphas[0].len()) * n_coefficients);
            for i in 0..n {
                let values = (0..nodes.len()).map(|m| x(m)[i]);
                push(
                    &mut coefficients,
                    &through,
                    values,
                    to - from,
                    n_coefficients,
                );
            }
            for i in 0..alphas[0].len() {
                let values = alphas.iter().map(|alpha| alpha[i]);
                push(&mut coefficients, &inner, values, to - from, n_coefficients);
            }
            for data in &system.data {
                let known = data.table.piece(0.5 * (from + to)).around(from);
                let rest = n_coefficients.saturating_sub(known.len());
                coefficients.extend(known.into_iter().take(n_coefficients));
                coefficients.resize(coefficients.len() + rest, 0.0);
            }
            pieces.push(Piece {
                from,
                to,
                n_coefficients,
                coefficients,
            });
            let side = |i: usize| {
                let values = alphas.iter().map(|alpha| alpha[i]);
                let (low, high) = values
                    .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), a| {
                        (low.min(a), high.max(a))
                    });
                match system.switches[i].role {
                    Role::Step => {}
                    Role::Equation => return Side::Slide,
                    Role::Member(other) => {
                        // What is smaller in the middle of the element is zero.
                        let m = layout.nodes.div_ceil(2);
                        let [own, others] =
                            [i, other].map(|k| member(system, k, instants[m], x(m)));
                        let is_zero = own < others || own == others && i < other;
                        return if is_zero { Side::Slide } else { Side::Minus };
                    }
                }
                match (low >= 1.0 - ROUNDING, high <= ROUNDING) {
                    (true, _) => Side::Plus,
                    // A force has no bound.
                    (_, true) if !system.switches[i].unilateral => Side::Minus,
                    _ => Side::Slide,
                }
            };
            sides.push((from, (0..alphas[0].len()).map(side).collect()));
        }
        t = to;
        points.push(t, x(layout.end), &alphas[layout.nodes - 1]);
    }
    if let Some((before, laws)) = stopped.filter(|(_, laws)| !laws.is_empty()) {
        let (k, j, m) = (layout.steps, layout.elements, layout.end);
        let x = &w[layout.x(k, j, m)..][..n];
        points.jump(horizon, laws, before, x);
        points.push(horizon, x, &problem.alphas(w, (k, j, layout.nodes)));
    }
    if let Some(piece) = pieces.last_mut() {
        piece.to = horizon;
    }
    let dense = Dense { pieces };
    if problem.settings.sampling != Sampling::Method {
        points = sampled(
            &dense,
            &problem.settings.sampling,
            horizon,
            (n, system.switches.len()),
            points,
        );
    }
    recorded(system, problem.settings, points, dense.pieces, &sides)
}

/// Instants as shares of an element, or where nodes are while time passes evenly, should they be too close.
fn apart(instants: &[f64], even: &[f64]) -> Vec<f64> {
    let (from, to) = (instants[0], instants[instants.len() - 1]);
    let shares: Vec<f64> = instants.iter().map(|t| (t - from) / (to - from)).collect();
    let are_apart = shares.windows(2).all(|pair| pair[1] - pair[0] > CLOSEST);
    if are_apart { shares } else { even.to_vec() }
}

/// The polynomials at the instants that the experiment asks for.
fn sampled(
    dense: &Dense,
    sampling: &Sampling,
    horizon: f64,
    (n, m): (usize, usize),
    known: Points,
) -> Points {
    let instants: Vec<f64> = match sampling {
        Sampling::Method => Vec::new(),
        Sampling::Every(period) => {
            let count = (horizon / period).floor() as usize;
            let inner = (0..=count).map(|i| i as f64 * period);
            inner.filter(|t| *t < horizon).chain([horizon]).collect()
        }
        Sampling::At(instants) => instants.iter().copied().filter(|t| *t <= horizon).collect(),
    };
    let mut points = known.emptied();
    for t in instants {
        if let Some(row) = dense.at(t) {
            points.push(t, &row[..n], &row[n..n + m]);
        }
    }
    points
}

/// Coefficients of the polynomials that are 1 at one of the points and 0 at the others.
fn basis(points: &[f64]) -> Vec<Vec<f64>> {
    let one = |i: usize| {
        let mut coefficients = vec![1.0];
        for (j, &other) in points.iter().enumerate().filter(|(j, _)| *j != i) {
            debug_assert_ne!(i, j);
            let scale = 1.0 / (points[i] - other);
            // Times (τ - other)/(point - other).
            let mut next = vec![0.0; coefficients.len() + 1];
            for (k, c) in coefficients.iter().enumerate() {
                next[k] -= other * scale * c;
                next[k + 1] += scale * c;
            }
            coefficients = next;
        }
        coefficients
    };
    (0..points.len()).map(one).collect()
}

/// The polynomial in t through values, in an element of length h.
fn push(
    coefficients: &mut Vec<f64>,
    basis: &[Vec<f64>],
    values: impl Iterator<Item = f64>,
    h: f64,
    n_coefficients: usize,
) {
    let first = coefficients.len();
    coefficients.resize(first + n_coefficients, 0.0);
    for (polynomial, value) in basis.iter().zip(values) {
        let mut scale = value;
        for (sum, c) in coefficients[first..].iter_mut().zip(polynomial) {
            *sum += scale * c;
            scale /= h;
        }
    }
}
