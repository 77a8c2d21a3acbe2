//! Tangents along a part as polynomials, one or several in lanes.

use wide::f64x4;

use crate::tape::Lane;

/// Directions that are followed at once.
pub(in crate::sensitivity) const LANES: usize = <f64x4 as Lane>::WIDTH;

/// A tangent along a part, or several in lanes: a polynomial for each state in the time since its start.
#[derive(Clone, Debug)]
pub(in crate::sensitivity) struct Tangent<L = f64> {
    /// How many coefficients a polynomial has.
    len: usize,
    /// State by state.
    coefficients: Vec<L>,
}

impl<L: Lane> Tangent<L> {
    /// Of n states, by the coefficients of each, of which there are `len`.
    pub fn new<C: Iterator<Item = L>>(n: usize, len: usize, of: impl Fn(usize) -> C) -> Self {
        let mut coefficients = Vec::with_capacity(n * len);
        (0..n).for_each(|i| coefficients.extend(of(i)));
        Tangent { len, coefficients }
    }

    fn rows(&self) -> impl ExactSizeIterator<Item = &[L]> {
        self.coefficients.chunks(self.len)
    }

    /// S that long after the start, at the front of `sums`.
    pub fn read(&self, tau: f64, sums: &mut [L]) {
        let tau = L::splat(tau);
        for (sum, row) in sums.iter_mut().zip(self.rows()) {
            let nothing = L::splat(0.0);
            *sum = row.iter().rev().fold(nothing, |sum, c| sum * tau + *c);
        }
    }

    /// S that long after the start.
    pub fn at(&self, tau: f64) -> Vec<L> {
        let mut sums = vec![L::splat(0.0); self.rows().len()];
        self.read(tau, &mut sums);
        sums
    }

    /// S and S' that long after the start.
    pub fn at_with_slope(&self, tau: f64) -> [Vec<L>; 2] {
        let nothing = || vec![L::splat(0.0); self.rows().len()];
        let (mut sums, mut slopes, tau) = (nothing(), nothing(), L::splat(tau));
        for ((sum, slope), row) in sums.iter_mut().zip(&mut slopes).zip(self.rows()) {
            for c in row.iter().rev() {
                *slope = *slope * tau + *sum;
                *sum = *sum * tau + *c;
            }
        }
        [sums, slopes]
    }

    /// The largest term of each entry at an instant, and the larger one of the last two.
    pub fn terms(&self, tau: f64) -> Vec<[L; 2]> {
        let of = |row: &[L]| {
            let (mut whole, mut last, mut power) = (L::splat(0.0), L::splat(0.0), 1.0);
            for (k, c) in row.iter().enumerate() {
                let term = (*c * L::splat(power)).map(f64::abs);
                whole = whole.zip(term, f64::max);
                if k + 2 >= row.len() {
                    last = last.zip(term, f64::max);
                }
                power *= tau;
            }
            [whole, last]
        };
        self.rows().map(of).collect()
    }

    /// One of them.
    pub fn lane(&self, lane: usize) -> Tangent {
        Tangent {
            len: self.len,
            coefficients: of_lane(&self.coefficients, lane),
        }
    }
}

impl Tangent {
    /// The highest power of time.
    pub fn order(&self) -> usize {
        let last = |row: &[f64]| row.iter().rposition(|&c| c != 0.0);
        self.rows().filter_map(last).max().unwrap_or(0)
    }
}

/// Rows as lanes, the last of which are zero where there are fewer.
pub(in crate::sensitivity) fn in_lanes<L: Lane>(rows: &[&[f64]]) -> Vec<L> {
    let lanes = |i: usize| {
        let mut numbers = [0.0; LANES];
        for (number, row) in numbers.iter_mut().zip(rows) {
            *number = row[i];
        }
        L::load(&numbers)
    };
    (0..rows.first().map_or(0, |row| row.len()))
        .map(lanes)
        .collect()
}

/// The numbers of a lane.
pub(in crate::sensitivity) fn of_lane<L: Lane>(lanes: &[L], lane: usize) -> Vec<f64> {
    lanes.iter().map(|numbers| number(numbers, lane)).collect()
}

/// That of a lane.
pub(in crate::sensitivity) fn number<L: Lane>(numbers: &L, lane: usize) -> f64 {
    let mut all = [0.0; LANES];
    numbers.store(&mut all);
    all[lane]
}

/// A slope times how parameters move, to which it is nothing where they do not.
pub(in crate::sensitivity) fn times<L: Lane>(slope: f64, by: L) -> L {
    match slope.is_finite() {
        true => by * L::splat(slope),
        false => by.map(|by| if by == 0.0 { 0.0 } else { slope * by }),
    }
}
