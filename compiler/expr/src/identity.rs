//! Whether all terms of an expression cancel, by its residue modulo a prime.
//!
//! A polynomial that is not zero vanishes at few points of a finite field: at random ones, for degree d, with a
//! probability below d/p (Schwartz 1980). A function of something is one more indeterminate, the same for arguments
//! with one residue. What is proven so holds as an identity of polynomials, however it is written; identities of the
//! functions themselves, as sin² + cos² = 1, are not known here.

use nsd_solver::runtime::random::mix;

use super::Expr;
use super::nodes::{Data, Id, Nodes};
use super::simplify::nearby_decimal;

/// 2⁶¹ - 1.
const PRIME: u64 = (1 << 61) - 1;

/// Seeds of two independent points.
const POINTS: [u64; 2] = [0x9e37_79b9_7f4a_7c15, 0xd1b5_4a32_d192_ed03];

/// Numbers up to this one that have no fraction are exact.
const EXACT: f64 = 9_007_199_254_740_992.0;

fn add(a: u64, b: u64) -> u64 {
    (a + b) % PRIME
}

fn multiply(a: u64, b: u64) -> u64 {
    (u128::from(a) * u128::from(b) % u128::from(PRIME)) as u64
}

/// aᵏ, or none for a zero that divides.
fn power(a: u64, k: i64) -> Option<u64> {
    if k < 0 {
        // a^(p-1) = 1
        let inverse = power(a, PRIME as i64 - 2)?;
        return (a != 0).then(|| power(inverse, -k)).flatten();
    }
    let (mut square, mut result, mut k) = (a, 1, k);
    while k > 0 {
        if k & 1 == 1 {
            result = multiply(result, square);
        }
        square = multiply(square, square);
        k >>= 1;
    }
    Some(result)
}

/// The residue of a number as it is written in decimals; none of what is no number.
fn number(value: f64) -> Option<u64> {
    let size = value.abs();
    let residue = if size.fract() == 0.0 && size <= EXACT {
        size as u64 % PRIME
    } else {
        let text = format!("{:e}", nearby_decimal(size, size));
        let (digits, exponent) = text.split_once('e')?;
        let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
        let digits: u64 = format!("{whole}{fraction}").parse().ok()?;
        let exponent = exponent.parse::<i64>().ok()? - fraction.len() as i64;
        multiply(digits % PRIME, power(10, exponent)?)
    };
    Some(if value < 0.0 {
        add(PRIME - residue, 0)
    } else {
        residue
    })
}

/// A point of the field that looks random.
fn mixed(seed: u64) -> u64 {
    mix(seed) % PRIME
}

impl Nodes {
    /// The residue of a node of which the children have the residues `of`.
    fn residue(&self, id: Id, seed: u64, of: impl Fn(Id) -> Option<u64>) -> Option<u64> {
        let indeterminate = |kind: u64, parts: [u64; 2]| {
            let parts = parts.iter();
            parts.fold(mixed(seed ^ mixed(kind)), |hash, part| mixed(hash ^ part))
        };
        match self.data(id) {
            Data::Constant(value) => number(value),
            Data::Variable(var) => Some(indeterminate(0, [var.index() as u64, 0])),
            Data::Sum {
                constant,
                start,
                len,
            } => {
                let mut terms = self.terms(start, len).iter();
                terms.try_fold(number(constant)?, |sum, &(term, c)| {
                    Some(add(sum, multiply(number(c)?, of(term)?)))
                })
            }
            Data::Product { start, len } => {
                let mut factors = self.factors(start, len).iter();
                factors.try_fold(1, |product, &(factor, k)| {
                    Some(multiply(product, power(of(factor)?, i64::from(k))?))
                })
            }
            Data::Unary(function, a) => match of(a)? {
                0 => number(function.value(0.0)),
                a => Some(indeterminate(1 + function as u64, [a, 0])),
            },
            Data::Binary(function, a, b) => {
                Some(indeterminate(64 + function as u64, [of(a)?, of(b)?]))
            }
        }
    }
}

impl<'e> Expr<'e> {
    /// Whether the expression is zero for all values of its variables, as an identity of polynomials in them and in
    /// functions of them.
    pub fn cancels(self) -> bool {
        if let Some(value) = self.as_constant() {
            return value == 0.0;
        }
        if self.is_function() || self.as_variable().is_some() {
            return false;
        }
        let nodes = self.exprs.nodes();
        let order = nodes.below([self.id]);
        let vanishes_at = |seed: u64| {
            let mut residues: Vec<Option<u64>> = Vec::with_capacity(order.len());
            for &id in &order {
                let of = |child: Id| residues[order.partition_point(|&other| other < child)];
                residues.push(nodes.residue(id, seed, of));
            }
            residues.last().copied().flatten() == Some(0)
        };
        POINTS.into_iter().all(vanishes_at)
    }

    /// The number 0 where all terms cancel, else the expression as it is.
    pub fn cancelled(self) -> Self {
        match self.cancels() {
            true => self.exprs.constant(0.0),
            false => self,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::Exprs;

    #[test]
    fn identities_cancel_however_they_are_written() {
        let e = Exprs::new();
        let (x, y) = (e.variable("x"), e.variable("y"));
        let square = x.powi(2) + 2.0 * x * y + y.powi(2);
        for identity in [
            (x + 1.0).powi(2) - x.powi(2) - 2.0 * x - 1.0,
            (x + y).powi(2) - square,
            (x - 1.0) * (x + 1.0) - x.powi(2) + 1.0,
            (x + 0.1).powi(2) - x.powi(2) - 0.2 * x - 0.01,
            1.0 / (x + 1.0) - 1.0 / (x - 1.0) + 2.0 / (x.powi(2) - 1.0),
            (x + y).powi(2).sin() - square.sin(),
            x * ((x + y).powi(2) - square).tanh(),
            (x * y).powf(y) - (y * x).powf(y),
            e.constant(0.0),
        ] {
            assert!(identity.cancels(), "{identity}");
            assert!(identity.cancelled().is_zero());
        }
    }

    #[test]
    fn what_is_small_or_narrow_does_not_cancel() {
        let e = Exprs::new();
        let (x, y) = (e.variable("x"), e.variable("y"));
        for other in [
            x - y,
            1e-300 * x,
            (x + 1.0).powi(2) - x.powi(2) - 2.0 * x - (1.0 + 1e-11),
            0.5 + 0.5 * (1000.0 * (x - 70.0)).tanh(),
            (-1e6 * x.powi(2)).exp(),
            (-1e6 * x.powi(2)).exp() * (1.0 - (1e3 * x).tanh().powi(2)),
            x.sin() - y.sin(),
            x.sin().powi(2) - x.cos().powi(2),
            x.powf(y) - y.powf(x),
            1.0 / ((x + y).powi(2) - x.powi(2) - 2.0 * x * y - y.powi(2)),
            x * f64::INFINITY,
        ] {
            assert!(!other.cancels(), "{other}");
        }
    }
}
