//! S' = f_x S + f_p along a part of a step by Taylor series, as the run itself.
//!
//! The slopes of f and of φ along the polynomials of the step are series in time, J = Σ J_k τᵏ and so on, from which those of a
//! tangent and of A = ∂α_K/∂p follow order by order:
//!
//! 0 = Σ_j φ_x,j S_{k-j} + Σ_j φ_α,j A_{k-j} + φ_p,k,   (k + 1) S_{k+1} = Σ_j f_x,j S_{k-j} + Σ_j f_α,j A_{k-j} + f_p,k,
//!
//! with one factorization of φ_α,0 for all orders and directions (Barrio 2006, for variational equations).

use super::functions::{Functions, ModeFunctions, Psi};
use super::variational::Way;
use crate::expansion::series;
use crate::hybrid::Input;
use crate::linalg::{DenseLu, Singular};
use crate::tape::convolve;

/// The highest power of time.
pub(super) const ORDER: usize = 28;
const STRIDE: usize = ORDER + 1;

/// A series in the time since the start of a part.
pub(super) type Series = [f64; STRIDE];

/// What a rate or a φ depends on.
#[derive(Clone, Copy)]
enum By {
    State(usize),
    /// α of what slides, by its place among that.
    Alpha(usize),
    Parameter(usize),
}

/// ∂f/∂slot or ∂φ/∂slot along a part.
struct Slope {
    of: usize,
    by: By,
    /// The highest power that is not zero.
    degree: usize,
    series: Series,
}

impl Slope {
    fn new(of: usize, by: By, series: Series) -> Self {
        let degree = series.iter().rposition(|&c| c != 0.0).unwrap_or(0);
        Slope {
            of,
            by,
            degree,
            series,
        }
    }

    /// The coefficient of order k of its product with a series, from those of an order on.
    fn product(&self, with: &[f64], k: usize, from: usize) -> f64 {
        let last = self.degree.min(k);
        match from <= last {
            true if last == 0 => self.series[0] * with[k],
            true => convolve(&self.series[from..=last], &with[k - last..=k - from]),
            false => 0.0,
        }
    }

    /// What a weight of that coefficient makes those of the other series, from an order on.
    fn spread(&self, weight: f64, onto: &mut [f64], k: usize, from: usize) {
        for j in from..=self.degree.min(k) {
            onto[k - j] += weight * self.series[j];
        }
    }
}

/// What parameters make of a functional, with the sizes of what it is made of.
#[derive(Clone, Debug)]
pub(super) struct Weighed {
    pub sums: Vec<f64>,
    pub sizes: Vec<f64>,
}

impl Weighed {
    pub fn new(n: usize) -> Self {
        Weighed {
            sums: vec![0.0; n],
            sizes: vec![0.0; n],
        }
    }

    /// Adds a term.
    pub fn add(&mut self, parameter: usize, term: f64) {
        self.sums[parameter] += term;
        self.sizes[parameter] += term.abs();
    }
}

/// A tangent along a part: a polynomial for each state in the time since its start.
#[derive(Clone, Debug)]
pub(super) struct Tangent {
    stride: usize,
    coefficients: Vec<f64>,
}

impl Tangent {
    /// `stride` coefficients for each state.
    pub fn new(stride: usize, coefficients: Vec<f64>) -> Self {
        Tangent {
            stride,
            coefficients,
        }
    }

    /// S that long after the start.
    pub fn at(&self, tau: f64) -> Vec<f64> {
        let rows = self.coefficients.chunks(self.stride);
        rows.map(|row| series::value(row, tau)).collect()
    }

    /// The highest power of time.
    pub fn order(&self) -> usize {
        let rows = self.coefficients.chunks(self.stride);
        let orders = rows.filter_map(|row| row.iter().rposition(|&c| c != 0.0));
        orders.max().unwrap_or(0)
    }

    /// S' that long after the start.
    pub fn slope(&self, tau: f64) -> Vec<f64> {
        let rows = self.coefficients.chunks(self.stride);
        rows.map(|row| series::slope(row, tau)).collect()
    }

    /// The largest term of each entry at an instant, and the larger one of the last two.
    pub fn terms(&self, tau: f64) -> impl Iterator<Item = [f64; 2]> + '_ {
        let rows = self.coefficients.chunks(self.stride);
        rows.map(move |row| {
            let last = series::magnitude(row, tau, self.stride - 2);
            [series::magnitude(row, tau, 0), last]
        })
    }
}

/// The slopes of a mode along a part of a step.
pub(super) struct Slopes {
    rates: Vec<Slope>,
    phi: Vec<Slope>,
    n_sliding: usize,
    /// φ_α at the start, where anything slides.
    lu: Option<DenseLu>,
}

impl Slopes {
    /// From an instant of a step on.
    pub fn new(functions: &mut Functions, way: Way, start: f64) -> Result<Self, Singular> {
        let point = Around::new(functions, way, start);
        let (mode, slots) = (way.mode, functions.slots);
        let by = |slot: usize| match slots.switch(slot) {
            Some(switch) => Some(By::Alpha(mode.sliding.binary_search(&switch).ok()?)),
            None if slot == 0 => None,
            None if slot <= slots.n_states => Some(By::State(slot - 1)),
            None => Some(By::Parameter(slot - slots.parameter(0))),
        };
        let mut rates: Vec<(usize, usize, Series)> = Vec::new();
        for (states, group) in &mode.blocks {
            group.series(
                |input| point.series(input),
                |at, slot, row| rates.push((states[at], slot, *row)),
            );
        }
        rates.sort_by_key(|&(state, ..)| state);
        let mut phi = Vec::new();
        for (at, of) in mode.kept.iter().enumerate() {
            point.phi(of, &rates, |slot, series| {
                phi.extend(by(slot).map(|by| Slope::new(at, by, series)));
            });
        }
        let rates = rates.into_iter();
        let rates =
            rates.filter_map(|(state, slot, series)| Some(Slope::new(state, by(slot)?, series)));
        Ok(Slopes {
            rates: rates.collect(),
            n_sliding: mode.sliding.len(),
            lu: factored(mode, &phi)?,
            phi,
        })
    }

    /// The spectral radius of |J| at the start, J = f_x - f_α φ_α⁻¹ φ_x: how fast S may change by itself, in whatever units.
    pub fn fastest(&self, n: usize) -> f64 {
        const ROUNDS: usize = 20;
        let mut of_alpha = vec![vec![0.0; self.n_sliding]; n];
        let mut jacobian = vec![0.0; n * n];
        for slope in &self.phi {
            if let By::State(i) = slope.by {
                of_alpha[i][slope.of] -= slope.series[0];
            }
        }
        for column in &mut of_alpha {
            if let Some(lu) = &self.lu {
                lu.solve(column);
            }
        }
        for slope in &self.rates {
            let row = &mut jacobian[slope.of * n..][..n];
            match slope.by {
                By::State(i) => row[i] += slope.series[0],
                By::Alpha(at) => {
                    for (entry, column) in row.iter_mut().zip(&of_alpha) {
                        *entry += slope.series[0] * column[at];
                    }
                }
                By::Parameter(_) => {}
            }
        }
        let (mut v, mut growth) = (vec![1.0; n], 0.0);
        for _ in 0..ROUNDS {
            let rows = jacobian.chunks(n.max(1));
            let product = |row: &[f64]| row.iter().zip(&v).map(|(a, v)| a.abs() * v).sum();
            let next: Vec<f64> = rows.map(product).collect();
            let largest = crate::linalg::largest(&next);
            if largest == 0.0 || !largest.is_finite() {
                return largest;
            }
            growth += largest.ln();
            v = next.into_iter().map(|v| v / largest).collect();
        }
        (growth / ROUNDS as f64).exp()
    }

    /// How large the terms of the rates of a tangent are at the start.
    pub fn terms(&self, start: &[f64], parameters: &[f64]) -> Vec<f64> {
        let mut terms = vec![0.0; start.len()];
        for slope in &self.rates {
            let by = match slope.by {
                By::State(i) => start[i],
                By::Alpha(_) => 0.0,
                By::Parameter(i) => parameters[i],
            };
            if by != 0.0 {
                terms[slope.of] += (slope.series[0] * by).abs();
            }
        }
        terms
    }

    /// The tangent of a direction from its start on, up to the highest order, or to where terms seem to be nothing h later.
    pub fn tangent(&self, start: &[f64], parameters: &[f64], h: Option<f64>) -> Tangent {
        let mut s = vec![0.0; start.len() * STRIDE];
        for (row, &start) in s.chunks_mut(STRIDE).zip(start) {
            row[0] = start;
        }
        let mut order = vec![0.0; self.n_sliding];
        let mut a = vec![0.0; self.n_sliding * STRIDE];
        let mut ending = h.map(|h| Ending::new(start, h));
        let term = |slope: &Slope, s: &[f64], a: &[f64], k: usize, from: usize| match slope.by {
            By::State(i) => slope.product(&s[i * STRIDE..], k, 0),
            By::Alpha(i) => slope.product(&a[i * STRIDE..], k, from),
            By::Parameter(i) if parameters[i] == 0.0 => 0.0,
            By::Parameter(i) => slope.series[k] * parameters[i],
        };
        for k in 0..STRIDE {
            if let Some(lu) = &self.lu {
                order.fill(0.0);
                for slope in &self.phi {
                    order[slope.of] -= term(slope, &s, &a, k, 1);
                }
                lu.solve(&mut order);
                for (row, order) in a.chunks_mut(STRIDE).zip(&order) {
                    row[k] = *order;
                }
            }
            if k == ORDER {
                break;
            }
            for slope in &self.rates {
                s[slope.of * STRIDE + k + 1] += term(slope, &s, &a, k, 0);
            }
            for row in s.chunks_mut(STRIDE) {
                row[k + 1] /= (k + 1) as f64;
            }
            let next = s.chunks(STRIDE).map(|row| row[k + 1]);
            if ending.as_mut().is_some_and(|ending| ending.ends(next)) {
                break;
            }
        }
        Tangent::new(STRIDE, s)
    }

    /// The transpose of `tangent`: the weights of S at instants after the start as weights of S at the start and of the
    /// parameters, order by order from the last one. Of the series of S only terms from an order on are weighed.
    pub fn transposed(
        &self,
        ends: &[(f64, Vec<f64>)],
        (n, from): (usize, usize),
        by: &mut Weighed,
    ) -> Vec<f64> {
        let mut s = vec![0.0; n * STRIDE];
        for (tau, weights) in ends {
            for (row, weight) in s.chunks_mut(STRIDE).zip(weights) {
                let mut power = *weight;
                for (k, entry) in row.iter_mut().enumerate() {
                    *entry += if k < from { 0.0 } else { power };
                    power *= tau;
                }
            }
        }
        let mut a = vec![0.0; self.n_sliding * STRIDE];
        let mut order = vec![0.0; self.n_sliding];
        for k in (0..ORDER).rev() {
            for slope in &self.rates {
                let weight = s[slope.of * STRIDE + k + 1] / (k + 1) as f64;
                match slope.by {
                    By::State(i) => slope.spread(weight, &mut s[i * STRIDE..], k, 0),
                    By::Alpha(i) => slope.spread(weight, &mut a[i * STRIDE..], k, 0),
                    By::Parameter(i) => by.add(i, weight * slope.series[k]),
                }
            }
            let Some(lu) = &self.lu else { continue };
            for (order, row) in order.iter_mut().zip(a.chunks(STRIDE)) {
                *order = -row[k];
            }
            lu.solve_transposed(&mut order);
            for slope in &self.phi {
                let weight = order[slope.of];
                match slope.by {
                    By::State(i) => slope.spread(weight, &mut s[i * STRIDE..], k, 0),
                    By::Alpha(i) => slope.spread(weight, &mut a[i * STRIDE..], k, 1),
                    By::Parameter(i) => by.add(i, weight * slope.series[k]),
                }
            }
        }
        s.chunks(STRIDE).map(|row| row[0]).collect()
    }
}

/// Whether several orders in a row have been nothing for every entry.
struct Ending {
    h: f64,
    power: f64,
    largest: Vec<f64>,
    count: usize,
}

impl Ending {
    /// So many orders, below this part of the largest term.
    const ORDERS: usize = 3;
    const NOTHING: f64 = 1e-18;

    fn new(start: &[f64], h: f64) -> Self {
        Ending {
            h,
            power: 1.0,
            largest: start.iter().map(|s| s.abs()).collect(),
            count: 0,
        }
    }

    /// Takes the coefficients of the next order.
    fn ends(&mut self, coefficients: impl Iterator<Item = f64>) -> bool {
        self.power *= self.h;
        let mut is_nothing = true;
        for (largest, c) in self.largest.iter_mut().zip(coefficients) {
            let term = c.abs() * self.power;
            is_nothing &= term <= Self::NOTHING * *largest;
            *largest = largest.max(term);
        }
        self.count = if is_nothing { self.count + 1 } else { 0 };
        self.count >= Self::ORDERS
    }
}

/// φ_α at the start, factored.
fn factored(mode: &ModeFunctions, phi: &[Slope]) -> Result<Option<DenseLu>, Singular> {
    let n = mode.sliding.len();
    if n == 0 {
        return Ok(None);
    }
    let mut matrix = vec![0.0; n * n];
    for slope in phi {
        if let By::Alpha(column) = slope.by {
            matrix[slope.of * n + column] += slope.series[0];
        }
    }
    let mut lu = DenseLu::new(n);
    lu.factor(&matrix)?;
    Ok(Some(lu))
}

/// What functions read, along a part of a step.
struct Around<'a> {
    time: f64,
    /// States, and all α.
    rows: Vec<Series>,
    way: Way<'a>,
}

impl<'a> Around<'a> {
    fn new(functions: &Functions, way: Way<'a>, start: f64) -> Self {
        let n = functions.slots.n_states + functions.slots.n_switches;
        let row = |at: usize| {
            let mut row = series::around(way.step.row(at), start);
            // What nothing but outputs looks at.
            if row[0].is_nan() {
                row = constant(0.5);
            }
            row
        };
        Around {
            time: way.step.start + start,
            rows: (0..n).map(row).collect(),
            way,
        }
    }

    fn series(&self, input: Input) -> Series {
        match input {
            Input::Time => {
                let mut time = constant(self.time);
                time[1] = 1.0;
                time
            }
            Input::State(i) => self.rows[i],
            Input::Alpha(switch) => self.rows[self.way.step.end.len() + switch],
            Input::Coefficient(i) => constant(self.way.coefficients[i]),
            Input::Parameter(i) => constant(self.way.run.parameters[i]),
            Input::Number(number) => constant(number),
        }
    }

    /// The slopes of φ = h_t + h_x f by slots, from those of f.
    fn phi(&self, of: &Psi, rates: &[(usize, usize, Series)], mut add: impl FnMut(usize, Series)) {
        let n = self.way.step.end.len();
        let is_state = |slot: usize| (1..=n).contains(&slot);
        of.series(
            |input| self.series(input),
            |slot, slope| {
                if is_state(slot) {
                    let first = rates.partition_point(|rate| rate.0 < slot - 1);
                    let own = rates[first..].iter();
                    for (_, by, rate) in own.take_while(|rate| rate.0 == slot - 1) {
                        add(*by, product(slope, rate));
                    }
                }
            },
        );
        of.bent_series(
            |input| self.series(input),
            |[a, b], bend| match a {
                0 => add(b, *bend),
                a if is_state(a) => add(b, product(bend, &self.rate(a - 1))),
                _ => {}
            },
        );
    }

    /// x' of a state.
    fn rate(&self, state: usize) -> Series {
        let row = &self.rows[state];
        let mut rate = constant(0.0);
        for (k, rate) in rate[..ORDER].iter_mut().enumerate() {
            *rate = (k + 1) as f64 * row[k + 1];
        }
        rate
    }
}

fn constant(value: f64) -> Series {
    let mut series = [0.0; STRIDE];
    series[0] = value;
    series
}

fn product(a: &Series, b: &Series) -> Series {
    std::array::from_fn(|k| convolve(&a[..=k], &b[..=k]))
}
