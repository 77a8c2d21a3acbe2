//! The functions of an active set with their derivatives, those by directions among them.

use std::sync::Arc;

use crate::fesd::element::jacobian::Jacobian;
use crate::fesd::element::projection::Projection;
use crate::fesd::element::scheme::{Scheme, WIDTH};
use crate::fesd::element::stages::Stages;
use crate::fesd::system::Reduced;
use crate::fesd::system::evaluator::Evaluator;
use crate::fesd::system::full::{Functions, partials};
use crate::fesd::system::hidden::Hidden;
use crate::hybrid::{Partials, Side};
use crate::linalg::{DenseLu, Singular};
use crate::sensitivity::Slope;

/// By what a run is differentiated: how parameters move with each direction, the last of which is the length of elements.
pub(super) struct Parameters {
    /// By direction.
    pub by: Vec<Vec<f64>>,
    /// Whether one moves at all.
    moving: Vec<bool>,
}

impl Parameters {
    pub fn new(directions: &[Vec<f64>], n_parameters: usize) -> Self {
        let moves = |at: usize| directions.iter().any(|by| by[at] != 0.0);
        let mut by = directions.to_vec();
        by.push(vec![0.0; n_parameters]);
        Parameters {
            moving: (0..n_parameters).map(moves).collect(),
            by,
        }
    }

    pub fn n_directions(&self) -> usize {
        self.by.len()
    }
}

/// What an end of an element is to tangents: functions of t, x and directions to first order, with w as it follows from
/// these.
pub(super) struct Here {
    /// x'.
    pub f: Vec<f64>,
    /// The watched members with their values.
    pub members: Vec<(f64, Slope)>,
    /// What stays zero along the active set, and contains no w.
    pub kept: Vec<Slope>,
    /// α of all switches, and the slopes of those that slide.
    pub alpha: Vec<f64>,
    pub sliding: Vec<(usize, Slope)>,
}

/// An active set.
pub(super) struct Active {
    pub reduced: Arc<Reduced>,
    pub stages: Stages,
    pub jacobian: Jacobian,
    /// (f, r), the hidden equations, members and α, by t, x, w and the parameters that move.
    equations: Functions,
    hidden: Functions,
    members: Functions,
    alphas: Functions,
    /// The derivatives of those of (f, r), where ends are projected.
    bends: Option<Partials>,
    /// Solves for w.
    solver: Hidden,
    at: Evaluator,
}

/// Inputs of functions: t, x, w, and numbers, the last of which are the parameters.
#[derive(Clone, Copy)]
struct Inputs {
    n: usize,
    n_w: usize,
    /// The first parameter.
    first: usize,
}

impl Inputs {
    /// Those before the numbers.
    fn n_own(self) -> usize {
        1 + self.n + self.n_w
    }

    /// Adds a derivative by an input to a row over t, x, w and the directions.
    fn add(self, row: &mut [f64], (input, slope): (usize, f64), parameters: &Parameters) {
        let own = self.n_own();
        match input.checked_sub(self.first) {
            Some(parameter) => {
                for (entry, by) in row[own..].iter_mut().zip(&parameters.by) {
                    if by[parameter] != 0.0 {
                        *entry += slope * by[parameter];
                    }
                }
            }
            None => row[input] += slope,
        }
    }
}

/// The rows of functions where an evaluator is, over t, x, w and the directions.
fn rows(
    at: &mut Evaluator,
    of: (usize, &Partials),
    inputs: Inputs,
    parameters: &Parameters,
) -> Vec<Vec<f64>> {
    let (n_rows, slopes) = of;
    let mut rows = vec![vec![0.0; inputs.n_own() + parameters.n_directions()]; n_rows];
    for (&(row, input), slope) in slopes.entries.iter().zip(at.eval(&slopes.tape)) {
        inputs.add(&mut rows[row], (input, slope), parameters);
    }
    rows
}

impl Active {
    pub fn new(
        scheme: &Scheme,
        (n, n_numbers): (usize, usize),
        reduced: Arc<Reduced>,
        parameters: &Parameters,
    ) -> Self {
        let n_w = reduced.unknowns.len();
        let first = 1 + n + n_w + n_numbers - parameters.moving.len();
        let differentiated = |input: usize| {
            let parameter = input.checked_sub(first);
            input < 1 + n + n_w || parameter.is_some_and(|at| parameters.moving[at])
        };
        let functions = |tape: &crate::tape::Tape| Functions::new(tape.clone(), differentiated);
        let stages = Stages::new(scheme, n, n_numbers, &reduced);
        let equations = functions(&reduced.equations.tape);
        let bends = Projection::applies(scheme, n, &reduced)
            .then(|| partials(&reduced.equations.slopes.tape, differentiated));
        let [hidden, members, alphas] =
            [&reduced.hidden.tape, &reduced.members.tape, &reduced.alphas].map(functions);
        let all = [&equations, &hidden, &members, &alphas];
        let tapes = all.map(|functions| [&functions.tape, &functions.slopes.tape]);
        let [a, b, c, d] = tapes;
        let more = bends.as_ref().map_or(&equations.tape, |bends| &bends.tape);
        let own = &reduced.equations.slopes.tape;
        let tapes = [a[0], a[1], b[0], b[1], c[0], c[1], d[0], d[1], more, own];
        Active {
            at: Evaluator::new(1 + n + n_w + n_numbers, tapes),
            jacobian: Jacobian::new(scheme, &stages, &reduced),
            solver: Hidden::new(n, n_numbers, &reduced),
            equations,
            hidden,
            members,
            alphas,
            bends,
            stages,
            reduced,
        }
    }

    fn inputs(&self, parameters: &Parameters) -> Inputs {
        Inputs {
            n: self.stages.n,
            n_w: self.reduced.unknowns.len(),
            first: self.at.inputs.len() - parameters.moving.len(),
        }
    }

    /// Takes the numbers that hold.
    pub fn set_numbers(&mut self, numbers: &[f64]) {
        self.stages.numbers.copy_from_slice(numbers);
        self.solver.set_numbers(numbers);
        self.at.set_numbers(numbers);
    }

    /// Moves to a node of the element.
    fn enter(&mut self, scheme: &Scheme, node: usize) {
        let Stages { n, t, h, .. } = self.stages;
        let x = &self.stages.x;
        let x = (0..n).map(|i| x[i * scheme.groups + node / WIDTH].as_array()[node % WIDTH]);
        let w = self.stages.w(node).iter().copied();
        self.at.set(t + scheme.tableau.nodes[node] * h, x.chain(w));
    }

    /// The rows of f and r at a node.
    pub fn at_node(
        &mut self,
        scheme: &Scheme,
        node: usize,
        parameters: &Parameters,
    ) -> Vec<Vec<f64>> {
        self.enter(scheme, node);
        let inputs = self.inputs(parameters);
        let of = (self.equations.tape.n_outputs(), &self.equations.slopes);
        rows(&mut self.at, of, inputs, parameters)
    }

    /// How the end of the present element is moved onto its surfaces, from x̃ to x at an instant, near which w acts; none
    /// where it is not.
    pub fn projected(
        &mut self,
        t: f64,
        (from, x): (&[f64], &[f64]),
        w: &[f64],
        parameters: &Parameters,
    ) -> Result<Option<Projected>, Singular> {
        let Some(bends) = &self.bends else {
            return Ok(None);
        };
        let inputs = self.inputs(parameters);
        let (n, n_w) = (inputs.n, inputs.n_w);
        let entries = &self.reduced.equations.slopes.entries;
        self.at.set(t, x.iter().chain(w).copied());
        let of = (self.equations.tape.n_outputs(), &self.equations.slopes);
        let surfaces = rows(&mut self.at, of, inputs, parameters).split_off(n);
        self.at.set(t, from.iter().chain(w).copied());
        let mut by_w = vec![0.0; n * n_w];
        let slopes = &self.reduced.equations.slopes.tape;
        for (&(row, input), slope) in entries.iter().zip(self.at.eval(slopes)) {
            if row < n && input > n {
                by_w[row * n_w + input - 1 - n] = slope;
            }
        }
        let of = (entries.len(), bends);
        let bends = rows(&mut self.at, of, inputs, parameters);
        let mut projected = Projected {
            lu: DenseLu::new(n_w),
            bent: vec![vec![0.0; inputs.n_own() + parameters.n_directions()]; n],
            surfaces,
            by_w,
            inputs,
        };
        projected.lu.factor(&projected.matrix())?;
        let moved: Vec<f64> = x.iter().zip(from).map(|(x, from)| x - from).collect();
        let mut nu = projected.along(&moved);
        projected.lu.solve(&mut nu);
        for (&(row, input), bend) in entries.iter().zip(bends) {
            if row < n && input > n {
                let share = nu[input - 1 - n];
                let sums = projected.bent[row].iter_mut().zip(bend);
                sums.for_each(|(sum, bend)| *sum += share * bend);
            }
        }
        Ok(Some(projected))
    }

    /// What is known where x is at an instant, near w.
    pub fn here(
        &mut self,
        t: f64,
        (x, w): (&[f64], &[f64]),
        parameters: &Parameters,
    ) -> Result<Here, Singular> {
        let singular = |_| Singular { column: 0 };
        self.solver.set(t, x.iter().copied(), w);
        self.solver.solve(&self.reduced).map_err(singular)?;
        let w = self.solver.w().iter();
        self.at.set(t, x.iter().chain(w).copied());
        let inputs = self.inputs(parameters);
        let (n, own) = (inputs.n, inputs.n_own());
        let mut all = |functions: &Functions| -> (Vec<f64>, Vec<Vec<f64>>) {
            let values = self.at.eval(&functions.tape).collect();
            let of = (functions.tape.n_outputs(), &functions.slopes);
            (values, rows(&mut self.at, of, inputs, parameters))
        };
        let (mut f, equations) = all(&self.equations);
        let (_, hidden) = all(&self.hidden);
        let follow = Follow::new(hidden, inputs)?;
        f.truncate(n);
        let contains_w = |row: &&Vec<f64>| row[1 + n..own].iter().any(|slope| *slope != 0.0);
        let kept = equations[n..].iter().filter(|row| !contains_w(row));
        let kept = kept.map(|row| follow.slope(row.clone())).collect();
        let with_slopes = |(values, rows): (Vec<f64>, Vec<Vec<f64>>)| {
            let slopes = rows.into_iter().map(|row| follow.slope(row));
            values.into_iter().zip(slopes).collect::<Vec<_>>()
        };
        let members = with_slopes(all(&self.members));
        let sliding = with_slopes(all(&self.alphas));
        let sides = &self.reduced.sides;
        let mut alpha: Vec<f64> = sides.iter().map(|side| 0.5 + 0.5 * side.sign()).collect();
        let slides = (0..sides.len()).filter(|&i| sides[i] == Side::Slide);
        let sliding = slides.zip(sliding).map(|(i, (value, slope))| {
            alpha[i] = value;
            (i, slope)
        });
        Ok(Here {
            sliding: sliding.collect(),
            f,
            members,
            kept,
            alpha,
        })
    }
}

/// Rows over t, x and directions along the surface on which w solves its equations.
struct Follow {
    hidden: Vec<Vec<f64>>,
    lu: DenseLu,
    inputs: Inputs,
}

impl Follow {
    fn new(hidden: Vec<Vec<f64>>, inputs: Inputs) -> Result<Self, Singular> {
        let w = 1 + inputs.n..inputs.n_own();
        let by_w = hidden.iter().flat_map(|row| row[w.clone()].iter().copied());
        let mut lu = DenseLu::new(inputs.n_w);
        lu.factor(&by_w.collect::<Vec<_>>())?;
        Ok(Follow { hidden, lu, inputs })
    }

    /// dw = -H_w⁻¹ (H_t dt + H_x dx + H_p dp) in a row.
    fn slope(&self, mut row: Vec<f64>) -> Slope {
        let (n, own) = (self.inputs.n, self.inputs.n_own());
        let mut weights = row[1 + n..own].to_vec();
        if weights.iter().any(|weight| *weight != 0.0) {
            self.lu.solve_transposed(&mut weights);
            for (weight, hidden) in weights.iter().zip(&self.hidden) {
                for (entry, hidden) in row.iter_mut().zip(hidden) {
                    *entry -= weight * hidden;
                }
            }
        }
        row.drain(1 + n..own);
        Slope::row(&row, n)
    }
}

/// An end x = x̃ + F_w ν on surfaces 0 = r(t, x).
pub(super) struct Projected {
    /// F_w at x̃, row by row.
    by_w: Vec<f64>,
    /// The rows of F_w ν for this ν, and of r.
    bent: Vec<Vec<f64>>,
    surfaces: Vec<Vec<f64>>,
    /// r_x F_w.
    lu: DenseLu,
    inputs: Inputs,
}

impl Projected {
    fn matrix(&self) -> Vec<f64> {
        let n_w = self.inputs.n_w;
        let columns = (0..n_w).map(|k| self.by_w.iter().skip(k).step_by(n_w).copied());
        let columns: Vec<Vec<f64>> = columns.map(Iterator::collect).collect();
        let mut matrix = vec![0.0; n_w * n_w];
        for (k, column) in columns.iter().enumerate() {
            for (row, value) in self.along(column).into_iter().enumerate() {
                matrix[row * n_w + k] = value;
            }
        }
        matrix
    }

    /// r_x along a change of x.
    fn along(&self, x: &[f64]) -> Vec<f64> {
        let of = |row: &Vec<f64>| row[1..].iter().zip(x).map(|(a, b)| a * b).sum();
        self.surfaces.iter().map(of).collect()
    }

    /// The tangent of x from that of x̃: dx = dx̃ + d(F_w ν) with dr = 0, where w moves, too.
    pub fn tangent(&self, time: f64, (x, w): (&[f64], &[f64]), direction: usize) -> Vec<f64> {
        let own = self.inputs.n_own();
        let with = |row: &Vec<f64>, more: &[f64]| {
            let terms = row[1..]
                .iter()
                .zip(x.iter().chain(more))
                .map(|(a, b)| a * b);
            row[0] * time + terms.sum::<f64>() + row[own + direction]
        };
        let bent = x.iter().zip(&self.bent);
        let mut x: Vec<f64> = bent.map(|(x, row)| x + with(row, w)).collect();
        let mut nu: Vec<f64> = (self.surfaces.iter())
            .map(|row| {
                let along: f64 = row[1..].iter().zip(&x).map(|(a, b)| a * b).sum();
                -(row[0] * time + along + row[own + direction])
            })
            .collect();
        self.lu.solve(&mut nu);
        for (x, by_w) in x.iter_mut().zip(self.by_w.chunks_exact(self.inputs.n_w)) {
            *x += by_w.iter().zip(&nu).map(|(a, b)| a * b).sum::<f64>();
        }
        x
    }
}
