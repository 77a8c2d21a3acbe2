//! S' = f_x S + f_p along a step, whose polynomials are known: a linear equation with known coefficients.
//!
//! It is solved by Gauss collocation with [`NODES`] nodes: with J_i and b_i at node i, K_i = J_i (S₀ + h Σ_j a_ij K_j) + b_i
//! and S₁ = S₀ + h Σ_j b_j K_j. A part of the step is halved until the defect S' - J S - b of the polynomial at its ends and
//! between its nodes moves no entry by more than the tolerance.

use super::Why;
use super::forward::Run;
use super::functions::{Functions, Linearized, ModeFunctions, Point};
use super::recording::Step;
use crate::integrate::tableau::{Family, Tableau, lagrange};
use crate::linalg::DenseLu;

/// Nodes of a part of a step.
const NODES: usize = 9;
/// Halvings of a step.
const MOST_HALVINGS: usize = 20;
/// A defect is rounding up to this part of its terms.
const ROUNDING: f64 = 1e-14;
/// Where the defect is looked at besides the ends: between nodes.
const BETWEEN: [f64; 2] = [0.25, 0.6];

/// A part of a step with the tangents of states and α.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    pub from: f64,
    pub to: f64,
    /// By direction that is known, at the start, the nodes and the end: the tangents of states and of all α.
    pub values: Vec<Option<Vec<Vec<f64>>>>,
}

/// The method, and how large tangents have been.
pub(super) struct Variational {
    tableau: Tableau,
    /// The start, the nodes, and the end.
    points: Vec<f64>,
    /// By direction and state, that, and how large the terms of its rates were, over time.
    largest: Vec<Vec<f64>>,
    terms: Vec<Vec<f64>>,
}

/// A step in its mode.
#[derive(Clone, Copy)]
pub(super) struct Way<'a> {
    pub step: &'a Step,
    pub mode: &'a ModeFunctions,
    pub coefficients: &'a [f64],
    pub run: &'a Run<'a>,
    /// How large rates have been.
    pub speeds: &'a [f64],
}

impl Variational {
    pub fn new(n_states: usize, n_directions: usize) -> Self {
        let tableau = Tableau::new(Family::GaussLegendre, NODES).expect("there are Gauss methods");
        Variational {
            points: tableau.points(),
            tableau,
            largest: vec![vec![0.0; n_states]; n_directions],
            terms: vec![vec![0.0; n_states]; n_directions],
        }
    }

    /// How large the tangents of a direction have been, by state.
    pub fn largest(&self, direction: usize) -> &[f64] {
        &self.largest[direction]
    }

    /// An instant has moved a tangent by the rates of its states.
    pub fn passed(&mut self, direction: usize, time: f64, speeds: &[f64]) {
        for (terms, speed) in self.terms[direction].iter_mut().zip(speeds) {
            *terms += (speed * time).abs();
        }
    }

    /// How large the terms were that the tangents of a direction are made of, by state.
    pub fn terms(&self, direction: usize) -> &[f64] {
        &self.terms[direction]
    }

    /// The values of a piece in which nothing moves.
    pub fn constant(&self, value: Vec<f64>) -> Vec<Vec<f64>> {
        vec![value; self.points.len()]
    }

    /// The tangents inside of a piece, `share` of it behind its start.
    pub fn inside(&self, values: &[Vec<f64>], share: f64, out: &mut [f64]) {
        let weights = lagrange(&self.points, &[share]);
        out.fill(0.0);
        for (weight, values) in weights.iter().zip(values) {
            for (out, value) in out.iter_mut().zip(values) {
                *out += weight * value;
            }
        }
    }

    /// Takes tangents of the directions that are known along a step, and hands on its pieces.
    pub fn follow(
        &mut self,
        functions: &mut Functions,
        way: Way,
        tangents: &mut [Option<Vec<f64>>],
        pieces: &mut Vec<Piece>,
    ) -> Result<(), Why> {
        let mut left = vec![([0.0, 1.0], 0)];
        while let Some(([a, b], halvings)) = left.pop() {
            match self.part(functions, way, tangents, [a, b])? {
                Some(piece) => {
                    for (d, values) in piece.values.iter().enumerate() {
                        let Some(values) = values else { continue };
                        let n = self.largest[d].len();
                        for (largest, value) in self.largest[d].iter_mut().zip(&values[NODES + 1]) {
                            *largest = largest.max(value.abs());
                        }
                        tangents[d] = Some(values[NODES + 1][..n].to_vec());
                    }
                    pieces.push(piece);
                }
                None if halvings < MOST_HALVINGS => {
                    let middle = 0.5 * (a + b);
                    left.push(([middle, b], halvings + 1));
                    left.push(([a, middle], halvings + 1));
                }
                None => return Err(Why::Rough),
            }
        }
        Ok(())
    }

    /// A part of a step; none where it is too long.
    fn part(
        &mut self,
        functions: &mut Functions,
        way: Way,
        tangents: &[Option<Vec<f64>>],
        [a, b]: [f64; 2],
    ) -> Result<Option<Piece>, Why> {
        let length = way.step.length;
        let (n, h) = (functions.slots.n_states, (b - a) * length);
        let mut at = |share: f64| way.linearize(functions, (a + (b - a) * share) * length);
        let nodes = self.tableau.nodes.iter();
        let nodes: Vec<Linearized> = nodes.map(|&c| at(c)).collect::<Result<_, Why>>()?;
        let ends = [at(0.0)?, at(1.0)?];
        let between = [at(BETWEEN[0])?, at(BETWEEN[1])?];
        let mut lu = DenseLu::new(NODES * n);
        lu.factor(&self.matrix(&nodes, n, h))
            .map_err(|_| Why::Rough)?;
        let mut values = vec![None; tangents.len()];
        for (d, tangent) in tangents.iter().enumerate() {
            let Some(tangent) = tangent else { continue };
            let entries = nodes
                .iter()
                .flat_map(|node| (0..n).map(move |i| node.along(i, tangent, d)));
            let mut slopes: Vec<f64> = entries.collect();
            lu.solve(&mut slopes);
            // S at a share of the part, from the weights of the slopes.
            let moved = |weights: &[f64]| -> Vec<f64> {
                let state = |i: usize| {
                    let sum = weights
                        .iter()
                        .enumerate()
                        .map(|(j, w)| w * slopes[j * n + i]);
                    tangent[i] + h * sum.sum::<f64>()
                };
                (0..n).map(state).collect()
            };
            let rows = self.tableau.a.chunks(NODES);
            let mut found = vec![tangent.clone()];
            found.extend(rows.map(moved));
            found.push(moved(&self.tableau.weights));
            let checks = [0.0, 1.0, BETWEEN[0], BETWEEN[1]];
            let linear = ends.iter().chain(&between);
            for (share, linear) in checks.into_iter().zip(linear) {
                let mut state = vec![0.0; n];
                self.inside(&found, share, &mut state);
                let weights = lagrange(&self.tableau.nodes, &[share]);
                let slope = |i: usize| -> f64 {
                    weights
                        .iter()
                        .enumerate()
                        .map(|(j, w)| w * slopes[j * n + i])
                        .sum()
                };
                for i in 0..n {
                    let defect = (slope(i) - linear.along(i, &state, d)).abs();
                    let sizes = found.iter().map(|s| s[i].abs());
                    let size = sizes.fold(self.largest[d][i], f64::max);
                    let rounding = ROUNDING * linear.terms(i, &state, d);
                    let is_small = h * defect <= way.run.tolerance * size + h * rounding;
                    if !is_small {
                        return Ok(None);
                    }
                }
            }
            let linear = [&ends[0]].into_iter().chain(&nodes).chain([&ends[1]]);
            for (tangent, linear) in found.iter_mut().zip(linear) {
                let alpha = (n..linear.rows.len()).map(|i| linear.along(i, &tangent[..n], d));
                let alpha: Vec<f64> = alpha.collect();
                tangent.extend(alpha);
            }
            for i in 0..n {
                self.terms[d][i] += h * linear_terms(&ends, &found, (i, d));
            }
            values[d] = Some(found);
        }
        let time = |share: f64| match share {
            1.0 => way.step.until,
            share => way.step.start + share * length,
        };
        Ok(Some(Piece {
            from: time(a),
            to: time(b),
            values,
        }))
    }

    /// I - h A ⊗ J.
    fn matrix(&self, nodes: &[Linearized], n: usize, h: f64) -> Vec<f64> {
        let width = NODES * n;
        let mut matrix = vec![0.0; width * width];
        for (i, node) in nodes.iter().enumerate() {
            for j in 0..NODES {
                let a = h * self.tableau.a[i * NODES + j];
                for row in 0..n {
                    let start = (i * n + row) * width + j * n;
                    let entries = matrix[start..start + n].iter_mut();
                    for (entry, by) in entries.zip(&node.rows[row][1..=n]) {
                        *entry = -a * by;
                    }
                }
            }
        }
        (0..width).for_each(|at| matrix[at * (width + 1)] += 1.0);
        matrix
    }
}

/// How large the terms of the rate of a tangent are at the ends of a part.
fn linear_terms(ends: &[Linearized; 2], found: &[Vec<f64>], (i, d): (usize, usize)) -> f64 {
    let n = ends[0].f.len();
    let at = |end: &Linearized, tangent: &[f64]| end.terms(i, &tangent[..n], d);
    at(&ends[0], &found[0]).max(at(&ends[1], &found[NODES + 1]))
}

impl Way<'_> {
    /// The functions `tau` after the start of the step, where the run moves as they say.
    fn linearize(&self, functions: &mut Functions, tau: f64) -> Result<Linearized, Why> {
        const UNLIKE: f64 = 1e-3;
        const ROUNDING: f64 = 1e-9;
        let (n, m) = (functions.slots.n_states, functions.slots.n_switches);
        let (mut x, mut slope, mut alpha) = (vec![0.0; n], vec![0.0; n], vec![0.0; m]);
        self.step.state(tau, &mut x, &mut slope);
        self.step.alpha(tau, &mut alpha);
        let point = Point {
            t: self.step.start + tau,
            x: &x,
            alpha: &alpha,
            coefficients: self.coefficients,
            parameters: self.run.parameters,
        };
        let linear = functions
            .linearize(self.mode, &point)
            .map_err(|_| Why::Singular)?;
        for i in 0..n {
            let (f, slope) = (linear.f[i], slope[i]);
            let size = f.abs() + slope.abs() + x[i].abs() / self.step.length;
            let allowed = UNLIKE * size + ROUNDING * self.speeds[i];
            if (f - slope).abs() > allowed {
                return Err(Why::Unknown);
            }
        }
        let is_finite = linear.rows.iter().flatten().all(|v| v.is_finite());
        if is_finite {
            Ok(linear)
        } else {
            Err(Why::Rough)
        }
    }
}
