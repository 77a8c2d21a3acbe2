//! Elements as a trajectory, whatever has solved for their values.
//!
//! In an element, states are polynomials through their values at its nodes, and α through its values. A switch has one
//! side in an element: α is 0 or 1 at all of its nodes, or the state slides. The two switches of a disc slide where
//! their 2α - 1 is inside of it, and are above where it is on the edge at all nodes. Where states have jumped there are
//! two values at one time.

use nsd_solver::expansion::Polynomials;
use nsd_solver::hybrid::Side;

use crate::expr::{Expr, Var};
use crate::report::{Dense, Piece, Trajectory};
use crate::simulate::{Points, recorded};
use crate::system::experiment::{Sampling, Settings};
use crate::system::{Role, System};

/// α that is so close to 0 or 1 is.
const ROUNDING: f64 = 1e-7;

/// Nodes that are closer, as a share of their element, make no polynomial.
const CLOSEST: f64 = 1e-4;

/// Where the nodes of elements are.
#[derive(Clone, Debug)]
pub(crate) struct Shape {
    /// Node 0, the Runge-Kutta nodes, and the end, in an element of length 1.
    nodes: Vec<f64>,
    /// How many of them are Runge-Kutta nodes.
    n_nodes: usize,
}

impl Shape {
    /// With the nodes of an element of length 1: 0, those of a Runge-Kutta method, and the end where it is none of them.
    pub fn new(nodes: &[f64], n_nodes: usize) -> Self {
        Shape {
            nodes: nodes.to_vec(),
            n_nodes,
        }
    }

    /// The polynomials and sides of an element with the instants and states of its nodes and ends, and α at its nodes.
    pub fn element(
        &self,
        system: &System,
        instants: &[f64],
        x: &[&[f64]],
        alphas: &[Vec<f64>],
    ) -> (Piece, Box<[Side]>) {
        let (from, to) = (instants[0], instants[instants.len() - 1]);
        let (n, n_coefficients) = (system.states.len(), self.nodes.len());
        let nodes = apart(instants, &self.nodes);
        let through = basis(&nodes);
        let inner = basis(&nodes[1..=self.n_nodes]);
        let mut coefficients = Vec::with_capacity((n + alphas[0].len()) * n_coefficients);
        for i in 0..n {
            let values = x.iter().map(|x| x[i]);
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
        let m = x.len() / 2;
        let sides = (0..alphas[0].len()).map(|i| side(system, i, alphas, (instants[m], x[m])));
        let piece = Piece {
            from,
            to,
            n_coefficients,
            coefficients,
        };
        (piece, sides.collect())
    }
}

/// The side of a switch in an element with α at its nodes, and an instant and the state in its middle.
fn side(system: &System, i: usize, alphas: &[Vec<f64>], (t, x): (f64, &[f64])) -> Side {
    let values = alphas.iter().map(|alpha| alpha[i]);
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), a| {
        (low.min(a), high.max(a))
    });
    match system.switches[i].role {
        Role::Step => {}
        Role::Equation => return Side::Slide,
        Role::Member(other) => {
            // What is smaller in the middle of the element is zero.
            let [own, others] = [i, other].map(|k| member(system, k, t, x));
            let is_zero = own < others || own == others && i < other;
            return if is_zero { Side::Slide } else { Side::Minus };
        }
    }
    if let Some(other) = system.switches[i].across {
        let inside = |alpha: f64| (2.0 * alpha - 1.0).powi(2);
        let square = |alpha: &Vec<f64>| inside(alpha[i]) + inside(alpha[other]);
        let on_edge = alphas.iter().all(|alpha| square(alpha) >= 1.0 - ROUNDING);
        return if on_edge { Side::Plus } else { Side::Slide };
    }
    match (low >= 1.0 - ROUNDING, high <= ROUNDING) {
        (true, _) => Side::Plus,
        // A force has no bound.
        (_, true) if !system.switches[i].unilateral => Side::Minus,
        _ => Side::Slide,
    }
}

/// Points, polynomials and sides, element by element.
pub(crate) struct Elements<'s, 'e> {
    system: &'s System<'e>,
    shape: Shape,
    points: Points,
    pieces: Vec<Piece>,
    sides: Vec<(f64, Box<[Side]>)>,
}

impl<'s, 'e> Elements<'s, 'e> {
    pub fn new(system: &'s System<'e>, nodes: &[f64], n_nodes: usize) -> Self {
        Elements {
            system,
            shape: Shape::new(nodes, n_nodes),
            points: Points::default(),
            pieces: Vec::new(),
            sides: Vec::new(),
        }
    }

    /// The state at an instant.
    pub fn point(&mut self, t: f64, x: &[f64], alphas: &[f64]) {
        let n = self.system.states.len();
        self.points.push(t, &x[..n], alphas);
    }

    /// States jump by laws.
    pub fn jump(&mut self, t: f64, laws: Vec<usize>, [before, after]: [&[f64]; 2], alphas: &[f64]) {
        let n = self.system.states.len();
        self.points.jump(t, laws, &before[..n], &after[..n]);
        self.points.push(t, &after[..n], alphas);
    }

    /// An element with the instants and states of its nodes and ends, and α at its nodes.
    pub fn element(&mut self, instants: &[f64], x: &[&[f64]], alphas: &[Vec<f64>]) {
        let (piece, sides) = self.shape.element(self.system, instants, x, alphas);
        self.sides.push((piece.from, sides));
        self.pieces.push(piece);
    }

    /// The trajectory to the horizon, with some parameters open, by their numbers.
    pub fn finish(mut self, settings: &Settings, horizon: f64, open: &[usize]) -> Trajectory {
        if let Some(piece) = self.pieces.last_mut() {
            piece.to = horizon;
        }
        let dense = Dense {
            pieces: self.pieces,
        };
        let (n, m) = (self.system.states.len(), self.system.switches.len());
        let points = match settings.sampling {
            Sampling::Method | Sampling::Curve => self.points,
            // A run without a first element has its start alone.
            _ if dense.pieces.is_empty() => self.points,
            _ => sampled(&dense, &settings.sampling, horizon, (n, m), self.points),
        };
        recorded(
            self.system,
            settings,
            points,
            dense.pieces,
            &self.sides,
            open,
        )
    }
}

/// The polynomials of an element, those of n states first.
pub(crate) struct Rows<'p> {
    pub piece: &'p Piece,
    pub n: usize,
}

impl Rows<'_> {
    fn row(&self, at: usize) -> &[f64] {
        let n = self.piece.n_coefficients;
        &self.piece.coefficients[at * n..(at + 1) * n]
    }
}

impl Polynomials for Rows<'_> {
    fn degree(&self) -> usize {
        self.piece.n_coefficients - 1
    }

    fn x(&self, i: usize) -> &[f64] {
        self.row(i)
    }

    fn alpha(&self, switch: usize) -> &[f64] {
        self.row(self.n + switch)
    }
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
        Sampling::Method | Sampling::Curve => Vec::new(),
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
        // Its value at zero, which may be a point.
        if points.contains(&0.0) {
            coefficients[0] = if points[i] == 0.0 { 1.0 } else { 0.0 };
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
