//! Tangents along a part as polynomials, one or several in lanes.

use wide::f64x4;

use crate::tape::Lane;

/// A tangent along a part, or several in lanes: a polynomial for each state in the time since its start.
#[derive(Clone, Debug)]
pub(in crate::sensitivity) struct Tangent<L = f64> {
    n: usize,
    /// Order by order, of each those of all states.
    coefficients: Vec<L>,
}

impl<L: Lane> Tangent<L> {
    /// Of so many states, by their coefficients order by order.
    pub fn new(n: usize, coefficients: Vec<L>) -> Self {
        Tangent { n, coefficients }
    }

    fn orders(&self) -> impl DoubleEndedIterator<Item = &[L]> + ExactSizeIterator {
        self.coefficients.chunks(self.n.max(1))
    }

    /// S that long after the start.
    pub fn at(&self, tau: f64) -> Vec<L> {
        let (mut sums, tau) = (vec![L::splat(0.0); self.n], L::splat(tau));
        for order in self.orders().rev() {
            for (sum, c) in sums.iter_mut().zip(order) {
                *sum = *sum * tau + *c;
            }
        }
        sums
    }

    /// S and S' that long after the start.
    pub fn at_with_slope(&self, tau: f64) -> [Vec<L>; 2] {
        let nothing = || vec![L::splat(0.0); self.n];
        let (mut sums, mut slopes, tau) = (nothing(), nothing(), L::splat(tau));
        for order in self.orders().rev() {
            for ((sum, slope), c) in sums.iter_mut().zip(&mut slopes).zip(order) {
                *slope = *slope * tau + *sum;
                *sum = *sum * tau + *c;
            }
        }
        [sums, slopes]
    }

    /// The largest term of each entry at an instant, and the larger one of the last two.
    pub fn terms(&self, tau: f64) -> Vec<[L; 2]> {
        let mut largest = vec![[L::splat(0.0); 2]; self.n];
        let (mut power, count) = (1.0, self.orders().len());
        for (k, order) in self.orders().enumerate() {
            let is_last = k + 2 >= count;
            for ([whole, last], c) in largest.iter_mut().zip(order) {
                let term = (*c * L::splat(power)).map(f64::abs);
                *whole = whole.zip(term, f64::max);
                if is_last {
                    *last = last.zip(term, f64::max);
                }
            }
            power *= tau;
        }
        largest
    }
}

impl Tangent {
    /// The highest power of time.
    pub fn order(&self) -> usize {
        let last = self.coefficients.iter().rposition(|&c| c != 0.0);
        last.map_or(0, |last| last / self.n)
    }
}

impl Tangent<f64x4> {
    /// One of them.
    pub fn lane(&self, lane: usize) -> Tangent {
        Tangent::new(self.n, of_lane(&self.coefficients, lane))
    }
}

/// Rows as lanes, the last of which are zero where there are fewer.
pub(in crate::sensitivity) fn in_lanes(rows: &[&[f64]]) -> Vec<f64x4> {
    let mut lanes = vec![f64x4::splat(0.0); rows.first().map_or(0, |row| row.len())];
    for (lane, row) in rows.iter().enumerate() {
        for (numbers, one) in lanes.iter_mut().zip(*row) {
            numbers.as_mut_array()[lane] = *one;
        }
    }
    lanes
}

/// The numbers of a lane.
pub(in crate::sensitivity) fn of_lane(lanes: &[f64x4], lane: usize) -> Vec<f64> {
    lanes
        .iter()
        .map(|numbers| numbers.as_array()[lane])
        .collect()
}
