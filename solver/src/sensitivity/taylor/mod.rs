//! S' = f_x S + f_p along a part of a step by Taylor series, as the run itself.
//!
//! The slopes of f and of φ along the polynomials of the step are series in time, J = Σ J_k τᵏ and so on, from which those of a
//! tangent and of A = ∂α_K/∂p follow order by order:
//!
//! 0 = Σ_j φ_x,j S_{k-j} + Σ_j φ_α,j A_{k-j} + φ_p,k,   (k + 1) S_{k+1} = Σ_j f_x,j S_{k-j} + Σ_j f_α,j A_{k-j} + f_p,k,
//!
//! with one factorization of φ_α,0 for all orders and directions (Barrio 2006, for variational equations).
//!
//! Directions, or costates of the transpose, are lanes of one recursion.

mod tangent;

use std::ops::Range;

use wide::f64x4;

use super::functions::{Functions, ModeFunctions, Psi, Slots};
use super::variational::Way;
use crate::expansion::series;
use crate::hybrid::Input;
use crate::linalg::{DenseLu, Singular};
use crate::tape::Lane;
pub(super) use tangent::{LANES, Tangent, in_lanes, number, of_lane, times};

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

/// A series up to the highest power that is not zero, by where it stands among the coefficients of all.
#[derive(Clone, Copy)]
struct Span {
    start: usize,
    len: usize,
}

/// ∂f/∂slot or ∂φ/∂slot along a part, which is not zero.
#[derive(Clone, Copy)]
struct Slope {
    of: usize,
    /// The place of the slot among states, α of what slides, or parameters.
    by: usize,
    series: Span,
}

/// Slopes by what they are by.
#[derive(Default)]
struct Sorted {
    states: Vec<Slope>,
    alphas: Vec<Slope>,
    parameters: Vec<Slope>,
}

impl Sorted {
    fn add(&mut self, of: usize, by: By, series: Span) {
        if series.len == 0 {
            return;
        }
        let (all, by) = match by {
            By::State(by) => (&mut self.states, by),
            By::Alpha(by) => (&mut self.alphas, by),
            By::Parameter(by) => (&mut self.parameters, by),
        };
        all.push(Slope { of, by, series });
    }

    fn len(&self) -> usize {
        self.states.len() + self.alphas.len() + self.parameters.len()
    }
}

/// The coefficients of series.
struct Coefficients(Vec<f64>);

impl Coefficients {
    fn add(&mut self, series: &[f64]) -> Span {
        let len = series.iter().rposition(|&c| c != 0.0).map_or(0, |k| k + 1);
        let start = self.0.len();
        self.0.extend_from_slice(&series[..len]);
        Span { start, len }
    }

    fn of(&self, Span { start, len }: Span) -> &[f64] {
        &self.0[start..start + len]
    }

    fn first(&self, series: Span) -> f64 {
        self.0[series.start]
    }

    /// Adds a product with a series in lanes, from an order of this one on, to its coefficient of order k.
    fn convolve<L: Lane>(
        &self,
        slope: Slope,
        with: &Rows<L>,
        (k, from): (usize, usize),
        onto: &mut L,
    ) {
        let (own, orders) = self.meets(slope, (k, from));
        let mut sum = *onto;
        for (&c, other) in own.iter().zip(with.row(slope.by)[orders].iter().rev()) {
            sum = sum + L::splat(c) * *other;
        }
        *onto = sum;
    }

    /// The transpose.
    fn spread(
        &self,
        slope: Slope,
        weight: f64x4,
        (k, from): (usize, usize),
        onto: &mut Rows<f64x4>,
    ) {
        let (own, orders) = self.meets(slope, (k, from));
        let onto = &mut onto.row_mut(slope.by)[orders];
        for (&c, onto) in own.iter().zip(onto.iter_mut().rev()) {
            *onto += f64x4::splat(c) * weight;
        }
    }

    /// Of a product the coefficient of order k is Σ_j c_j d_{k-j}: the c_j from one on, and the orders of d, in reverse.
    fn meets(&self, slope: Slope, (k, from): (usize, usize)) -> (&[f64], Range<usize>) {
        let own = self.of(slope.series);
        let len = own.len().min(k + 1);
        match from < len {
            true => (&own[from..len], k + 1 - len..k + 1 - from),
            false => (&[], 0..0),
        }
    }
}

/// Series in lanes.
struct Rows<L> {
    coefficients: Vec<L>,
}

impl<L: Lane> Rows<L> {
    fn new(n: usize) -> Self {
        Rows {
            coefficients: vec![L::splat(0.0); n * STRIDE],
        }
    }

    fn row(&self, i: usize) -> &[L] {
        &self.coefficients[i * STRIDE..][..STRIDE]
    }

    fn row_mut(&mut self, i: usize) -> &mut [L] {
        &mut self.coefficients[i * STRIDE..][..STRIDE]
    }

    fn order(&self, k: usize) -> impl Iterator<Item = L> + '_ {
        self.coefficients.iter().skip(k).step_by(STRIDE).copied()
    }

    fn order_mut(&mut self, k: usize) -> impl Iterator<Item = &mut L> {
        self.coefficients.iter_mut().skip(k).step_by(STRIDE)
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
        self.add_sum(parameter, term, term.abs());
    }

    /// Adds a sum of terms of these sizes.
    fn add_sum(&mut self, parameter: usize, sum: f64, size: f64) {
        self.sums[parameter] += sum;
        self.sizes[parameter] += size;
    }
}

/// Weights of S at instants after the start of a part, which go back to it.
pub(super) struct Back<'b> {
    pub ends: &'b [(f64, Vec<f64>)],
    /// Of the series of S only terms from this order on are weighed.
    pub from: usize,
    /// What parameters make of it.
    pub by: &'b mut Weighed,
}

/// The slopes of a mode along a part of a step.
pub(super) struct Slopes {
    coefficients: Coefficients,
    rates: Sorted,
    phi: Sorted,
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
            None => {
                let parameter = slot - slots.parameter(0);
                functions
                    .moves(parameter)
                    .then_some(By::Parameter(parameter))
            }
        };
        let n_slopes = mode.n_slopes();
        let mut coefficients = Coefficients(Vec::with_capacity(n_slopes * STRIDE / 2));
        let mut all: Vec<(usize, usize, Span)> = Vec::with_capacity(n_slopes);
        for (states, group) in &mode.blocks {
            let first = all.len();
            group.series(
                |input, row| point.write(input, row),
                |(at, slot), same, row| {
                    let known = all.get(first + same);
                    let series = known.map_or_else(|| coefficients.add(row), |known| known.2);
                    all.push((states[at], slot, series));
                },
            );
        }
        all.sort_by_key(|&(state, ..)| state);
        let (mut rates, mut phi) = (Sorted::default(), Sorted::default());
        for (at, of) in mode.kept.iter().enumerate() {
            point.phi(of, slots, (&all, &mut coefficients), |slot, series| {
                if let Some(by) = by(slot) {
                    phi.add(at, by, series);
                }
            });
        }
        for (state, slot, series) in all {
            if let Some(by) = by(slot) {
                rates.add(state, by, series);
            }
        }
        Ok(Slopes {
            lu: factored(mode, &phi, &coefficients)?,
            coefficients,
            rates,
            phi,
            n_sliding: mode.sliding.len(),
        })
    }

    /// Gives back what it has room for.
    pub fn shrink(&mut self) {
        self.coefficients.0.shrink_to_fit();
    }

    /// How many numbers it is.
    pub fn size(&self) -> usize {
        const OWN: usize = size_of::<Slope>() / size_of::<f64>();
        self.coefficients.0.len() + OWN * (self.rates.len() + self.phi.len())
    }

    /// The spectral radius of |J| at the start, J = f_x - f_α φ_α⁻¹ φ_x: how fast S may change by itself, in whatever units.
    pub fn fastest(&self, n: usize) -> f64 {
        const ROUNDS: usize = 20;
        let first = |slope: &Slope| self.coefficients.first(slope.series);
        let mut of_alpha = vec![vec![0.0; self.n_sliding]; n];
        let mut jacobian = vec![0.0; n * n];
        for slope in &self.phi.states {
            of_alpha[slope.by][slope.of] -= first(slope);
        }
        for column in &mut of_alpha {
            if let Some(lu) = &self.lu {
                lu.solve(column);
            }
        }
        for slope in &self.rates.states {
            jacobian[slope.of * n + slope.by] += first(slope);
        }
        for slope in &self.rates.alphas {
            let row = &mut jacobian[slope.of * n..][..n];
            for (entry, column) in row.iter_mut().zip(&of_alpha) {
                *entry += first(slope) * column[slope.by];
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
        let states = self
            .rates
            .states
            .iter()
            .map(|slope| (slope, start[slope.by]));
        let own = self.rates.parameters.iter();
        let own = own.map(|slope| (slope, parameters[slope.by]));
        for (slope, by) in states.chain(own).filter(|(_, by)| *by != 0.0) {
            terms[slope.of] += (self.coefficients.first(slope.series) * by).abs();
        }
        terms
    }

    /// The tangents of directions, up to as many as there are lanes, by their starts and parameters: up to the highest order, or
    /// to where terms of all seem to be nothing h later.
    pub fn tangents<L: Lane>(&self, [start, by]: [&[L]; 2], h: Option<f64>) -> Tangent<L> {
        let n = start.len();
        let (mut s, mut a) = (Rows::new(n), Rows::new(self.n_sliding));
        (s.order_mut(0).zip(start)).for_each(|(c, start)| *c = *start);
        for (slopes, rows, first) in [(&self.rates, &mut s, 1), (&self.phi, &mut a, 0)] {
            for slope in &slopes.parameters {
                let series = self.coefficients.of(slope.series);
                let onto = rows.row_mut(slope.of)[first..].iter_mut();
                for (onto, &c) in onto.zip(series) {
                    *onto = *onto + times(c, by[slope.by]);
                }
            }
        }
        let mut ending = h.map(|h| Ending::new(start, h));
        let mut order = vec![L::splat(0.0); self.n_sliding];
        let mut count = STRIDE;
        for k in 0..ORDER {
            self.solve_order(k, &s, &mut a, &mut order);
            for slope in &self.rates.states {
                let mut sum = s.row(slope.of)[k + 1];
                self.coefficients.convolve(*slope, &s, (k, 0), &mut sum);
                s.row_mut(slope.of)[k + 1] = sum;
            }
            for slope in &self.rates.alphas {
                let onto = &mut s.row_mut(slope.of)[k + 1];
                self.coefficients.convolve(*slope, &a, (k, 0), onto);
            }
            let share = L::splat(1.0 / (k + 1) as f64);
            s.order_mut(k + 1).for_each(|c| *c = *c * share);
            let ends = |ending: &mut Ending<L>| ending.ends(s.order(k + 1));
            if ending.as_mut().is_some_and(ends) {
                count = k + 2;
                break;
            }
        }
        Tangent::new(n, count, |i| s.row(i)[..count].iter().copied())
    }

    /// A_k.
    fn solve_order<L: Lane>(&self, k: usize, s: &Rows<L>, a: &mut Rows<L>, order: &mut [L]) {
        let Some(lu) = &self.lu else { return };
        (order.iter_mut().zip(a.order(k))).for_each(|(order, c)| *order = c);
        for slope in &self.phi.states {
            self.coefficients
                .convolve(*slope, s, (k, 0), &mut order[slope.of]);
        }
        for slope in &self.phi.alphas {
            self.coefficients
                .convolve(*slope, a, (k, 1), &mut order[slope.of]);
        }
        lu.solve_lanes(order);
        for (c, order) in a.order_mut(k).zip(order) {
            *c = -*order;
        }
    }

    /// The transpose of `tangents`: the weights of S at the start of as many states and, added to what is known of them, those
    /// of the parameters, order by order from the last one.
    pub fn transposed(&self, all: &mut [Back], n: usize) -> Vec<Vec<f64>> {
        let (mut s, mut a) = (Rows::<f64x4>::new(n), Rows::new(self.n_sliding));
        for (lane, back) in all.iter().enumerate() {
            for (tau, weights) in back.ends {
                let mut power = tau.powi(back.from as i32);
                for k in back.from..STRIDE {
                    for (c, weight) in s.order_mut(k).zip(weights) {
                        c.as_mut_array()[lane] += power * weight;
                    }
                    power *= tau;
                }
            }
        }
        let mut order = vec![f64x4::splat(0.0); self.n_sliding];
        for k in (0..ORDER).rev() {
            let share = f64x4::splat(1.0 / (k + 1) as f64);
            s.order_mut(k + 1).for_each(|c| *c *= share);
            for slope in &self.rates.states {
                let weight = s.row(slope.of)[k + 1];
                self.coefficients.spread(*slope, weight, (k, 0), &mut s);
            }
            for slope in &self.rates.alphas {
                let weight = s.row(slope.of)[k + 1];
                self.coefficients.spread(*slope, weight, (k, 0), &mut a);
            }
            let Some(lu) = &self.lu else { continue };
            for (order, c) in order.iter_mut().zip(a.order(k)) {
                *order = -c;
            }
            lu.solve_transposed(&mut order);
            for slope in &self.phi.states {
                self.coefficients
                    .spread(*slope, order[slope.of], (k, 0), &mut s);
            }
            for slope in &self.phi.alphas {
                self.coefficients
                    .spread(*slope, order[slope.of], (k, 1), &mut a);
            }
            (a.order_mut(k).zip(&order)).for_each(|(c, order)| *c = *order);
        }
        self.weigh(all, [&s, &a]);
        let first: Vec<f64x4> = s.order(0).collect();
        let start = |lane| of_lane(&first, lane);
        (0..all.len()).map(start).collect()
    }

    /// Adds the weights of parameters: those of rates of order k, and behind them those of φ, times slopes.
    fn weigh(&self, all: &mut [Back], [s, a]: [&Rows<f64x4>; 2]) {
        for (slopes, rows, first) in [(&self.rates, s, 1), (&self.phi, a, 0)] {
            for slope in &slopes.parameters {
                let (mut sum, mut size) = (f64x4::splat(0.0), f64x4::splat(0.0));
                let series = self.coefficients.of(slope.series).iter().take(ORDER);
                for (&c, weight) in series.zip(&rows.row(slope.of)[first..]) {
                    let term = *weight * f64x4::splat(c);
                    sum += term;
                    size += term.abs();
                }
                let [sums, sizes] = [sum, size].map(f64x4::to_array);
                for (back, (sum, size)) in all.iter_mut().zip(sums.into_iter().zip(sizes)) {
                    back.by.add_sum(slope.by, sum, size);
                }
            }
        }
    }
}

/// Whether several orders in a row have been nothing for every entry.
struct Ending<L> {
    h: f64,
    power: f64,
    largest: Vec<L>,
    count: usize,
}

impl<L: Lane> Ending<L> {
    /// So many orders, below this part of the largest term.
    const ORDERS: usize = 3;
    const NOTHING: f64 = 1e-18;

    fn new(start: &[L], h: f64) -> Self {
        Ending {
            h,
            power: 1.0,
            largest: start.iter().map(|s| s.map(f64::abs)).collect(),
            count: 0,
        }
    }

    /// Takes the coefficients of the next order.
    fn ends(&mut self, coefficients: impl Iterator<Item = L>) -> bool {
        self.power *= self.h;
        let (power, share) = (L::splat(self.power), L::splat(Self::NOTHING));
        let mut is_nothing = true;
        for (largest, c) in self.largest.iter_mut().zip(coefficients) {
            let term = c.map(f64::abs) * power;
            let excess = term - share * *largest;
            is_nothing &= (0..L::WIDTH).all(|lane| number(&excess, lane) <= 0.0);
            *largest = largest.zip(term, f64::max);
        }
        self.count = if is_nothing { self.count + 1 } else { 0 };
        self.count >= Self::ORDERS
    }
}

/// φ_α at the start, factored.
fn factored(
    mode: &ModeFunctions,
    phi: &Sorted,
    coefficients: &Coefficients,
) -> Result<Option<DenseLu>, Singular> {
    let n = mode.sliding.len();
    if n == 0 {
        return Ok(None);
    }
    let mut matrix = vec![0.0; n * n];
    for slope in &phi.alphas {
        matrix[slope.of * n + slope.by] += coefficients.first(slope.series);
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
            let own = way.step.row(at);
            let mut row = match start == 0.0 && own.len() <= STRIDE {
                true => padded(own),
                false => series::around(own, start),
            };
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

    /// Writes the series of what is read.
    fn write(&self, input: Input, row: &mut [f64]) {
        let fixed = match input {
            Input::Time => self.time,
            Input::State(i) => return row.copy_from_slice(&self.rows[i]),
            Input::Alpha(switch) => {
                return row.copy_from_slice(&self.rows[self.way.step.end.len() + switch]);
            }
            Input::Coefficient(i) => self.way.coefficients[i],
            Input::Parameter(i) => self.way.run.parameters[i],
            Input::Number(number) => number,
        };
        row.fill(0.0);
        row[0] = fixed;
        if input == Input::Time {
            row[1] = 1.0;
        }
    }

    /// Hands on the slopes of φ = h_t + h_x f by slots, from those of f, state by state.
    fn phi(
        &self,
        of: &Psi,
        slots: Slots,
        (rates, coefficients): (&[(usize, usize, Span)], &mut Coefficients),
        mut add: impl FnMut(usize, Span),
    ) {
        let n = self.way.step.end.len();
        let is_state = |slot: usize| (1..=n).contains(&slot);
        of.series(
            |input, row| self.write(input, row),
            |slot, slope| {
                if is_state(slot) {
                    let first = rates.partition_point(|rate| rate.0 < slot - 1);
                    let own = rates[first..].iter();
                    for &(_, by, rate) in own.take_while(|rate| rate.0 == slot - 1) {
                        let product = product(slope, coefficients.of(rate));
                        add(by, coefficients.add(&product));
                    }
                }
            },
        );
        of.bent_series(
            slots,
            |input, row| self.write(input, row),
            |[a, b], bend| match a {
                0 => add(b, coefficients.add(bend)),
                a if is_state(a) => add(b, coefficients.add(&product(bend, &self.rate(a - 1)))),
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

fn padded(coefficients: &[f64]) -> Series {
    let mut series = [0.0; STRIDE];
    series[..coefficients.len()].copy_from_slice(coefficients);
    series
}

fn constant(value: f64) -> Series {
    let mut series = [0.0; STRIDE];
    series[0] = value;
    series
}

/// The product of two series, of which the second one may have fewer orders.
fn product(a: &Series, b: &[f64]) -> Series {
    let mut product = constant(0.0);
    for (j, a) in a.iter().enumerate().filter(|(_, a)| **a != 0.0) {
        for (sum, b) in product[j..].iter_mut().zip(b) {
            *sum += a * b;
        }
    }
    product
}
