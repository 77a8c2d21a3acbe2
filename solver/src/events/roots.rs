//! First root of a polynomial in (0, h].
//!
//! The polynomial is written in Bernstein form on the interval: coefficients of
//! one sign prove that it has no root, one change of sign that it has exactly
//! one (Descartes' rule; Farouki 2012, section 5.4). Halving the interval by de
//! Casteljau's algorithm ends in one of the two, or in an interval as narrow as
//! rounding, which holds a double root.
//!
//! Where coefficients of one sign are small and their differences change their sign, the polynomial
//! comes close to zero and turns back (`turn`).

use crate::events::minima::{Turn, lowest, turn};
use crate::expansion::series;

/// A root, and whether the polynomial changes its sign there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Root {
    /// Where it is, in (0, h].
    pub tau: f64,
    /// False at a double root, where the polynomial only touches zero.
    pub crosses: bool,
}

/// Memory and binomial tables for polynomials up to a degree.
pub(crate) struct RootFinder {
    /// Pascal's triangle: C(n, k), by n up to the degree.
    binomials: Vec<Vec<f64>>,
    /// Coefficients on [0, 1].
    scaled: Vec<f64>,
    /// The same over C(degree, k).
    weighted: Vec<f64>,
    /// Intervals left to look at, with their Bernstein coefficients one after another.
    stack: Vec<Interval>,
    bernstein: Vec<f64>,
    /// Where the polynomial comes close to zero and turns back, before its first root.
    pub close: Vec<f64>,
    /// The series of what bounds two α that stick together.
    pub margin: Vec<f64>,
}

#[derive(Clone, Copy)]
struct Interval {
    start: f64,
    width: f64,
}

/// Intervals below this fraction of the step hold a double root.
const NARROWEST: f64 = 1e-11;

/// Several turns within this fraction of the step are one.
const NARROW: f64 = 1e-3;

/// Halvings until an interval is that narrow.
const DEPTH: usize = 40;

impl RootFinder {
    /// Tables for polynomials of degree up to `degree`.
    pub(crate) fn new(degree: usize) -> Self {
        RootFinder {
            binomials: pascal(degree),
            scaled: Vec::with_capacity(degree + 1),
            weighted: Vec::with_capacity(degree + 1),
            stack: Vec::with_capacity(DEPTH),
            bernstein: Vec::with_capacity(DEPTH * (degree + 1)),
            close: Vec::new(),
            margin: Vec::new(),
        }
    }

    /// The least root of a series that should have sign `side`; its constant term is `start` instead of
    /// `c[0]`. One that starts at zero, within `band`, is divided by its leading power first, as is `level`;
    /// one that starts on the wrong side has its root at once.
    pub(crate) fn first_from(
        &mut self,
        start: f64,
        c: &[f64],
        h: f64,
        side: f64,
        band: Option<f64>,
        level: f64,
    ) -> Option<Root> {
        self.close.clear();
        let (start, c, level) = match band {
            Some(band) => {
                let leading = series::leading(c, h, band)?;
                (c[leading], &c[leading..], level / h.powi(leading as i32))
            }
            None => (start, c, level),
        };
        if start * side <= 0.0 {
            return Some(Root {
                tau: 0.0,
                crosses: true,
            });
        }
        self.first(start, &c[1..], h, level)
    }

    /// The least root in (0, h] of `start` + Σ `rest[k]` τᵏ⁺¹, whose value at 0 counts as non-zero.
    /// Leaves in `close` where it turns back, no farther than `level` from zero.
    pub(crate) fn first(&mut self, start: f64, rest: &[f64], h: f64, level: f64) -> Option<Root> {
        self.close.clear();
        let degree = rest.len();
        debug_assert!(
            degree < self.binomials.len(),
            "the tables reach to the degree"
        );
        if stays_away(start, rest, h, level) {
            return None;
        }
        self.scaled.clear();
        self.scaled.push(start);
        let mut power = 1.0;
        for &c in rest {
            power *= h;
            self.scaled.push(c * power);
        }
        if self.low_terms_decide(level) {
            return None;
        }
        self.write_bernstein(degree);
        self.stack.clear();
        self.stack.push(Interval {
            start: 0.0,
            width: 1.0,
        });
        while let Some(interval) = self.stack.pop() {
            let place = self.bernstein.len() - (degree + 1);
            let changes = match sign_changes(&self.bernstein[place..]) {
                0 if self.turns_repeatedly(place, interval, h, level) => 2,
                changes => changes,
            };
            match changes {
                0 => self.bernstein.truncate(place),
                1 => {
                    let end = interval.start + interval.width;
                    let s = refine(&self.scaled, interval.start, end);
                    let extremum = touching(&self.scaled, s);
                    return Some(Root {
                        tau: h * extremum.unwrap_or(s),
                        crosses: extremum.is_none(),
                    });
                }
                _ if interval.width < NARROWEST => {
                    return Some(Root {
                        tau: h * (interval.start + 0.5 * interval.width),
                        crosses: false,
                    });
                }
                _ => self.halve(interval, degree),
            }
        }
        None
    }

    /// The Bernstein form on [0, 1]: b_j = Σ_k C(j, k) / C(degree, k) c_k.
    fn write_bernstein(&mut self, degree: usize) {
        self.weighted.clear();
        let over = self.scaled.iter().zip(&self.binomials[degree]);
        self.weighted.extend(over.map(|(c, binomial)| c / binomial));
        let (weighted, binomials) = (&self.weighted, &self.binomials);
        let coefficient = |j: usize| -> f64 {
            let terms = binomials[j].iter().zip(weighted);
            terms.map(|(binomial, c)| binomial * c).sum()
        };
        self.bernstein.clear();
        self.bernstein.extend((0..=degree).map(coefficient));
    }

    /// Notes where the polynomial turns back close to zero in an interval without a root, whose coefficients begin
    /// at `place`; true where several turns are still to be told apart.
    fn turns_repeatedly(&mut self, place: usize, interval: Interval, h: f64, level: f64) -> bool {
        let end = interval.start + interval.width;
        let s = match turn(&self.bernstein[place..], level) {
            Turn::None => return false,
            Turn::Start => interval.start,
            Turn::End => end,
            Turn::Several if interval.width > NARROW => return true,
            Turn::Inside | Turn::Several => lowest(&self.scaled, interval.start, end),
        };
        let tau = h * s;
        // A turn where two intervals meet belongs to both.
        let before = self.close.last();
        let is_new = before.is_none_or(|before| tau - before > 1e-6 * h);
        if is_new && series::value(&self.scaled, s).abs() <= level {
            self.close.push(tau);
        }
        false
    }

    /// The right half of an interval takes the place of the whole, the left half comes on top.
    fn halve(&mut self, Interval { start, width }: Interval, degree: usize) {
        let width = 0.5 * width;
        split(&mut self.bernstein, degree + 1);
        let middle = start + width;
        let halves = [middle, start].map(|start| Interval { start, width });
        self.stack.extend(halves);
    }

    /// True when the lowest terms stay away from zero, as their own Bernstein form shows, by more than
    /// all others add up to.
    fn low_terms_decide(&self, level: f64) -> bool {
        let start = self.scaled[0];
        // The least degree whose rest is small.
        let (mut degree, mut rest) = (self.scaled.len() - 1, 0.0);
        while degree > 0 && rest + self.scaled[degree].abs() <= SMALL_REST * start.abs() {
            rest += self.scaled[degree].abs();
            degree -= 1;
        }
        let side = start.signum();
        2 * degree <= self.scaled.len()
            && (1..=degree).all(|j| {
                let binomials = self.binomials[j].iter().zip(&self.binomials[degree]);
                let terms = binomials.zip(&self.scaled);
                let b: f64 = terms.map(|((of_j, of_all), c)| of_j / of_all * c).sum();
                side * b > rest + level
            })
    }
}

/// Terms that add up to less than this fraction of the constant one are left out at first.
const SMALL_REST: f64 = 0.02;

/// True when the constant term outweighs all others on the interval by more than `level`.
fn stays_away(start: f64, rest: &[f64], h: f64, level: f64) -> bool {
    let others = rest.iter().rev().fold(0.0, |sum, c| (sum + c.abs()) * h);
    start.abs() > others + level
}

/// C(n, k) by n and k, exact up to n = 57.
fn pascal(degree: usize) -> Vec<Vec<f64>> {
    let mut rows = vec![vec![1.0]];
    for n in 1..=degree {
        let above: &[f64] = &rows[n - 1];
        let inner = above.windows(2).map(|pair| pair[0] + pair[1]);
        rows.push([1.0].into_iter().chain(inner).chain([1.0]).collect());
    }
    rows
}

/// Changes of sign among the coefficients; a zero at the right end is a root of its own.
fn sign_changes(bernstein: &[f64]) -> usize {
    let mut changes = 0;
    let mut sign = 0.0;
    for &b in bernstein {
        if b != 0.0 {
            if sign * b < 0.0 {
                changes += 1;
            }
            sign = b.signum();
        }
    }
    changes + usize::from(bernstein.last() == Some(&0.0))
}

/// Replaces the last `n` coefficients by those of the right half, followed by those of the left.
fn split(bernstein: &mut Vec<f64>, n: usize) {
    let place = bernstein.len() - n;
    bernstein.extend_from_within(place..);
    let (right, left) = bernstein[place..].split_at_mut(n);
    for level in 1..n {
        // Round `level` makes left[level] final, and its last value is right[n - 1 - level].
        for j in (level..n).rev() {
            left[j] = 0.5 * (left[j - 1] + left[j]);
        }
        right[n - 1 - level] = left[n - 1];
    }
}

/// A root whose slope is below this fraction of the coefficients may have a neighbour so close that
/// the dip between them is rounding.
const FLAT: f64 = 1e-6;

/// A dip below this fraction of the coefficients is rounding.
const SHALLOW: f64 = 32.0 * f64::EPSILON;

/// The extremum next to the root `s`, where the two cannot be told apart.
fn touching(scaled: &[f64], s: f64) -> Option<f64> {
    let scale = scaled.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
    if series::slope(scaled, s).abs() > FLAT * scale {
        return None;
    }
    let mut extremum = s;
    for _ in 0..20 {
        let step = series::slope(scaled, extremum) / series::curvature(scaled, extremum);
        if !step.is_finite() {
            break;
        }
        extremum -= step;
        if step.abs() <= 1e-15 {
            break;
        }
    }
    let near = (extremum - s).abs() <= 1e-3 && (0.0..=1.0).contains(&extremum);
    let extremum = if near { extremum } else { s };
    (series::value(scaled, extremum).abs() <= SHALLOW * scale).then_some(extremum)
}

/// The one root in [lo, hi] by Newton's method, safeguarded by bisection.
fn refine(scaled: &[f64], mut lo: f64, mut hi: f64) -> f64 {
    let rising = series::value(scaled, hi) >= series::value(scaled, lo);
    let mut s = 0.5 * (lo + hi);
    for _ in 0..100 {
        let v = series::value(scaled, s);
        if v == 0.0 {
            return s;
        }
        if (v > 0.0) == rising {
            hi = s;
        } else {
            lo = s;
        }
        let newton = s - v / series::slope(scaled, s);
        let next = if newton > lo && newton < hi {
            newton
        } else {
            0.5 * (lo + hi)
        };
        if (next - s).abs() <= f64::EPSILON * s.abs().max(f64::MIN_POSITIVE) {
            return next;
        }
        s = next;
    }
    s
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn from_roots(roots: &[f64]) -> Vec<f64> {
        roots.iter().fold(vec![1.0], |poly, root| {
            let mut next = vec![0.0; poly.len() + 1];
            for (k, c) in poly.iter().enumerate() {
                next[k] -= root * c;
                next[k + 1] += c;
            }
            next
        })
    }

    fn first_root(degree: usize, c: &[f64], h: f64) -> Option<Root> {
        RootFinder::new(degree).first(c[0], &c[1..], h, 0.0)
    }

    proptest! {
        #[test]
        fn finds_the_least_of_separated_roots(first in 0.05..0.45_f64, gap in 0.05..0.5_f64, outside in 1.2..3.0_f64) {
            let root = first_root(8, &from_roots(&[first + gap, outside, first, -outside, -1.5]), 1.0).unwrap();
            prop_assert!(root.crosses);
            prop_assert!((root.tau - first).abs() < 1e-12);
        }

        #[test]
        fn reports_no_root_where_there_is_none(roots in prop::collection::vec(1.01..3.0_f64, 1..8)) {
            prop_assert_eq!(first_root(8, &from_roots(&roots), 1.0), None);
        }
    }

    #[test]
    fn a_pair_of_close_roots_is_not_missed() {
        let root = first_root(4, &from_roots(&[0.5, 0.500_001]), 1.0).unwrap();
        assert!(root.crosses);
        assert!((root.tau - 0.5).abs() < 1e-9);
    }

    #[test]
    fn what_the_lowest_terms_alone_do_not_reach_is_not_missed() {
        // 1 - 0.995 t stays above zero up to 1, and the last term brings it below.
        let c = [1.0, -0.995, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.01];
        let root = first_root(8, &c, 1.0).unwrap();
        assert!(series::value(&c, root.tau).abs() < 1e-15, "{root:?}");
        assert!(root.crosses);
    }

    #[test]
    fn a_double_root_is_marked() {
        let root = first_root(4, &[0.25, -1.0, 1.0], 1.0).unwrap();
        assert_eq!(
            root,
            Root {
                tau: root.tau,
                crosses: false
            }
        );
        assert!((root.tau - 0.5).abs() < 1e-9);
    }

    #[test]
    fn the_right_end_belongs_to_the_interval() {
        assert!(first_root(4, &[-2.0, 1.0], 2.0).is_some());
        assert!(first_root(4, &[-2.0, 1.0], 1.99).is_none());
    }
}
